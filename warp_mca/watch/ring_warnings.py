"""Owns the warning about flat ends whose contact force rings above what waves in the bodies can give."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.physics.contact.surfaces import face_geometry, is_curved_contact
from warp_mca.physics.elements.cells import body_materials
from warp_mca.scene import RigidPlane

if TYPE_CHECKING:
    from warp_mca.phases.prepare import Prepared
    from warp_mca.physics.contact.surfaces import ContactPass
    from warp_mca.results.contact_history import ContactHistory
    from warp_mca.scene import Contact

Array = NDArray[np.float64]

RING = 1.05  # times the greatest force of waves, from which on a word is said
LINEAR = 0.01  # strain v / c up to which bodies count as linear; beyond, twice of what is more may stiffen them
ACROSS = 0.1  # component of the normal along an axis, from which on a node that is fixed there is held along the normal
HELD = 9.0 / 8.0  # times rho c A v: the most from a master that is held, whose wave comes back; docs/decisions.md


def ring_warnings(ready: Prepared, contacts: Sequence[ContactHistory], interval: float) -> list[str]:
    """A sentence for each contact of flat ends whose greatest force exceeds that of waves.

    Bodies that meet with speed v press on each other with Z v at most, Z = Z_1 Z_2 / (Z_1 + Z_2), where rho c A of
    either body is at least Z_k: c is the speed of dilatational waves and A the area of its shadow along the normal.
    Waves that come back from free ends only take from it. So nothing is said of bodies that have more behind them or
    meet twice: with joints, ties, driven nodes, or other contacts. `interval`: between rows [s].
    """
    found = []
    for item in ready.model.passes:
        contact, history = ready.scene.contacts[item.contact], contacts[item.contact]
        greatest = float(history.pressure.max(initial=0.0))
        if item.sign < 0.0 or greatest == 0.0 or not _is_first_impact(ready, contact, item):
            continue
        time = interval * int(history.pressure.argmax())
        most = _greatest_force(ready, contact, item, time)
        if greatest > RING * most > 0.0:
            found.append(
                f"the greatest force of {history.name}, {greatest:.3g} N, is {greatest / most:.2f} times the "
                f"{most:.3g} N of waves in flat ends (rho c A v): contact springs and cells ring there; the impulse "
                "and means over several rows are right, F_n_max and single rows depend on mesh, penalty and "
                "output_interval: take means, or choose a longer output_interval"
            )
    return found


def _is_first_impact(ready: Prepared, contact: Contact, item: ContactPass) -> bool:
    """Whether flat ends meet of bodies that only this contact moves, or that are held at rest."""
    scene = ready.scene
    bodies = {contact.slave.body} | (set() if isinstance(contact.master, RigidPlane) else {contact.master.body})
    bound = {name for joint in scene.joints for name in (joint.body, joint.other)}
    bound |= {name for tie in scene.ties for name in (tie.slave.body, tie.master.body)}
    bound |= {prescribed.body for prescribed in scene.prescribed}
    for other in scene.contacts:
        if other is not contact:
            bound |= {other.slave.body} | (set() if isinstance(other.master, RigidPlane) else {other.master.body})
    normal = ready.model.contact_axes[item.contact, 0]
    return (
        normal.any()
        and not bodies & bound
        and not scene.body(contact.slave.body).rigid
        and not _is_held(ready, contact.slave.body, normal)
        and item.initial_overlap == "refuse"
        and not is_curved_contact(ready.model.X, item)
    )


def _greatest_force(ready: Prepared, contact: Contact, item: ContactPass, time: float) -> float:
    """Force of waves [N] up to a time [s]; gravity adds the speed of a fall so long, and twice the weight."""
    model, normal = ready.model, ready.model.contact_axes[item.contact, 0]
    nodes = _nodes(ready, contact.slave.body)
    gravity = float(np.linalg.norm(model.gravity[0]))
    speed = float((-model.V[nodes] @ normal).max()) + gravity * time
    Z, c = _impedance(ready, contact.slave.body, normal)
    if not isinstance(contact.master, RigidPlane):
        name = contact.master.body
        speed += float((model.V[_nodes(ready, name)] @ normal).max())
        if _is_held(ready, name, normal):
            Z *= HELD
        elif not ready.scene.body(name).rigid:
            Z *= 1.0 / (1.0 + Z / _impedance(ready, name, normal)[0])
    speed = max(speed, 0.0)
    stiffening = 1.0 + 2.0 * max(speed / c - LINEAR, 0.0)
    return stiffening * Z * speed + 2.0 * gravity * float(model.mass[nodes].sum())


def _nodes(ready: Prepared, body: str) -> slice:
    first = ready.model.node_start[body]
    return slice(first, first + len(ready.meshes[body].points))


def _impedance(ready: Prepared, body: str, normal: Array) -> tuple[float, float]:
    """Greatest rho c [kg/(m^2 s)] of its materials times the area of its shadow [kg/s], and the greatest c [m/s]."""
    materials = [material for material, _ in body_materials(ready.scene.body(body), ready.meshes[body])]
    speeds = [material.wave_speeds["dilatational"] for material in materials]
    faces = ready.meshes[body].boundary[0]
    shadow = 0.5 * float(np.abs(face_geometry(ready.model.X[_nodes(ready, body)], faces)[1] @ normal).sum())
    return max(m.rho * c for m, c in zip(materials, speeds, strict=True)) * shadow, max(speeds)


def _is_held(ready: Prepared, body: str, normal: Array) -> bool:
    """Whether some of its nodes are fixed along the normal."""
    axes = [axis for axis in range(3) if math.fabs(normal[axis]) > ACROSS]
    fixed = np.bitwise_or.reduce(ready.model.fixed_axes[_nodes(ready, body)])
    return any(int(fixed) >> axis & 1 for axis in axes)
