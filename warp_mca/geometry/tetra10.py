"""Owns the geometry of the ten-node tetrahedron: its four integration points, volumes, gradients, lumped shares.

Nodes 4 to 9 lie on the edges in the order of `EDGES`, anywhere: edges are parabolas. With the barycentric coordinates
L_i shape functions are L_i (2 L_i - 1) at corners and 4 L_i L_j on edges (Zienkiewicz, Taylor and Zhu, The Finite
Element Method, 7th ed., 2013, section 6.2); the points are those of Hammer, Marlowe and Stroud (1956).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

EDGES = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])  # corners beside the nodes 4 to 9
FAR = (5.0 - 5.0**0.5) / 20.0  # barycentric coordinates of the points
NEAR = 1.0 - 3.0 * FAR
POINTS = np.full((4, 4), FAR) + (NEAR - FAR) * np.eye(4)
# Of the mass: the diagonal of the consistent one, scaled (Hinton, Rock and Zienkiewicz, Earthquake Engng Struct. Dyn. 4
# (1976) 245).
SHARES = np.array([1.0 / 36.0] * 4 + [4.0 / 27.0] * 6)


def shape_functions(at: Array) -> Array:
    """Shape functions [-], shape (point_count, 10), at barycentric coordinates, shape (point_count, 4), float64."""
    i, j = EDGES.T
    return np.concatenate([at * (2.0 * at - 1.0), 4.0 * at[:, i] * at[:, j]], axis=1)


def derivatives(at: Array) -> Array:
    """Derivatives with respect to L_0 to L_3 as if they were independent [-], shape (point_count, 10, 4)."""
    found = np.zeros((len(at), 10, 4))
    for a in range(4):
        found[:, a, a] = 4.0 * at[:, a] - 1.0
    for a, (i, j) in enumerate(EDGES, 4):
        found[:, a, i], found[:, a, j] = 4.0 * at[:, j], 4.0 * at[:, i]
    return found


def edges_at(x: Array, at: Array) -> Array:
    """Edges of the tetrahedron that touches each element at given coordinates, from its first corner [m].

    Args:
        x: nodes [m], shape (element_count, 10, 3), float64.
        at: barycentric coordinates, shape (point_count, 4), float64.

    Returns:
        Shape (element_count, point_count, 3, 3), float64; its determinant is six times the volume there.
    """
    found = derivatives(at)
    differences = (found[:, :, 1:] - found[:, :, :1]).transpose(0, 2, 1)
    return (differences.reshape(-1, len(SHARES)) @ x).reshape(len(x), len(at), 3, 3)


def _cofactors(edges: Array) -> tuple[Array, Array]:
    """Cross products of the edges 1 x 2, 2 x 0 and 0 x 1, shape (…, 3, 3), and determinants, shape (…)."""
    x, y, z = np.moveaxis(edges, -1, 0)
    after, last = [1, 2, 0], [2, 0, 1]
    rows = [p[..., after] * q[..., last] - q[..., after] * p[..., last] for p, q in ((y, z), (z, x), (x, y))]
    found = np.stack(rows, axis=-1)
    return found, (edges[..., 0, :] * found[..., 0, :]).sum(axis=-1)


def determinants(x: Array) -> Array:
    """Volumes [m^3] as weights of the four points, shape (element_count, 4); nodes x [m] as in `edges_at`."""
    return _cofactors(edges_at(x, POINTS))[1] / 24.0


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), negative where inverted; nodes x [m] as in `edges_at`."""
    return determinants(x).sum(axis=1)


def slopes(x: Array) -> Array:
    """Gradients of L_0 to L_3 at the points [1/m], shape (element_count, 4, 4, 3); nodes x [m] as in `edges_at`."""
    cofactors, determinant = _cofactors(edges_at(x, POINTS))
    last = cofactors / determinant[..., None, None]
    return np.concatenate([-last.sum(axis=2, keepdims=True), last], axis=2)


def gradients(x: Array) -> Array:
    """Gradients of the shape functions at the points [1/m], shape (element_count, 4, 10, 3); x as in `edges_at`."""
    return derivatives(POINTS) @ slopes(x)
