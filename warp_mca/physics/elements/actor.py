"""Owns the elements of a model as an actor: a stage for each block."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from warp_mca.physics.actor import Actor, When
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.stage import BLOCK_DIM, ElementStage
from warp_mca.physics.elements.state import ElementState
from warp_mca.step.stage import SUMS, Stage

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver


class Elements(list[ElementStage], Actor):
    """The stages of all blocks, in the model's order."""

    block_dim = BLOCK_DIM

    def __init__(self, solver: Solver) -> None:
        """Allocate on the current device."""
        model = solver.model
        super().__init__(ELEMENTS[block.element].stage(block, model.X, solver.precision) for block in model.blocks)
        self.solver = solver
        for index, stage in enumerate(self):
            stage.index, stage.dt = index, solver.dt / (model.rates.substeps if model.rates else 1)

    def new_state(self) -> list[ElementState]:
        """State of elements that have never flowed, by block."""
        return [stage.new_state() for stage in self]

    def kernels(self) -> list[Any]:
        """Those of a step; of stresses where something shows them."""
        shown = self.solver.output and self.solver.output.arrays
        more = [stage.stress_kernel for stage in self if shown]
        return [kernel for stage in self for kernel in stage.kernels()] + more

    def forces(self, when: When) -> Iterable[Stage]:
        """Forces of the elements of each block."""
        work, level, chain = self.solver.work, when.level, when.chain
        for own in self:
            if level is None or own.parts(level, chain):
                yield Stage("element forces", lambda s, own=own: own.launch(work, s.state, s.split, level, chain))

    def energies(self, when: When) -> Iterable[Stage]:
        """Energies at t(n); a GPU takes them from the displacements that were kept, while nodes move."""
        work = self.solver.work
        for own in self:
            yield Stage(
                "element energies",
                lambda s, own=own: own.energies(work, s.state, s.split, work.at_record(s.state)),
                SUMS,
                only_records=True,
            )

    def sums(self, when: When) -> Iterable[Stage]:
        """Energies and extremes of each scene."""
        yield Stage("element sums", self.solver.records.sum_elements, SUMS, only_records=True)
