"""Owns how a body is aimed at another one: how far it can travel until the two touch, wherever they do."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.integer]
PAIRS = 2_000_000  # compared at a time


def frame_of(direction: Array) -> Array:
    """Three unit vectors, the last one along `direction` (of unit length), as rows, shape (3, 3)."""
    across = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    across /= np.linalg.norm(across)
    return np.array([across, np.cross(direction, across), direction])


def edges_of(triangle: Index) -> Index:
    """Edges of triangles, each once, shape (edge_count, 2)."""
    ends = np.sort(triangle[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(ends, axis=0)


def near(one: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Index, Index]:
    """Pairs of boxes that overlap, as their numbers in `one` and in `other`.

    Args:
        one, other: least and greatest coordinates of boxes, each shape (count, axes).
    """
    rows = max(1, PAIRS // max(1, len(other[0])))
    found = []
    for start in range(0, len(one[0]), rows):
        low, high = (item[start : start + rows] for item in one)
        meet = np.ones((len(low), len(other[0])), dtype=bool)
        for k in range(low.shape[1]):
            meet &= (low[:, k, None] <= other[1][:, k]) & (high[:, k, None] >= other[0][:, k])
        a, b = np.nonzero(meet)
        found.append((a + start, b))
    return tuple(np.concatenate(items) for items in zip(*found, strict=True))  # type: ignore[return-value]


def _boxes(points: Array, parts: Index) -> tuple[Array, Array]:
    return points[parts].min(axis=1), points[parts].max(axis=1)


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors in the plane."""
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def _above(points: Array, surface: Array, triangle: Index) -> Array:
    """Height of a surface over points along the third axis, for each point and triangle that meet in projection."""
    k, t = near((points[:, :2], points[:, :2]), _boxes(surface[:, :2], triangle))
    a, b, c = (surface[triangle[t, i]] for i in range(3))
    area = cross(b[:, :2] - a[:, :2], c[:, :2] - a[:, :2])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = cross(points[k, :2] - a[:, :2], c[:, :2] - a[:, :2]) / area
        w = cross(b[:, :2] - a[:, :2], points[k, :2] - a[:, :2]) / area
    inside = (u >= 0.0) & (w >= 0.0) & (u + w <= 1.0)
    height = a[:, 2] + u * (b[:, 2] - a[:, 2]) + w * (c[:, 2] - a[:, 2])
    return (height - points[k, 2])[inside]


def _across(one: Array, edge: Index, other: Array, other_edge: Index) -> Array:
    """Height of edges of the other over edges of the one along the third axis, where they cross in projection."""
    k, m = near(_boxes(one[:, :2], edge), _boxes(other[:, :2], other_edge))
    p, q = one[edge[k, 0]], other[other_edge[m, 0]]
    r, s = one[edge[k, 1]] - p, other[other_edge[m, 1]] - q
    area = cross(r[:, :2], s[:, :2])
    with np.errstate(divide="ignore", invalid="ignore"):
        u = cross((q - p)[:, :2], s[:, :2]) / area
        w = cross((q - p)[:, :2], r[:, :2]) / area
    meet = (u >= 0.0) & (u <= 1.0) & (w >= 0.0) & (w <= 1.0)
    return ((q + w[:, None] * s)[:, 2] - (p + u[:, None] * r)[:, 2])[meet]


def travel(one: Array, triangle: Index, other: Array, other_triangle: Index, direction: Array) -> float:
    """How far the one can move along a direction until it touches the other, or has to move back if they overlap [m].

    Infinite where they miss each other. All heights are taken, also those behind: bodies that start apart are asked.

    Args:
        one, other: nodes [m], each shape (node_count, 3).
        triangle, other_triangle: of their skins, each shape (triangle_count, 3).
        direction: of unit length, shape (3,).
    """
    axes = frame_of(direction)
    a, b = one @ axes.T, other @ axes.T
    mine, theirs = np.unique(triangle), np.unique(other_triangle)
    heights = [
        _above(a[mine], b, other_triangle),
        -_above(b[theirs], a, triangle),
        _across(a, edges_of(triangle), b, edges_of(other_triangle)),
    ]
    return float(min((item.min() for item in heights if len(item)), default=np.inf))


def chord(points: Array, triangle: Index, origin: Array, direction: Array) -> tuple[float, float]:
    """Where a line enters a body first and leaves it last, along its direction from the origin [m]; nan off it."""
    axes = frame_of(direction)
    height = _above((origin @ axes.T)[None], points @ axes.T, triangle)
    return (float(height.min()), float(height.max())) if len(height) else (np.nan, np.nan)
