"""Owns `wedge6`: the wedge with assumed transverse shear and an internal vector of its thickness."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.chunks import chunks
from warp_mca.physics.elements.element import Array, largest

if TYPE_CHECKING:
    from warp_mca.model.model import Block
    from warp_mca.physics.elements.stage import ElementStage

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
_CHUNK = 5000


def _dyads(N: Array) -> Array:
    """Symmetric products n_k n_j of the rows of matrices, shape (3, 3, n, 3, 3)."""
    products = np.einsum("eki,ejl->kjeil", N, N)
    return 0.5 * (products + products.transpose(1, 0, 2, 3, 4))


def _relief(strain: Array, n: Array, K: Array, G: Array) -> Array:
    """What the internal vector adds to elastic strains that are linear in zeta, shape (n, 3, 3, 5, 3) both."""
    stress = 2.0 * G[:, None, None, None] * np.einsum("eijpk,ej->eipk", strain, n)
    stress += (K - 2.0 / 3.0 * G)[:, None, None, None] * np.einsum("eiipk,ej->ejpk", strain, n)
    square = np.einsum("ei,ei->e", n, n)
    share = (K + G / 3.0) / ((K + 4.0 / 3.0 * G) * square)
    stress -= np.einsum("e,ei,ej,ejpk->eipk", share, n, n, stress)
    d = np.einsum("e,eipk,ej->eijpk", -0.5 / (G * square), stress, n)
    return d + d.transpose(0, 2, 1, 3, 4)


def _strains(x: Array, K: Array, G: Array) -> tuple[Array, Array]:
    """Strain at the points for each pattern and direction, shape (n, 6, 3, 3, 5, 3), and volumes, shape (n,)."""
    p = np.einsum("pa,eai->epi", _PATTERNS, x)
    b = np.stack(
        [
            np.cross(p[:, 1], p[:, 2]),
            np.cross(p[:, 2], p[:, 0]),
            np.cross(p[:, 0], p[:, 1]) + np.cross(p[:, 3], p[:, 4]) / 3.0,
            np.cross(p[:, 4], p[:, 2]) / 3.0,
            np.cross(p[:, 2], p[:, 3]) / 3.0,
        ],
        axis=1,
    )
    volume = np.einsum("ei,ei->e", b[:, 2], p[:, 2])
    b /= volume[:, None, None]
    mean = np.einsum("ik,epj->eijpk", np.eye(3), b)
    mean = 0.5 * (mean + mean.transpose(0, 2, 1, 3, 4))
    base = p[:, :3]
    N = np.linalg.inv(base).transpose(0, 2, 1)
    gamma = np.eye(5)[3:] - np.einsum("emi,epi->emp", p[:, 3:], b)
    c1, c2 = np.einsum("emp,eki->mkepi", gamma, base)
    y = {(k, j): dyad for k, row in enumerate(_dyads(N)) for j, dyad in enumerate(row)}

    def part(*terms: tuple[Array, Array]) -> Array:
        return sum((np.einsum("epk,eij->eijpk", factor, dyad) for factor, dyad in terms), np.zeros(mean.shape))

    both, tau = c2[0] + c1[1], 0.5 * (c2[0] - c1[1])
    even = mean + part(((c1[0] - both) / 6.0, y[0, 2]), ((c2[1] - both) / 6.0, y[1, 2]))
    thick = part((c1[0], y[0, 0]), (c2[1], y[1, 1]), (both, y[0, 1]))
    thick += _relief(thick, N[:, 2], K, G)
    kappa = np.sqrt(13.5 * K / (6.0 * K + 2.0 * G))[:, None, None]
    flat = np.stack([part((kappa * c1[2], y[2, 2]), (-tau, y[1, 2])), part((kappa * c2[2], y[2, 2]), (tau, y[0, 2]))])
    flat -= np.einsum("meiipk,jl->mejlpk", flat, np.eye(3)) / 3.0
    places = [even + zeta * thick + r * flat[0] + s * flat[1] for zeta, r, s in _PLACE]
    return np.stack(places, axis=1), volume


class Wedge6:
    """See `warp_mca.kernels.elements.wedge6`. Meshes store its cells as hexahedra whose corners coincide."""

    name = "wedge6"
    cell = "wedge"
    patches = False

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """Row sums of the consistent masses."""
        p = np.einsum("pa,eai->epi", _PATTERNS, x)[:, :, None]
        zeta, r, s = _PLACE.T[:, None, :, None]
        slopes = p[:, 0] + zeta * p[:, 3], p[:, 1] + zeta * p[:, 4], p[:, 2] + r * p[:, 3] + s * p[:, 4]
        det = np.einsum("egi,egi->eg", np.cross(slopes[0], slopes[1]), slopes[2])
        return (rho[:, None] / 6.0) * (det @ _SHAPE)

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """The largest eigenvalues themselves, or norms."""
        bound = np.empty(len(x))
        for part in chunks(len(x), _CHUNK):
            bound[part] = largest(self.stiffness(x[part], K[part], G[part], 1.0 / np.sqrt(mass[part])), coarse)
        return bound

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 18 x 18 problem."""
        return self.eigenvalue_bounds(x, K, G, mass)

    def stiffness(self, x: Array, K: Array, G: Array, scale: Array) -> Array:
        """Stiffness of elastic wedges [N/m], shape (element_count, 18, 18).

        Args:
            x, K, G: as in `Element`.
            scale: factors on the displacements of the corners [-], shape (element_count, 6).
        """
        strain, volume = _strains(x, K, G)
        n = len(x)
        found = np.einsum("egijpk,pa,ea->egijak", strain, _PATTERNS, scale, optimize=True)
        trace = np.einsum("egiiak->egak", found).reshape(n, 6, 18)
        flat = found.reshape(n, 54, 18)
        stiff = 2.0 * G[:, None, None] * (flat.transpose(0, 2, 1) @ flat)
        stiff += (K - 2.0 / 3.0 * G)[:, None, None] * (trace.transpose(0, 2, 1) @ trace)
        return volume[:, None, None] / 6.0 * stiff

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import wedge6
        from warp_mca.physics.elements.stage import ElementStage

        return ElementStage(block, precision, wedge6, points=6)
