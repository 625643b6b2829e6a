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
SHIFTS = (1e-7, 1e-5, 1e-3)  # of the typical diagonal, added so that motions without stiffness have some; more where
# noise spoils the factors of a piece


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
) -> sparse.csc_array:
    """K, symmetric, shape (3 node_count, 3 node_count) [N/m].

    Args:
        product: p -> K p of nodal displacements p [m], shape (node_count, 3), float64 [N].
        pattern, colour: as `colours` takes and gives them.
    """
    pairs = sparse.coo_array(pattern)
    rows, columns = pairs.coords
    blocks = np.zeros((len(rows), 3, 3))
    for c in range(colour.max() + 1):
        mine = np.flatnonzero(colour[columns] == c)
        for axis in range(3):
            p = np.zeros((len(colour), 3))
            p[colour == c, axis] = 1.0
            blocks[mine, :, axis] = product(p)[rows[mine]]
    i, j, axes = 3 * rows[:, None, None], 3 * columns[:, None, None], np.arange(3)
    i, j = np.broadcast_arrays(i + axes[:, None], j + axes)
    found = sparse.coo_array((blocks.ravel(), (i.ravel(), j.ravel())), shape=(3 * len(colour),) * 2)
    return sparse.csc_array(0.5 * (found + found.T))


def inverse(K: sparse.csc_array) -> tuple[Callable[[Array], Array], bool] | None:
    """The function r -> p with K p = r, both of shape (node_count, 3), float64 [N, m], and whether it is exact.

    Axes without stiffness stay. Pieces whose factors would take more than MOST_WORK have the inverse of their diagonal.
    None where K is not positive, with a shift neither.
    """
    diagonal = K.diagonal()
    stiff = diagonal > 0.0
    rows = sparse.csr_array(K)
    pieces = connected_components(rows, directed=False)[1]
    factors, rough, exact = [], stiff.copy(), True
    for k in np.unique(pieces[stiff]):
        mine = np.flatnonzero(pieces == k)
        part = rows[mine][:, mine]
        order = reverse_cuthill_mckee(part, symmetric_mode=True)
        ordered = sparse.coo_array(part[order][:, order])
        if float(_width(ordered)) ** 2 * len(mine) <= MOST_WORK:
            found = next(filter(None, (_factors(ordered, len(mine), shift) for shift in SHIFTS)), None)
            if found is None:
                return None
            factors.append((mine[order], found[0]))
            exact, rough[mine] = exact and found[1] == SHIFTS[0], False

    def solve(r: Array) -> Array:
        known = r.ravel()
        p = np.where(rough, known, 0.0) / np.where(rough, diagonal, 1.0)
        with one_blas_thread():
            for order, factor in factors:
                p[order] = cho_solve_banded((factor, True), known[order])
        return p.reshape(r.shape)

    return solve, exact and not rough.any()


def _factors(K: sparse.coo_array, count: int, shift: float) -> tuple[Array, float] | None:
    """Those of a matrix of `count` rows, to whose diagonal that share of its median is added, and the shift."""
    band = _band(K, count)
    band[0] += shift * np.median(band[0])
    try:
        with one_blas_thread():
            return cholesky_banded(band, overwrite_ab=True, lower=True), shift
    except LinAlgError:
        return None


def _width(K: sparse.coo_array) -> int:
    """Number of diagonals of the lower triangle that have entries."""
    return int((K.coords[0] - K.coords[1]).max()) + 1


def _band(K: sparse.coo_array, count: int) -> Array:
    """These diagonals of a matrix of `count` rows, as LAPACK takes them."""
    i, j = K.coords
    below, band = i >= j, np.zeros((_width(K), count))
    band[(i - j)[below], j[below]] = K.data[below]
    return band
