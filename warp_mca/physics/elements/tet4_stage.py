"""Owns the device side of `tet4`: its pressure nodes, and the two kernels before that of the forces."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.kernels.elements import tet4
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.simd import vectorised
from warp_mca.physics.elements.element import Array
from warp_mca.physics.elements.stage import BLOCK_DIM, ElementStage
from warp_mca.system.threads import ELEMENTS, NODES, Split, whole

if TYPE_CHECKING:
    from warp_mca.system.block import Block
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace


class Tet4Stage(ElementStage):
    """Pressure nodes, one for each node and material, and their dilatation."""

    def __init__(self, block: Block, volume: Array, precision: str) -> None:
        super().__init__(block, precision, tet4, points=1)
        real = scalars(precision).real
        key = block.conn.astype(np.int64) * (int(block.material.max()) + 1) + block.material
        found, group = np.unique(key, return_inverse=True)
        group = group.reshape(block.conn.shape)
        order = np.argsort(group.ravel(), kind="stable")
        offset = np.searchsorted(group.ravel()[order], np.arange(len(found) + 1))
        around = np.bincount(group.ravel(), np.tile(volume, 4))
        self.group = wp.array(group, dtype=wp.int32)
        self.offset = wp.array(offset, dtype=wp.int32)
        self.element = wp.array(order % self.count, dtype=wp.int32)
        self.inverse_volume = wp.array(1.0 / around, dtype=real)
        self.growth = wp.zeros(self.count, dtype=real)
        self.dilatation = wp.zeros(len(found), dtype=real)
        self.dilatation_kernel = vectorised(tet4.dilatation_kernel(precision, block.finite))
        self.average_kernel = tet4.average_kernel(precision)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [*super().kernels(), self.dilatation_kernel, self.average_kernel]

    def nodal(self, part: slice) -> list[Any]:
        """Pressure nodes of each element of a range, and the dilatation of all."""
        return [self.group[:, part], self.dilatation]

    more = nodal

    def launch(
        self,
        work: Workspace,
        state: State,
        split: Split = whole,
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """Forces of each element on its nodes [N], after the dilatation at the pressure nodes; of all alike."""

        def grow(part: slice) -> None:
            count, inputs = part.stop - part.start, [work.X, self.conn[:, part], work.displacements(state)]
            wp.launch(self.dilatation_kernel, count, inputs=inputs, outputs=[self.growth[part]], block_dim=BLOCK_DIM)

        def average(part: slice) -> None:
            ends = self.offset[part.start : part.stop + 1]
            count, inputs = part.stop - part.start, [ends, self.element, self.inverse_volume[part], self.growth]
            wp.launch(self.average_kernel, count, inputs=inputs, outputs=[self.dilatation[part]], block_dim=BLOCK_DIM)

        split(self.count, grow, ELEMENTS)
        split(len(self.dilatation), average, NODES)
        super().launch(work, state, split)
