"""Owns the device side of `hex8` at small strain: on a GPU, the list of the elements that have yielded."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import warp as wp

from warp_mca.elements.stage import BLOCK_DIM, ElementStage
from warp_mca.kernels import hex8

if TYPE_CHECKING:
    from warp_mca.model import Block


class Hex8Stage(ElementStage):
    """Elements that have yielded, in the order in which they did, and their number at the end."""

    def __init__(self, block: Block, precision: str) -> None:
        super().__init__(block, precision, hex8, points=8)
        listed = block.plastic and wp.get_device().is_cuda
        self.force_kernel = hex8.force_kernel(precision, block.plastic, listed=listed)
        self.width = 2 * self.count if listed else self.count
        entries = np.full(self.count + 1 if listed else 0, -1, dtype=np.int32)
        entries[-1:] = 0
        self.list = wp.array(entries, dtype=wp.int32)

    def forces(self, X: wp.array, law: wp.array, u: wp.array, stamp: wp.array, force: wp.array) -> None:
        """Forces of each element on its nodes [N], into the slots of this block; plastic flow."""
        inputs = [X, self.conn, self.material, law, u, self.block.slot, stamp]
        outputs = [self.yielded, self.list, self.history, force]
        wp.launch(self.force_kernel, self.width, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)
