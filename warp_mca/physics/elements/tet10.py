"""Owns the ten-node tetrahedron with the pressure of each point, `tet10`, and of the mean dilatation, `tet10_mean`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.chunks import chunks
from warp_mca.geometry.tetra10 import POINTS, SHARES, derivatives, determinants, gradients, slopes, volumes
from warp_mca.physics.elements.element import Array, largest

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block


def _spread() -> float:
    """Greatest sum of the squares of the derivatives at the points, less their mean over L_0 to L_3, of values at the
    nodes whose squares, weighted by `SHARES`, sum to 1."""
    found = derivatives(POINTS)
    found = (found - found.mean(axis=2, keepdims=True)) / np.sqrt(SHARES)[:, None]
    return float(np.linalg.norm(found.transpose(0, 2, 1).reshape(-1, len(SHARES)), 2) ** 2)


class Tet10:
    """See `warp_mca.kernels.elements.tet10`; `mean`: whether the element has one pressure."""

    cell = "tetra10"
    patches = False

    def __init__(self, mean: bool = False) -> None:
        self.name, self.mean = "tet10_mean" if mean else "tet10", mean

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """1/36 of the mass at each corner and 4/27 at each edge."""
        return (rho * volumes(x))[:, None] * SHARES

    def mean_gradients(self, x: Array) -> Array:
        """Weighted means over the points."""
        weight = determinants(x)
        return np.einsum("eg,egai->eai", weight, gradients(x)) / weight.sum(axis=1)[:, None, None]

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Bounds without the mean of the dilatation, which only takes energy away.

        Of A = M^-1/2 K M^-1/2 the closer one is the eighth root of the trace of A^8. The coarse one takes the greatest
        energy of a gradient that the slopes of L_0 to L_3 give at one of the points.
        """
        bound = np.empty(len(x))
        for part in chunks(len(x), 20_000 if coarse else 256):  # as much as caches hold
            if coarse:
                b, weight = slopes(x[part]), determinants(x[part])
                tensor = b.transpose(0, 1, 3, 2) @ b
                stiff = K[part, None] * np.trace(tensor, axis1=2, axis2=3)
                stiff += 2.0 * G[part, None] * np.linalg.norm(tensor, axis=(2, 3))
                lightest = (mass[part] / SHARES).min(axis=1)
                bound[part] = _SPREAD * (np.abs(weight) * stiff).max(axis=1) / lightest
            else:
                A = self._stiffness(x[part], K[part], G[part], mass[part], mean=False)
                scale = np.trace(A, axis1=1, axis2=2)
                A = A / scale[:, None, None]
                A = A @ A
                bound[part] = scale * largest(A @ A, coarse=True) ** 0.25
        return bound

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 30 x 30 problem."""
        return largest(self._stiffness(x, K, G, mass, self.mean))

    def _stiffness(self, x: Array, K: Array, G: Array, mass: Array, mean: bool) -> Array:
        """M^-1/2 K M^-1/2 of each element [1/s^2], shape (element_count, 30, 30)."""
        n, weight = len(x), determinants(x)
        b = gradients(x) / np.sqrt(mass)[:, None, :, None]
        flat = (np.sqrt(np.abs(weight))[:, :, None, None] * b).reshape(n, 4, 30)
        cross = flat.transpose(0, 2, 1) @ flat
        turned = cross.reshape(n, 10, 3, 10, 3).transpose(0, 1, 4, 3, 2)
        same = np.trace(turned, axis1=2, axis2=4)
        found = G[:, None, None, None, None] * (np.einsum("eab,ij->eaibj", same, np.eye(3)) + turned)
        found = found.reshape(n, 30, 30) - (2.0 / 3.0) * G[:, None, None] * cross
        if mean:
            whole = np.einsum("eg,egai->eai", weight, b).reshape(n, 30) / np.sqrt(weight.sum(axis=1))[:, None]
            cross = whole[:, :, None] * whole[:, None, :]
        return found + K[:, None, None] * cross

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements.tet10 import kernels
        from warp_mca.physics.elements.stage import ElementStage

        return ElementStage(block, precision, kernels(self.name, self.mean), points=4)


_SPREAD = _spread()
