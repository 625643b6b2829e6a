"""Owns the elements of a model as an actor: a stage for each block."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TYPE_CHECKING, Any

from warp_mca.base.errors import RequestError
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.stage import BLOCK_DIM, ElementStage
from warp_mca.physics.elements.state import ElementState
from warp_mca.system.actor import Actor, When
from warp_mca.system.stage import SUMS, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.block import Block
    from warp_mca.system.model import Model


def _stage(model: Model, block: Block, precision: str) -> ElementStage:
    """The stage of a block.

    Raises:
        RequestError: the element does not take the law; it names the body of the first one.
    """
    try:
        return ELEMENTS[block.element].stage(block, model.X, precision)
    except RequestError as error:
        body, _ = model.owner(int(model.element_of[block.first]))
        raise RequestError(str(error).replace("Body.", f"Body {body}.", 1)) from error


class Elements(list[ElementStage], Actor):
    """The stages of all blocks, in the model's order."""

    block_dim = BLOCK_DIM

    def __init__(self, solver: System) -> None:
        """Allocate on the current device."""
        model = solver.model
        super().__init__(_stage(model, block, solver.precision) for block in model.blocks)
        self.solver = solver
        for index, stage in enumerate(self):
            if stage.failing:
                stage.failing.place(model.X)
            stage.index, stage.dt = index, solver.dt / (model.rates.substeps if model.rates else 1)

    def new_state(self) -> list[ElementState]:
        """State of elements that have never flowed, by block."""
        return [stage.new_state() for stage in self]

    def kernels(self) -> list[Any]:
        """Those of a step; of stresses where something shows them."""
        shown = self.solver.output and self.solver.output.arrays
        more = [stage.stress_kernel for stage in self if shown]
        return [kernel for stage in self for kernel in stage.kernels()] + more

    def stages(self, when: When) -> Iterable[Stage]:
        """Forces of each block; energies at t(n), which a GPU takes from kept displacements while nodes move."""
        work, level, chain = self.solver.work, when.level, when.chain

        def forces(own: ElementStage, step: Step) -> None:
            own.launch(work, step.state, step.split, level, chain)

        def energies(own: ElementStage, step: Step) -> None:
            own.energies(work, step.state, step.split, work.at_record(step.state))

        def acting(act: Callable[..., None], step: Step) -> None:
            act(work, step.state, step.split)

        for own in self:
            failing = own.failing
            if failing:
                yield Stage("forces", "nodes of whole elements", partial(acting, failing.follow))
            if level is None or own.parts(level, chain):
                yield Stage("forces", "element forces", partial(forces, own))
            if failing:
                yield Stage("forces", "failure of elements", partial(acting, failing.judge))
            yield Stage("energies", "element energies", partial(energies, own), SUMS, only_records=True)
        yield Stage("sums", "element sums", self.solver.records.sum_elements, SUMS, only_records=True)
        if self.solver.model.fails:
            yield Stage("sums", "sums of failed elements", self.solver.records.sum_failed, SUMS, only_records=True)
