"""Owns the device side of rigid bodies: their momentum and pose, and the motion that these give their nodes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array
from warp_mca.base.joining import offsets
from warp_mca.base.rotation import mean_pose
from warp_mca.kernels.nodes import rigid_body
from warp_mca.kernels.nodes.cluster import Clusters, Mean
from warp_mca.kernels.nodes.rigid_motion import Poses, RigidBodies, RigidStep
from warp_mca.kernels.nodes.rigid_rows import RigidRows
from warp_mca.physics.rigid.joint_arrays import JointArrays, JointState
from warp_mca.system.actor import Actor, When
from warp_mca.system.bodies import GROUND
from warp_mca.system.stage import BESIDE, Stage, Step
from warp_mca.system.threads import NODES, Split, whole

if TYPE_CHECKING:
    from warp_mca.physics.joints.constraint_stage import ConstraintStage
    from warp_mca.system.actor import System
    from warp_mca.system.model import Model
    from warp_mca.system.rigid import RigidBody, RigidPin, RigidRow
    from warp_mca.system.state import State


BLOCK = 256  # threads of a GPU for a group of bodies


@dataclass(eq=False)
class RigidState:
    """State of rigid bodies, in the order of `Model.rigid_bodies`; riders count as parts of a body.

    Attributes:
        centre: displacement of each mass centre since the start of the phase [m], shape (body_count,), vec3d.
        rotation: of each body since then, a unit quaternion [-], shape (body_count,), quatd.
        momentum: of each body at the latest half step [kg m/s], shape (body_count,), vec3d.
        spin: angular momentum of each body about its mass centre then [kg m^2/s], shape (body_count,), vec3d.
        orientation: rotation of the cluster of each pin in `Model.rigid_pins` since the start [-], shape (pin_count,),
            quatd.
        turn: greatest turn of each body in a step [rad], shape (body_count,), float64.
        joints: of joints between whole bodies, `JointState`; None without.
    """

    centre: wp.array
    rotation: wp.array
    momentum: wp.array
    spin: wp.array
    orientation: wp.array
    turn: wp.array
    joints: JointState | None = None


def groups_of(bodies: Sequence[RigidBody], rows: Sequence[RigidRow]) -> list[list[int]]:
    """Places of bodies that rows connect, group by group."""
    group = list(range(len(bodies)))
    for row in rows:
        if row.second != GROUND:
            low, high = sorted((group[row.first], group[row.second]))
            group = [low if g == high else g for g in group]
    return [[k for k, g in enumerate(group) if g == own] for own in sorted(set(group))]


class RigidStage(Actor):
    """What `kernels.nodes.rigid_body` reads and writes; of no use for a model without rigid bodies."""

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, nodes = solver.model, solver.nodes
        self.model, self.nodes, self.work, self.dt = model, nodes, nodes.work, nodes.dt
        self.count = len(model.rigid_bodies)
        self.lanes = BLOCK if wp.get_device().is_cuda else 1
        if not self.count:
            return
        self.kernel = rigid_body.advance_kernel(nodes.kind, bool(model.body_joints))
        self.own = own = model.rigid_bodies
        self._make_bodies(model, own)
        self._make_rows(solver, own, model.rigid_rows)
        self._make_pins(model.rigid_pins, nodes.constraints)
        self._make_outputs()
        moved = [body.nodes for body in own]
        arms = [model.X[body.nodes] - body.centre for body in own]
        self.node = wp.array(np.concatenate(moved), dtype=wp.int32)
        self.body = wp.array(np.repeat(np.arange(len(own)), [len(n) for n in moved]), dtype=wp.int32)
        self.arm = wp.array(np.concatenate(arms), dtype=wp.vec3d)

    def _make_bodies(self, model: Model, own: Sequence[RigidBody]) -> None:
        found, loaded = RigidBodies(), [np.concatenate([body.loaded, body.riders]) for body in own]
        arms = [model.X[nodes] - body.centre for nodes, body in zip(loaded, own, strict=True)]
        none = [np.full(len(body.loaded), -1) for body in own]
        found.mass = wp.array([body.mass for body in own], dtype=wp.float64)
        found.inertia = wp.array([body.inertia for body in own], dtype=wp.mat33d)
        found.inverse_inertia = wp.array([np.linalg.inv(body.inertia) for body in own], dtype=wp.mat33d)
        found.gravity = wp.array([model.gravity[body.scene] for body in own], dtype=wp.vec3d)
        found.begin = wp.array(offsets([len(nodes) for nodes in loaded]), dtype=wp.int32)
        found.node = wp.array(np.concatenate(loaded), dtype=wp.int32)
        found.arm = wp.array(np.concatenate(arms), dtype=wp.vec3d)
        pairs = [np.concatenate([n, body.pairs]) for n, body in zip(none, own, strict=True)]
        signs = [np.concatenate([n, body.signs]) for n, body in zip(none, own, strict=True)]
        found.pair = wp.array(np.concatenate(pairs), dtype=wp.int32)
        found.sign = wp.array(np.concatenate(signs), dtype=wp.float64)
        self.bodies = found

    def _make_rows(self, solver: System, own: Sequence[RigidBody], unsorted: Sequence[RigidRow]) -> None:
        groups = groups_of(own, unsorted)
        self.groups = len(groups)
        self.group_of = group_of = {k: g for g, group in enumerate(groups) for k in group}
        rows = sorted(unsorted, key=lambda row: group_of[row.first])
        count = np.bincount(np.array([group_of[row.first] for row in rows], dtype=np.int64), minlength=len(groups))
        first = [row.first for row in rows]
        second = [-1 if row.second == GROUND else row.second for row in rows]
        found = RigidRows()
        found.member = wp.array([k for group in groups for k in group], dtype=wp.int32)
        found.body = wp.array(offsets([len(group) for group in groups]), dtype=wp.int32)
        found.begin = wp.array(offsets(count.tolist()), dtype=wp.int32)
        found.entry = wp.array(offsets((count**2).tolist())[:-1], dtype=wp.int32)
        found.first, found.second = wp.array(first, dtype=wp.int32), wp.array(second, dtype=wp.int32)
        arms = [row.point - own[k].centre for row, k in zip(rows, first, strict=True)]
        others = [row.point - own[max(k, 0)].centre for row, k in zip(rows, second, strict=True)]
        found.first_arm, found.second_arm = wp.array(arms, dtype=wp.vec3d), wp.array(others, dtype=wp.vec3d)
        found.direction = wp.array([row.direction for row in rows], dtype=wp.vec3d)
        found.pair = wp.array([row.pair for row in rows], dtype=wp.int32)
        found.sign = wp.array([row.sign for row in rows], dtype=wp.float64)
        found.twist = wp.array([row.twist for row in rows], dtype=wp.vec3d)
        # pins of a group follow each other
        pins = self.model.rigid_pins
        self.pin_order = sorted(range(len(pins)), key=lambda p: group_of[pins[p].body])
        place = {p: k for k, p in enumerate(self.pin_order)} | {-1: -1}
        found.pin = wp.array([place[row.pin] for row in rows], dtype=wp.int32)
        of_groups = np.array([group_of[pin.body] for pin in pins], dtype=np.int64)
        found.pins = wp.array(offsets(np.bincount(of_groups, minlength=len(groups)).tolist()), dtype=wp.int32)
        found.joint = wp.array([row.joint for row in rows], dtype=wp.int32)
        self.joints: JointArrays | None = None
        if items := self.model.body_joints:
            of_joints = [group_of[max(item.body, item.other) if item.soft else item.body] for item in items]
            places = [place[p] for p in range(len(pins))]
            self.joints = JointArrays(solver, items, of_joints, rows, places, len(groups))
            found.joints = self.joints.joints
            first = self.joints.rates
            rates = [first[row.joint] + row.rate if row.rate >= 0 else -1 for row in rows]
            found.rate = wp.array(rates, dtype=wp.int32)
            self._make_couplers(found, rows)
        self.rows, self.entries = found, int((count**2).sum())

    def _make_couplers(self, found: Any, rows: Sequence[RigidRow]) -> None:
        """Rows of the two rates that each coupler ties, its ratio, and what its positions differ by at the start."""
        assert self.joints is not None
        items, parts, offset = self.joints.items, np.full((len(rows), 2), -1), np.zeros(len(rows))
        place = {(row.joint, row.rate): r for r, row in enumerate(rows) if row.rate >= 0}
        for r, row in enumerate(rows):
            if row.geared >= 0:
                ends = list(zip((row.geared, row.leader), row.rates, strict=True))
                parts[r] = [place[end] for end in ends]
                one, other = (items[j].position[k] for j, k in ends)
                offset[r] = one - row.ratio * other
        found.part = wp.array(parts, dtype=wp.vec2i)
        found.ratio = wp.array([row.ratio for row in rows], dtype=wp.float64)
        found.offset = wp.array(offset, dtype=wp.float64)

    def _make_pins(self, pins: Sequence[RigidPin], constraints: ConstraintStage) -> None:
        items, found = [pins[p] for p in self.pin_order], Clusters()
        weight = np.zeros(len(self.model.joint_first))
        for item in items:
            weight[item.start : item.end] = item.weight
        found.begin = wp.array([(item.start, item.end, item.end) for item in items], dtype=wp.vec3i)
        found.node = constraints.bonds.first
        found.weight = wp.array(weight, dtype=wp.float64)
        self.rows.place = wp.array([item.place for item in items], dtype=wp.vec3d)
        found.axis = wp.array([item.axis for item in items], dtype=wp.vec3d)
        found.arm = wp.array(np.array([(item.arm, item.arm) for item in items]).reshape(-1, 2, 3), dtype=wp.vec3d)
        self.clusters = found

    def _make_outputs(self) -> None:
        bodies, size, pins = self.count, len(self.rows.first), len(self.pin_order)
        step = self.step = RigidStep()
        step.force = wp.zeros(len(self.bodies.node), dtype=wp.vec3d)
        step.turn, step.velocity = (wp.zeros(bodies, dtype=wp.vec3d) for _ in range(2))
        step.rate, step.turned = (wp.zeros(bodies, dtype=wp.mat33d) for _ in range(2))
        step.normal, step.twist = (wp.zeros(size, dtype=wp.vec3d) for _ in range(2))
        step.lever = wp.zeros((size, 2), dtype=wp.vec3d)
        step.gap, step.value, step.share = (wp.zeros(size, dtype=wp.float64) for _ in range(3))
        step.matrix = wp.zeros(self.entries, dtype=wp.float64)
        step.mean, step.impulse = wp.zeros(pins, dtype=Mean), wp.zeros((pins, 2), dtype=wp.vec3d)
        step.point, step.place, step.axis = (wp.zeros(pins, dtype=wp.vec3d) for _ in range(3))
        if self.joints:
            step.joints = self.joints.step

    def new_state(self) -> RigidState:
        """State before `start`, on the current device."""
        at_rest, pins = ([(0.0, 0.0, 0.0, 1.0)] * n for n in (self.count, len(self.model.rigid_pins)))
        vectors = {name: wp.zeros(self.count, dtype=wp.vec3d) for name in ("centre", "momentum", "spin")}
        turns = {"rotation": wp.array(at_rest, dtype=wp.quatd), "orientation": wp.array(pins, dtype=wp.quatd)}
        joints = self.joints.new_state() if self.count and self.joints else None
        turn = wp.zeros(self.count, dtype=wp.float64)
        return RigidState(**turns, **vectors, turn=turn, joints=joints)

    def record_kernels(self) -> list[Any]:
        """Those of a step, which have blocks of Warp's own size."""
        found = [self.kernel, rigid_body.follow] if self.count else []
        return found + (self.joints.record_kernels() if self.count and self.joints else [])

    def start(self, state: State) -> None:
        """Take pose and momentum from the nodes, and the velocities half a step back, from t = 0 to t = -dt / 2."""
        if not self.count:
            return
        u = np.asarray(state.u.numpy(), dtype=np.float64)
        poses = [_pose(self.model, body, u) for body in self.own]
        state.rigid.centre.assign(np.array([centre for centre, _, _, _ in poses]))
        state.rigid.rotation.assign(np.array([rotation for _, rotation, _, _ in poses]))
        state.rigid.momentum.assign(np.array([momentum for _, _, momentum, _ in poses]))
        state.rigid.spin.assign(np.array([spin for _, _, _, spin in poses]))
        self._advance(state, -0.5 * self.dt, -self.dt, False)
        self._follow(state, whole)

    def stages(self, when: When) -> Iterable[Stage]:
        """Rigid bodies and their nodes."""
        if when.common and self.count:
            yield Stage("advance", "rigid bodies", lambda s: self._step(s, when.level), BESIDE)
        if self.count and self.joints:
            yield self.joints.stage()

    def _step(self, step: Step, level: int | None) -> None:
        """All rigid bodies and their nodes, with forces of elements up to a level, or of all."""
        self._advance(step.state, self.dt, self.dt, True, level)
        self._follow(step.state, step.split, step.records)

    def _advance(self, state: State, kick: float, span: float, moves: bool, level: int | None = None) -> None:
        own = state.rigid
        inputs = [self.bodies, self.rows, self.clusters, self.work.X]
        inputs += [*self.nodes.given(state, level), kick, span, moves]
        poses = Poses()
        poses.centre, poses.rotation, poses.momentum = own.centre, own.rotation, own.momentum
        poses.spin, poses.orientation, poses.turn = own.spin, own.orientation, own.turn
        if self.joints:
            poses.joints = self.joints.poses(state)
        outputs, threads = [self.nodes.moved(state), poses, state.constraints.impulse], (self.groups, self.lanes)
        wp.launch(self.kernel, threads, inputs=inputs, outputs=[*outputs, self.step], block_dim=BLOCK)

    def _follow(self, state: State, split: Split, records: bool = False) -> None:
        def launch(part: slice) -> None:
            inputs = [self.node[part], self.body[part], self.arm[part], state.rigid.centre, self.step]
            outputs = [self.nodes.moved(state, records)]
            wp.launch(rigid_body.follow, part.stop - part.start, inputs=inputs, outputs=outputs)

        split(len(self.node), launch, NODES)


def _pose(model: Model, body: RigidBody, u: Array) -> tuple[Array, Array, Array, Array]:
    """Displacement of the mass centre [m], quaternion, momentum [kg m/s] and spin [kg m^2/s] from the nodes."""
    nodes = body.nodes
    mass, turned, rotation = model.mass[nodes], model.X[nodes] - body.centre, np.array([0.0, 0.0, 0.0, 1.0])
    centre = mass @ u[nodes] / body.mass
    if u[nodes].any():
        from scipy.spatial.transform import Rotation

        _, _, R = mean_pose(model.X[nodes], model.X[nodes] + u[nodes], mass)
        rotation, turned = Rotation.from_matrix(R).as_quat(), turned @ R.T
    return centre, rotation, mass @ model.V[nodes], mass @ np.cross(turned, model.V[nodes])
