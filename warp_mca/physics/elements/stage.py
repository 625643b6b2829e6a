"""Owns the device side of elements: the arrays and kernels of one block."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.elements.viscosity import DILATATION, LINEAR, QUADRATIC, TAKEN, UNKNOWN, VISCOUS_ROWS
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.simd import vectorised
from warp_mca.kernels.loads import thermal
from warp_mca.kernels.materials.laws import ROWS, law_functions, row_count
from warp_mca.physics.elements.failing import failing_of
from warp_mca.physics.elements.state import ElementState
from warp_mca.system.reading import on_host
from warp_mca.system.threads import ELEMENTS, Split, whole

if TYPE_CHECKING:
    from warp_mca.system.block import Block
    from warp_mca.system.state import State
    from warp_mca.system.workspace import Workspace

Index = NDArray[np.int32]

BLOCK_DIM = PATCH  # threads of a block, for all kernels of elements


def levels_of(ends: Sequence[int]) -> Index:
    """Level of each of some entries, of which those of level k end at ends[k], int32."""
    counts = np.diff(np.array([0, *ends], dtype=np.int64))
    return np.repeat(np.arange(len(ends), dtype=np.int32), counts)


def _turned(rows: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric tensors, traceless where `rows` lack zz, that are turned; arguments as `ElementStage.rotated`."""
    xx, yy, *zz, xy, yz, xz = rows
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz[0] if zz else -xx - yy], axis=-1).reshape(-1, 3, 3)
    turned = rotation @ tensor @ rotation.transpose(0, 2, 1)
    i, j = ([0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]) if zz else ([0, 1, 0, 1, 0], [0, 1, 1, 2, 2])
    return turned[:, i, j].T


class ElementStage:
    """Device side of one block of elements.

    Attributes:
        block: the host side. precision: as in `warp_mca.run`.
        index: of the block in the model; its state is `State.elements[index]`.
        conn, material: as in `Block`.
        dt: time step of level 0 [s], for viscosity and laws that depend on rates; 0, as it is at first, asks for the
            stress of the history as it stands.
        points: integration points that keep a history.
        lags: whether internal vectors lag behind, see `ElementState.extreme`.
        kept: kinds of what the history of an element holds, of `kernels.materials.laws.ROWS`, point by point.
        slot_node: node that each slot of the force array belongs to, shape (slot_count,), int32: corner by corner.
        slot: where the block's slots start in the force array.
        slot_level: level of `Model.rates` of each slot, shape (slot_count,), int32; empty with one rate.
        failing: what elements that may fail have more, or None.
        rounds: patches that a block of threads computes in turn.
    """

    rounds = 0

    def __init__(self, block: Block, precision: str, kernels: Any, points: int) -> None:
        """Allocate.

        Args:
            block: the elements.
            precision: as in `warp_mca.run`.
            kernels: module that makes force_kernel, energy_kernel and stress_kernel, and says by `kept(law, finite)`
                what follows the history of the points, if anything does, and by `lags` whether vectors lag behind.
            points: integration points that keep a history.
        """
        self.block, self.corners, self.index, self.precision = block, block.conn.shape[0], 0, precision
        self.conn = wp.array(block.conn, dtype=wp.int32)
        self.material = wp.array(block.material, dtype=wp.int32)
        self.count = block.conn.shape[1]
        self.slot_node: Index = block.conn.ravel()
        self.slot_level: Index = np.tile(levels_of(block.level_ends), self.corners)
        self.slot, self.dt, self.points = 0, 0.0, points
        self.law = law_functions(block.law, precision)
        more = kernels.kept(self.law, block.finite) if hasattr(kernels, "kept") else ()
        self.kept: tuple[str, ...] = points * self.law.history + more
        self.lags = hasattr(kernels, "lags") and kernels.lags(self.law, block.finite)
        self.real = scalars(precision).real
        self.failing = failing_of(self, precision, kernels)
        self.no_nodes = [wp.zeros((0, 0), dtype=wp.int32), wp.zeros(0, dtype=self.real)]
        kind, viscous = (precision, block.law, block.finite), [block.joining] if block.joining else []
        self.force_kernel = vectorised(kernels.force_kernel(*kind, *viscous), large=block.finite or points > 1)
        self.energy_kernel = vectorised(kernels.energy_kernel(*kind, *[True] * block.heated), large=block.finite)
        self.stress_kernel = vectorised(kernels.stress_kernel(*kind), large=block.finite)

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [self.force_kernel, self.energy_kernel, *(self.failing.kernels() if self.failing else [])]

    def nodal(self, part: slice) -> list[Any]:
        """Pressure nodes of the corners of a range of elements, and dilatation of all pressure nodes; empty without."""
        return self.no_nodes

    def more(self, part: slice) -> list[Any]:
        """What the force kernel takes beside what all take, of a range of elements."""
        return []

    def new_state(self) -> ElementState:
        """State of elements that have never flowed, on the current device."""
        rows = VISCOUS_ROWS + self.block.heated if self.block.viscous else 3 if self.lags else 2
        extreme = np.zeros((rows, self.count))
        if self.block.viscosity is not None:
            extreme[DILATATION], extreme[[LINEAR, QUADRATIC]] = UNKNOWN, self.block.viscosity
        return ElementState(
            yielded=wp.zeros(self.count if self.block.plastic else 0, dtype=wp.int32),
            history=wp.zeros((row_count(self.kept), self.count if self.kept else 0), dtype=self.real),
            extreme=wp.array(extreme, dtype=self.real),
            peak=wp.zeros((5 if self.law.plastic_row >= 0 else 3, self.count), dtype=wp.float32),
            failing=self.failing.new_state() if self.failing else None,
        )

    def rotated(self, history: NDArray, rotation: NDArray[np.float64]) -> NDArray:
        """A history whose elements are turned, with their reference positions.

        Args:
            history: as in `ElementState`, shape (row_count, element_count).
            rotation: of each element [-], shape (element_count, 3, 3), float64.
        """
        found, first = np.array(history, dtype=np.float64), 0
        for kind in self.kept:
            part = slice(first, first + ROWS[kind])
            first = part.stop
            if kind == "vector":
                found[part] = np.einsum("eij,je->ie", rotation, found[part])
            elif kind != "scalar":
                found[part] = _turned(found[part], rotation)
        return found.astype(history.dtype)

    def _history(self, own: ElementState, part: slice) -> list[Any]:
        """Yield flags and history of a range of elements."""
        yielded = own.yielded[part] if self.block.plastic else own.yielded
        return [yielded, own.history[:, part] if self.kept else own.history]

    def _nodes(self, work: Workspace, state: State, u: wp.array | None = None) -> tuple[wp.array, wp.array, wp.array]:
        """Positions, nodes of each element and displacements that elements compute with, those of the state if u is
        None; elements that may fail have their own."""
        if self.failing:
            return self.failing.X, self.failing.conn, state.elements[self.index].failing.u
        return work.X, self.conn, work.displacements(state) if u is None else u

    def make_room(self, blocks: int) -> None:
        """Called where contact is computed beside the elements: leave room on the device for its blocks of threads."""

    def schedule(self) -> None:
        """Launched now and then, between steps: choose in which order the next ones compute elements."""

    def active(self, level: int) -> int:
        """Elements up to this level."""
        return self.block.level_ends[level] if self.block.level_ends else self.count

    def parts(self, level: int, chain: int | None = None) -> list[slice]:
        """Elements up to a level, of one chain or all, see `Model.rates`."""
        ends = (0, *self.block.part_ends)
        levels = len(self.block.level_ends)
        chains = range(levels) if chain is None else [chain]
        k = [levels * own + c for own in range(level + 1) for c in chains]
        return [slice(ends[i], ends[i + 1]) for i in k if ends[i] < ends[i + 1]]

    def launch(
        self,
        work: Workspace,
        state: State,
        split: Split = whole,
        level: int | None = None,
        chain: int | None = None,
    ) -> None:
        """Forces of each element on its nodes [N], into the slots of this block; plastic flow.

        Of elements up to a `level` of `Model.rates`, of all if None; of one `chain` or all.
        """
        own = state.elements[self.index]

        def launch(part: slice) -> None:
            X, conn, u = self._nodes(work, state)
            inputs = [X, conn[:, part], self.material[part], work.law, u]
            dt = self.dt * (1 << bisect_right(self.block.level_ends, part.start))
            inputs += [self.slot + part.start, self.count, *self.more(part), dt]
            outputs = [*self._history(own, part), own.extreme[:, part], work.force]
            wp.launch(self.force_kernel, part.stop - part.start, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)

        def launch_from(first: int, part: slice) -> None:
            launch(slice(first + part.start, first + part.stop))

        if chain is None:
            count = self.count if level is None else self.active(level)
            rates = self.law.by_points or self.block.viscous  # which have the step of their level
            ends = [end for end in self.block.level_ends if end < count] if rates else []
            for first, end in pairwise([0, *ends, count]):
                split(end - first, partial(launch_from, first), ELEMENTS)
            return
        assert level is not None
        for part in self.parts(level, chain):
            launch(part)

    def energies(self, work: Workspace, state: State, split: Split = whole, u: wp.array | None = None) -> None:
        """Rows elastic, plastic energy [J]; greatest strain, smallest Jacobian ratio so far [-]; hourglass energy [J].

        Of viscous blocks, in the last row, the energy that viscosity took [J].
        To be called after `launch` of the same step; u are the displacements of that [m], if not those of the state.
        """
        own = state.elements[self.index]
        X, conn, seen = self._nodes(work, state, None if work.frame is not None else u)

        def launch(part: slice) -> None:
            inputs = [X, conn[:, part], self.material[part], work.law, *self._history(own, part)]
            inputs += [own.extreme[:, part], seen, self.block.first + part.start, *self.nodal(part)]
            count, first = part.stop - part.start, self.block.first + part.start
            outputs = [work.energy, own.peak[:, part]]
            wp.launch(self.energy_kernel, count, inputs=inputs, outputs=outputs, block_dim=BLOCK_DIM)
            if self.block.viscous:
                wp.copy(work.energy[5, first : first + count], own.extreme[TAKEN, part])
            if self.failing:
                self.failing.lose(work, state, part)

        split(self.count, launch, ELEMENTS)

    def stresses(
        self, work: Workspace, state: State, u: wp.array, element: wp.array, first: int, stress: wp.array
    ) -> None:
        """Stress [Pa] and plastic strain [-] at the corners of some elements with displacements u, from `first` on."""
        own = state.elements[self.index]
        X, conn, seen = self._nodes(work, state, u)
        inputs = [X, conn, self.material, work.law, own.yielded, own.history, seen, element, first]
        inputs += self.nodal(slice(0, self.count))
        wp.launch(self.stress_kernel, len(element), inputs=inputs, outputs=[stress], block_dim=BLOCK_DIM)
        if self.block.heated:
            kernel = thermal.stress_kernel(self.precision, self.block.finite)
            wp.launch(kernel, len(element), inputs=[element, own.extreme, first, self.corners], outputs=[stress])

    def max_plastic_strain(self, state: State, part: slice) -> float:
        """Greatest equivalent plastic strain of any point of a range of elements [-]."""
        row, size = self.law.plastic_row, self.law.size
        if row < 0 or not self.points or part.start == part.stop:
            return 0.0
        found = on_host(state.elements[self.index].history, slice(row, self.points * size, size))
        return float(found[:, part].max())


def gather_lists(stages: Sequence[ElementStage], node_count: int) -> tuple[Index, Index]:
    """Give each stage its slots; list the slots of the forces on each node, in rising order.

    Returns:
        (The first slot of each node, one beyond all of them where it has none, and its second, -1 where there is none,
        -2 - row where it has more than two, shape (node_count, 2), int32; rows of three more slots, -1 where there are
        fewer, and the number of the node's rows, shape (row_count, 4), int32.)
    """
    first = 0
    for stage in stages:
        stage.slot = first
        first += len(stage.slot_node)
    node = np.concatenate([np.zeros(0, np.int32), *(stage.slot_node for stage in stages)])
    first_slots, more_slots = list_slots(np.arange(len(node), dtype=np.int32), node, node_count)
    first_slots[first_slots[:, 0] < 0, 0] = first  # of nodes without elements: a slot without force
    return first_slots, more_slots


def list_slots(entry: Index, node: Index, node_count: int) -> tuple[Index, Index]:
    """As `gather_lists`, of some slots: entries that stand for them, and the node of each; -1 where a node has none."""
    from scipy.sparse import csc_array

    count, begins = np.bincount(node, minlength=node_count), np.arange(len(node) + 1, dtype=np.int32)
    by_slot = csc_array((np.empty(len(node), np.int8), node, begins), shape=(node_count, len(node)))
    slot = entry[by_slot.tocsr().indices]  # a stable sort by node, in a tenth of the time of argsort
    begin = np.cumsum(count) - count
    first_slots = np.full((node_count, 2), -1, dtype=np.int32)
    first_slots[count > 0, 0] = slot[begin[count > 0]]
    first_slots[count == 2, 1] = slot[begin[count == 2] + 1]
    many = np.flatnonzero(count > 2)
    others = count[many] - 1
    rows = (others + 2) // 3
    first_row = np.cumsum(rows) - rows
    first_slots[many, 1] = -2 - first_row
    more_slots = np.full((int(rows.sum()), 4), -1, dtype=np.int32)
    more_slots[:, 3] = np.repeat(rows, rows)
    k = np.arange(others.sum()) - np.repeat(np.cumsum(others) - others, others)
    row, column = np.divmod(k, 3)
    more_slots[np.repeat(first_row, others) + row, column] = slot[np.repeat(begin[many], others) + 1 + k]
    return first_slots, more_slots
