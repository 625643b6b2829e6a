"""Owns a depth buffer in numpy: which triangle is seen at each pixel, and values interpolated there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating]
Index = NDArray[np.int64]

AT_ONCE = 2_000_000  # pixels computed together, which bounds the memory
NOTHING = np.iinfo(np.int64).max
DEPTHS = 2.0**30  # number of depths that are distinguished


@dataclass(frozen=True)
class Seen:
    """What is seen at each pixel that shows a triangle.

    Attributes:
        pixel: index into the flattened picture, shape (seen_count,), int32.
        triangle: that is nearest to the eye there, shape (seen_count,), int32.
        weight: of its corners [-], shape (seen_count, 3), float64.
    """

    pixel: NDArray[np.int32]
    triangle: NDArray[np.int32]
    weight: Array

    def interpolated(self, values: NDArray[np.floating]) -> Array:
        """Values of the corners at the pixels, from shape (triangle_count, 3, n) to (seen_count, n)."""
        corner = values[self.triangle]
        return sum(self.weight[:, k, None] * corner[:, k] for k in range(3))  # pyright: ignore[reportReturnType]


def rasterise(corners: Array, width: int, height: int) -> Seen:
    """Find the nearest triangle at each pixel.

    Args:
        corners: x to the right and y downwards in pixels, and nearness to the eye, shape (triangle_count, 3, 3).
        width, height: of the picture in pixels; pixel (k, j) has its centre at x = k + 0.5, y = j + 0.5.
    """
    nearest = np.full(width * height, NOTHING)
    far, near = float(corners[:, :, 2].min(initial=np.inf)), float(corners[:, :, 2].max(initial=-np.inf))
    scale = DEPTHS / (near - far) if near > far else 0.0
    at, slope_x, slope_y = _planes(corners)
    owner, row, first, count = _spans(corners, width, height)
    total = np.cumsum(count)
    start = 0
    while start < len(count):
        done = int(total[start - 1]) if start else 0
        end = max(start + 1, int(np.searchsorted(total, done + AT_ONCE, side="right")))
        spans = slice(start, end)
        x = np.arange(done, int(total[end - 1])) + np.repeat(first[spans] - (total - count)[spans], count[spans])
        of = owner[spans]
        nearness = at[of] + slope_y[of] * (row[spans] + 0.5)  # at x = 0
        z = np.repeat(nearness, count[spans]) + np.repeat(slope_x[of], count[spans]) * (x + 0.5)
        key = (np.clip((near - z) * scale, 0.0, DEPTHS).astype(np.int64) << 32) | np.repeat(of, count[spans])
        np.minimum.at(nearest, x + np.repeat(row[spans] * width, count[spans]), key)
        start = end
    pixel = np.flatnonzero(nearest != NOTHING)
    triangle = nearest[pixel] & 0xFFFFFFFF
    weight = _weights(corners[triangle], pixel % width + 0.5, pixel // width + 0.5)
    return Seen(pixel.astype(np.int32), triangle.astype(np.int32), weight)


def _spans(corners: Array, width: int, height: int) -> tuple[Index, Index, Index, Index]:
    """Runs of pixels that triangles cover in a row: triangle, row, first pixel and number of pixels of each run.

    A pixel belongs to a triangle when its centre lies inside; one on an edge between two belongs to one of them.
    """
    top, bottom = corners[:, :, 1].min(axis=1), corners[:, :, 1].max(axis=1)
    low = np.clip(np.ceil(top - 0.5), 0, height).astype(np.int64)
    rows = np.clip(np.ceil(bottom - 0.5), 0, height).astype(np.int64) - low
    owner = np.repeat(np.arange(len(corners)), rows)
    row = np.arange(len(owner)) - np.repeat(np.cumsum(rows) - rows - low, rows)
    y = row + 0.5
    left, right = np.full(len(y), np.inf), np.full(len(y), -np.inf)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        (xa, ya), (xb, yb) = corners[owner, a, :2].T, corners[owner, b, :2].T
        crosses = (ya <= y) != (yb <= y)
        x = xa + (y - ya) * (xb - xa) / np.where(crosses, yb - ya, 1.0)
        left, right = np.where(crosses, np.minimum(left, x), left), np.where(crosses, np.maximum(right, x), right)
    first = np.clip(np.ceil(left - 0.5), 0, width).astype(np.int64)
    count = np.clip(np.ceil(right - 0.5), 0, width).astype(np.int64) - first
    kept = count > 0
    return owner[kept], row[kept], first[kept], count[kept]


def _planes(corners: Array) -> tuple[Array, Array, Array]:
    """Nearness over each triangle, z = at + slope_x x + slope_y y: at, slope_x, slope_y."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    area = np.where(normal[:, 2] == 0.0, 1.0, normal[:, 2])
    slope_x, slope_y = -normal[:, 0] / area, -normal[:, 1] / area
    return corners[:, 0, 2] - slope_x * corners[:, 0, 0] - slope_y * corners[:, 0, 1], slope_x, slope_y


def _weights(corners: Array, x: Array, y: Array) -> Array:
    """Barycentric weights of points in triangles [-], shape (point_count, 3)."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, k, :2].T for k in range(3))
    area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
    c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    return np.stack([1.0 - b - c, b, c], axis=1)
