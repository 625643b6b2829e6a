"""Owns what the hexahedral elements share on the host: lumped masses and largest eigenvalues."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.geometry.hexahedron import (
    CORNERS,
    GRID,
    SLOPE,
    by_element,
    cofactors,
    gradients,
    grid_determinants,
    interpolated,
    tangents,
)
from warp_mca.physics.elements.element import Array, largest

# A Laplacian's entries are sums of those of the metric cofactor_k . cofactor_j / det at the points, times slopes.
_ROW, _COLUMN = np.triu_indices(8)
_TWICE = np.where(_ROW == _COLUMN, 1.0, 2.0)  # how often an entry stands in the matrix
_PAIRS = [(k, j) for k in range(3) for j in range(k, 3)]

# Signs of the patterns eta zeta, zeta xi, xi eta, xi eta zeta at the corners, shape (4, 8).
PATTERNS = np.array(
    [CORNERS[:, 1] * CORNERS[:, 2], CORNERS[:, 2] * CORNERS[:, 0], CORNERS[:, 0] * CORNERS[:, 1], CORNERS.prod(axis=1)]
)


def _metric_slopes() -> Array:
    """What the metric adds to the entries of a Laplacian, shape (36, 6 pairs x 8 points)."""
    found = []
    for k, j in _PAIRS:
        product = SLOPE[:, _ROW, k] * SLOPE[:, _COLUMN, j]
        found.append(product if k == j else product + SLOPE[:, _ROW, j] * SLOPE[:, _COLUMN, k])
    return np.ascontiguousarray(np.stack(found)[:, GRID].reshape(48, 36).T)


_METRIC = _metric_slopes()
_MEAN = np.ascontiguousarray(SLOPE.transpose(2, 0, 1)[:, GRID].reshape(24, 8).T)


def lumped_masses(x: Array, rho: Array) -> Array:
    """Row-sum lumped masses [kg], shape (element_count, 8): they keep the mass and the centre of mass exactly.

    Args:
        x: corners [m], shape (element_count, 8, 3), float64.
        rho: density [kg/m^3], shape (element_count,).
    """
    mass = np.empty((len(x), 8))
    for part in chunks(len(x), CHUNK):
        weight = rho[part] * grid_determinants(tangents(x[part]))
        mass[part] = by_element(interpolated(interpolated(interpolated(weight, 0), 1), 2))
    return mass


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
    cofactor, det = cofactors(x)
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


def mean_parts(x: Array) -> tuple[Array, Array, Array, Array]:
    """What elements of mean gradients and hourglass modes share, of corners x [m], shape (n, 8, 3), float64.

    Returns:
        (Mean gradients of the shape functions [1/m], shape (n, 8, 3); volumes [m^3]; hourglass vectors, which turn
        displacements into amplitudes [-], shape (n, 4, 8); tangents along the natural coordinates at the centroid [m],
        shape (n, 3, 3).)
    """
    point, weight = gradients(x)
    volume = weight.sum(axis=1)
    b = np.einsum("eg,egai->eai", weight, point, optimize=True) / volume[:, None, None]
    sums = np.einsum("ma,eai->emi", PATTERNS, x)
    gamma = 0.125 * (PATTERNS - np.einsum("emi,eai->ema", sums, b, optimize=True))
    return b, volume, gamma, np.einsum("ak,eai->eki", CORNERS, x) / 8.0


def mean_gradients(x: Array) -> Array:
    """Mean gradients of the shape functions [1/m], shape (element_count, 8, 3); x as in `mean_parts`."""
    return mean_parts(x)[0]


def mean_stiffness(b: Array, volume: Array, K: Array, G: Array) -> Array:
    """Stiffness of the mean strain [N/m], shape (n, 24, 24); arguments as `mean_parts` gives them."""
    n = len(b)
    same = np.einsum("eai,ebi->eab", b, b)
    cross = np.einsum("eai,ebj->eaibj", b, b)
    matrix = np.einsum("eab,ij->eaibj", same, np.eye(3)) + cross.transpose(0, 1, 4, 3, 2) - (2.0 / 3.0) * cross
    flat = b.reshape(n, 24)
    found = (volume * G)[:, None, None] * matrix.reshape(n, 24, 24)
    return found + (K * volume)[:, None, None] * flat[:, :, None] * flat[:, None, :]


def congruent(B: Array, D: Array) -> Array:
    """B^T D B of each element: shapes (n, p, 24), (n, p, p) -> (n, 24, 24)."""
    return np.einsum("epx,epq,eqy->exy", B, D, B, optimize=True)


def mean_and_modes_bounds(
    modes_stiffness: Callable[[Array, Array, Array, Array], Array],
    x: Array,
    K: Array,
    G: Array,
    mass: Array,
    coarse: bool,
) -> Array:
    """Bounds omega^2 [1/s^2] of elements of mean gradients and hourglass modes: those of both parts, added.

    Args:
        modes_stiffness: (volume, tangents, K, G) -> matrices of the amplitudes [N/m], shape (n, 12, 12).
        x, K, G, mass, coarse: as `eigenvalue_bounds`.
    """
    bound = np.empty(len(x))
    for part in chunks(len(x), 20000):
        b, volume, gamma, tangents = mean_parts(x[part])
        root = 1.0 / np.sqrt(mass[part])
        b, gamma = b * root[..., None], gamma * root[:, None, :]
        tensor = np.einsum("eai,eaj->eij", b, b, optimize=True)
        modes = np.einsum("ema,ena->emn", gamma, gamma, optimize=True)
        mean = K[part] * np.trace(tensor, axis1=1, axis2=2) + 2.0 * G[part] * largest(tensor, coarse)
        stiff = largest(modes_stiffness(volume, tangents, K[part], G[part]), coarse)
        bound[part] = volume * mean + stiff * largest(modes, coarse)
    return bound
