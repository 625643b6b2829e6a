"""Owns the contacts of a model as an actor: a stage for each contact pass."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.contact import contact
from warp_mca.kernels.contact.spring_sums import sum_springs
from warp_mca.physics.contact.contact_state import ContactState
from warp_mca.physics.contact.edge_stage import EdgeStage, NoEdgeStage
from warp_mca.physics.contact.extremes import NormalForce
from warp_mca.physics.contact.skin_edges import EdgePass
from warp_mca.physics.contact.stage import ContactStage
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import BESIDE, BEYOND, LISTS, SPRINGS, Search, Stage, Step
from warp_mca.system.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.contact import ContactPass
    from warp_mca.system.model import Model
    from warp_mca.system.state import State


def stage_of(items: Sequence[ContactPass], model: Model, index: int, normal_force: NormalForce) -> ContactStage:
    """The stage of a pass of each scene, on the current device."""
    edges = [item for item in items if isinstance(item, EdgePass)]
    if not edges:
        return ContactStage(items, model, index, normal_force)
    some = all(
        any(len(ends) for ends in side) for side in zip(*((e.slave_edge, e.master_edge) for e in edges), strict=True)
    )
    return (EdgeStage if some else NoEdgeStage)(edges, model, index, normal_force)


class Contacts(list[ContactStage], Actor):
    """The stages of all contact passes: the k-th passes of all scenes are one.

    Attributes:
        normal_force: how normal forces are summed.
    """

    block_dim = contact.BLOCK_DIM

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model, count = solver.model, len(solver.model.passes) // solver.layout.count
        scenes = [model.passes[k * count : (k + 1) * count] for k in range(solver.layout.count)]
        self.solver, self.normal_force = solver, NormalForce(scenes if count else [], solver.threads)
        super().__init__(stage_of(model.passes[k::count], model, k, self.normal_force) for k in range(count))

    @property
    def blocks(self) -> int:
        """Blocks of threads of the largest pass."""
        return max((stage.blocks for stage in self), default=0)

    @property
    def is_replayable(self) -> bool:
        """Whether a graph can hold the search."""
        return any(stage.is_replayable for stage in self)

    def new_state(self) -> list[ContactState]:
        """Springs that nothing presses, by pass."""
        return [stage.new_state() for stage in self]

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [kernel for stage in self for kernel in stage.kernels()]

    def record_kernels(self) -> list[Any]:
        """Those of a search and of a record."""
        return [kernel for stage in self for kernel in (sum_springs, *stage.search_kernels())]

    def find_boxes(self, u: wp.array) -> None:
        """First part of a search of every pass, at these displacements."""
        for stage in self:
            stage.find_boxes(self.solver.work, u)

    def list_faces(self, state: State, u: wp.array, split: Split = whole) -> None:
        """Second part of a search of every pass."""
        for stage in self:
            stage.list_faces(self.solver.work, state, u, split)

    def search_all(self, state: State) -> None:
        """Broad phase of every pass."""
        self.find_boxes(state.u)
        self.list_faces(state, state.u)

    def stages(self, when: When) -> Iterable[Stage]:
        """Forces of each pass, after the search or ahead of it, and sums of these."""
        work, dt = self.solver.work, self.solver.nodes.dt

        def searching(which: Search, act: Callable[[State], None]) -> Callable[[Step], None]:
            return lambda step: act(step.state) if step.search == which else None

        if when.common and self:
            search = searching("before", self.search_all)
            boxes = searching("after", lambda state: self.find_boxes(work.at_record(state)))
            lists = searching("after", lambda state: self.list_faces(state, work.at_record(state)))
            yield Stage("forces", "search before contact", search, BEYOND, only_records=True)
            for own in self:
                yield Stage("forces", "contact", lambda s, own=own: own.launch(work, s.state, dt, s.split), BEYOND)
            yield Stage("search", "boxes of faces", boxes, LISTS, only_records=True, after=(BESIDE,))
            yield Stage("search", "search after contact", lists, LISTS, only_records=True, after=(BEYOND,))
        for own in self:
            yield Stage("sums", "spring sums", partial(self._sum, own), SPRINGS, only_records=True)

    def _sum(self, own: ContactStage, step: Step) -> None:
        """Sums of a pass. In a check between rows, what is summed over an output interval goes on."""
        inputs = [own.column, own.first, step.is_row, step.state.contacts[own.index].spring]
        self.solver.records.sum_runs(sum_springs, int(np.diff(own.springs).max()), inputs)
