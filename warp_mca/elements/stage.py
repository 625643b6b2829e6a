"""Owns the device side of elements: the arrays and kernels of one block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.hardware.lanes import side_by_side
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import HISTORY_SIZE
from warp_mca.model.patches import PATCH
from warp_mca.solve.threads import ELEMENTS, Split, whole

if TYPE_CHECKING:
    from warp_mca.model.model import Block

Index = NDArray[np.int32]

BLOCK_DIM = PATCH  # threads of a block, for all kernels of elements


class ElementStage:
    """Device side of one block of elements; an elastic block allocates no history.

    Attributes:
        block: the host side.
        conn, material: as in `Block`.
        yielded: not 0 where an element has yielded, shape (element_count,), int32; empty where elastic.
        history: plastic strain and equivalent plastic strain of each point, in the order of
            `kernels.elements.point_records.history_functions`, then what the element keeps more; empty where elastic.
        extreme: greatest square of the deviatoric strain and greatest loss of volume 1 - J of any step so far [-], from
            0 on, shape (2, element_count), in the scalars of the precision.
        slot_node: node that each slot of the force array belongs to, shape (slot_count,), int32: corner by corner.
        slot: where the block's slots start in the force array.
        rounds: patches that a block of threads computes in turn.
    """

    rounds = 0

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
        self.slot_node: Index = block.conn.ravel()
        self.slot = 0
        kept = self.count if block.plastic else 0
        real = scalars(precision).real
        self.yielded = wp.zeros(kept, dtype=wp.int32)
        self.points = points
        self.history = wp.zeros((rows or points * HISTORY_SIZE, kept), dtype=real)
        self.extreme = wp.zeros((2, self.count), dtype=real)
        kind = (precision, block.law, block.finite)
        self.force_kernel = side_by_side(kernels.force_kernel(*kind), large=block.finite)
        self.energy_kernel = side_by_side(kernels.energy_kernel(*kind), large=block.finite)
        self.stress_kernel = side_by_side(kernels.stress_kernel(*kind), large=block.finite)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.force_kernel, self.energy_kernel]

    def more(self, part: slice) -> list[Any]:
        """What kernels of this formulation take beside what all take, of a range of elements."""
        return []

    def _history(self, part: slice) -> list[Any]:
        """Yield flags and history of a range of elements."""
        return [self.yielded[part], self.history[:, part]] if self.block.plastic else [self.yielded, self.history]

    def make_room(self, blocks: int) -> None:
        """Called where contact is computed beside the elements: leave room on the device for its blocks of threads."""

    def schedule(self) -> None:
        """Launched now and then, between steps: choose in which order the next ones compute elements."""

    def forces(self, X: wp.array, law: wp.array, u: wp.array, force: wp.array, split: Split = whole) -> None:
        """Forces of each element on its nodes [N], into the slots of this block; plastic flow."""

        def launch(part: slice) -> None:
            inputs = [X, self.conn[:, part], self.material[part], law, u, self.slot + part.start, self.count]
            outputs = [*self._history(part), self.extreme[:, part], force]
            inputs += self.more(part)
            wp.launch(self.force_kernel, part.stop - part.start, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

        split(self.count, launch, ELEMENTS)

    def energies(self, X: wp.array, law: wp.array, u: wp.array, energy: wp.array, split: Split = whole) -> None:
        """Rows elastic, plastic energy [J]; greatest strain, smallest Jacobian ratio so far [-]; hourglass energy [J].

        To be called after `forces` of the same step.
        """

        def launch(part: slice) -> None:
            inputs = [X, self.conn[:, part], self.material[part], law, *self._history(part), self.extreme[:, part], u]
            inputs += [self.block.first + part.start, *self.more(part)]
            wp.launch(self.energy_kernel, part.stop - part.start, inputs=inputs, outputs=[energy], block_dim=BLOCK_DIM)

        split(self.count, launch, ELEMENTS)

    def stresses(
        self, X: wp.array, law: wp.array, u: wp.array, element: wp.array, first: int, stress: wp.array
    ) -> None:
        """Stress [Pa] and plastic strain [-] at the corners of some elements, from slot `first` on."""
        inputs = [X, self.conn, self.material, law, self.yielded, self.history, u, element, first]
        inputs += self.more(slice(0, self.count))
        wp.launch(self.stress_kernel, len(element), inputs=inputs, outputs=[stress], block_dim=BLOCK_DIM)

    def reset(self) -> None:
        """Forget all plastic flow."""
        self.yielded.zero_()
        self.history.zero_()

    def max_plastic_strain(self, part: slice) -> float:
        """Greatest equivalent plastic strain of any point of a range of elements [-]."""
        if not self.block.plastic or part.start == part.stop:
            return 0.0
        last = self.history[HISTORY_SIZE - 1 : self.points * HISTORY_SIZE : HISTORY_SIZE, part]
        return float(last.numpy().max())


def gather_lists(stages: Sequence[ElementStage], node_count: int) -> tuple[Index, Index]:
    """Give each stage its slots; list the slots of the forces on each node, in rising order.

    Returns:
        (The first slot of each node and its second, -1 where it has one, -2 - row where it has more than two, shape
        (node_count, 2), int32; rows of three more slots, -1 where there are fewer, and the number of the node's rows,
        shape (row_count, 4), int32.)
    """
    first = 0
    for stage in stages:
        stage.slot = first
        first += len(stage.slot_node)
    node = np.concatenate([stage.slot_node for stage in stages])
    slot, count = np.argsort(node, kind="stable").astype(np.int32), np.bincount(node, minlength=node_count)
    begin = np.cumsum(count) - count
    near = np.full((node_count, 2), -1, dtype=np.int32)
    near[:, 0] = slot[begin]
    near[count == 2, 1] = slot[begin[count == 2] + 1]
    many = np.flatnonzero(count > 2)
    others = count[many] - 1
    rows = (others + 2) // 3
    first_row = np.cumsum(rows) - rows
    near[many, 1] = -2 - first_row
    more = np.full((int(rows.sum()), 4), -1, dtype=np.int32)
    more[:, 3] = np.repeat(rows, rows)
    k = np.arange(others.sum()) - np.repeat(np.cumsum(others) - others, others)
    row, column = np.divmod(k, 3)
    more[np.repeat(first_row, others) + row, column] = slot[np.repeat(begin[many], others) + 1 + k]
    return near, more
