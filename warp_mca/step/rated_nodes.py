"""Owns the nodal stages where elements take steps of their own, see `warp_mca.model.rates`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.kernels.nodes import node
from warp_mca.kernels.nodes.gather import LEVEL_BIT
from warp_mca.physics.elements.stage import list_slots
from warp_mca.step.node_stage import NodeStage
from warp_mca.system.actor import When
from warp_mca.system.stage import Stage
from warp_mca.system.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.step.solver import Solver
    from warp_mca.system.state import State
    from warp_mca.system.time_step import Rates


@dataclass(frozen=True)
class _Active:
    """What a substep advances: `node.integrate_kernel` and `NodeData` say what the arrays hold."""

    item: wp.array
    first_slots: wp.array
    more_slots: wp.array


class RatedNodeStage(NodeStage):
    """Advances the nodes up to a level by substeps of central differences.

    Attributes:
        v_record: velocities half a step after the latest record [m/s], shape (node_count,), vec3d.
    """

    rated = True

    def __init__(self, solver: Solver, rounds: int) -> None:
        """As `NodeStage`; `dt` is the step of contacts and joints [s].

        Raises:
            RequestError: the model is too large for the numbers of its nodes and slots.
        """
        super().__init__(solver, rounds)
        model = solver.model
        assert model.rates is not None
        self.rates: Rates = model.rates
        self.base = self.dt / (1 << self.rates.common)
        self.active = self._lists(solver.elements)
        self.chains = [self._items(np.flatnonzero(self.rates.node_level == k)) for k in range(self.rates.top + 1)]
        self.v_record = wp.zeros(model.node_count, dtype=wp.vec3d)

    def _choose(self, fixed: bool, early: bool) -> None:
        """As `NodeStage._choose`, and the kernel of chains beside that of the fastest nodes."""
        super()._choose(fixed, early)
        self.beside_kernel = node.integrate_kernel(self.kind, fixed, self.constraints.bound, early, True)

    def kernels(self) -> list[Any]:
        """As `NodeStage.kernels`."""
        return [*super().kernels(), *([self.beside_kernel] if wp.get_device().is_cuda else [])]

    def _items(self, nodes: NDArray[np.intp]) -> wp.array:
        """Nodes with their levels, as the kernel takes them."""
        level = self.rates.node_level[nodes].astype(np.int32)
        return wp.array(nodes.astype(np.int32) + (level << LEVEL_BIT), dtype=wp.int32)

    def _lists(self, elements: Sequence[ElementStage]) -> list[_Active]:
        """Nodes and slots of each level."""
        node_level = self.rates.node_level.astype(np.int32)
        node_of = np.concatenate([np.zeros(0, np.int32), *(stage.slot_node for stage in elements)])
        level = np.concatenate([np.zeros(0, np.int32), *(stage.slot_level for stage in elements)])
        if max(len(node_of), len(node_level)) >= 1 << LEVEL_BIT:
            remedy = f"steps of their own reach up to {(1 << LEVEL_BIT) - 1:,}; leave multi_rate out"
            raise bad_value("number of forces on nodes", len(node_of), remedy)
        entry = np.arange(len(node_of), dtype=np.int32)
        entry += (level - node_level[node_of]) << LEVEL_BIT
        found = []
        for k in range(self.rates.top + 1):
            slots = level <= k
            first, more = list_slots(entry[slots], node_of[slots], self.node_count)
            item = self._items(np.flatnonzero(node_level <= k))
            found.append(_Active(item, wp.array(first, dtype=wp.vec2i), wp.array(more, dtype=wp.vec4i)))
        return found

    def integrate(
        self,
        state: State,
        kick: float,
        drift: float,
        role: wp.array,
        split: Split = whole,
        records: bool = False,
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """As `NodeStage.integrate`, for the nodes up to a level, all if None, of one level where a chain is given.

        kick and drift are those of level 0.
        """
        level = self.rates.top if level is None else level
        common = self.rates.common
        items = self.active[level].item if chain is None else self.chains[chain]
        pressed = self.kind.pushed and (level >= common if chain is None else chain == common)
        kernel = self.beside_kernel if chain else self.integrate_kernel
        inputs = [items, *self.given(state, level, role), self.scene, self.gravity, kick, drift]
        self._integrate(kernel, len(items), inputs, state, split, records, pressed)

    def slots(self, level: int | None) -> tuple[wp.array, wp.array]:
        """As `NodeStage.slots`."""
        active = self.active[self.rates.top if level is None else level]
        return active.first_slots, active.more_slots

    def at_record(self, state: State) -> tuple[wp.array, wp.array, float]:
        """As `NodeStage.at_record`: what was kept of the record itself."""
        return self.work.at_record(state), self.v_record, 0.0

    def stages(self, when: When) -> Iterable[Stage]:
        """As `NodeStage.stages`; velocities of a record are kept before the next substep changes them."""
        yield from super().stages(when)
        yield Stage("correct", "velocities kept", lambda s: wp.copy(self.v_record, s.state.v), only_records=True)


def node_stage(solver: Solver) -> NodeStage:
    """The nodal stage of a solver's model."""
    rounds = 0  # of patches that the elements take, where nothing else waits for the nodes
    if not (len(solver.work.nodal_force) or solver.constraints.bound):
        rounds = min(0 if stage.block.plastic else stage.rounds for stage in solver.elements)
    return (RatedNodeStage if solver.model.rates else NodeStage)(solver, rounds)
