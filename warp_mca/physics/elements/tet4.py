"""Owns `tet4`: the 4-node tetrahedron with averaged nodal pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.chunks import chunks
from warp_mca.geometry.tetrahedron import gradients, volumes
from warp_mca.physics.elements.element import Array, largest

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block


class Tet4:
    """See `warp_mca.kernels.elements.tet4`."""

    name = "tet4"
    cell = "tetrahedron"
    patches = False
    one_rate = True  # the pressure is averaged over neighbours

    def lumped_masses(self, x: Array, rho: Array) -> Array:
        """A quarter of the mass at each corner."""
        return np.repeat((0.25 * rho * volumes(x))[:, None], 4, axis=1)

    def mean_gradients(self, x: Array) -> Array:
        """As the gradients are, which do not vary."""
        return gradients(x)

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Bounds without the averaging of the pressure, which only takes energy away (Jensen's inequality)."""
        bound = np.empty(len(x))
        for part in chunks(len(x), 50000):
            b = gradients(x[part]) / np.sqrt(mass[part])[..., None]
            tensor = np.einsum("eai,eaj->eij", b, b)
            spread = 2.0 * G[part] * largest(tensor, coarse)
            bound[part] = volumes(x[part]) * (K[part] * np.trace(tensor, axis1=1, axis2=2) + spread)
        return bound

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 12 x 12 problem without averaging."""
        n = len(x)
        b = gradients(x) / np.sqrt(mass)[..., None]
        same = np.einsum("eai,ebi->eab", b, b)
        cross = np.einsum("eai,ebj->eaibj", b, b)
        matrix = np.einsum("eab,ij->eaibj", same, np.eye(3)) + cross.transpose(0, 1, 4, 3, 2) - (2.0 / 3.0) * cross
        flat = b.reshape(n, 12)
        stiffness = G[:, None, None] * matrix.reshape(n, 12, 12)
        stiffness += K[:, None, None] * flat[:, :, None] * flat[:, None, :]
        return (volumes(x) * np.linalg.eigvalsh(stiffness)[:, -1]).astype(np.float64)

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.physics.elements.tet4_stage import Tet4Stage

        return Tet4Stage(block, volumes(X[block.conn.T]), precision)
