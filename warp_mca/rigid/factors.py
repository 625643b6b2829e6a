"""Owns the inverse of the stiffness matrix of bodies, the factors of which hold on as they turn.

A body that turned by R has the stiffness R K R^T. Its nodes e that joints tie to other bodies are eliminated last, from
the complement of Schur, S = K_ee - K_ei Y with Y = K_ii^-1 K_ie: the sum of these of all bodies joins them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import LinAlgError, cho_solve_banded, cholesky_banded
from scipy.sparse.csgraph import connected_components, reverse_cuthill_mckee

from warp_mca.base.blas import one_blas_thread
from warp_mca.base.rotation import mean_pose

Array = NDArray[np.float64]
Nodes = NDArray[np.integer]

MOST_WORK = 1e11  # multiplications of the factors of a body
SHIFTS = (1e-7, 1e-6, 1e-5, 1e-3)  # of the typical diagonal, added so that motions without stiffness have some; more
# where noise spoils the factors of a body
EXACT = 1e-6  # with no more the inverse counts as exact: the softest motion of a rod of 100 cells has some 5e-6


@dataclass(frozen=True, kw_only=True)
class Body:
    """Nodes that elements hold together; arrays of forces and displacements are of shape (node_count, 3, case_count).

    Attributes:
        inner: nodes without joints, in the order of the factors, shape (count,).
        ends: nodes with joints, shape (end_count,).
        factor: of K of the inner nodes [N/m], a band as LAPACK has it; None where that takes more than MOST_WORK.
        diagonal: of K of the inner nodes [N/m], shape (count, 3), float64; axes without stiffness stay.
        shift: in the factors, share of the typical diagonal.
        Y: shape (count, 3, 3 end_count), float64; 0 without factors.
        S: shape (3 end_count, 3 end_count), float64 [N/m].
        R: rotation since then, shape (3, 3), float64.
        turns: no node is held along some axes only.
    """

    inner: Nodes
    ends: Nodes
    factor: Array | None
    diagonal: Array
    shift: float
    Y: Array
    S: Array
    R: Array
    turns: bool

    def solve(self, r: Array) -> Array:
        """p of the inner nodes with K_ii p = r, as the body lay."""
        stiff = (self.diagonal > 0.0)[:, :, None]
        if self.factor is None:
            return np.where(stiff, r, 0.0) / np.where(stiff, self.diagonal[:, :, None], 1.0)
        with one_blas_thread():
            p = cho_solve_banded((self.factor, True), r.reshape(3 * len(r), r.shape[2]))
        return np.where(stiff, p.reshape(r.shape), 0.0)

    def turned(self, before: Array, now: Array) -> Body:
        """The body with all nodes at other places [m], both of shape (node_count, 3), float64."""
        nodes = np.concatenate([self.inner, self.ends])
        return replace(self, R=mean_pose(before[nodes], now[nodes], np.ones(len(nodes)))[2]) if self.turns else self


@dataclass(frozen=True, kw_only=True)
class Inverse:
    """K^-1 of bodies, some nodes of which move alike.

    Attributes:
        bodies: that have stiffness.
        shape: positions of the nodes when K was found [m], shape (node_count, 3), float64.
        heads: one of each set of nodes that move alike, shape (joint_count,); the others have no place of their own.
        joint: of each node, its place in `heads`, or -1, shape (node_count,).
        trace: of the blocks of nodes in K [N/m], shape (node_count,), float64, at heads of all that move with them.
        turned: K was found at an earlier shape.
    """

    bodies: Sequence[Body]
    shape: Array
    heads: Nodes
    joint: Nodes
    trace: Array
    turned: bool = False

    def __call__(self, r: Array) -> Array:
        """p with K p = r, both of shape (node_count, 3), float64 [N, m]."""
        p, right, found = np.zeros_like(r), r[self.heads], []
        for body in self.bodies:
            mine = r[body.inner] @ body.R
            found.append(body.solve(mine[:, :, None])[:, :, 0])
            ends = np.einsum("ncj,nc->j", body.Y, mine).reshape(-1, 3)
            np.subtract.at(right, self.joint[body.ends], ends @ body.R.T)
        x = (self._joined @ right.ravel()).reshape(-1, 3)
        for body, own in zip(self.bodies, found, strict=True):
            ends = x[self.joint[body.ends]] @ body.R
            p[body.inner] = (own - np.einsum("ncj,j->nc", body.Y, ends.ravel())) @ body.R.T
        p[self.heads] = x
        return p

    @property
    def exact(self) -> bool:
        """Up to shifts of EXACT, and to what has changed but for rotations."""
        return all(body.factor is not None and body.shift <= EXACT for body in self.bodies)

    def at(self, shape: Array) -> Inverse:
        """The inverse after bodies have turned: positions of the nodes [m], shape (node_count, 3), float64."""
        return replace(self, bodies=[body.turned(self.shape, shape) for body in self.bodies], turned=True)

    @cached_property
    def _joined(self) -> Array:
        """Inverse of the sum of all S, shape (3 joint_count, 3 joint_count), float64 [m/N]."""
        total = np.zeros((len(self.heads), 3, len(self.heads), 3))
        for body in self.bodies:
            own = body.S.reshape(len(body.ends), 3, len(body.ends), 3)
            number = self.joint[body.ends]
            np.add.at(total.swapaxes(1, 2), np.ix_(number, number), np.einsum("ai,minj,bj->mnab", body.R, own, body.R))
        size, ways = np.linalg.eigh(total.reshape(3 * len(self.heads), 3 * len(self.heads)))
        typical = np.median(np.concatenate([body.diagonal[body.diagonal > 0.0] for body in self.bodies]))
        return np.asarray(ways / np.maximum(size, SHIFTS[0] * typical) @ ways.T, dtype=np.float64)


def inverse(K: sparse.bsr_array, shape: Array, pairs: Nodes) -> Inverse | None:
    """The inverse of K, or None where that of the inner nodes of a body is not positive, with a shift neither.

    Args:
        K: symmetric, in blocks of nodes, of bodies without their joints, shape (3 node_count, 3 node_count) [N/m].
        shape: positions of the nodes [m], shape (node_count, 3), float64.
        pairs: nodes that move alike, shape (2, pair_count); no first one is a second one.
    """
    K = K.copy()
    K.eliminate_zeros()
    links = sparse.csr_array((np.ones(len(K.indices)), K.indices, K.indptr), shape=(len(shape),) * 2)
    heads, joint = np.unique(pairs[0]), np.full(len(shape), -1)
    joint[heads] = np.arange(len(heads))
    joint[pairs[1]] = joint[pairs[0]]
    number = connected_components(links, directed=False)[1]
    bodies: list[Body] = []
    for k in np.unique(number[np.diff(K.indptr) > 0]):
        nodes = np.flatnonzero(number == k)
        inner = nodes[joint[nodes] < 0]
        order = inner[reverse_cuthill_mckee(links[inner][:, inner], symmetric_mode=True)]
        found = _body(K, order, nodes[joint[nodes] >= 0])
        if found is None:
            return None
        bodies.append(found)
    trace = np.asarray(K.diagonal(), dtype=np.float64).reshape(-1, 3).sum(axis=1)
    np.add.at(trace, pairs[0], trace[pairs[1]])
    return Inverse(bodies=bodies, shape=shape, heads=heads, joint=joint, trace=trace) if bodies else None


def _body(K: sparse.bsr_array, inner: Nodes, ends: Nodes) -> Body | None:
    """A body of these nodes, or None where K of the inner ones is not positive."""
    count, place = len(inner), np.full(len(K.indptr) - 1, -1)
    nodes = np.concatenate([inner, ends])
    place[nodes] = np.arange(len(nodes))
    rows, columns = place[rows_of(K)], place[K.indices]
    last = columns >= count
    B = np.zeros((len(nodes), 3, len(ends), 3))
    B[rows[last], :, columns[last] - count] = K.data[last]
    B = B.reshape(len(nodes), 3, 3 * len(ends))
    diagonal = np.asarray(K.diagonal(), dtype=np.float64).reshape(-1, 3)[nodes]
    stiff = diagonal > 0.0
    body = Body(
        inner=inner,
        ends=ends,
        factor=None,
        diagonal=diagonal[:count],
        shift=0.0,
        Y=np.zeros((count, 3, B.shape[2])),
        S=B[count:].reshape(3 * len(ends), 3 * len(ends)),
        R=np.eye(3),
        turns=bool((stiff == stiff[:, :1]).all()),
    )
    lower = np.flatnonzero((columns >= 0) & (rows >= columns) & (rows < count))
    i, j = rows[lower], columns[lower]
    band = float(3 * (i - j).max() + 3) if count else 0.0
    if not count or 3 * count * band * (band + 6 * len(ends)) > MOST_WORK:  # of the factors, and of Y
        return body
    piece = i, j, np.asarray(K.data[lower], dtype=np.float64), stiff[:count].ravel()
    found = next(filter(None, (_factors(_band(*piece), shift) for shift in SHIFTS)), None)
    if found is None:
        return None
    body = replace(body, factor=found[0], shift=found[1])
    if not len(ends):
        return body
    Y = body.solve(B[:count])
    S = body.S - np.einsum("ncj,nck->jk", B[:count], Y)
    return replace(body, Y=Y, S=0.5 * (S + S.T))


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


def rows_of(K: sparse.csr_array | sparse.bsr_array) -> NDArray[np.integer]:
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
