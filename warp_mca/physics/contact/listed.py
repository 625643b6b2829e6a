"""Owns the passes of a listed contact: what the program chooses of it, and what it adds to the stable step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.exposure import Exposure
from warp_mca.physics.contact.auto_penalty import settled
from warp_mca.physics.contact.bonds import Place, bonded
from warp_mca.physics.contact.both_sides import bulges_over, pokes
from warp_mca.physics.contact.eigenvalues import contact_eigenvalues
from warp_mca.physics.contact.resting import resting
from warp_mca.physics.contact.skin_edges import edge_eigenvalues, edge_pass, is_two_way, no_edges
from warp_mca.physics.contact.stiffness import Inertia
from warp_mca.physics.contact.surfaces import contact_passes, faces_of
from warp_mca.physics.elements.cells import body_materials
from warp_mca.scene import Contact, RigidPlane, Surface
from warp_mca.system.contact import ChosenPenalty, ContactPass, Faces

if TYPE_CHECKING:
    from warp_mca.system.bodies import Bodies


class Given(NamedTuple):
    """A pass, and what its springs add to the largest eigenvalue at some nodes [1/s^2]."""

    item: ContactPass
    nodes: Index
    value: Array


def as_settled(
    parts: Bodies, contact: Contact, slave: Faces, master: Faces | None, velocity: Array, flat: bool | None = None
) -> tuple[Contact, ChosenPenalty | None]:
    """A contact with all that is left to the program, and the penalty that was chosen; `flat` as in `passes_of`."""
    both = contact.two_way is None and master is not None and _needs_both(parts, contact, slave, master)
    contact = replace(contact, two_way=is_two_way(contact, slave, master, both))
    contact, chosen = settled(parts, contact, slave, master, velocity)
    return resting(parts, contact, slave, master, velocity, flat), chosen


def _soft(parts: Bodies, contact: Contact) -> bool:
    """Whether both bodies are flexible, and of materials for large strain only, as rubber.

    A node that presses with F beside a corner of faces of size h that stands out by w falls off it, as F w / h grows
    faster than what elements hold it by, from a pressure of some 0.2 E on; nodes of both sides bear half of F each.
    """
    bodies = [parts.scene.body(name) for name in contact.sides]
    if any(body.rigid for body in bodies):
        return False
    materials = [item for body in bodies for item, _ in body_materials(body, parts.meshes[body.name])]
    return all(item.finite_only for item in materials)


def _needs_both(parts: Bodies, contact: Contact, slave: Faces, master: Faces) -> bool:
    """Whether nodes of the master have to be kept out of the slave's faces, too, however wide these are."""
    if _soft(parts, contact) or pokes(parts.X, slave, master):
        return True
    modulus = np.where(parts.rigid, np.inf, 4.0 * parts.G * (3.0 * parts.K + parts.G) / (3.0 * parts.K + 4.0 * parts.G))
    return bulges_over(contact, parts.X, modulus, slave, master)


def passes_of(
    parts: Bodies,
    contact: Contact,
    index: int,
    slave: Faces,
    master: Faces | None,
    place: Place | None = None,
    flat: bool | None = None,
) -> list[Given]:
    """The passes of a contact as `as_settled` gives it: of nodes, one or two, then of edges where some may cross.

    Where elements of its bodies may fail there is one of edges always: some may cross later. `place` is that of bonds,
    `flat` as in `spring_stiffness`.
    """
    found = contact_passes(contact, index, slave, master, flat)
    if place is not None:
        found = [bonded(found[0], contact, place, parts.node_start[contact.slave.body], slave, parts.X)]
    given = []
    for item in found:
        sides = (slave, master) if item.sign > 0.0 else (master, slave)
        assert sides[0] is not None
        nodes, value = contact_eigenvalues(item, sides[0], sides[1], parts.mass)
        given.append(Given(item, nodes, value))
    if master is None:
        return given
    if edges := edge_pass(parts.X, Inertia.of(parts), found[0], slave, master, contact):
        given.append(Given(edges, *edge_eigenvalues(edges, parts.mass)))
    elif set(contact.sides) & set(parts.scene.failing):
        given.append(Given(no_edges(found[0]), np.zeros(0, np.int32), np.zeros(0)))
    return given


def growth(parts: Bodies, contact: Contact, index: int, given: Sequence[Given]) -> Array:
    """By how much what a contact adds at each node may grow as elements fail [1/s^2], shape (node_count,), float64.

    As the passes with all inner faces at once, over those that are `given`.
    """
    failing = set(contact.sides) & set(parts.scene.failing)
    if not failing:
        return np.zeros(len(parts.X))

    def faces(surface: Surface) -> Faces:
        mesh = parts.meshes[surface.body]
        own = Exposure(mesh).all_faces(surface.nodes) if surface.body in failing else mesh.surface(surface.nodes)
        return faces_of(parts, surface.body, *own)

    master = None if isinstance(contact.master, RigidPlane) else faces(contact.master)
    sums = np.zeros((2, len(parts.X)))
    for added, passes in zip(
        sums, (given, passes_of(parts, contact, index, faces(contact.slave), master)), strict=True
    ):
        for _, nodes, value in passes:
            np.add.at(added, nodes, value)
    return np.maximum(sums[1] - sums[0], 0.0)
