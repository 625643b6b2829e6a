"""Owns the stiffness matrix of bodies, found from the forces of a few displacements, and what keeps its inverse.

Columns of nodes that share no neighbour have no row in common, so that one displacement of all of them gives them all
(Curtis, Powell and Reid, IMA J. Appl. Math. 13 (1974) 117).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from warp_mca.rigid.factors import Inverse, inverse, rows_of

Array = NDArray[np.float64]
Product = Callable[[Array], Array]

MOST_NODES, MOST_COLOURS = 20_000, 80  # with which K is found and factored; each colour takes three products
MOST_JOINTS = 100  # nodes: each takes three solutions


class Stiffness:
    """Stiffness of bodies, the inverse of which several searches for their shape use.

    Attributes:
        forces: internal nodal forces [N] of displacements [m], both shape (node_count, 3), float64, of bodies without
            their joints.
        pairs: nodes that move alike, shape (2, pair_count); no first one is a second one.
    """

    def __init__(
        self,
        forces: Product,
        pattern: sparse.csr_array,
        pairs: NDArray[np.integer] | None = None,
        before: Stiffness | None = None,
    ) -> None:
        """Take the factors from that of the same bodies elsewhere, or none.

        Args:
            forces, pairs: as above.
            pattern: entry (i, j) where the force on node i depends on the displacement of node j, shape (node_count,
                node_count).
            before: of the same bodies, turned since.
        """
        self.forces, self._pattern = forces, pattern
        self.pairs = np.zeros((2, 0), dtype=np.int64) if pairs is None else pairs
        self._known: Inverse | None = before._known if before else None

    @cached_property
    def small(self) -> bool:
        """K is found and factored."""
        few = len(self._pattern.indptr) <= MOST_NODES and self.pairs.shape[1] <= MOST_JOINTS
        return few and (self._known is not None or int(self._colour.max()) < MOST_COLOURS)

    @cached_property
    def _colour(self) -> NDArray[np.int64]:
        return colours(self._pattern)

    def inverse(self, product: Product, shape: Array, anew: bool) -> Inverse | None:
        """That of K, by the factors of an earlier shape where there are some, unless `anew`; None if there is none.

        Args:
            product: p -> K p of nodal displacements p [m], shape (node_count, 3), float64 [N].
            shape: positions of the nodes [m], shape (node_count, 3), float64.
            anew: factors are to be those of this shape.
        """
        if self._known and self._known.exact and not anew:
            return self._known.at(shape)
        K = stiffness_matrix(product, self._pattern, self._colour)
        self._known = inverse(K, shape, self.pairs)
        return self._known


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


def stiffness_matrix(product: Product, pattern: sparse.csr_array, colour: NDArray[np.int64]) -> sparse.bsr_array:
    """K, symmetric, in blocks of nodes, shape (3 node_count, 3 node_count) [N/m].

    Args:
        product: p -> K p of nodal displacements p [m], shape (node_count, 3), float64 [N].
        pattern, colour: as `colours` takes and gives them.
    """
    columns, rows = pattern.indices, rows_of(pattern)
    blocks = np.zeros((len(rows), 3, 3))
    for c in range(colour.max() + 1):
        mine = np.flatnonzero(colour[columns] == c)
        for axis in range(3):
            p = np.zeros((len(colour), 3))
            p[colour == c, axis] = 1.0
            blocks[mine, :, axis] = product(p)[rows[mine]]
    found = sparse.bsr_array((blocks, columns, pattern.indptr), shape=(3 * len(colour),) * 2)
    return sparse.bsr_array(0.5 * (found + found.T))
