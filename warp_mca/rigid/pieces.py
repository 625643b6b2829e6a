"""Owns which nodes share an element, and the motions without strain of the pieces that elements hold together."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from warp_mca.rigid.body_motion import HELD, Motions
from warp_mca.rigid.chain import Array

MOST_PIECES = 30


def shared_elements(conns: Iterable[NDArray[np.integer]], count: int) -> sparse.csr_array:
    """Entry (i, j) where nodes i and j share an element or are the same, shape (count, count).

    conns: nodes of the elements, each of shape (corner_count, element_count).
    """
    found = sparse.csr_array(sparse.eye_array(count))
    for conn in conns:
        elements = np.broadcast_to(np.arange(conn.shape[1]), conn.shape)
        members = sparse.csr_array((np.ones(conn.size), (conn.ravel(), elements.ravel())), shape=(count, conn.shape[1]))
        found = found + members @ members.T
    return sparse.csr_array(found)


def free_motions(
    shape: Array, masses: Array, pattern: sparse.csr_array, held: NDArray[np.bool_], pairs: NDArray[np.integer]
) -> Array | None:
    """Fields of small motions without strain, shape (node_count, 3, motion_count); None of more than MOST_PIECES.

    Args:
        shape: positions of nodes [m], shape (node_count, 3), float64.
        masses: of nodes [kg], shape (node_count,), float64.
        pattern: of `shared_elements`.
        held: axes of nodes that do not move, shape (node_count, 3), bool.
        pairs: nodes that move alike, shape (2, pair_count).
    """
    number, piece = connected_components(pattern, directed=False)
    moves = np.bincount(piece, weights=~held.all(axis=1), minlength=number) > 0.0
    if moves.sum() > MOST_PIECES:
        return None
    rigid = Motions(shape, masses @ shape / masses.sum(), masses, np.zeros(shape.shape, dtype=bool)).free()
    fields = np.concatenate([rigid * (piece == k)[:, None, None] for k in np.flatnonzero(moves)], axis=2)
    rows = np.concatenate([fields[held], (fields[pairs[0]] - fields[pairs[1]]).reshape(-1, fields.shape[2])])
    size, ways = np.linalg.eigh(rows.T @ rows)
    return fields @ ways[:, size <= HELD**2 * max(size[-1], 0.0)]
