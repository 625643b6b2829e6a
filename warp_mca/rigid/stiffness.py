"""Owns the stiffness matrix of a body, found from the forces of a few displacements, and the inverse of its factors.

Columns of nodes that share no neighbour have no row in common, so that one displacement of all of them gives them all
(Curtis, Powell and Reid, IMA J. Appl. Math. 13 (1974) 117).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]

SHIFT = 1e-7  # of the typical diagonal over the typical mass, times the masses: motions without stiffness have this


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


def inverse(K: sparse.csc_array, masses: Array) -> Callable[[Array], Array]:
    """The function r -> p with K p = r, both of shape (node_count, 3), float64 [N, m]; axes without stiffness stay.

    masses: of the nodes [kg], shape (node_count,), float64.
    """
    diagonal = K.diagonal()
    stiff = diagonal > 0.0
    typical = float(np.median(diagonal[stiff]))
    weight = np.repeat(np.maximum(masses, 1e-3 * masses.max()) / masses.max(), 3)
    factors = splu(K + sparse.diags_array(np.where(stiff, SHIFT * weight, 1.0) * typical), permc_spec="MMD_AT_PLUS_A")

    def solve(r: Array) -> Array:
        return factors.solve(np.where(stiff, r.ravel(), 0.0)).reshape(r.shape)

    return solve
