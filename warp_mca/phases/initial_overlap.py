"""Owns the check for bodies that overlap before the first step, and how each contact handles them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.cell_types import triangulated
from warp_mca.phases.press_fit import STARTING, add_flush, press_rate
from warp_mca.scene import OVERLAP_CHOICES, Contact, RigidPlane, Surface
from warp_mca.scene.contacts import contact_names
from warp_mca.watch.skins import depths_below

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.phases.prepare import Prepared
    from warp_mca.physics.contact.stage import ContactStage
    from warp_mca.step.solver import Solver
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.state import State

Array = NDArray[np.float64]

ROUNDING = 1e-6  # of a face's edge: depths up to this are rounding, no overlap
DEEP = 0.5  # of a face's edge: nodes deeper than this are looked for in the whole body, since faces reach one edge deep
WITHIN = 0.25  # of a cell's radius: a cell whose middle is deeper lies in the other body, wherever its nodes are


@dataclass(frozen=True)
class Overlap:
    """Slave nodes of one contact pass that lie inside the master, or cells behind slave faces whose middle does.

    Attributes:
        count: number of them.
        node: the deepest one, or a corner of the deepest cell.
        depth: of that node, or of that middle [m].
        energy: that springs of this pass would hold at the start [J].
        kind: nodes or cells; "behind" for nodes behind the master's faces that lie outside its body.
    """

    count: int
    node: int
    depth: float
    energy: float
    kind: str = "nodes"


def settle_initial_overlap(ready: Sequence[Prepared], solver: Solver, state: State) -> None:
    """Refuse scenes whose bodies overlap, or start their springs free of force, as each contact says.

    Call it after `Solver.begin`, before the first step.

    Raises:
        RequestError: bodies of a contact with `initial_overlap="refuse"` overlap by more than rounding.
    """
    for stage, (depth, energy) in zip(solver.contacts, _initial_depths(solver, state), strict=True):
        rate = np.zeros_like(depth)
        slaves = np.concatenate([np.repeat(item.slave, stage.sides) for item in stage.items])
        for scene, item in enumerate(stage.items):
            mine = slice(int(stage.springs[scene]), int(stage.springs[scene + 1]))
            if not stage.on_plane and (depth[mine] > _rounding(stage, scene, solver)).any():
                outside = _outside(slaves[mine], depth[mine], ready[scene], stage, scene, solver)
                depth[mine][outside] = energy[mine][outside] = 0.0
                held = state.contacts[stage.index].spring.held
                kept = held.numpy()
                kept[mine][outside] = 0.0  # in front of all faces
                held.assign(kept)
            if item.initial_overlap == "refuse":
                least = _rounding(stage, scene, solver)
                found = _found(slaves[mine], depth[mine], energy[mine], least)
                if found and not stage.on_plane:
                    found = _or_behind(found, slaves[mine][depth[mine] > least], ready[scene], stage, scene, solver)
                found = found or _deep_overlap(ready[scene], stage, scene, solver)
                if found:
                    raise _refusal(ready, scene, item.contact, found, solver.model.X[found.node])
            if item.initial_overlap == "refuse":
                depth[mine] = 0.0
            if item.initial_overlap == "press":
                least, most = _rounding(stage, scene, solver), DEEP * _edge(stage, scene)
                add_flush(depth[mine], energy[mine], (least, most), stage, scene, solver, state)
                rate[mine] = press_rate(depth[mine], energy[mine], ready[scene], stage, scene, solver)
                if rate[mine].any():
                    state.scenes[scene].energy_scale += STARTING * float(energy[mine].sum())
                else:
                    depth[mine] = 0.0
        if stage.overlaps != {"refuse"}:
            stage.rest_at(state, depth, rate)


def _initial_depths(solver: Solver, state: State) -> list[tuple[Array, Array]]:
    """Of each contact pass, depth [m] and energy [J] of every spring at the start; the state does not change."""
    with wp.ScopedDevice(solver.device):
        tried = state.copy()
        for stage in solver.contacts:
            stage.launch(solver.work, tried, 0.0)
        solver.work.nodal_force.zero_()
        springs = [own.spring for own in tried.contacts]
        return [(spring.depth.numpy(), spring.energy.numpy()) for spring in springs]


def _edge(stage: ContactStage, scene: int) -> float:
    """Length of the shortest edge of the master's faces, of the slave's usual one on a plane [m]."""
    item = stage.items[scene]
    return 2.0 * item.deepest if stage.on_plane else float(np.sqrt(item.smallest_area))


def _rounding(stage: ContactStage, scene: int, solver: Solver) -> float:
    """Depth that rounding explains [m]."""
    own = solver.model.X[slice(*solver.layout.nodes[scene : scene + 2])]
    return max(ROUNDING * _edge(stage, scene), 8.0 * float(np.spacing(np.abs(own).max())))


def _found(slaves: NDArray[np.int32], depth: Array, energy: Array, least: float) -> Overlap | None:
    """What lies deeper than `least` [m], if anything does."""
    inside = depth > least
    if not inside.any():
        return None
    deepest = int(depth.argmax())
    count = len(np.unique(slaves[inside]))
    return Overlap(count, int(slaves[deepest]), float(depth[deepest]), float(energy.sum()))


def _outside(
    slaves: NDArray[np.int32], depth: Array, ready: Prepared, stage: ContactStage, scene: int, solver: Solver
) -> NDArray[np.bool_]:
    """Springs whose node lies outside of closed masters, though behind the plane of a face that leans."""
    found, least = depth > 0.0, _rounding(stage, scene, solver)
    for slave, master in _surfaces(ready, stage.items[scene]):
        mesh, first = ready.meshes[master.body], _first(slave.body, ready, scene, solver)
        mine = found & (slaves >= first) & (slaves < first + len(ready.meshes[slave.body].points))
        if not mine.any():
            continue
        skin = mesh.boundary[0]
        if len(mesh.surface(master.nodes)[0]) != len(skin):  # an open surface does not tell inside from outside
            return np.zeros(len(depth), dtype=bool)
        first = _first(master.body, ready, scene, solver)
        x = solver.model.X[first : first + len(mesh.points)]
        found[mine] = depths_below(solver.model.X[slaves[mine]], x, triangulated(skin)) < -least
    return found


def _first(body: str, ready: Prepared, scene: int, solver: Solver) -> int:
    """First node of a body of a scene."""
    return int(solver.layout.nodes[scene]) + ready.model.node_start[body]


def _or_behind(
    found: Overlap, nodes: NDArray[np.int32], ready: Prepared, stage: ContactStage, scene: int, solver: Solver
) -> Overlap:
    """What was found, named "behind" if none of the pressed nodes lies in the master's body."""
    points = solver.model.X[np.unique(nodes)]
    for name in {master.body for _, master in _surfaces(ready, stage.items[scene])}:
        first = _first(name, ready, scene, solver)
        mesh = ready.meshes[name]
        body = solver.model.X[first : first + len(mesh.points)]
        inside = depths_below(points, body, triangulated(mesh.boundary[0]))
        if (inside > -_rounding(stage, scene, solver)).any():
            return found
    return replace(found, kind="behind")


def _surfaces(ready: Prepared, item: ContactPass) -> list[tuple[Surface, Surface]]:
    """Slaves and masters of different bodies in a pass that has no plane."""
    contact = ready.scene.contacts[item.contact]
    if isinstance(contact, Contact):
        assert not isinstance(contact.master, RigidPlane)
        return [(contact.slave, contact.master) if item.sign > 0.0 else (contact.master, contact.slave)]
    skins = {body.name: Surface(body=body.name, nodes="boundary") for body in ready.scene.bodies}
    pairs = [pair for pair in ready.scene.general_pairs() if pair[0] != pair[1]]
    return [(skins[a], skins[b]) for one, other in pairs for a, b in ((one, other), (other, one))]


def _deep_overlap(ready: Prepared, stage: ContactStage, scene: int, solver: Solver) -> Overlap | None:
    """Slave nodes that lie inside the master's body too deep for its faces to reach them, if there are any."""
    if stage.on_plane:
        return None
    found = (_deep_in(ready, stage, scene, solver, *pair) for pair in _surfaces(ready, stage.items[scene]))
    return next((overlap for overlap in found if overlap), None)


def _deep_in(
    ready: Prepared, stage: ContactStage, scene: int, solver: Solver, slave: Surface, master: Surface
) -> Overlap | None:
    """`_deep_overlap` of two surfaces."""
    item, model = stage.items[scene], ready.model
    mesh, start = ready.meshes[master.body], model.node_start[master.body]
    first = int(solver.layout.nodes[scene])
    X = solver.model.X[first:]
    body = X[start : start + len(mesh.points)]
    own = item.slave - first if len(stage.items) > 1 else item.slave
    if item.pairs:  # of which the slave's are some
        begin = model.node_start[slave.body]
        own = own[(own >= begin) & (own < begin + len(ready.meshes[slave.body].points))]
    near = own[_in_box(X[own], body)]
    found = None
    if len(near):
        depth = depths_below(X[near], body, triangulated(mesh.boundary[0]))
        found = _found(near + first, depth, np.zeros(len(near)), DEEP * _edge(stage, scene))
    if found:
        return found
    node, middle, radius = _cells_behind(ready.meshes[slave.body], slave.nodes, X[model.node_start[slave.body] :], body)
    if not len(node):
        return None
    depth = depths_below(middle, body, triangulated(mesh.boundary[0]))
    depth[depth <= WITHIN * radius] = 0.0
    nodes = node + model.node_start[slave.body] + first
    within = _found(nodes, depth, np.zeros(len(near)), 0.0)
    return replace(within, count=int((depth > 0.0).sum()), kind="cells") if within else None


def _cells_behind(mesh: Mesh, name: str, X: Array, body: Array) -> tuple[NDArray[np.int32], Array, Array]:
    """A corner, the middle [m] and the distance from it to the nearest corner [m] of the cells behind a surface whose
    middles lie in the box around a body.

    Where two equal bodies coincide no node is inside, but these middles are.
    """
    behind, first, found = np.unique(mesh.surface(name)[1]), 0, []
    for conn in mesh.cells.values():
        part = conn[behind[(behind >= first) & (behind < first + len(conn))] - first]
        first += len(conn)
        middle = X[part].mean(axis=1)
        near = _in_box(middle, body)
        part, middle = part[near], middle[near]
        radius = np.linalg.norm(X[part] - middle[:, None], axis=2).min(axis=1, initial=np.inf)
        found.append((part[:, 0], middle, radius))
    corner, middle, radius = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    return corner, middle, radius


def _in_box(points: Array, body: Array) -> NDArray[np.bool_]:
    """Whether points lie in the box around a body, shape (point_count,), bool."""
    return ((points > body.min(axis=0)) & (points < body.max(axis=0))).all(axis=1)


def _refusal(ready: Sequence[Prepared], scene: int, contact: int, found: Overlap, at: Array) -> RequestError:
    item = ready[scene].scene.contacts[contact]
    field = f"Contact {contact_names(ready[scene].scene.contacts)[contact]}: initial_overlap"
    others = ", ".join(repr(choice) for choice in OVERLAP_CHOICES[1:])
    place = f"({found.count} of them, up to {found.depth:.3g} m deep at ({at[0]:.4g}, {at[1]:.4g}, {at[2]:.4g}) m)"
    remedy = f"{found.kind} of one body lie inside the other before the first step {place}"
    if found.kind == "behind":
        remedy = (
            f"nodes of one body lie behind the other's faces in the contact, though outside of it {place}: faces press "
            "towards their own side only; take the faces on the side where the nodes lie, or nodes='boundary'"
        )
    elif found.kind == "nodes":  # which springs press; bodies of cells that only their middle shows are out of place
        springs = f"contact springs would hold {found.energy:.3g} J"
        remedy = f"{remedy}, and {springs}: move the bodies apart, or choose one of {others}"
    else:
        remedy += ": move the bodies apart"
    error = bad_value(field, item.initial_overlap, remedy)
    return RequestError(f"scenes[{scene}]: {error}") if len(ready) > 1 else error
