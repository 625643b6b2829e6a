"""Owns press fits: how fast an overlap at the start is brought in, and nodes flush with another side of the master."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.kernels.contact.spring import ANY_DEPTH
from warp_mca.physics.contact.bonds import nearest_of_side, normals
from warp_mca.physics.elements.cells import body_materials
from warp_mca.scene import Contact, ContactAll, RigidPlane
from warp_mca.watch.energy import WEIGHT

if TYPE_CHECKING:
    from warp_mca.phases.prepare import Prepared
    from warp_mca.physics.contact.stage import ContactStage
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State

CROSSINGS = 6.0  # times in which waves cross the longer body while springs of a press fit come to their full force
LEAST_STEPS = 60  # of these
STARTING = 0.01  # of their energy if the full force came at once, the least to which an imbalance is compared
BESIDE = 0.01  # of a face's width, by which nodes may lie beside it, as at the edges of round surfaces


def press_rate(depth: Array, energy: Array, ready: Prepared, stage: ContactStage, scene: int, solver: Solver) -> Array:
    """The a of `kernels.contact.spring.shrink` [m] for springs of these depths [m] and energies [J].

    At once, the full force makes bodies swing about their new shape to twice the stress, and springs of the surface
    open in steps that make energy. In h steps up and as many down the overlap is h (h + 1) a. Arrays have shape
    (spring_count,).
    """
    force = 2.0 * float(np.divide(energy, depth, out=np.zeros_like(depth), where=depth > 0.0).sum())
    weight = float(np.linalg.norm(ready.scene.gravity)) * float(ready.model.mass.sum())
    item = stage.items[scene]
    contact, crossing = ready.scene.contacts[item.contact], 0.0
    held = False  # nodes that cannot leave the plane do not swing
    if isinstance(contact, Contact) and isinstance(contact.master, RigidPlane):
        axis = int(np.abs(contact.master.normal).argmax())
        held = bool((solver.model.fixed_axes[item.slave[depth > 0.0]] >> axis & 1).all())
    if held or force <= WEIGHT * weight:
        return np.zeros_like(depth)
    for body in ready.scene.bodies:
        if not body.rigid and (isinstance(contact, ContactAll) or body.name in contact.sides):
            mesh = ready.meshes[body.name]
            slowest = min(material.wave_speeds["bar"] for material, _ in body_materials(body, mesh))
            crossing = max(crossing, float(np.ptp(mesh.points, axis=0).max()) / slowest)
    half = 0.5 * max(CROSSINGS * crossing / solver.nodes.dt, LEAST_STEPS)
    return depth / (half * (half + 1.0))


def add_flush(
    depth: Array,
    energy: Array,
    span: tuple[float, float],
    stage: ContactStage,
    scene: int,
    solver: Solver,
    state: State,
) -> None:
    """Add the springs of nodes that lie flush with one side of a master and behind another, which count as in front.

    Within the `span` of depths [m] they get the other side's depth [m] and energy [J], arrays of shape (spring_count,),
    and may press there at once.
    """
    item, X, (least, most) = stage.items[scene], solver.model.X, span
    if stage.sides == 1 or stage.general:
        return
    flush, behind = np.zeros(len(item.slave), dtype=int), []
    for p in range(stage.sides):
        number = np.flatnonzero(item.side == p).astype(np.int32)
        if not len(number):
            continue
        which, found, opposed = nearest_of_side(X, item.slave, item.slave_face, X, item.face, number)
        place = np.einsum("sk,ski->si", found.weight, X[item.face[which]])
        gap = ((X[item.slave] - place) * normals(X, item.face[which])).sum(axis=1)
        flush += found.apart <= least
        within = (found.beyond <= BESIDE) & (gap < -least) & (gap > -most)
        behind.append((p, gap, which, opposed & within))
    free = (depth.reshape(-1, stage.sides) == 0.0).all(axis=1) & (flush > 0)
    held = state.contacts[stage.index].spring.held
    kept = held.numpy()
    for p, gap, which, found in behind:
        node = np.flatnonzero(found & free)
        row = stage.sides * node + p
        stiffness = np.minimum(item.stiffness[node], item.face_stiffness[which[node]])
        depth[row], energy[row] = -gap[node], 0.5 * stiffness * gap[node] ** 2
        kept[int(stage.springs[scene]) + row] = ANY_DEPTH
    held.assign(kept)
