"""Owns the device side of what acts in a chain: torques and friction in its hinges, and its base."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.joining import offsets
from warp_mca.base.rotation import point_velocity
from warp_mca.kernels.nodes import base, joint_torque
from warp_mca.kernels.records import loads
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import BESIDE, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.loads import MovableBase
    from warp_mca.system.model import Model
    from warp_mca.system.state import State

BLOCK = 256  # threads of a GPU for the hinges of a scene


@dataclass(eq=False)
class LoadState:
    """State of loaded hinges and movable bases; empty where a scene has none.

    Attributes:
        spin: of each hinge's inner and outer nodes about their mass centre at the latest half step [kg m^2/s], shape
            (hinge_count,), vec2d.
        work: of drive and of friction in each hinge up to t(n) [J], shape (hinge_count,), vec2d.
        work_after: the same half a step later [J], shape (hinge_count,), vec2d.
        clock: steps that each hinge has taken [-], shape (hinge_count,), int32.
        carriage: velocity of each base's carriage at the latest half step [m/s], shape (base_count,), vec3d.
        base_work: of each base's motion and its carriage's weight up to t(n) [J], shape (base_count,), float64.
        base_work_after: the same half a step later [J], shape (base_count,), float64.
        base_clock: steps that each base has taken [-], shape (base_count,), int32.
    """

    spin: wp.array
    work: wp.array
    work_after: wp.array
    clock: wp.array
    carriage: wp.array
    base_work: wp.array
    base_work_after: wp.array
    base_clock: wp.array


def _firsts(items: Sequence[Any], scenes: int) -> wp.array:
    """First item of each scene, and the number of all."""
    return wp.array(np.searchsorted([item.scene for item in items], np.arange(scenes + 1)), dtype=wp.int32)


def _hinge_velocity(model: Model, item: MovableBase) -> NDArray[np.float64]:
    """Velocity of the hinge on a base at the start of the phase [m/s], shape (3,)."""
    if item.coupling < 0:
        return model.V[model.joint_first[item.start]]
    own = model.couplings[item.coupling]
    nodes = model.joint_first[own.start : own.middle]
    return point_velocity(model.X[nodes], model.V[nodes], own.weight[: len(nodes)] * model.mass[nodes], own.place)


def _joined(parts: Sequence[NDArray], dtype: Any) -> wp.array:
    return wp.array(np.concatenate([np.zeros(0), *parts]), dtype=dtype)


class LoadStage(Actor):
    """What `kernels.nodes.joint_torque` and `kernels.nodes.base` read and write.

    Attributes:
        hinges, bases: of the model.
        latest: impulse of each coupling in this step [N s], shape (coupling_count,), vec3d; empty without pinned bases.
    """

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, self.scenes = solver.model, solver.layout.count
        self.hinges, self.bases = model.hinge_loads, model.bases
        self.work, self.constraints, self.dt = solver.work, solver.constraints, solver.common_dt
        self.lanes = BLOCK if wp.get_device().is_cuda else 1
        self.device_bases, self.latest = base.Bases(), wp.zeros(0, dtype=wp.vec3d)
        if not (self.hinges or self.bases):
            return
        self.first_hinge, self.first_base = _firsts(self.hinges, self.scenes), _firsts(self.bases, self.scenes)
        self.kinetic = wp.zeros(len(self.bases), dtype=wp.float64)
        self._make_hinges()
        self._make_bases(model)

    def _make_hinges(self) -> None:
        items, self.loads = self.hinges, joint_torque.HingeLoads()
        sides = [side for item in items for side in (item.inner, item.outer)]
        self.loads.node = _joined(sides, wp.int32)
        self.loads.begin = wp.array(offsets([len(side) for side in sides]), dtype=wp.int32)
        for name in ("friction", "damping", "friction_rate"):
            setattr(self.loads, name, wp.array([getattr(item, name) for item in items], dtype=wp.float64))
        self.loads.table = wp.array(offsets([len(item.times) for item in items]), dtype=wp.int32)
        self.loads.times = _joined([item.times for item in items], wp.float64)
        self.loads.torques = _joined([item.torques for item in items], wp.float64)

    def _make_bases(self, model: Model) -> None:
        items, found = self.bases, self.device_bases
        pinned = [item.coupling >= 0 for item in items]
        found.begin = wp.array([item.start for item in items], dtype=wp.int32)
        found.end = wp.array(
            [item.start if own else item.end for item, own in zip(items, pinned, strict=True)], dtype=wp.int32
        )
        found.coupling = wp.array([item.coupling for item in items], dtype=wp.int32)
        self.latest = wp.zeros(len(model.couplings) if any(pinned) else 0, dtype=wp.vec3d)
        found.direction = wp.array([item.direction for item in items], dtype=wp.vec3d)
        found.mass = wp.array([item.carriage_mass for item in items], dtype=wp.float64)
        found.gravity = wp.array([model.gravity[item.scene] for item in items], dtype=wp.vec3d)
        found.table = wp.array(offsets([len(item.times) for item in items]), dtype=wp.int32)
        found.times = _joined([item.times for item in items], wp.float64)
        found.v_x = _joined([item.velocities[:, 0] for item in items], wp.float64)
        found.v_y = _joined([item.velocities[:, 1] for item in items], wp.float64)
        # half a step before the start, as `Solver.start` takes the nodes there
        start = [_hinge_velocity(model, item) - 0.5 * self.dt * model.gravity[item.scene] for item in items]
        self.start_velocities = np.array(start).reshape(-1, 3)

    def new_state(self) -> LoadState:
        """State before the first step, on the current device."""
        hinges, bases = len(self.hinges), len(self.bases)
        pairs = {name: wp.zeros(hinges, dtype=wp.vec2d) for name in ("spin", "work", "work_after")}
        return LoadState(
            **pairs,
            clock=wp.zeros(hinges, dtype=wp.int32),
            carriage=wp.array(self.start_velocities if bases else [], dtype=wp.vec3d),
            base_work=wp.zeros(bases, dtype=wp.float64),
            base_work_after=wp.zeros(bases, dtype=wp.float64),
            base_clock=wp.zeros(bases, dtype=wp.int32),
        )

    def record_kernels(self) -> list[Any]:
        """Those of a step and of a record."""
        found = [joint_torque.joint_torques] if self.hinges else []
        found += [base.move_bases] if self.bases else []
        return [*found, loads.sum_loads] if found else []

    def start(self, state: State) -> None:
        """Let torques act for half a step back."""
        if self.hinges:
            self.torques(state, -0.5 * self.dt, 0.0)

    def stages(self, when: When) -> Iterable[Stage]:
        """Bases that move or slide, with their hinge nodes; torques; work, heat and kinetic energy of carriages."""
        if when.common and self.bases:
            yield Stage("advance", "bases", self.move_bases, BESIDE)
        if when.common and self.hinges:
            yield Stage("correct", "joint torques", lambda s: self.torques(s.state, self.dt, self.dt))
        if self.hinges or self.bases:
            yield Stage("works", "joint and base sums", self._sum, only_records=True)

    def torques(self, state: State, kick: float, drift: float) -> None:
        """Let torques act for `kick` [s] on nodes that all else has moved for `drift` [s]; 0 before the first step."""
        own = state.loads
        inputs = [self.first_hinge, self.loads, self.work.X, self.work.mass, kick, drift]
        outputs = [state.u, state.v, state.speed_square, own.spin, own.work, own.work_after, own.clock]
        threads = (self.scenes, self.lanes)
        wp.launch(joint_torque.joint_torques, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)

    def move_bases(self, step: Step) -> None:
        """Nodes of ground hinges that move, once all of them have moved as free ones, and their carriages."""
        state, own = step.state, step.state.loads
        inputs = [self.device_bases, self.constraints.bonds.first, self.work.mass, self.latest, self.dt]
        outputs = [state.u, state.v, state.speed_square, state.constraints.impulse]
        outputs += [own.carriage, own.base_work, own.base_work_after, own.base_clock, self.kinetic]
        wp.launch(base.move_bases, len(self.bases), inputs=inputs, outputs=outputs)

    def _sum(self, step: Step) -> None:
        """Work, heat and kinetic energy of carriages, in the record."""
        own = step.state.loads
        inputs = [self.work.row, self.first_hinge, own.work, self.first_base, own.base_work, self.kinetic]
        wp.launch(loads.sum_loads, self.scenes, inputs=inputs, outputs=[self.work.partial])
