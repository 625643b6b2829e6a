"""Owns the device side of joints between whole bodies: their arrays, their state, and what is recorded of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array
from warp_mca.base.joining import offsets
from warp_mca.kernels.nodes.joint_arrays import LOADS, JointPoses, JointStep, RigidJoints
from warp_mca.kernels.nodes.screws import Twist
from warp_mca.kernels.records.entries import list_entries, sum_entries
from warp_mca.physics.loads.pushed import tables_of
from warp_mca.system.columns import JOINTS, added_columns
from warp_mca.system.stage import Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.body_joints import BodyJoint
    from warp_mca.system.rigid import RigidRow
    from warp_mca.system.state import State


ROUNDING = 1e-15  # opening that counts as closed, over the greatest arm of a joint: a few units of float64


@dataclass(eq=False)
class JointState:
    """State of joints between whole bodies, those of `Model.body_joints` and their rates in turn.

    Attributes:
        position: of each rate at t(n) [rad], [m]; of a ball the turns so far, shape (rate_count,), float64.
        rate: of each at the latest half step [rad/s], [m/s], shape (rate_count,), float64.
        ball: rotation of each ball, at the first of its rates, a unit quaternion [-], shape (rate_count,), quatd.
        work: of the motor of each rate, half a step after t(n) [J], shape (rate_count,), float64.
        heat: of friction and dampers then [J], shape (rate_count,), float64.
        impulse: force and moment of each joint on its body, summed over the steps [N s], [N m s], shape (6
            joint_count,), float64.
        drive: torque or force of each motor, summed over the steps [N m s], [N s], shape (rate_count,), float64.
        clock: steps that each joint has taken [-], shape (joint_count,), int32.
        held: torque or force of motors that a function gives [N m], [N], shape (rate_count,), float64.
        alone: least part of the screw of a freedom that others of its joint did not make, and the step of it [-], shape
            (joint_count,), vec2d.
        rank: at the first joint of each group of bodies: number of independent rows that hold its joints, the least
            part of one that others do not hold, both at the start, the least part so far over that one, 0 where rows
            became fewer, and the step of it [-], shape (joint_count,), vec4d.
    """

    position: wp.array
    rate: wp.array
    ball: wp.array
    work: wp.array
    heat: wp.array
    impulse: wp.array
    drive: wp.array
    clock: wp.array
    held: wp.array
    alone: wp.array
    rank: wp.array


class JointArrays:
    """Joints of a model on the device, for `physics.rigid.stage.RigidStage`.

    Attributes:
        joints: as kernels take them.
        step: what a step computes and forgets.
    """

    def __init__(
        self,
        solver: System,
        items: Sequence[BodyJoint],
        group_of: Sequence[int],
        rows: Sequence[RigidRow],
        pin_place: Sequence[int],
        groups: int,
    ) -> None:
        """Allocate on the current device.

        Args:
            solver: that advances the model.
            items: its joints.
            group_of: group of bodies of each joint.
            rows: of all bodies, in the order of groups.
            pin_place: place of each pin of the model among those on the device.
            groups: number of groups.
        """
        self.solver, self.items = solver, items
        self.counts = [len(item.kind) for item in items]
        self.rates = offsets(self.counts)
        self.column = added_columns(solver.model)[JOINTS]
        scenes = np.array([item.scene for item in items])
        joints = np.searchsorted(scenes, np.arange(solver.layout.count + 1))
        self.first_joint = wp.array(LOADS * joints, dtype=wp.int32)
        self.first_rate = wp.array(self.rates[joints], dtype=wp.int32)
        self.most = int(np.diff(self.rates[joints]).max())
        self._make_joints(group_of, rows, pin_place, groups)
        self._make_step(len(rows), groups)

    def _make_joints(
        self, group_of: Sequence[int], rows: Sequence[RigidRow], pin_place: Sequence[int], groups: int
    ) -> None:
        items, found, bodies = self.items, RigidJoints(), self.solver.model.rigid_bodies
        member = sorted(range(len(items)), key=lambda j: group_of[j])
        found.begin = wp.array(offsets(np.bincount(group_of, minlength=groups).tolist()), dtype=wp.int32)
        found.member = wp.array(member, dtype=wp.int32)
        for name in ("body", "other"):
            found_bodies = [max(getattr(item, name), -1) for item in items]
            setattr(found, name, wp.array(found_bodies, dtype=wp.int32))
            arms = [item.place - bodies[max(b, 0)].centre for item, b in zip(items, found_bodies, strict=True)]
            setattr(found, "arm" if name == "body" else "other_arm", wp.array(arms, dtype=wp.vec3d))
        found.pin = wp.array([pin_place[item.pin] if item.pin >= 0 else -1 for item in items], dtype=wp.int32)
        found.soft = wp.array([int(item.soft) for item in items], dtype=wp.int32)
        of_rows = [row.joint for row in rows]
        found.row = wp.array([of_rows.index(j) for j in range(len(items))], dtype=wp.int32)
        found.length = wp.array([item.length for item in items], dtype=wp.float64)
        found.turned = wp.array([item.turned for item in items], dtype=wp.quatd)
        found.moved = wp.array([item.moved for item in items], dtype=wp.vec3d)
        found.rate = wp.array(self.rates, dtype=wp.int32)
        for name, dtype in (("kind", wp.int32), ("part", wp.int32), ("motor", wp.int32), ("axis", wp.vec3d)):
            setattr(found, name, wp.array(np.concatenate([getattr(item, name) for item in items]), dtype=dtype))
        found.point = wp.array(np.concatenate([item.point for item in items]), dtype=wp.vec3d)
        found.drive = wp.array(np.concatenate([item.drive for item in items]), dtype=wp.float64)
        tables = [table for item in items for table in item.tables]
        if tables:
            found.tables = tables_of([_Table(np.array(table.times), np.array(table.values)) for table in tables])
        reach = [np.linalg.norm(arm, axis=1).max() for arm in (found.arm.numpy(), found.other_arm.numpy())]
        found.rounding = ROUNDING * float(max(*reach, max(item.length for item in items)))
        self.joints = found

    def _make_step(self, rows: int, groups: int) -> None:
        rates, joints, step = int(self.rates[-1]), len(self.items), JointStep()
        step.screw, step.dual = wp.zeros(rates, dtype=Twist), wp.zeros(rates, dtype=Twist)
        step.basis, step.load = wp.zeros(6 * joints, dtype=Twist), wp.zeros(LOADS * joints, dtype=wp.float64)
        step.push, step.total = wp.zeros(rows, dtype=wp.float64), wp.zeros(rows, dtype=wp.float64)
        step.worst = wp.zeros(groups, dtype=wp.float64)
        for name in ("change", "ahead", "behind", "torque", "drag", "hold"):
            setattr(step, name, wp.zeros(rates, dtype=wp.float64))
        for name in ("work", "heat", "kinetic", "stored", "effort", "seen", "pace"):
            setattr(step, name, wp.zeros(rates, dtype=wp.float64))
        self.step = step

    def new_state(self) -> JointState:
        """State before `start`, on the current device."""
        rates, at_rest = int(self.rates[-1]), [(0.0, 0.0, 0.0, 1.0)]
        zeros = {name: wp.zeros(rates, dtype=wp.float64) for name in ("rate", "work", "heat", "drive", "held")}
        position = np.concatenate([np.zeros(0), *(item.position for item in self.items)])
        return JointState(
            **zeros,
            position=wp.array(position, dtype=wp.float64),
            ball=wp.array(at_rest * rates, dtype=wp.quatd),
            impulse=wp.zeros(LOADS * len(self.items), dtype=wp.float64),
            clock=wp.zeros(len(self.items), dtype=wp.int32),
            alone=wp.array([(1.0, 0.0)] * len(self.items), dtype=wp.vec2d),
            rank=wp.zeros(len(self.items), dtype=wp.vec4d),
        )

    def poses(self, state: State) -> Any:
        """The state as kernels take it."""
        found, own = JointPoses(), state.rigid.joints
        for name in ("position", "rate", "ball", "work", "heat", "impulse", "drive", "clock", "held", "alone", "rank"):
            setattr(found, name, getattr(own, name))
        return found

    def record_kernels(self) -> list[Any]:
        """Those that list and sum what is recorded."""
        return [sum_entries, list_entries]

    def stage(self) -> Stage:
        """Energies, loads and positions of a record."""
        return Stage("works", "joints between bodies", self._record, only_records=True)

    def _record(self, step: Step) -> None:
        own, work = self.step, self.solver.work
        for k, entry in enumerate((own.kinetic, own.stored, own.heat, own.work)):
            self.solver.records.sum_runs(sum_entries, self.most, [self.column.first + k, self.first_rate, entry])
        column, scenes = self.column.first + len(self.column.energies), self.solver.layout.count
        for first, entry in ((self.first_joint, own.load), (self.first_rate, own.effort), (self.first_rate, own.seen)):
            if len(entry):
                wp.launch(list_entries, len(entry), inputs=[work.row, column, first, entry], outputs=[work.partial])
            column += len(entry) // scenes


@dataclass(frozen=True)
class _Table:
    """An amplitude as arrays, as `tables_of` takes it."""

    times: Array
    values: Array
