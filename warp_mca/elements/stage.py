"""Owns the device side of elements: the arrays and kernels of one block."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.kernels import j2
from warp_mca.kernels.scalars import scalars

if TYPE_CHECKING:
    from warp_mca.model import Block

BLOCK_DIM = 64  # threads of a block: these kernels fill the register file


class ElementStage:
    """Device side of one block of elements; an elastic block allocates no history.

    Attributes:
        block: the host side.
        conn, material: as in `Block`.
        yielded: not 0 where an element has yielded, shape (element_count,), int32; empty where elastic.
        history: plastic strain and equivalent plastic strain of each point in turn, then what the element keeps more;
            empty where elastic.
    """

    def __init__(self, block: Block, precision: str, kernels: Any, points: int, rows: int | None = None) -> None:
        """Allocate.

        Args:
            block: the elements.
            precision: as in `warp_mca.run`.
            kernels: module that makes force_kernel, energy_kernel and stress_kernel.
            points: integration points that keep a plastic strain.
            rows: of the history, where an element keeps more.
        """
        self.block, self.corners = block, block.conn.shape[0]
        self.conn = wp.array(block.conn, dtype=wp.int32)
        self.material = wp.array(block.material, dtype=wp.int32)
        self.count = block.conn.shape[1]
        kept = self.count if block.plastic else 0
        self.yielded = wp.zeros(kept, dtype=wp.int32)
        self.points = points
        self.history = wp.zeros((rows or points * j2.HISTORY_SIZE, kept), dtype=scalars(precision).real)
        kind = (precision, block.plastic, block.finite)
        self.force_kernel = kernels.force_kernel(*kind)
        self.energy_kernel = kernels.energy_kernel(*kind)
        self.stress_kernel = kernels.stress_kernel(*kind)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.force_kernel, self.energy_kernel]

    def more(self) -> list[wp.array]:
        """What kernels of this formulation take beside what all take."""
        return []

    def forces(self, X: wp.array, law: wp.array, u: wp.array, force: wp.array) -> None:
        """Forces of each element on its nodes [N], into the slots of this block; plastic flow."""
        inputs = [X, self.conn, self.material, law, u, self.block.slot, *self.more()]
        outputs = [self.yielded, self.history, force]
        wp.launch(self.force_kernel, self.count, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

    def energies(self, X: wp.array, law: wp.array, u: wp.array, energy: wp.array) -> None:
        """Rows elastic, plastic energy [J], largest strain, smallest Jacobian ratio [-], hourglass energy [J]."""
        inputs = [X, self.conn, self.material, law, self.yielded, self.history, u, self.block.first, *self.more()]
        wp.launch(self.energy_kernel, self.count, inputs=inputs, outputs=[energy], block_dim=BLOCK_DIM)

    def stresses(
        self, X: wp.array, law: wp.array, u: wp.array, element: wp.array, first: int, stress: wp.array
    ) -> None:
        """Stress [Pa] and plastic strain [-] at the corners of some elements, from slot `first` on."""
        inputs = [X, self.conn, self.material, law, self.yielded, self.history, u, element, first, *self.more()]
        wp.launch(self.stress_kernel, len(element), inputs=inputs, outputs=[stress], block_dim=BLOCK_DIM)

    def max_plastic_strain(self) -> float:
        """Greatest equivalent plastic strain of any point [-]."""
        last = self.history.numpy()[: self.points * j2.HISTORY_SIZE][j2.HISTORY_SIZE - 1 :: j2.HISTORY_SIZE]
        return float(last.max(initial=0.0))
