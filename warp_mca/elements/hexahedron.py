"""Owns the host-side integrals of the trilinear hexahedron: volume, lumped mass and largest eigenvalue."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)


def shape_functions(xi: Array) -> tuple[Array, Array]:
    """Shape functions [-], shape (..., 8), and their natural derivatives, shape (..., 8, 3), at xi, shape (..., 3)."""
    factor = 1.0 + xi[..., None, :] * CORNERS
    value = factor.prod(axis=-1) / 8.0
    slope = np.empty((*xi.shape[:-1], 8, 3))
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        slope[..., axis] = CORNERS[:, axis] * factor[..., others].prod(axis=-1) / 8.0
    return value, slope


_SLOPE = shape_functions(CORNERS / np.sqrt(3.0))[1]  # at the Gauss points, shape (8 points, 8 corners, 3)
_GRID = [0, 1, 3, 2, 4, 5, 7, 6]  # corners counted along xi, then eta, then zeta, and back
_NEAR, _FAR = 0.5 + 0.5 / np.sqrt(3.0), 0.5 - 0.5 / np.sqrt(3.0)  # weights of the ends of an axis at a Gauss point
CHUNK = 2048  # elements that are computed at a time: what they need stays in a core's cache

# A Laplacian's entries are sums of those of the metric cofactor_k . cofactor_j / det at the points, times slopes.
_ROW, _COLUMN = np.triu_indices(8)
_TWICE = np.where(_ROW == _COLUMN, 1.0, 2.0)  # how often an entry stands in the matrix
_PAIRS = [(k, j) for k in range(3) for j in range(k, 3)]


def _metric_slopes() -> Array:
    """What the metric adds to the entries of a Laplacian, shape (36, 6 pairs x 8 points)."""
    found = []
    for k, j in _PAIRS:
        product = _SLOPE[:, _ROW, k] * _SLOPE[:, _COLUMN, j]
        found.append(product if k == j else product + _SLOPE[:, _ROW, j] * _SLOPE[:, _COLUMN, k])
    return np.ascontiguousarray(np.stack(found)[:, _GRID].reshape(48, 36).T)


_METRIC = _metric_slopes()
_MEAN = np.ascontiguousarray(_SLOPE.transpose(2, 0, 1)[:, _GRID].reshape(24, 8).T)


def chunks(count: int, size: int) -> list[slice]:
    """Slices of `size` that cut `count` entries, the last one shorter."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def _interpolated(value: Array, axis: int) -> Array:
    """From the two ends of an axis of length 2 to its two Gauss points; the transposed step is the same."""
    found = np.empty_like(value)
    (low, high), (first, second) = np.moveaxis(value, axis, 0), np.moveaxis(found, axis, 0)
    np.multiply(low, _NEAR, out=first)
    np.multiply(high, _NEAR, out=second)
    first += _FAR * high
    second += _FAR * low
    return found


def _tangents(x: Array) -> list[Array]:
    """Derivatives dx/dxi, dx/deta, dx/dzeta [m], each constant along its own axis.

    Arrays of a chunk of elements: components first, then two places along each of zeta, eta, xi, then elements. All is
    computed so, without BLAS: memory is read once, and digits depend neither on the machine nor on the neighbours.

    Args:
        x: corners [m], shape (element_count, 8, 3).

    Returns:
        Shapes (3, 2, 2, 1, element_count), (3, 2, 1, 2, element_count), (3, 1, 2, 2, element_count).
    """
    corner = np.ascontiguousarray(x.transpose(2, 1, 0)[:, _GRID]).reshape(3, 2, 2, 2, len(x))
    found = []
    for axis in (3, 2, 1):
        low, high = np.moveaxis(corner, axis, 0)
        slope = _interpolated(_interpolated(0.5 * (high - low), 1), 2)
        found.append(np.expand_dims(slope, axis))
    return found


def _cross(p: Array, q: Array) -> Array:
    """Cross product of vectors whose components come first."""
    pairs = ((1, 2), (2, 0), (0, 1))
    return np.stack([p[j] * q[k] - p[k] * q[j] for j, k in pairs])


def _determinants(tangents: list[Array]) -> Array:
    """Determinants of the Jacobian at the Gauss points [m^3], shape (2, 2, 2, element_count)."""
    a, b, c = tangents
    normal = _cross(b, c)
    return a[0] * normal[0] + a[1] * normal[1] + a[2] * normal[2]


def _by_element(value: Array) -> Array:
    """Shape (element_count, 8), in the order of CORNERS, from (2, 2, 2, element_count)."""
    return value.reshape(8, -1)[_GRID].T


def determinants(x: Array) -> Array:
    """Of the Jacobian at the Gauss points [m^3], shape (element_count, 8); corners x [m] as in `lumped_masses`."""
    found = np.empty((len(x), 8))
    for part in chunks(len(x), CHUNK):
        found[part] = _by_element(_determinants(_tangents(x[part])))
    return found


def lumped_masses(x: Array, rho: Array) -> Array:
    """Row-sum lumped masses [kg], shape (element_count, 8): they keep the mass and the centre of mass exactly.

    Args:
        x: corners [m], shape (element_count, 8, 3), float64.
        rho: density [kg/m^3], shape (element_count,).
    """
    mass = np.empty((len(x), 8))
    for part in chunks(len(x), CHUNK):
        weight = rho[part] * _determinants(_tangents(x[part]))
        mass[part] = _by_element(_interpolated(_interpolated(_interpolated(weight, 0), 1), 2))
    return mass


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), by 8-point Gauss quadrature, which is exact."""
    volume = np.empty(len(x))
    for part in chunks(len(x), CHUNK):
        volume[part] = _determinants(_tangents(x[part])).reshape(8, -1).sum(axis=0)
    return volume


def _cofactors(x: Array) -> tuple[Array, Array]:
    """Of the Jacobian, shape (3 axes, 3 components, 2, 2, 2, element_count), and its determinants as above."""
    a, b, c = _tangents(x)
    cofactor = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)])
    return cofactor, (a * cofactor[0]).sum(axis=0)


def gradients(x: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions [1/m], shape (element_count, 8 points, 8 nodes, 3), and weights [m^3]."""
    cofactor, det = _cofactors(x)
    inverse = (cofactor / det).reshape(3, 3, 8, -1)[:, :, _GRID].transpose(3, 2, 0, 1)
    return _SLOPE @ np.ascontiguousarray(inverse), _by_element(det)


def eigenvalue_bounds(x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
    """Upper bound on the largest eigenvalue omega^2 [1/s^2] of each element, shape (element_count,), float64.

    The energy is K V theta^2 / 2 with the mean dilatation theta, plus G times the squared deviatoric strain, which
    the squared velocity gradient bounds: the first is a rank-one matrix with its eigenvalue in closed form, the
    second an 8 x 8 Laplacian for each direction.

    Args:
        x: corners [m], shape (element_count, 8, 3). K, G: moduli [Pa], shape (element_count,).
        mass: lumped masses [kg], shape (element_count, 8).
        coarse: take the Laplacian's norm for its eigenvalue: a quarter higher, four times as quick.
    """
    bound = np.empty(len(x))
    for part in chunks(len(x), CHUNK):
        laplacian, volumetric = _laplacians(x[part], mass[part])
        if coarse:
            largest = np.sqrt(_TWICE @ laplacian**2)
        else:
            matrix = np.empty((laplacian.shape[1], 8, 8))
            matrix[:, _ROW, _COLUMN] = matrix[:, _COLUMN, _ROW] = laplacian.T
            largest = np.linalg.eigvalsh(matrix)[:, -1]
        bound[part] = K[part] * volumetric + 2.0 * G[part] * largest
    return bound


def _product(matrix: Array, columns: Array) -> Array:
    """matrix @ columns, a few columns at a time: so many as BLAS leaves to one thread, since threads would wait."""
    found = np.empty((len(matrix), columns.shape[1]))
    for part in chunks(columns.shape[1], 128):
        np.matmul(matrix, columns[:, part], out=found[:, part])
    return found


def _laplacians(x: Array, mass: Array) -> tuple[Array, Array]:
    """Entries (_ROW, _COLUMN) of M^-1/2 (sum over points w grad N_a . grad N_b) M^-1/2 [m/kg], shape (36,
    element_count), and the eigenvalue of the mean dilatation's matrix without K [m/kg], shape (element_count,)."""
    cofactor, det = _cofactors(x)
    metric = np.stack([(cofactor[k] * cofactor[j]).sum(axis=0) / det for k, j in _PAIRS])
    root = 1.0 / np.sqrt(mass.T)
    laplacian = _product(_METRIC, metric.reshape(48, -1))
    laplacian *= root[_ROW]
    laplacian *= root[_COLUMN]
    square = 0.0
    for i in range(3):
        mean = _product(_MEAN, cofactor[:, i].reshape(24, -1))
        square = square + ((mean * root) ** 2).sum(axis=0)
    return laplacian, square / det.reshape(8, -1).sum(axis=0)


def largest_eigenvalues(x: Array, K: Array, G: Array, mass: Array) -> Array:
    """Exact largest eigenvalue omega^2 [1/s^2] of each element's 24 x 24 problem; arguments as `eigenvalue_bounds`."""
    b, w = gradients(x)
    b = b / np.sqrt(mass)[:, None, :, None]
    n = len(x)
    mean = np.einsum("eg,egai->eai", w, b, optimize=True).reshape(n, 24)
    volume = w.sum(axis=1)
    same = np.einsum("eg,egai,egbi->eab", w, b, b, optimize=True)
    cross = np.einsum("eg,egai,egbj->eaibj", w, b, b, optimize=True)
    # 2 G (dev sym grad u)^2 = G (grad : grad + grad : grad^T - 2/3 tr^2)
    matrix = np.einsum("eab,ij->eaibj", same, np.eye(3)) + cross.transpose(0, 1, 4, 3, 2) - (2.0 / 3.0) * cross
    stiffness = G[:, None, None] * matrix.reshape(n, 24, 24)
    stiffness += (K / volume)[:, None, None] * mean[:, :, None] * mean[:, None, :]
    return np.linalg.eigvalsh(stiffness)[:, -1].astype(np.float64)
