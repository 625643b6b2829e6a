"""Owns the end of loads on what has lost its elements: faces whose element failed, nodes all of whose elements did."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Index
from warp_mca.kernels.loads.lasting import close_faces, close_shares, find_lasting

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


class Lasting:
    """Entries of loads of one kind, of which each lasts as long as an element with all of its nodes.

    What lasts follows from the State alone, at the start of each step: loads end in the step after the failure.

    Attributes:
        entry: those that may end, shape (count,), int32.
        lasts: whether each of these does, shape (count,), int32.
    """

    def __init__(self, solver: System, nodes: Index, whole: Any) -> None:
        """Allocate on the current device.

        Args:
            solver: whose elements may fail.
            nodes: of each entry, shape (entry_count, most), int32; some may be equal.
            whole: what stands for each entry while it lasts, faces or shares.
        """
        self.whole, self.close = whole, close_faces if whole.dtype == wp.vec4i else close_shares
        held = [
            (k, block.failing is not None, _holders(block.conn, nodes)) for k, block in enumerate(solver.model.blocks)
        ]
        ends = np.ones(len(nodes), dtype=bool)
        for _, fails, rows in held:
            ends &= fails | (np.diff(rows.indptr) == 0)
        entry = np.flatnonzero(ends)
        self.entry, self.lasts = wp.array(entry, dtype=wp.int32), wp.zeros(len(entry), dtype=wp.int32)
        self.rows = []
        for k, fails, rows in held:
            if fails and rows[entry].nnz:
                first, element = (wp.array(it, dtype=wp.int32) for it in (rows[entry].indptr, rows[entry].indices))
                self.rows.append((k, first, element))

    def kernels(self) -> list[Any]:
        """Those of a step."""
        return [find_lasting, self.close] if self.rows else []

    def renew(self, state: State, out: Any) -> None:
        """Write what stands for each entry now."""
        count = len(self.entry) if self.rows else 0
        for k, (block, first, element) in enumerate(self.rows):
            failing = state.elements[block].failing
            assert failing is not None
            wp.launch(find_lasting, count, inputs=[first, element, failing.age, k == 0], outputs=[self.lasts])
        wp.launch(self.close, count, inputs=[self.entry, self.lasts, self.whole], outputs=[out])


def _holders(conn: Index, nodes: Index) -> Any:
    """Elements of a block with all nodes of each entry, as the rows of a sparse matrix."""
    from scipy.sparse import csr_array

    def incidence(rows: Index) -> Any:
        pairs = np.unique(np.column_stack([np.repeat(np.arange(len(rows)), rows.shape[1]), rows.ravel()]), axis=0)
        shape = (len(rows), 1 + max(int(conn.max()), int(nodes.max())))
        return csr_array((np.ones(len(pairs), np.int32), (pairs[:, 0], pairs[:, 1])), shape=shape)

    entries = incidence(nodes)
    shared = (entries @ incidence(conn.T).T).tocsr()
    shared.data = (shared.data == np.repeat(np.diff(entries.indptr), np.diff(shared.indptr))).astype(np.int32)
    shared.eliminate_zeros()
    shared.sort_indices()
    return shared
