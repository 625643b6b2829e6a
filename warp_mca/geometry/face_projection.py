"""Owns the projection of points on the faces of a mesh: the nearest face, its shape functions, the distance from it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.cell_types import is_triangle

CANDIDATES = 32  # faces tried for each point, those with the nearest middles
ITERATIONS = 8  # of Newton's method, which is exact in one on a parallelogram
FARTHEST = 3.0  # natural coordinate at which iterates are held: far points need not converge
ROUNDING = 1e-9  # shape functions below this are 0: a point on an edge takes the nodes of the edge alone


class Projected(NamedTuple):
    """Where points lie on faces.

    Attributes:
        face: nearest face of each point, shape (point_count,), int.
        weight: shape functions of its corners there [-], beyond [0, 1] where the point lies beyond the face's edges;
            their sum is 1, shape (point_count, 4), float64; the last is 0 on a triangle.
        distance: of the point from that place [m], shape (point_count,), float64.
        beyond: how far that place lies beyond the face's edges, as a share of the face's width [-], shape
            (point_count,), float64.
        apart: distance of the point from the face, within its edges [m], shape (point_count,), float64.
    """

    face: NDArray[np.intp]
    weight: Array
    distance: Array
    beyond: Array
    apart: Array


def project(at: Array, points: Array, faces: Index) -> Projected:
    """The nearest face of each point; of several at one distance that of the least number.

    Args:
        at: the points [m], shape (point_count, 3), float64.
        points: positions of the nodes [m], shape (node_count, 3), float64.
        faces: their nodes, shape (face_count, 4), int32; triangles have their last corner twice.
    """
    from scipy.spatial import KDTree

    _, near = KDTree(points[faces].mean(axis=1)).query(at, k=min(CANDIDATES, len(faces)))
    near = np.sort(np.asarray(near).reshape(len(at), -1), axis=1)
    x = points[faces[near]]
    weight, beyond, clipped = _on_quadrilaterals(at[:, None], x)
    flat = is_triangle(faces)[near]
    if flat.any():
        triangles = _on_triangles(at[:, None], x)
        weight = np.where(flat[..., None], triangles[0], weight)
        beyond = np.where(flat, triangles[1], beyond)
        clipped = np.where(flat[..., None], triangles[2], clipped)
    apart = np.linalg.norm(at[:, None] - np.einsum("pfc,pfci->pfi", clipped, x), axis=-1)
    best = (apart <= apart.min(axis=1, keepdims=True) + ROUNDING * np.ptp(x)).argmax(axis=1)
    rows = np.arange(len(at))
    chosen, corners = weight[rows, best], x[rows, best]
    chosen = np.where(np.abs(chosen) < ROUNDING, 0.0, chosen)
    chosen /= chosen.sum(axis=1, keepdims=True)
    distance = np.linalg.norm(at - np.einsum("pc,pci->pi", chosen, corners), axis=-1)
    return Projected(near[rows, best], chosen, distance, beyond[rows, best], apart[rows, best])


def shape(xi: Array, eta: Array) -> Array:
    """Bilinear shape functions, shape (..., 4)."""
    return 0.25 * np.stack(
        [(1.0 - xi) * (1.0 - eta), (1.0 + xi) * (1.0 - eta), (1.0 + xi) * (1.0 + eta), (1.0 - xi) * (1.0 + eta)],
        axis=-1,
    )


def _on_quadrilaterals(at: Array, x: Array) -> tuple[Array, Array, Array]:
    """Shape functions at the nearest place of each extended face, how far that is beyond it, those held within it.

    Newton's method for the least distance; see `kernels.contact.projection.closest_point`.
    """
    e = 0.25 * (x[..., 1, :] + x[..., 2, :] - x[..., 0, :] - x[..., 3, :])
    f = 0.25 * (x[..., 2, :] + x[..., 3, :] - x[..., 0, :] - x[..., 1, :])
    t = 0.25 * (x[..., 0, :] + x[..., 2, :] - x[..., 1, :] - x[..., 3, :])
    r0 = at - x.mean(axis=-2)
    xi, eta = np.zeros(r0.shape[:-1]), np.zeros(r0.shape[:-1])
    for _ in range(ITERATIONS):
        along_xi, along_eta = e + eta[..., None] * t, f + xi[..., None] * t
        r = r0 - xi[..., None] * e - eta[..., None] * along_eta
        g0, g1 = (r * along_xi).sum(axis=-1), (r * along_eta).sum(axis=-1)
        h00, h11 = (along_xi**2).sum(axis=-1), (along_eta**2).sum(axis=-1)
        h01 = (along_xi * along_eta).sum(axis=-1)
        determinant = h00 * h11 - h01 * h01
        with np.errstate(divide="ignore", invalid="ignore"):  # triangles have none; they are projected elsewhere
            xi = np.nan_to_num(np.clip(xi + (h11 * g0 - h01 * g1) / determinant, -FARTHEST, FARTHEST))
            eta = np.nan_to_num(np.clip(eta + (h00 * g1 - h01 * g0) / determinant, -FARTHEST, FARTHEST))
    beyond = 0.5 * np.maximum(np.maximum(np.abs(xi), np.abs(eta)) - 1.0, 0.0)
    return shape(xi, eta), beyond, shape(np.clip(xi, -1.0, 1.0), np.clip(eta, -1.0, 1.0))


def _on_triangles(at: Array, x: Array) -> tuple[Array, Array, Array]:
    """The same on triangles, whose place held within them is that of the area coordinates held above 0."""
    ab, ac, ap = x[..., 1, :] - x[..., 0, :], x[..., 2, :] - x[..., 0, :], at - x[..., 0, :]
    d00, d01, d11 = ((p * q).sum(axis=-1) for p, q in ((ab, ab), (ab, ac), (ac, ac)))
    d20, d21 = ((p * q).sum(axis=-1) for p, q in ((ap, ab), (ap, ac)))
    with np.errstate(divide="ignore", invalid="ignore"):
        second = (d11 * d20 - d01 * d21) / (d00 * d11 - d01 * d01)
        third = (d00 * d21 - d01 * d20) / (d00 * d11 - d01 * d01)
    weight = np.stack([1.0 - second - third, second, third, np.zeros_like(second)], axis=-1)
    held = np.clip(weight, 0.0, None)
    return weight, np.maximum(-weight.min(axis=-1), 0.0), held / held.sum(axis=-1, keepdims=True)
