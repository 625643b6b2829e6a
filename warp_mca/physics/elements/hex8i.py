"""Owns `hex8i`: the hexahedron with internal modes, which bends right with one element across."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.physics.elements.element import Array
from warp_mca.physics.elements.hexahedron import (
    congruent,
    lumped_masses,
    mean_and_modes_bounds,
    mean_gradients,
    mean_parts,
    mean_stiffness,
)

if TYPE_CHECKING:
    from warp_mca.physics.elements.stage import ElementStage
    from warp_mca.system.block import Block

_VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


def _elasticity(K: Array, G: Array) -> Array:
    """Matrices of isotropic elasticity [Pa], shape (n, 6, 6), for strains xx, yy, zz and twice xy, yz, xz."""
    C = np.zeros((len(K), 6, 6))
    C[:, :3, :3] = (K - 2.0 / 3.0 * G)[:, None, None]
    C[:, range(3), range(3)] += 2.0 * G[:, None]
    C[:, range(3, 6), range(3, 6)] = G[:, None]
    return C


def _modes_stiffness(volume: Array, tangents: Array, K: Array, G: Array) -> Array:
    """Matrices of the amplitudes (pattern, component) [N/m], shape (n, 12, 12), with the internal vectors condensed."""
    n, C = len(volume), _elasticity(K / G, np.ones_like(G))  # over G: stiffness may be of any size
    cofactor = np.cross(np.roll(tangents, -1, axis=1), np.roll(tangents, -2, axis=1))
    with np.errstate(all="ignore"):  # a cell without volume has no stable step
        normal = cofactor / np.einsum("ei,ei->e", tangents[:, 0], cofactor[:, 0])[:, None, None]  # rows n_k
    outer = np.zeros((n, 3, 6, 3))  # [j]: strain of a gradient a n_j, as a matrix that acts on a
    for row, (p, q) in enumerate(_VOIGT):
        outer[:, :, row, p] += normal[:, :, q]
        if p != q:
            outer[:, :, row, q] += normal[:, :, p]
    D = np.zeros((n, 12, 12))
    for k in range(3):
        strain = np.zeros((n, 6, 12))  # linear in coordinate k
        for m in range(3):
            if m != k:
                strain[:, :, 3 * m : 3 * m + 3] = outer[:, 3 - m - k]
        stress = C @ strain
        traction = outer[:, k].transpose(0, 2, 1) @ stress
        square = np.einsum("ei,ei->e", normal[:, k], normal[:, k])
        # the acoustic tensor's inverse by Sherman and Morrison, as in the kernel
        share = (K + G / 3.0) / (K + 4.0 / 3.0 * G) / square
        inverse = np.eye(3) - share[:, None, None] * normal[:, k, :, None] * normal[:, k, None, :]
        relaxed = (
            strain.transpose(0, 2, 1) @ stress
            - traction.transpose(0, 2, 1) @ inverse @ traction / square[:, None, None]
        )
        D += (volume / 3.0)[:, None, None] * relaxed
        along = tangents[:, k, :, None] * tangents[:, k, None, :]
        D[:, 9:, 9:] += (volume * (4.0 / 27.0) * square**2)[:, None, None] * along
    return G[:, None, None] * D


class Hex8i:
    """See `warp_mca.kernels.elements.hex8i`. Pyramids are hexahedra whose corners coincide; `wedge6` computes wedges.

    Attributes:
        points: 8, or 16 or 24 with two or three in each half of the third direction.
    """

    cell = "hexahedron"
    leaves = ("wedge",)
    patches = True
    lags = True
    lumped_masses = staticmethod(lumped_masses)
    mean_gradients = staticmethod(mean_gradients)

    def __init__(self, name: str = "hex8i", points: int = 8) -> None:
        self.name, self.points = name, points

    def stiffness(self, x: Array, K: Array, G: Array, scale: Array | None = None) -> Array:
        """Stiffness [N/m] in x, y, z of the corners, shape (element_count, 24, 24), float64.

        Args:
            x: corners [m], shape (element_count, 8, 3). K, G: moduli [Pa], shape (element_count,).
            scale: factors on the displacements of the corners [-], shape (element_count, 8).
        """
        b, volume, gamma, tangents = mean_parts(x)
        if scale is not None:
            b, gamma = b * scale[..., None], gamma * scale[:, None, :]
        amplitude = np.einsum("ema,ij->emiaj", gamma, np.eye(3)).reshape(len(x), 12, 24)
        return mean_stiffness(b, volume, K, G) + congruent(amplitude, _modes_stiffness(volume, tangents, K, G))

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Sum of bounds of the mean strain's part and of that of the hourglass modes."""
        return mean_and_modes_bounds(_modes_stiffness, x, K, G, mass, coarse)

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 24 x 24 problem."""
        return np.linalg.eigvalsh(self.stiffness(x, K, G, 1.0 / np.sqrt(mass)))[:, -1].astype(np.float64)

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import hex8i, hex8i_patch
        from warp_mca.physics.elements.patch_stage import hexahedral_stage

        kernels, patch_kernels = hex8i.kernels(self.points), hex8i_patch.kernels(self.points)
        return hexahedral_stage(block, X, precision, kernels, patch_kernels, self.points)
