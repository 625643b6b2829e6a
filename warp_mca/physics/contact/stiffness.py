"""Owns the penalty stiffness of contacts: of slave nodes and of master faces."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.physics.contact.sides import MAX_SIDES, find_sides
from warp_mca.scene import Contact, ContactAll, RigidPlane

if TYPE_CHECKING:
    from warp_mca.system.bodies import Bodies
    from warp_mca.system.contact import Faces

# Default spring stiffness over E* A / d, with E* = E / (1 - nu^2) and the height d of a cell. Flat ends whose springs
# are stiffer ring, because they close more quickly than waves leave the first cells. Few nodes carry a curved contact,
# so that softer springs lower its force peak: at nu = 0.3 it has penalty = 5; see docs/measurements/methods.md.
FLAT, CURVED = 0.5, 3.792
CONFINED = 0.6  # share of the modulus of uniaxial strain that flat ends take at least; it is above E* from nu = 0.39 on
GLUED = 2.0  # of bonds between flat surfaces, as compliant as one cell: with FLAT a wave came 4 % late through a bond
SHARE = 0.16  # stiffness of two edges that cross over that of a node: its ends may bear a node and a crossing at once


class Inertia(NamedTuple):
    """Masses of a model [kg]: of its nodes, shape (node_count,), and of its elements, shape (element_count,)."""

    node: Array
    element: Array

    @staticmethod
    def of(parts: Bodies) -> Inertia:
        """Of the bodies of a scene."""
        return Inertia(parts.mass, parts.rho * parts.volume)


def nearest_faces(contact: Contact, slave: Faces, master: Faces | None) -> tuple[int, int]:
    """Face of the slave and of the master where the surfaces are nearest to each other; 0 of a plane."""
    if master is None:
        assert isinstance(contact.master, RigidPlane)
        return int((slave.middle @ np.asarray(contact.master.normal, dtype=float)).argmin()), 0
    from scipy.spatial import KDTree

    distance, face = (np.asarray(found) for found in KDTree(master.middle).query(slave.middle))
    nearest = int(distance.argmin())
    return nearest, int(face[nearest])


def flat_modulus(contact: Array, K: Array, G: Array) -> Array:
    """Modulus E* [Pa] of elements under flat contact, or a share of that of uniaxial strain, shape (element_count,).

    Cells under a flat end do not spread at first. Waves there go with K + 4 G / 3, far above E* where Poisson's ratio
    is near 0.5: springs of E* would close more slowly than such a wave lasts, and most of its force would be missing.

    Args:
        contact: E* = E / (1 - nu^2) [Pa], shape (element_count,).
        K, G: bulk and shear modulus [Pa], shape (element_count,).
    """
    return np.maximum(contact, CONFINED * (K + 4.0 / 3.0 * G))


def is_flat(slave: Faces, master: Faces | None) -> bool:
    """Whether no surface of a contact is curved, which decides on the default stiffness."""
    return not (slave.curved.any() or (master is not None and master.curved.any()))


def spring_stiffness(
    contact: Contact, slave: Faces, master: Faces | None, flat: bool | None = None
) -> list[tuple[Array, Array]]:
    """Penalty stiffness [N/m] of the nodes and of the faces of the slave, and of the master where it has faces.

    A number f gives f K A^2 / V, and a node the mean of the faces around it. The default takes E* in place of K, so
    that it suits any Poisson's ratio, and is stiffer where one of the surfaces is curved. Where both are flat, it takes
    `flat_modulus`, nodes share the stiffness of faces as they share their area, so that their pressure is uniform, and
    the springs of the two surfaces are in series. Two passes of one contact have half of it each. `flat` is what
    `is_flat` says; of surfaces that change, what it said at the start. `Contact.stiffness` is that of each node.
    """
    surfaces = [slave] if master is None else [slave, master]
    if (k := contact.stiffness) is not None:
        return [(np.full(len(faces.nodes), k), np.full(len(faces.node), k)) for faces in surfaces]
    half = 0.5 if contact.two_way else 1.0
    if contact.penalty is None and (is_flat(slave, master) if flat is None else flat):
        near = nearest_faces(contact, slave, master)[: len(surfaces)]
        layers = [float(faces.layer[k] / faces.area[k]) for faces, k in zip(surfaces, near, strict=True)]
        found = []
        for faces, k, own, other in zip(surfaces, near, layers, layers[::-1], strict=True):
            factor = half * (GLUED if contact.bond else FLAT) / (1.0 if master is None else 1.0 + own / other)
            whole = np.where(is_triangle(faces.node), 2.0, 1.0) * faces.layer
            found.append((factor * _node_shares(faces, k), factor * whole))
        return found
    if contact.penalty is None:
        factor, found = half * CURVED, [faces.contact for faces in surfaces]
    else:
        assert not isinstance(contact.penalty, str)  # `auto_penalty.settled` has replaced it
        factor, found = half * contact.penalty, [faces.bulk for faces in surfaces]
    return [(factor * node_mean(faces.nodes, faces, k), factor * k) for faces, k in zip(surfaces, found, strict=True)]


def edge_stiffness(contact: Contact | ContactAll, faces: Faces, beside: Index, ends: Index, inertia: Inertia) -> Array:
    """Penalty stiffness of edges that may cross others [N/m], shape (edge_count,).

    One spring alone bears a crossing, as few bear a curved contact, so the default is a share of theirs, flat faces or
    not. It is less where an end has less than a quarter of the mass of a cell beside it, as corners have.

    Args:
        contact: `Contact.stiffness` is that of each edge.
        faces: of the edge's surface.
        beside: the two faces beside each edge, shape (edge_count, 2).
        ends: nodes at the ends of each edge, shape (edge_count, 2).
        inertia: of the model.
    """
    if isinstance(contact, Contact) and contact.stiffness is not None:
        return np.full(len(beside), contact.stiffness)
    penalty = contact.penalty
    assert not isinstance(penalty, str)  # `auto_penalty.settled` has replaced it
    own = SHARE * (CURVED * faces.contact if penalty is None else penalty * faces.bulk)
    quarter = 0.25 * inertia.element[faces.element[beside]].mean(axis=1)
    return own[beside].mean(axis=1) * np.minimum(1.0, inertia.node[ends].min(axis=1) / quarter)


def _node_shares(faces: Faces, nearest: int) -> Array:
    """Share of each node in the stiffness of the faces around it [N/m], shape (node_count,).

    Of those on one side of the surface: that of the face which is `nearest` to the other surface, where the node is on
    this, or the mean over its sides.
    """
    real = np.ones(faces.node.shape, dtype=bool)
    real[:, 3] = ~is_triangle(faces.node)
    face = np.nonzero(real)[0]
    share, side = (faces.layer / real.sum(axis=1))[face], find_sides(faces.node, faces.normal)
    place, size = MAX_SIDES * faces.node[real] + side[face], MAX_SIDES * (int(faces.node.max()) + 1)
    on = (np.bincount(place, minlength=size) > 0).reshape(-1, MAX_SIDES)[faces.nodes]
    total = np.bincount(place, share, size).reshape(-1, MAX_SIDES)[faces.nodes]
    near = side[nearest]
    return np.where(on[:, near], total[:, near], total.sum(axis=1) / on.sum(axis=1))


def node_mean(nodes: Index, faces: Faces, value: Array) -> Array:
    """Mean over the faces around each node of a value given on faces."""
    total = np.zeros(nodes[-1] + 1)
    count = np.zeros(nodes[-1] + 1)
    for corner in range(4):
        np.add.at(total, faces.node[:, corner], value)
        np.add.at(count, faces.node[:, corner], 1.0)
    return total[nodes] / count[nodes]
