"""Owns the device side of the damping of bodies: their mean motion, and forces at nodes behind those of elements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array
from warp_mca.base.joining import offsets
from warp_mca.kernels.nodes import damping
from warp_mca.kernels.records.ledger import RUN, SUM_WIDTH
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.system.stage import MAIN, Step
from warp_mca.system.threads import NODES

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


@dataclass(eq=False)
class DampingState:
    """State of the damped bodies, node by node.

    Attributes:
        force: of elements on each node at the latest step [N], shape (count,), vec3d.
        damping: force that damped it then [N], shape (count,), vec3d.
        branch: y of each Maxwell branch of each node [N], shape (branch_total,), vec3d.
        taken: energy that damping took from each node up to t(n) [J], shape (count,), float64.
        clock: 1 once a node has taken a step [-], shape (count,), int32.
    """

    force: wp.array
    damping: wp.array
    branch: wp.array
    taken: wp.array
    clock: wp.array


class DampingStage(NodalLoad):
    """All damped bodies."""

    place, stream = "damp", MAIN

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        items, dt, own = self.items, solver.common_dt, damping.DampedBodies()
        counts = [len(item.node) for item in items]
        own.begin = wp.array(offsets(counts), dtype=wp.int32)
        rates = np.array([item.mass_rate for item in items])
        own.mass_rate = wp.array(-np.expm1(-dt * rates) / dt, dtype=wp.float64)  # decay by exp(-alpha dt) in each step
        own.lag = wp.array([item.stiffness / dt for item in items], dtype=wp.float64)
        own.ground = wp.array([int(item.ground) for item in items], dtype=wp.int32)
        own.turns = wp.array([item.turns for item in items], dtype=wp.int32)
        own.anchor = wp.array([item.anchor for item in items], dtype=wp.vec3i)
        branches = [len(item.gain) for item in items]
        own.branch = wp.array(offsets(branches), dtype=wp.int32)
        stored = offsets([count * n for count, n in zip(counts, branches, strict=True)])
        own.stored, self.stored = wp.array(stored[:-1], dtype=wp.int32), int(stored[-1])
        ratio = dt / np.concatenate([np.zeros(0), *(item.times for item in items)])
        own.gain = wp.array(np.concatenate([np.zeros(0), *(item.gain for item in items)]), dtype=wp.float64)
        own.keep = wp.array(np.exp(-ratio), dtype=wp.float64)
        own.share = wp.array(-np.expm1(-ratio) / ratio, dtype=wp.float64)
        self.bodies, self.share = own, np.array(own.share.numpy())
        self.node = wp.array(np.concatenate([item.node for item in items]), dtype=wp.int32)
        self.body = wp.array(np.repeat(np.arange(len(items)), counts), dtype=wp.int32)
        # bodies that cannot turn, with nothing relative to their motion, need none
        self.moves = any(item.turns or (item.mass_rate and not item.ground) for item in items)
        self.runs = min(max(-(-max(counts) // RUN), 1), SUM_WIDTH)
        self.lanes = RUN if wp.get_device().is_cuda else 1
        self.partial = wp.zeros((len(items), self.runs), dtype=damping.Sums)
        self.motion = damping.BodyMotion()
        for part in ("place", "velocity", "spin"):
            setattr(self.motion, part, wp.zeros(len(items), dtype=wp.vec3d))

    @property
    def kernel(self) -> Any:
        """That of a step."""
        return damping.damp_kernel(self.solver.nodes.kind)

    def new_state(self) -> DampingState:
        """State before the first step, on the current device."""
        return DampingState(
            force=wp.zeros(self.count, dtype=wp.vec3d),
            damping=wp.zeros(self.count, dtype=wp.vec3d),
            branch=wp.zeros(self.stored, dtype=wp.vec3d),
            taken=wp.zeros(self.count, dtype=wp.float64),
            clock=wp.zeros(self.count, dtype=wp.int32),
        )

    def settle(self, on: bool) -> float:
        """Branches relax at once from now on, or no more: what rests has the moduli of slow loads."""
        self.bodies.share.assign(0.0 * self.share if on else self.share)
        return 0.0

    def kernels(self) -> list[Any]:
        """That of the nodes."""
        return [self.kernel]

    def record_kernels(self) -> list[Any]:
        """Those of sums."""
        return [*super().record_kernels(), damping.sum_bodies]

    def push(self, step: Step, start: bool = False) -> None:
        """Add the damping forces; at the start those of the mass part alone, as elements have no forces then."""
        state, work = step.state, self.work
        places = [work.X, state.u, state.v]
        if self.moves:
            bodies = len(self.items)
            inputs, threads = [self.bodies, self.node, work.mass, *places], (bodies, self.runs, self.lanes)
            wp.launch(damping.sum_bodies, threads, inputs=inputs, outputs=[self.partial])
            inputs = [self.bodies, self.runs, self.node, *places, self.partial]
            wp.launch(damping.find_mean_motion, (bodies, self.lanes), inputs=inputs, outputs=[self.motion])
        nodes, force = self.solver.nodes.given(state)
        if start:
            inputs = [self.bodies, self.body, self.node, nodes, *places, self.motion]
            wp.launch(damping.damp_at_start, self.count, inputs=inputs, outputs=[work.nodal_force])
            return
        own = state.parts[self.name]
        outputs = [work.nodal_force, own.force, own.damping, own.branch, own.taken, own.clock]

        def launch(part: slice) -> None:
            inputs = [part.start, self.bodies, self.body, self.node, nodes, force, *places, self.motion]
            inputs.append(self.solver.common_dt)
            wp.launch(self.kernel, part.stop - part.start, inputs=inputs, outputs=outputs)

        step.split(self.count, launch, NODES)

    def feel(self, state: State, ahead: State, way: Array) -> None:
        """Count what the forces took."""
        own = state.parts[self.name]
        moved = way[np.array(self.node.numpy(), dtype=np.int32)]
        force = 0.5 * (own.damping.numpy() + ahead.parts[self.name].damping.numpy())
        own.taken.assign(own.taken.numpy() - (force * moved).sum(axis=1))

    def energies_of(self, state: State) -> Sequence[wp.array]:
        """What damping took from each node."""
        return [state.parts[self.name].taken]
