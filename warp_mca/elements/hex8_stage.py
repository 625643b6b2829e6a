"""Owns the device side of `hex8` at small strain: on a GPU, the list of the elements that have yielded."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.elements.stage import BLOCK_DIM, ElementStage
from warp_mca.kernels import hex8
from warp_mca.threads import ELEMENTS, Split, whole

if TYPE_CHECKING:
    from warp_mca.model import Block

BLOCKS = 8  # for each multiprocessor, that stride over the list


class Hex8Stage(ElementStage):
    """On a GPU, the elements that have yielded, in the order in which they did, and their number at the end."""

    def __init__(self, block: Block, precision: str) -> None:
        super().__init__(block, precision, hex8, points=8)
        listed = block.plastic and wp.get_device().is_cuda
        self.list = wp.zeros(self.count + 1 if listed else 0, dtype=wp.int32)
        self.launches = [(self.force_kernel, 0)]
        if listed:
            blocks = BLOCKS * wp.get_device().sm_count
            turns = {"elastic": 0, "plastic": blocks}
            self.launches = [(hex8.force_kernel(precision, True, turn=turn), most) for turn, most in turns.items()]

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.energy_kernel, *(kernel for kernel, _ in self.launches)]

    def reset(self) -> None:
        """Forget all plastic flow."""
        super().reset()
        self.list.zero_()

    def forces(self, X: wp.array, law: wp.array, u: wp.array, force: wp.array, split: Split = whole) -> None:
        """Forces of each element on its nodes [N], into the slots of this block; plastic flow."""

        def launch(part: slice) -> None:
            inputs = [X, self.conn[:, part], self.material[part], law, u, self.block.slot + part.start, self.count]
            yielded, history = self._history(part)
            for kernel, blocks in self.launches:
                wp.launch(
                    kernel,
                    part.stop - part.start,
                    inputs=inputs,
                    outputs=[yielded, self.list, history, force],
                    block_dim=BLOCK_DIM,
                    max_blocks=blocks,
                )

        split(self.count, launch, ELEMENTS)
