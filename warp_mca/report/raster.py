"""Owns a depth buffer in numpy: which triangle is seen at each pixel, and values interpolated there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

AT_ONCE = 2_000_000  # candidate pixels that are looked at together, which bounds the memory that is needed
NOTHING = np.iinfo(np.int64).max
DEPTHS = 2.0**30  # depths that are told apart


@dataclass(frozen=True)
class Seen:
    """What is seen at each pixel that shows a triangle.

    Attributes:
        pixel: index into the flattened picture, shape (seen_count,), int32.
        triangle: that is nearest to the eye there, shape (seen_count,), int32.
        weight: of its corners, shape (seen_count, 3), float64.
    """

    pixel: NDArray[np.int32]
    triangle: NDArray[np.int32]
    weight: Array

    def interpolated(self, values: NDArray[np.floating]) -> Array:
        """Values of the corners at the pixels, from shape (triangle_count, 3, ...) to (seen_count, ...)."""
        return np.einsum("pk,pk...->p...", self.weight, values[self.triangle])


def rasterise(corners: Array, width: int, height: int) -> Seen:
    """Find the nearest triangle at each pixel.

    Args:
        corners: x to the right and y downwards in pixels, and nearness to the eye, shape (triangle_count, 3, 3).
        width, height: of the picture in pixels; pixel (k, j) has its centre at x = k + 0.5, y = j + 0.5.
    """
    low = np.maximum(np.ceil(corners[:, :, :2].min(axis=1) - 0.5), 0).astype(np.int64)
    high = np.minimum(np.floor(corners[:, :, :2].max(axis=1) - 0.5), [width - 1, height - 1]).astype(np.int64)
    columns, rows = np.maximum(high - low + 1, 0).T
    count = columns * rows  # candidates of each triangle: the pixels of its box
    total = np.cumsum(count)
    nearest = np.full(width * height, NOTHING)
    far, near = float(corners[:, :, 2].min(initial=np.inf)), float(corners[:, :, 2].max(initial=-np.inf))
    scale = DEPTHS / (near - far) if near > far else 0.0
    first = 0
    while first < len(corners):
        done = total[first - 1] if first else 0
        end = max(first + 1, int(np.searchsorted(total, done + AT_ONCE, side="right")))
        number = np.repeat(np.arange(first, end), count[first:end])
        place = np.arange(done, done + len(number)) - (total - count)[number]
        x = low[number, 0] + place % columns[number]
        y = low[number, 1] + place // columns[number]
        weight = _weights(corners[number], x + 0.5, y + 0.5)
        inside = (weight >= -1e-9).all(axis=1)
        depth = near - np.einsum("pk,pk->p", weight[inside], corners[number[inside], :, 2])
        key = (depth * scale).astype(np.int64) << 32 | number[inside]
        np.minimum.at(nearest, (y * width + x)[inside], key)
        first = end
    pixel = np.flatnonzero(nearest != NOTHING)
    triangle = nearest[pixel] & 0xFFFFFFFF
    weight = _weights(corners[triangle], pixel % width + 0.5, pixel // width + 0.5)
    return Seen(pixel.astype(np.int32), triangle.astype(np.int32), weight)


def _weights(corners: Array, x: Array, y: Array) -> Array:
    """Barycentric weights of points in triangles, shape (point_count, 3); those of a triangle without area are nan."""
    (ax, ay), (bx, by), (cx, cy) = (corners[:, k, :2].T for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / area
        c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / area
    return np.stack([1.0 - b - c, b, c], axis=1)
