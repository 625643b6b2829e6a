"""Owns `hex8r`: the one-point hexahedron with assumed-strain hourglass stiffness."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.chunks import chunks
from warp_mca.geometry.hexahedron import CORNERS, gradients
from warp_mca.physics.elements.element import Array, largest
from warp_mca.physics.elements.hexahedron import lumped_masses

if TYPE_CHECKING:
    from warp_mca.model.model import Block
    from warp_mca.physics.elements.stage import ElementStage

# Signs of the patterns eta zeta, zeta xi, xi eta, xi eta zeta at the corners, shape (4, 8).
_PATTERNS = np.array(
    [CORNERS[:, 1] * CORNERS[:, 2], CORNERS[:, 2] * CORNERS[:, 0], CORNERS[:, 0] * CORNERS[:, 1], CORNERS.prod(axis=1)]
)


def _parts(x: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Mean gradients b (n, 8, 3), volumes, hourglass vectors (n, 4, 8), edge directions (n, 3, 3), half lengths."""
    point, weight = gradients(x)
    volume = weight.sum(axis=1)
    b = np.einsum("eg,egai->eai", weight, point, optimize=True) / volume[:, None, None]
    sums = np.einsum("ma,eai->emi", _PATTERNS, x)
    gamma = 0.125 * (_PATTERNS - np.einsum("emi,eai->ema", sums, b, optimize=True))
    mean = np.einsum("ak,eai->eki", CORNERS, x) / 8.0
    length = np.linalg.norm(mean, axis=2)
    return b, volume, gamma, mean / length[..., None], length


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
    n = len(x)
    b, volume, gamma, directions, a = _parts(x)
    if scale is not None:
        b, gamma = b * scale[..., None], gamma * scale[:, None, :]
    same = np.einsum("eai,ebi->eab", b, b)
    cross = np.einsum("eai,ebj->eaibj", b, b)
    matrix = np.einsum("eab,ij->eaibj", same, np.eye(3)) + cross.transpose(0, 1, 4, 3, 2) - (2.0 / 3.0) * cross
    found = (volume * G)[:, None, None] * matrix.reshape(n, 24, 24)
    flat = b.reshape(n, 24)
    found += (K * volume)[:, None, None] * flat[:, :, None] * flat[:, None, :]
    amplitude = np.einsum("ema,eki->emkai", gamma, directions, optimize=True).reshape(n, 12, 24)
    D = _hourglass_stiffness(volume, a, K, G)
    found += np.einsum("epx,epq,eqy->exy", amplitude, D, amplitude, optimize=True)
    return found


class Hex8r:
    """See `warp_mca.kernels.elements.hex8r`; wedges and pyramids are hexahedra whose corners coincide."""

    name = "hex8r"
    cell = "hexahedron"
    patches = True
    lumped_masses = staticmethod(lumped_masses)

    def eigenvalue_bounds(self, x: Array, K: Array, G: Array, mass: Array, coarse: bool = False) -> Array:
        """Sum of bounds of the mean strain's part, as for hex8 with 3 x 3 problems, and of the hourglass part."""
        bound = np.empty(len(x))
        for part in chunks(len(x), 20000):
            b, volume, gamma, _, a = _parts(x[part])
            root = 1.0 / np.sqrt(mass[part])
            b, gamma = b * root[..., None], gamma * root[:, None, :]
            tensor = np.einsum("eai,eaj->eij", b, b, optimize=True)
            modes = np.einsum("ema,ena->emn", gamma, gamma, optimize=True)
            mean = K[part] * np.trace(tensor, axis1=1, axis2=2) + 2.0 * G[part] * largest(tensor, coarse)
            stiff = largest(_hourglass_stiffness(volume, a, K[part], G[part]), coarse)
            bound[part] = volume * mean + stiff * largest(modes, coarse)
        return bound

    def largest_eigenvalues(self, x: Array, K: Array, G: Array, mass: Array) -> Array:
        """Of the 24 x 24 problem."""
        return np.linalg.eigvalsh(stiffness(x, K, G, 1.0 / np.sqrt(mass)))[:, -1].astype(np.float64)

    def stage(self, block: Block, X: Array, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        from warp_mca.kernels.elements import hex8r, hex8r_patch
        from warp_mca.physics.elements.patch_stage import hexahedral_stage

        return hexahedral_stage(block, X, precision, hex8r, hex8r_patch, points=1)
