"""Owns the device side of couplings, joints between clusters of nodes."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.nodes import couple
from warp_mca.kernels.nodes.cluster import Clusters, Sums
from warp_mca.kernels.nodes.coupling import Inverse
from warp_mca.kernels.nodes.hinge import Side
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import ASIDE, BESIDE, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System

# Threads of a block on a GPU, and nodes of its part of a cluster; a CPU takes clusters whole. Small blocks fit in what
# patches of elements leave free, see `PatchStage.make_room`.
BLOCK, PART = 64, 128


@dataclass(eq=False)
class CouplingState:
    """State of couplings; empty where a scene has none.

    Attributes:
        place: of each joint at t(n) [m], shape (coupling_count,), vec3d.
        orientation: rotation of the first and the second cluster since the start of the phase [-], shape
            (coupling_count, 2), quatd.
    """

    place: wp.array
    orientation: wp.array


class CouplingStage(Actor):
    """What `kernels.nodes.couple` reads and writes.

    Attributes:
        count: number of couplings.
        clusters: on the device.
    """

    block_dim = BLOCK

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model = solver.model
        self.items, self.count = model.couplings, len(model.couplings)
        self.work, self.loads, self.dt = solver.work, solver.loads, solver.common_dt
        if not self.count:
            return
        weight = np.zeros(len(model.joint_first))
        for item in self.items:
            weight[item.start : item.end] = item.weight
        self.clusters = Clusters()
        self.clusters.begin = wp.array([(item.start, item.middle, item.end) for item in self.items], dtype=wp.vec3i)
        self.clusters.node = solver.constraints.bonds.first
        self.clusters.weight = wp.array(weight, dtype=wp.float64)
        base = np.full(self.count, -1)
        for k, item in enumerate(model.bases):
            base[item.coupling] = k if item.coupling >= 0 else base[item.coupling]
        self.clusters.base = wp.array(base if (base >= 0).any() else base[:0], dtype=wp.int32)
        self.clusters.axis = wp.array([item.axis for item in self.items], dtype=wp.vec3d)
        self.clusters.arm = wp.array(np.array([item.arm for item in self.items]), dtype=wp.vec3d)
        self._make_parts(PART if wp.get_device().is_cuda else None)

    def _make_parts(self, size: int | None) -> None:
        """Cut clusters in parts of so many nodes; None: leave them whole."""
        part, first = [], []
        for j, item in enumerate(self.items):
            counts = []
            for side, (begin, end) in enumerate(((item.start, item.middle), (item.middle, item.end))):
                counts.append(len(part))
                part += [(j, side, k, min(k + (size or end), end)) for k in range(begin, end, size or end)]
            first.append((*counts, len(part)))
        self.clusters.part = wp.array(part, dtype=wp.vec4i)
        self.clusters.first_part = wp.array(first, dtype=wp.vec3i)
        self.threads = (len(part), BLOCK if size else 1)
        self.moments, self.momenta = wp.zeros(len(part), dtype=Sums), wp.zeros(len(part), dtype=couple.Momenta)
        self.sides, self.inverse = wp.zeros((self.count, 2), dtype=Side), wp.zeros(self.count, dtype=Inverse)
        self.point, self.place = wp.zeros(self.count, dtype=wp.vec3d), wp.zeros(self.count, dtype=wp.vec3d)

    def new_state(self) -> CouplingState:
        """State before the first step, on the current device."""
        at_rest = np.zeros((self.count, 2, 4))
        at_rest[..., 3] = 1.0
        return CouplingState(
            place=wp.array([item.place for item in self.items], dtype=wp.vec3d),
            orientation=wp.array(at_rest, dtype=wp.quatd),
        )

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [couple.couple_parts] if self.count else []

    @property
    def blocks(self) -> int:
        """Blocks of threads that take part."""
        return self.threads[0] if self.count else 0

    def stages(self, when: When) -> Iterable[Stage]:
        """What impulses need of positions, beside the forces; then clusters, which have moved as free nodes."""
        if when.common and self.count:
            yield Stage("forces", "couplings: responses", self.find_responses, ASIDE)
            yield Stage("advance", "couplings", self.couple, BESIDE)

    def find_responses(self, step: Step) -> None:
        """What impulses need and positions give."""
        state, own, work = step.state, step.state.couplings, self.work
        inputs = [self.clusters, work.X, work.mass, own.place, state.u, state.v]
        wp.launch(couple.sum_moments, self.threads, inputs=inputs, outputs=[self.moments], block_dim=BLOCK)
        inputs = [self.clusters, self.loads.device_bases, self.moments, own.place, own.orientation]
        inputs += [state.loads.carriage, state.loads.base_clock, self.dt]
        outputs = [self.sides, self.inverse, self.point, self.place]
        threads = (self.count, self.threads[1])
        wp.launch(couple.find_responses, threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)

    def couple(self, step: Step) -> None:
        """Join the clusters, once all their nodes have moved as free ones."""
        state, own, work = step.state, step.state.couplings, self.work
        inputs = [self.clusters, work.X, work.mass, self.place, state.u, state.v, self.dt]
        wp.launch(couple.sum_momenta, self.threads, inputs=inputs, outputs=[self.momenta], block_dim=BLOCK)
        inputs = [self.clusters, work.X, self.sides, self.inverse, self.point, self.place, self.momenta, self.dt]
        outputs = [state.u, state.v, state.speed_square, state.constraints.impulse, own.place, own.orientation]
        outputs.append(self.loads.latest)
        wp.launch(couple.couple_parts, self.threads, inputs=inputs, outputs=outputs, block_dim=BLOCK)
