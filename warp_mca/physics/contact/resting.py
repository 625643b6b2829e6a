"""Owns the dashpot of contacts in which bodies lie on each other: without it they would bounce on the springs for ever.

A weight that acts all at once lets an elastic body vibrate with an amplitude of its own sag. Nothing takes that motion,
and friction, which it unloads in each period, lets the body creep. The dashpot takes it. It acts only up to speeds that
weight itself gives, so that an impact keeps its energy.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.physics.contact.stiffness import nearest_faces, spring_stiffness
from warp_mca.scene import Contact, ContactAll, RigidPlane, Scene
from warp_mca.scene.contact_laws import ContactLaw, DampedPenalty, Penalty

if TYPE_CHECKING:
    from warp_mca.system.bodies import Bodies
    from warp_mca.system.contact import Faces
    from warp_mca.system.model import Model

CRITICAL = 0.5  # share of the critical damping of a slave node on its spring


def resting(
    parts: Bodies, contact: Contact, slave: Faces, master: Faces | None, velocity: Array, flat: bool | None = None
) -> Contact:
    """The contact with its law, if that is left to the program; `velocity` of nodes [m/s], shape (node_count, 3).

    `flat` as in `spring_stiffness`.
    """
    tied = contact.bond is not None and not contact.bond.fails  # nothing bounces there
    if contact.law is not None or tied or not any(parts.scene.gravity):
        return contact
    own, *other = spring_stiffness(replace(contact, two_way=False), slave, master, flat)
    stiffness, bodies = own[0], [contact.slave.body]
    if isinstance(contact.master, RigidPlane):
        normal, speed = np.asarray(contact.master.normal, dtype=float), 0.0
        apart = float(((parts.X[slave.nodes] - np.asarray(contact.master.point)) @ normal).min())
    else:
        assert master is not None
        stiffness = np.minimum(stiffness, other[0][1].max())
        bodies.append(contact.master.body)
        own_face, face = nearest_faces(contact, slave, master)
        normal = master.normal[face]
        speed = float((velocity[master.nodes] @ normal).mean())
        apart = float((slave.middle[own_face] - master.middle[face]) @ normal)
    size = float(np.linalg.norm(normal))
    approach = float(np.abs(velocity[slave.nodes] @ normal - speed).max() / size)
    return replace(contact, law=usual_law(parts, bodies, approach, apart / size, slave.nodes, stiffness))


def at_rest(
    parts: Bodies,
    contact: ContactAll,
    pairs: Sequence[tuple[str, str]],
    nodes: Index,
    stiffness: Array,
    velocity: Array,
) -> ContactAll:
    """A general contact with its law, if that is left to the program: two of its bodies at rest are enough."""
    if contact.law is not None or not any(parts.scene.gravity):
        return contact
    names = sorted({name for pair in pairs for name in pair})
    both = np.hstack([velocity, parts.X])
    least, most = ({name: bound(both[parts.all_nodes(name)], axis=0) for name in names} for bound in (np.min, np.max))
    found = [(math.inf, math.inf)]
    for a, b in pairs:
        if a != b:
            motion = np.maximum(most[a], most[b])[:3] - np.minimum(least[a], least[b])[:3]
            between = np.maximum(least[a], least[b])[3:] - np.minimum(most[a], most[b])[3:]  # boxes around them
            found.append((float(np.linalg.norm(motion)), float(between.max())))
    g = float(np.linalg.norm(parts.scene.gravity))
    approach, apart = min(found, key=lambda item: item[0] ** 2 + 2.0 * g * max(item[1], 0.0))
    return replace(contact, law=usual_law(parts, names, approach, apart, nodes, stiffness))


def undamped(model: Model, scene: Scene) -> Model:
    """The model without the dashpots that the program added."""
    plain = {"law": Penalty.law, "parameters": (), "damping": 0.0}
    passes = (replace(k, **plain) if scene.contacts[k.contact].law is None else k for k in model.passes)
    return replace(model, passes=tuple(passes))


def usual_law(
    parts: Bodies, bodies: Sequence[str], approach: float, apart: float, nodes: Index, stiffness: Array
) -> ContactLaw:
    """The law of a contact that leaves it to the program: with a dashpot where bodies rest on each other.

    They rest where they meet, after a fall too, no faster than their weight makes them bounce.

    Args:
        parts: of the model.
        bodies: that the contact keeps apart; none is a plane.
        approach: speed at which they approach at the start [m/s].
        apart: how far apart they are then [m].
        nodes: of the slave, shape (slave_count,).
        stiffness: of the springs of each [N/m], shape (slave_count,).
    """
    g, mass = float(np.linalg.norm(parts.scene.gravity)), parts.mass[nodes]
    free = (stiffness > 0.0) & np.isfinite(mass)
    if not free.any():
        return Penalty()
    speed = g * min(_bounce(parts, name, float(stiffness.sum())) for name in bodies)
    if approach**2 + 2.0 * g * max(apart, 0.0) > speed**2:
        return Penalty()
    return DampedPenalty(time=2.0 * CRITICAL * float(np.sqrt(mass[free] / stiffness[free]).min()), speed=speed)


def _bounce(parts: Bodies, body: str, stiffness: float) -> float:
    """Time in which a body of its mass bounces on springs, and a wave passes through its height [s]."""
    nodes, start = parts.all_nodes(body), parts.element_start[body]
    cells = slice(start, start + parts.meshes[body].cell_count)
    down = np.asarray(parts.scene.gravity) / np.linalg.norm(parts.scene.gravity)
    wave = np.sqrt((parts.K[cells] + 4.0 / 3.0 * parts.G[cells]) / parts.rho[cells]).min()
    return float(np.sqrt(parts.mass[nodes].sum() / stiffness) + np.ptp(parts.X[nodes] @ down) / wave)
