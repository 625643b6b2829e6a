"""Owns the host-side integrals of the trilinear hexahedron: volume, lumped mass and largest eigenvalue."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)
_POINT = CORNERS / np.sqrt(3.0)


def shape_functions(xi: Array) -> tuple[Array, Array]:
    """Shape functions [-], shape (..., 8), and their natural derivatives, shape (..., 8, 3), at xi, shape (..., 3)."""
    factor = 1.0 + xi[..., None, :] * CORNERS
    value = factor.prod(axis=-1) / 8.0
    slope = np.empty((*xi.shape[:-1], 8, 3))
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        slope[..., axis] = CORNERS[:, axis] * factor[..., others].prod(axis=-1) / 8.0
    return value, slope


_VALUE, _SLOPE = shape_functions(_POINT)


def jacobians(x: Array) -> Array:
    """Jacobians dx/dxi at the Gauss points, shape (element_count, 8, 3, 3); corners x [m] as in `lumped_masses`."""
    return np.einsum("eai,gak->egik", x, _SLOPE, optimize=True)


def lumped_masses(x: Array, rho: Array) -> Array:
    """Row-sum lumped masses [kg], shape (element_count, 8): they keep the mass and the centre of mass exactly.

    Args:
        x: corners [m], shape (element_count, 8, 3), float64.
        rho: density [kg/m^3], shape (element_count,).
    """
    return rho[:, None] * (np.linalg.det(jacobians(x)) @ _VALUE)


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), by 8-point Gauss quadrature, which is exact."""
    return np.linalg.det(jacobians(x)).sum(axis=1)


def gradients(x: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions [1/m], shape (element_count, 8 points, 8 nodes, 3), and weights [m^3]."""
    J = jacobians(x)
    return np.einsum("gak,egki->egai", _SLOPE, np.linalg.inv(J), optimize=True), np.linalg.det(J)


def eigenvalue_bounds(x: Array, K: Array, G: Array, mass: Array) -> Array:
    """Upper bound on the largest eigenvalue omega^2 [1/s^2] of each element, shape (element_count,), float64.

    The energy is K V theta^2 / 2 with the mean dilatation theta, plus G times the squared deviatoric strain, which
    the squared velocity gradient bounds: the first is a rank-one matrix with its eigenvalue in closed form, the
    second an 8 x 8 Laplacian for each direction.

    Args:
        x: corners [m], shape (element_count, 8, 3). K, G: moduli [Pa], shape (element_count,).
        mass: lumped masses [kg], shape (element_count, 8).
    """
    bound = np.empty(len(x))
    for part in chunks(len(x), 20000):
        b, w = gradients(x[part])
        scaled = b / np.sqrt(mass[part])[:, None, :, None]
        laplacian = np.einsum("eg,egai,egbi->eab", w, scaled, scaled, optimize=True)
        mean = np.einsum("eg,egai->eai", w, scaled, optimize=True)
        volumetric = K[part] * (mean**2).sum(axis=(1, 2)) / w.sum(axis=1)
        bound[part] = volumetric + 2.0 * G[part] * np.linalg.eigvalsh(laplacian)[:, -1]
    return bound


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


def chunks(count: int, size: int) -> list[slice]:
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
