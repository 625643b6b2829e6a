"""Owns the host side of an element of the user's own: the tetrahedron of constant strain; see `linear_tet_kernels`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.geometry.tetrahedron import gradients, volumes
from warp_mca.physics.elements.element import Array

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.model import Block


class LinearTet:
    """One point, one volume change for each element: it locks where metal flows, `tet4` does not."""

    name = "linear_tet"
    cell = "tetrahedron"
    patches = False

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """A quarter of the mass at each corner."""
        return np.repeat((0.25 * rho * volumes(x))[:, None], 4, axis=1)

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """The largest eigenvalues themselves."""
        return self.largest_eigenvalues(x, K, G, mass)

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of V B^T D B and the masses, with B in the order xx, yy, zz, xy, yz, xz."""
        n, b = len(x), gradients(x) / np.sqrt(mass)[..., None]
        B = np.zeros((n, 6, 4, 3))
        for row, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))):
            B[:, row, :, i] = b[..., j]
            B[:, row, :, j] = b[..., i]
        lame, twice = (K - 2.0 / 3.0 * G)[:, None, None], (2.0 * G)[:, None, None]
        D = np.pad(lame * np.ones((3, 3)), ((0, 0), (0, 3), (0, 3))) + twice * np.diag([1, 1, 1, 0.5, 0.5, 0.5])
        B = B.reshape(n, 6, 12)
        return volumes(x) * np.linalg.eigvalsh(B.transpose(0, 2, 1) @ D @ B)[:, -1]

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        import linear_tet_kernels

        from warp_mca.physics.elements.stage import ElementStage

        return ElementStage(block, precision, linear_tet_kernels, points=1)
