"""Owns `wedge6`: the wedge with assumed transverse shear and an internal vector of its thickness."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.chunks import chunks
from warp_mca.physics.elements.element import Array, largest

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block

# Rows as in `kernels.elements.wedge_shape`: patterns r, s, zeta, zeta r and zeta s of the corners, shape (5, 6).
_PATTERNS = np.array(
    [
        [-3, 3, 0, -3, 3, 0],
        [-3, 0, 3, -3, 0, 3],
        [-1, -1, -1, 1, 1, 1],
        [3, -3, 0, -3, 3, 0],
        [3, 0, -3, -3, 0, 3],
    ]
) / np.array(6.0)
# Of its points: zeta, r and s, shape (6, 3), and the shape functions of the corners there, shape (6, 6).
_PLACE = np.array([(zeta, *rs) for zeta in (-(3.0**-0.5), 3.0**-0.5) for rs in np.eye(3)[:, 1:] / 2.0 - 1.0 / 6.0])
_FLAT = np.column_stack([1 / 3 - _PLACE[:, 1] - _PLACE[:, 2], 1 / 3 + _PLACE[:, 1], 1 / 3 + _PLACE[:, 2]])
_SHAPE = 0.5 * np.column_stack([(1.0 - _PLACE[:, :1]) * _FLAT, (1.0 + _PLACE[:, :1]) * _FLAT])
_ROWS = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))
_CHUNK = 5000


def _rows(a: Array, b: Array) -> Array:
    """Strain a b, symmetric, of vectors: rows xx, yy, zz and twice xy, yz, xz, shape (n, 6)."""
    return np.stack([a[:, i] * b[:, j] + (i != j) * a[:, j] * b[:, i] for i, j in _ROWS], axis=1)


def _gradient_rows(b: Array) -> Array:
    """The same rows of sums of u_a b_a with gradients b, shape (n, corners, 3), for each u_a: (n, 6, corners * 3)."""
    found = np.zeros((len(b), 6, *b.shape[1:]))
    for row, (i, j) in enumerate(_ROWS):
        found[:, row, :, i] += b[:, :, j]
        if i != j:
            found[:, row, :, j] += b[:, :, i]
    return found.reshape(len(b), 6, -1)


def _deviator(rows: Array) -> Array:
    found = rows.copy()
    found[:, :3] -= rows[:, :3].mean(axis=1, keepdims=True)
    return found


def _stress(strain: Array, K: Array, G: Array) -> Array:
    """Of isotropic elasticity [Pa], shape as `strain`, (n, 6, count); each shear once."""
    found = strain * (G[:, None] * [2.0, 2.0, 2.0, 1.0, 1.0, 1.0])[..., None]
    found[:, :3] += (K - 2.0 / 3.0 * G)[:, None, None] * strain[:, :3].sum(axis=1, keepdims=True)
    return found


def _mean_parts(x: Array) -> tuple[Array, Array, Array]:
    """Patterns of corners x [m] and mean gradients of these [1/m], shape (n, 5, 3); volumes [m^3], shape (n,)."""
    p = np.einsum("pa,eai->epi", _PATTERNS, x)
    b = np.cross(p[:, [1, 2, 0, 4, 2]], p[:, [2, 0, 1, 2, 3]]) / np.array([1.0, 1.0, 1.0, 3.0, 3.0])[:, None]
    b[:, 2] += np.cross(p[:, 3], p[:, 4]) / 3.0
    volume = np.einsum("ei,ei->e", b[:, 2], p[:, 2])
    return p, b / volume[:, None, None], volume


def _strains(x: Array, K: Array, G: Array, scale: Array) -> tuple[list[tuple[float, Array]], Array]:
    """Parts of the strain that are orthogonal over the points: weight and rows for each corner and direction, shape (n,
    6, 18); volumes, shape (n,)."""
    p, b, volume = _mean_parts(x)
    base = p[:, :3]
    r, s, z = np.linalg.inv(base).transpose(2, 0, 1)
    gamma = (np.eye(5)[3:] - np.einsum("emi,epi->emp", p[:, 3:], b)) @ _PATTERNS * scale[:, None]
    a1, b1, c1, a2, b2, c2 = np.einsum("ema,eki->mkeai", gamma, base).reshape(6, len(x), 1, 18)
    rz, sz, zz, both = _rows(r, z)[..., None], _rows(s, z)[..., None], _rows(z, z)[..., None], a2 + b1
    even = _gradient_rows(np.einsum("pa,epi->eai", _PATTERNS, b) * scale[..., None])
    even += (rz * (a1 - both) + sz * (b2 - both)) / 6.0
    thick = _rows(r, r)[..., None] * a1 + _rows(s, s)[..., None] * b2 + _rows(r, s)[..., None] * both
    tractions = _gradient_rows(z[:, None])
    stiffness = tractions.transpose(0, 2, 1) @ _stress(tractions, K, G)
    thick -= tractions @ np.linalg.solve(stiffness, tractions.transpose(0, 2, 1) @ _stress(thick, K, G))
    kappa, tau = np.sqrt(13.5 * K / (6.0 * K + 2.0 * G))[:, None, None], 0.5 * (a2 - b1)
    along_r, along_s = _deviator(kappa * zz * c1 - sz * tau), _deviator(kappa * zz * c2 + rz * tau)
    # means over the points: zeta^2 1/3, r^2 and s^2 1/18, r s -1/36
    parts = [(1.0, even), (1.0 / 3.0, thick), (1.0 / 72.0, along_r + along_s), (1.0 / 24.0, along_r - along_s)]
    return parts, volume


class Wedge6:
    """See `warp_mca.kernels.elements.wedge6`. Meshes store its cells as hexahedra whose corners coincide."""

    name = "wedge6"
    cell = "wedge"
    patches = False
    lags = True

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """Row sums of the consistent masses."""
        p = np.einsum("pa,eai->epi", _PATTERNS, x)[:, :, None]
        zeta, r, s = _PLACE.T[:, None, :, None]
        slopes = p[:, 0] + zeta * p[:, 3], p[:, 1] + zeta * p[:, 4], p[:, 2] + r * p[:, 3] + s * p[:, 4]
        det = np.einsum("egi,egi->eg", np.cross(slopes[0], slopes[1]), slopes[2])
        return (rho[:, None] / 6.0) * (det @ _SHAPE)

    def mean_gradients(self, x: Array) -> Array:
        """By the mean gradients of its patterns."""
        return np.einsum("pa,epi->eai", _PATTERNS, _mean_parts(x)[1])

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Norms: of the eighth power, or coarse ones of the matrix."""
        bound = np.empty(len(x))
        for part in chunks(len(x), _CHUNK):
            matrix = self.stiffness(x[part], K[part], G[part], 1.0 / np.sqrt(mass[part]))
            size = largest(matrix, coarse=True)
            if not coarse:
                square = matrix / size[:, None, None]
                square = square @ square
                size = size * largest(square @ square, coarse=True) ** 0.25
            bound[part] = size
        return bound

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 18 x 18 problem."""
        return largest(self.stiffness(x, K, G, 1.0 / np.sqrt(mass)))

    def stiffness(self, x: Array, K: Array, G: Array, scale: Array) -> Array:
        """Stiffness of elastic wedges [N/m], shape (element_count, 18, 18).

        Args:
            x, K, G: as in `Element`.
            scale: factors on the displacements of the corners [-], shape (element_count, 6).
        """
        parts, volume = _strains(x, K, G, scale)
        sums = (weight * (strain.transpose(0, 2, 1) @ _stress(strain, K, G)) for weight, strain in parts)
        return volume[:, None, None] * sum(sums, np.zeros((len(x), 18, 18)))

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import wedge6
        from warp_mca.physics.elements.stage import ElementStage

        return ElementStage(block, precision, wedge6, points=6)
