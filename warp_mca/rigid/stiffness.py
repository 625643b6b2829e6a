"""Owns the stiffness matrix of a body, found from the forces of a few displacements, and the inverse of its factors.

Columns of nodes that share no neighbour have no row in common, so that one displacement of all of them gives them all
(Curtis, Powell and Reid, IMA J. Appl. Math. 13 (1974) 117).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

from warp_mca.base.blas import one_blas_thread

Array = NDArray[np.float64]

MOST_WORK = 1e11  # multiplications of the factors of a piece
SHIFTS = (1e-7, 1e-6, 1e-5, 1e-3)  # of the typical diagonal, added so that motions without stiffness have some; more
# where noise spoils the factors of a piece
EXACT = 1e-6  # with no more the inverse counts as exact: the softest motion of a rod of 100 cells has some 5e-6


def colours(pattern: sparse.csr_array) -> NDArray[np.int64]:
    """Numbers of the nodes, shape (node_count,), that differ where two nodes have a neighbour in common.

    pattern: entry (i, j) for neighbours i and j, each node one of its own, shape (node_count, node_count).
    """
    near = sparse.csr_array(pattern @ pattern)
    found = np.full(len(near.indptr) - 1, -1)
    for i in range(len(found)):
        taken = found[near.indices[near.indptr[i] : near.indptr[i + 1]]]
        free = np.ones(len(taken) + 1, dtype=bool)
        free[taken[(taken >= 0) & (taken < len(free))]] = False
        found[i] = free.argmax()
    return found


def stiffness_matrix(
    product: Callable[[Array], Array], pattern: sparse.csr_array, colour: NDArray[np.int64]
) -> sparse.bsr_array:
    """K, symmetric, in blocks of nodes, shape (3 node_count, 3 node_count) [N/m].

    Args:
        product: p -> K p of nodal displacements p [m], shape (node_count, 3), float64 [N].
        pattern, colour: as `colours` takes and gives them.
    """
    columns, rows = pattern.indices, _rows(pattern)
    blocks = np.zeros((len(rows), 3, 3))
    for c in range(colour.max() + 1):
        mine = np.flatnonzero(colour[columns] == c)
        for axis in range(3):
            p = np.zeros((len(colour), 3))
            p[colour == c, axis] = 1.0
            blocks[mine, :, axis] = product(p)[rows[mine]]
    found = sparse.bsr_array((blocks, columns, pattern.indptr), shape=(3 * len(colour),) * 2)
    return sparse.bsr_array(0.5 * (found + found.T))


def inverse(K: sparse.bsr_array) -> tuple[Callable[[Array], Array], bool] | None:
    """The function r -> p with K p = r, both of shape (node_count, 3), float64 [N, m], and whether it is exact.

    Axes without stiffness stay. Pieces whose factors would take more than MOST_WORK have the inverse of their diagonal.
    None where K is not positive, with a shift neither.
    """
    diagonal = K.diagonal().reshape(-1, 3)
    stiff = diagonal > 0.0
    felt = K.data.any(axis=(1, 2))
    rows, columns = _rows(K)[felt], K.indices[felt]
    blocks: Array = np.asarray(K.data[felt], dtype=np.float64)
    nodes = sparse.csr_array((np.ones(len(rows)), (rows, columns)), shape=(len(stiff),) * 2)
    pieces = connected_components(nodes, directed=False)[1]
    factors, rough, exact = [], stiff.copy(), True
    for k in np.unique(pieces[stiff.any(axis=1)]):
        mine = np.flatnonzero(pieces == k)
        order = mine[reverse_cuthill_mckee(nodes[mine][:, mine], symmetric_mode=True)]
        rank = np.full(len(stiff), -1)
        rank[order] = np.arange(len(order))
        lower = np.flatnonzero((rank[columns] >= 0) & (rank[rows] >= rank[columns]))
        i, j = rank[rows[lower]], rank[columns[lower]]
        if float(3 * (i - j).max() + 3) ** 2 * stiff[mine].size <= MOST_WORK:
            piece = i, j, blocks[lower], stiff[order].ravel()
            found = next(filter(None, (_factors(_band(*piece), shift) for shift in SHIFTS)), None)
            if found is None:
                return None
            factors.append((order, found[0]))
            exact, rough[mine] = exact and found[1] <= EXACT, False

    def solve(r: Array) -> Array:
        p = np.where(rough, r, 0.0) / np.where(rough, diagonal, 1.0)
        with one_blas_thread():
            for order, factor in factors:
                p[order] = cho_solve_banded((factor, True), r[order].ravel()).reshape(-1, 3)
        return np.where(stiff, p, 0.0)

    return solve, exact and not rough.any()


def _factors(band: Array, shift: float) -> tuple[Array, float] | None:
    """Those of a matrix of these diagonals, to whose main one that share of its median is added, and the shift.

    They take the place of the diagonals.
    """
    band[0] += shift * np.median(band[0])
    try:
        with one_blas_thread():
            return cholesky_banded(band, overwrite_ab=True, lower=True), shift
    except LinAlgError:
        return None


def _rows(K: sparse.csr_array | sparse.bsr_array) -> NDArray[np.integer]:
    """Row of each entry or block."""
    return np.repeat(np.arange(len(K.indptr) - 1), np.diff(K.indptr))


def _band(rows: Array, columns: Array, blocks: Array, stiff: NDArray[np.bool_]) -> Array:
    """Diagonals of the lower triangle of these blocks, as LAPACK has them; axes without stiffness get a typical one."""
    i = 3 * rows[:, None, None] + np.arange(3)[:, None]
    j = 3 * columns[:, None, None] + np.arange(3)
    i, j = np.broadcast_arrays(i, j)
    below, band = i >= j, np.zeros((3 * int((rows - columns).max()) + 3, len(stiff)))
    band[(i - j)[below], j[below]] = blocks[below]
    band[0, ~stiff] = np.median(band[0, stiff])
    return band
