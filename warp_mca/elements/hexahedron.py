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


def jacobians(x: Array) -> list[list[Array]]:
    """Components dx_i/dxi_k [m] of the Jacobian at the Gauss points, each of shape (element_count, 8).

    Args:
        x: corners [m], shape (element_count, 8, 3).
    """
    J = x.transpose(2, 0, 1) @ _SLOPE.transpose(1, 2, 0).reshape(8, 24)
    J = J.reshape(3, len(x), 3, 8)
    return [[np.ascontiguousarray(J[i, :, k]) for k in range(3)] for i in range(3)]


def _cofactors(J: list[list[Array]]) -> list[list[Array]]:
    """Of the Jacobian; written out, because NumPy takes five times as long for many small inverses."""
    found = []
    for i in range(3):
        p, q = J[(i + 1) % 3], J[(i + 2) % 3]
        found.append([p[(k + 1) % 3] * q[(k + 2) % 3] - p[(k + 2) % 3] * q[(k + 1) % 3] for k in range(3)])
    return found


def _expanded(J: list[list[Array]], C: list[list[Array]]) -> Array:
    """Determinant, along the first row."""
    return J[0][0] * C[0][0] + J[0][1] * C[0][1] + J[0][2] * C[0][2]


def determinants(x: Array) -> Array:
    """Of the Jacobian at the Gauss points [m^3], shape (element_count, 8); corners x [m] as in `lumped_masses`."""
    J = jacobians(x)
    return _expanded(J, _cofactors(J))


def lumped_masses(x: Array, rho: Array) -> Array:
    """Row-sum lumped masses [kg], shape (element_count, 8): they keep the mass and the centre of mass exactly.

    Args:
        x: corners [m], shape (element_count, 8, 3), float64.
        rho: density [kg/m^3], shape (element_count,).
    """
    return rho[:, None] * (determinants(x) @ _VALUE)


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), by 8-point Gauss quadrature, which is exact."""
    return determinants(x).sum(axis=1)


def gradients(x: Array) -> tuple[Array, Array]:
    """Gradients of the shape functions [1/m], shape (element_count, 8 points, 8 nodes, 3), and weights [m^3]."""
    J = jacobians(x)
    C = _cofactors(J)
    det = _expanded(J, C)
    inverse = np.stack([np.stack(row, axis=-1) for row in zip(*C, strict=True)], axis=-2) / det[..., None, None]
    return _SLOPE @ inverse, det


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
        root = (scaled * np.sqrt(w)[:, :, None, None]).transpose(0, 2, 1, 3).reshape(len(b), 8, 24)
        laplacian = root @ root.transpose(0, 2, 1)
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
    """Slices of `size` that cut `count` entries, the last one shorter."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
