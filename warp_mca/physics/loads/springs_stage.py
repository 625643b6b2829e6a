"""Owns the device side of springs between points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import offsets
from warp_mca.kernels.nodes import spring
from warp_mca.physics.loads.nodal_stage import NodalLoad
from warp_mca.system.stage import Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State

BLOCK = 256  # threads of a GPU for a spring, or for a part of its points
PART = 8 * BLOCK  # entries of a part: one multiprocessor would read those of long lists alone


@dataclass(eq=False)
class SpringsState:
    """State of springs between points.

    Attributes:
        energy: stored in each at t(n) [J], shape (count,), float64.
        taken: by its dashpot up to t(n) [J], shape (count,), float64.
        tension: T then [N], shape (count,), float64.
        elongation: L - L_0 then [m], shape (count,), float64.
        damper: tension of the dashpot along the spring then [N], shape (count,), vec3d.
        speed: of the second point from the first one, half a step before [m/s], shape (count,), vec3d.
        clock: 1 once a spring has taken a step [-], shape (count,), int32.
    """

    energy: wp.array
    taken: wp.array
    tension: wp.array
    elongation: wp.array
    damper: wp.array
    speed: wp.array
    clock: wp.array


class SpringsStage(NodalLoad):
    """All springs between points."""

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        super().__init__(solver, name)
        self.bars = items = [bar for item in self.items for bar in item.bars]
        own = spring.Springs()
        node = np.concatenate([item.node for item in items])
        weight = np.concatenate([item.weight for item in items])
        counts = [len(item.node) for item in items]
        self.lanes = BLOCK if wp.get_device().is_cuda else 1
        self.points, self.parts = _points(counts, node, weight), None
        if max(counts) > PART:
            self._divide(counts)
        own.points = self.points
        for key in ("between", "direction"):
            setattr(own, key, wp.array([getattr(item, key) for item in items], dtype=wp.vec3d))
        for key in ("rest", "lowest", "lightness"):
            setattr(own, key, self.numbers(key))
        tables = [table for item in items for table in (item.table, item.damper)]
        own.tables = wp.array(offsets([table.shape[1] for table in tables]), dtype=wp.int32)
        joined = np.concatenate(tables, axis=1)
        own.x, own.y = wp.array(joined[0], dtype=wp.float64), wp.array(joined[1], dtype=wp.float64)
        self.length, self.preload = self.numbers("length"), self.numbers("preload")
        self.springs, self.dt = own, solver.common_dt
        self.ends, self.force = _ends(node, weight, counts), wp.zeros(self.count, dtype=wp.vec3d)

    def _divide(self, counts: list[int]) -> None:
        """Let points be sums of parts."""
        sizes = [min(PART, count - k) for count in counts for k in range(0, count, PART)]
        self.parts, total = self.points, len(sizes)
        self.parts.begin = wp.array(offsets(sizes), dtype=wp.int32)
        numbers = [-(-count // PART) for count in counts]
        self.points = _points(numbers, np.arange(total, dtype=np.int32), np.ones(total))
        self.sums = [wp.zeros(total, dtype=wp.vec3d) for _ in range(2)]

    def motion(self, state: State) -> Sequence[wp.array]:
        """Displacements [m] and velocities [m/s] that `springs.points` weigh, of nodes or of parts of points."""
        if self.parts is None:
            return [state.u, state.v]
        threads = (len(self.sums[0]), self.lanes)
        wp.launch(spring.sum_parts, threads, [self.parts, state.u, state.v], self.sums, block_dim=BLOCK)
        return self.sums

    def entries(self, item: Any) -> int:
        """One for each spring."""
        return len(item.bars)

    def numbers(self, key: str) -> wp.array:
        """A field of each spring, shape (count,), float64."""
        return wp.array([getattr(bar, key) for bar in self.bars], dtype=wp.float64)

    def new_state(self) -> SpringsState:
        """State before the first step, on the current device."""
        numbers = {key: wp.zeros(self.count, dtype=wp.float64) for key in ("energy", "taken", "tension", "elongation")}
        vectors = {key: wp.zeros(self.count, dtype=wp.vec3d) for key in ("damper", "speed")}
        return SpringsState(**numbers, **vectors, clock=wp.zeros(self.count, dtype=wp.int32))

    def record_kernels(self) -> list[Any]:
        """Those of a step, which have blocks of Warp's own size."""
        return [*super().record_kernels(), spring.sum_parts, spring.pull_springs, spring.add_pulls]

    def push(self, step: Step, start: bool = False) -> None:
        """Add the forces of all springs."""
        self.pull(step, start, self.length, self.preload, self.motion(step.state))

    def pull(self, step: Step, start: bool, length: wp.array, preload: wp.array, motion: Sequence[wp.array]) -> None:
        """Add them with L_0 [m] and the preload [N] of each, shape (count,), float64, and the `motion` of points."""
        state, work, kept = step.state, self.work, spring.SpringState()
        for field in fields(SpringsState):
            setattr(kept, field.name, getattr(state.parts[self.name], field.name))
        inputs = [self.springs, length, preload, *motion, self.dt, not start]
        threads, outputs = (self.count, self.lanes), [self.force, kept]
        wp.launch(spring.pull_springs, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)
        wp.launch(spring.add_pulls, len(self.ends.node), inputs=[self.ends, self.force], outputs=[work.nodal_force])

    def feel(self, state: State, ahead: State, way: Array) -> None:
        """Count what dashpots took; no force gave what speeds changed by."""
        own = state.parts[self.name]
        tension = 0.5 * (own.damper.numpy() + ahead.parts[self.name].damper.numpy())
        moved = np.zeros((self.count, 3))
        for k, item in enumerate(self.bars):
            moved[k] = item.weight @ way[item.node]
        own.taken.assign(own.taken.numpy() + (tension * moved).sum(axis=1))
        own.speed.assign(own.speed.numpy() - moved / self.dt)

    def energies_of(self, state: State) -> Sequence[wp.array]:
        """Stored, and taken by dashpots."""
        own = state.parts[self.name]
        return [own.energy, own.taken]

    def readings_of(self, state: State) -> Sequence[wp.array]:
        """Tension and elongation."""
        own = state.parts[self.name]
        return [own.tension, own.elongation]


def _points(counts: Sequence[int], node: Index, weight: Array) -> Any:
    own = spring.Points()
    own.begin = wp.array(offsets(counts), dtype=wp.int32)
    own.node, own.weight = wp.array(node, dtype=wp.int32), wp.array(weight, dtype=wp.float64)
    return own


def _ends(node: Index, weight: Array, counts: list[int]) -> Any:
    """The springs at each node, from the nodes and weights of each spring in turn."""
    order, own = np.argsort(node, kind="stable"), spring.Ends()
    nodes, begin = np.unique(node[order], return_index=True)
    owner = np.repeat(np.arange(len(counts)), counts)[order]
    own.node, own.spring = wp.array(nodes, dtype=wp.int32), wp.array(owner, dtype=wp.int32)
    own.begin = wp.array([*begin, len(node)], dtype=wp.int32)
    own.weight = wp.array(weight[order], dtype=wp.float64)
    return own
