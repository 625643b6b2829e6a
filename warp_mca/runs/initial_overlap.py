"""Owns the check for bodies that overlap before the first step, and how each contact handles them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.cell_types import triangulated
from warp_mca.kernels.contact.inside import depths_inside
from warp_mca.results.contact_history import contact_names
from warp_mca.scene import OVERLAP_CHOICES, RigidPlane

if TYPE_CHECKING:
    from warp_mca.runs.prepare import Prepared
    from warp_mca.scene import Contact
    from warp_mca.solve.contact_stage import ContactStage
    from warp_mca.solve.solver import Solver
    from warp_mca.solve.state import State

Array = NDArray[np.float64]

ROUNDING = 1e-6  # of a face's edge: depths up to this are rounding, no overlap
DEEP = 0.5  # of a face's edge: nodes deeper than this are looked for in the whole body, since faces reach one edge deep


@dataclass(frozen=True)
class Overlap:
    """Slave nodes of one contact pass that lie inside the master.

    Attributes:
        count: number of them.
        node: the deepest one.
        depth: of that node [m].
        energy: that springs of this pass would hold at the start [J].
    """

    count: int
    node: int
    depth: float
    energy: float


def settle_initial_overlap(ready: Sequence[Prepared], solver: Solver, state: State) -> None:
    """Refuse scenes whose bodies overlap, or start their springs free of force, as each contact says.

    Call it after `Solver.begin`, before the first step.

    Raises:
        RequestError: bodies of a contact with `initial_overlap="refuse"` overlap by more than rounding.
    """
    for stage, (depth, energy) in zip(solver.contacts, _initial_depths(solver, state), strict=True):
        slaves = np.concatenate([np.repeat(item.slave, stage.sides) for item in stage.items])
        for scene, item in enumerate(stage.items):
            mine = slice(int(stage.springs[scene]), int(stage.springs[scene + 1]))
            if item.initial_overlap == "refuse":
                found = _found(slaves[mine], depth[mine], energy[mine], _rounding(stage, scene, solver))
                found = found or _deep_overlap(ready[scene], stage, scene, solver)
                if found:
                    raise _refusal(ready, scene, item.contact, found, solver.model.X[found.node])
            if item.initial_overlap != "stress_free":
                depth[mine] = 0.0
        if stage.stress_free:
            stage.rest_at(state, depth)


def _initial_depths(solver: Solver, state: State) -> list[tuple[Array, Array]]:
    """Of each contact pass, depth [m] and energy [J] of every spring at the start; the state does not change."""
    with wp.ScopedDevice(solver.device):
        tried = state.copy()
        for stage in solver.contacts:
            stage.launch(solver.work, tried, 0.0)
        solver.work.contact_force.zero_()
        springs = [own.spring for own in tried.contacts]
        return [(spring.depth.numpy(), spring.energy.numpy()) for spring in springs]


def _edge(stage: ContactStage, scene: int) -> float:
    """Length of the shortest edge of the master's faces, of the slave's usual one on a plane [m]."""
    item = stage.items[scene]
    return 2.0 * item.deepest if stage.on_plane else float(np.sqrt(item.smallest_area))


def _rounding(stage: ContactStage, scene: int, solver: Solver) -> float:
    """Depth that rounding explains [m]."""
    return max(ROUNDING * _edge(stage, scene), 8.0 * float(np.spacing(np.abs(solver.model.X).max())))


def _found(slaves: NDArray[np.int32], depth: Array, energy: Array, least: float) -> Overlap | None:
    """What lies deeper than `least` [m], if anything does."""
    inside = depth > least
    if not inside.any():
        return None
    deepest = int(depth.argmax())
    count = len(np.unique(slaves[inside]))
    return Overlap(count, int(slaves[deepest]), float(depth[deepest]), float(energy.sum()))


def _deep_overlap(ready: Prepared, stage: ContactStage, scene: int, solver: Solver) -> Overlap | None:
    """Slave nodes that lie inside the master's body too deep for its faces to reach them, if there are any."""
    if stage.on_plane:
        return None
    item, model = stage.items[scene], ready.model
    contact = ready.scene.contacts[item.contact]
    assert not isinstance(contact.master, RigidPlane)
    name = contact.master.body if item.sign > 0.0 else contact.slave.body
    mesh, start = ready.meshes[name], model.node_start[name]
    first = int(solver.layout.nodes[scene])
    X = solver.model.X[first:]
    body = X[start : start + len(mesh.points)]
    own = item.slave - first if len(stage.items) > 1 else item.slave
    near = own[((X[own] > body.min(axis=0)) & (X[own] < body.max(axis=0))).all(axis=1)]
    if not len(near):
        return None
    depth = _depths_inside(X[near], body, mesh.boundary[0])
    return _found(near + first, depth, np.zeros(len(near)), DEEP * _edge(stage, scene))


def _depths_inside(points: Array, body: Array, quads: NDArray[np.int32]) -> Array:
    """Depth of points below the surface of a body, negative outside [m], shape (point_count,), to float32's digits."""
    origin = body.mean(axis=0)
    reach = float(np.linalg.norm(np.ptp(body, axis=0)))
    with wp.ScopedDevice("cpu"):
        surface = wp.Mesh(
            wp.array((body - origin).astype(np.float32), dtype=wp.vec3f),
            wp.array(triangulated(quads).ravel(), dtype=wp.int32),
            support_winding_number=True,
        )
        distance = wp.zeros(len(points), dtype=wp.float32)
        inputs = [surface.id, wp.array((points - origin).astype(np.float32), dtype=wp.vec3f), reach]
        wp.launch(depths_inside, len(points), inputs=inputs, outputs=[distance])
        return distance.numpy().astype(np.float64)


def _refusal(ready: Sequence[Prepared], scene: int, contact: int, found: Overlap, at: Array) -> RequestError:
    item: Contact = ready[scene].scene.contacts[contact]
    field = f"Contact {contact_names(ready[scene].scene.contacts)[contact]}: initial_overlap"
    others = ", ".join(repr(choice) for choice in OVERLAP_CHOICES[1:])
    remedy = (
        f"nodes of one body lie inside the other before the first step ({found.count} of them, up to {found.depth:.3g} "
        f"m deep at ({at[0]:.4g}, {at[1]:.4g}, {at[2]:.4g}) m), and contact springs would hold {found.energy:.3g} J: "
        f"move the bodies apart, or choose one of {others}"
    )
    error = bad_value(field, item.initial_overlap, remedy)
    return RequestError(f"scenes[{scene}]: {error}") if len(ready) > 1 else error
