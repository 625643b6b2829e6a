"""Owns the geometry of the trilinear hexahedron: shape functions, Jacobians, volumes, gradients."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.geometry.cell_types import HEXAHEDRON

CORNERS = np.array(HEXAHEDRON.natural, dtype=float)


def shape_functions(xi: Array) -> tuple[Array, Array]:
    """Shape functions [-], shape (..., 8), and their natural derivatives, shape (..., 8, 3), at xi, shape (..., 3)."""
    x, y, z = (1.0 + xi[..., axis, None] * CORNERS[:, axis] for axis in range(3))
    slope = np.stack([CORNERS[:, 0] * (y * z), CORNERS[:, 1] * (x * z), CORNERS[:, 2] * (x * y)], axis=-1)
    return x * y * z / 8.0, slope / 8.0


SLOPE = shape_functions(CORNERS / np.sqrt(3.0))[1]  # at the Gauss points, shape (8 points, 8 corners, 3)
GRID = [0, 1, 3, 2, 4, 5, 7, 6]  # corners counted along xi, then eta, then zeta, and back
_NEAR, _FAR = 0.5 + 0.5 / np.sqrt(3.0), 0.5 - 0.5 / np.sqrt(3.0)  # weights of the ends of an axis at a Gauss point


def interpolated(value: Array, axis: int) -> Array:
    """Values at the two Gauss points of an axis from those at its ends; the map is symmetric."""
    found, before = np.empty_like(value), (slice(None),) * axis
    low, high, first, second = (array[*before, k] for array in (value, found) for k in (0, 1))
    np.multiply(low, _NEAR, out=first)
    np.multiply(high, _NEAR, out=second)
    first += _FAR * high
    second += _FAR * low
    return found


def tangents(x: Array) -> list[Array]:
    """Derivatives dx/dxi, dx/deta, dx/dzeta [m], each constant along its own axis.

    Axes of the arrays: components, then two places along each of zeta, eta, xi, then elements. No BLAS is used: memory
    is read once, and digits depend neither on the machine nor on the other elements of the chunk.

    Args:
        x: corners [m], shape (element_count, 8, 3).

    Returns:
        Shapes (3, 2, 2, 1, element_count), (3, 2, 1, 2, element_count), (3, 1, 2, 2, element_count).
    """
    corner = np.ascontiguousarray(x.transpose(2, 1, 0)[:, GRID]).reshape(3, 2, 2, 2, len(x))
    found = []
    for axis in (3, 2, 1):
        low, high = (corner[*((slice(None),) * axis), k] for k in (0, 1))
        slope = interpolated(interpolated(0.5 * (high - low), 1), 2)
        found.append(np.expand_dims(slope, axis))
    return found


def _cross(p: Array, q: Array) -> Array:
    """Cross product of vectors whose components come first."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return np.stack([p[j] * q[k] - p[k] * q[j] for j, k in pairs])


def grid_determinants(along: list[Array]) -> Array:
    """Determinants of the Jacobian at the Gauss points [m^3], shape (2, 2, 2, element_count), from `tangents`."""
    a, b, c = along
    normal = _cross(b, c)
    return a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]


def by_element(value: Array) -> Array:
    """Shape (element_count, 8), in the order of CORNERS, from (2, 2, 2, element_count)."""
    return value.reshape(8, -1)[GRID].T


def determinants(x: Array) -> Array:
    """Determinants of the Jacobian at the Gauss points [m^3], shape (element_count, 8).

    Args:
        x: corners [m], shape (element_count, 8, 3), float64.
    """
    found = np.empty((len(x), 8))
    for part in chunks(len(x), CHUNK):
        found[part] = by_element(grid_determinants(tangents(x[part])))
    return found


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), by 8-point Gauss quadrature, which is exact."""
    volume = np.empty(len(x))
    for part in chunks(len(x), CHUNK):
        volume[part] = grid_determinants(tangents(x[part])).reshape(8, -1).sum(axis=0)
    return volume


def cofactors(x: Array) -> tuple[Array, Array]:
    """Cofactors of the Jacobian [m^2], shape (3 axes, 3 components, 2, 2, 2, element_count), and its determinants
    [m^3], as from `grid_determinants`."""
    a, b, c = tangents(x)
    cofactor = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
    return cofactor, (a * cofactor[0]).sum(axis=0)


def gradients(x: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions [1/m], shape (element_count, 8 points, 8 nodes, 3), and weights [m^3]."""
    cofactor, det = cofactors(x)
    inverse = (cofactor / det).reshape(3, 3, 8, -1)[:, :, GRID].transpose(3, 2, 0, 1)
    return SLOPE @ np.ascontiguousarray(inverse), by_element(det)
