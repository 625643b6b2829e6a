"""Owns `hex8r`: the one-point hexahedron with assumed-strain hourglass stiffness."""

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


def _lengths(tangents: Array) -> tuple[Array, Array]:
    """Directions of the mean edges (n, 3, 3) and half their lengths [m] (n, 3)."""
    length = np.linalg.norm(tangents, axis=2)
    return tangents / length[..., None], length


def _hourglass_stiffness(volume: Array, a: Array, K: Array, G: Array) -> Array:
    """Matrices of the amplitudes p (pattern m, edge k), flattened to 12, shape (n, 12, 12); as in the kernel."""
    nu = (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
    plane, E = 2.0 * G / (1.0 - nu), 2.0 * G * (1.0 + nu)
    D = np.zeros((len(volume), 12, 12))
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        ei, ej = np.zeros((2, len(volume), 12))
        shear = np.zeros((len(volume), 12))
        ei[:, 3 * j + i] = 1.0 / a[:, i]
        ej[:, 3 * i + j] = 1.0 / a[:, j]
        shear[:, 3 * j + j], shear[:, 3 * i + i] = 1.0 / a[:, i], 1.0 / a[:, j]
        for left, right, modulus in ((ei, ei, plane), (ej, ej, plane), (shear, shear, G)):
            D += (volume * modulus / 3.0)[:, None, None] * left[:, :, None] * right[:, None, :]
        mixed = ei[:, :, None] * ej[:, None, :]
        D += (volume * plane * nu / 3.0)[:, None, None] * (mixed + mixed.transpose(0, 2, 1))
        D[:, 9 + k, 9 + k] += volume * E / (9.0 * a[:, k] ** 2)
    return D


def stiffness(x: Array, K: Array, G: Array, scale: Array | None = None) -> Array:
    """Stiffness [N/m] in x, y, z of the corners, shape (element_count, 24, 24), float64.

    Args:
        x: corners [m], shape (element_count, 8, 3). K, G: moduli [Pa], shape (element_count,).
        scale: factors on the displacements of the corners [-], shape (element_count, 8).
    """
    b, volume, gamma, tangents = mean_parts(x)
    directions, a = _lengths(tangents)
    if scale is not None:
        b, gamma = b * scale[..., None], gamma * scale[:, None, :]
    amplitude = np.einsum("ema,eki->emkai", gamma, directions, optimize=True).reshape(len(x), 12, 24)
    return mean_stiffness(b, volume, K, G) + congruent(amplitude, _hourglass_stiffness(volume, a, K, G))


class Hex8r:
    """See `warp_mca.kernels.elements.hex8r`; wedges and pyramids are hexahedra whose corners coincide."""

    name = "hex8r"
    cell = "hexahedron"
    patches = True
    lumped_masses = staticmethod(lumped_masses)
    mean_gradients = staticmethod(mean_gradients)

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Sum of bounds of the mean strain's part, as for hex8 with 3 x 3 problems, and of the hourglass part."""

        def modes(volume: Array, tangents: Array, K: Array, G: Array) -> Array:
            return _hourglass_stiffness(volume, _lengths(tangents)[1], K, G)

        return mean_and_modes_bounds(modes, x, K, G, mass, coarse)

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 24 x 24 problem."""
        return np.linalg.eigvalsh(stiffness(x, K, G, 1.0 / np.sqrt(mass)))[:, -1].astype(np.float64)

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import hex8r, hex8r_patch
        from warp_mca.physics.elements.patch_stage import hexahedral_stage

        return hexahedral_stage(block, X, precision, hex8r, hex8r_patch, points=1)
