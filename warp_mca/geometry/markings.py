"""Owns the question whether surfaces and curves of a mesh file mark its solid cells, or are parts of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray


def lie_on(lower: NDArray[np.integer], solids: Sequence[NDArray[np.integer]]) -> NDArray[np.bool_]:
    """Whether some solid cell has all corners of each of the lower cells, as those that mark a face or an edge have.

    Args:
        lower: corners of faces or edges, shape (count, corners).
        solids: corners of the solid cells of each type, each shape (cell_count, corners).
    """
    from scipy.sparse import coo_array

    solids = [cells for cells in solids if len(cells)]
    if not len(lower) or not solids:
        return np.zeros(len(lower), dtype=bool)
    node_count = 1 + int(max(lower.max(), *(cells.max() for cells in solids)))

    def incidence(tables: Sequence[NDArray]) -> coo_array:
        """Rows of cells and columns of nodes, 1 where a cell has a node."""
        count = sum(map(len, tables))
        row = np.concatenate([np.repeat(np.arange(len(t)), t.shape[1]) for t in tables])
        starts = np.cumsum([0, *(len(t) for t in tables)])
        row += np.repeat(starts[:-1], [t.size for t in tables])
        column = np.concatenate([t.ravel() for t in tables])
        pairs = np.unique(row * np.int64(node_count) + column)  # a collapsed cell has a node twice
        return coo_array((np.ones(len(pairs), np.int8), divmod(pairs, node_count)), shape=(count, node_count))

    own = incidence([lower])
    shared = (own.tocsr() @ incidence(solids).T.tocsc()).max(axis=1).toarray().ravel()
    return shared == np.asarray(own.sum(axis=1)).ravel()
