"""Owns the neo-Hookean law: C10 (I1 - 3) of the isochoric stretch, Treloar, Trans. Faraday Soc. 39 (1943) 241."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.isochoric import trace_function

wp.set_module_options({"enable_backward": False})


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> C10 [Pa], which is half of the shear modulus."""
    R = scalars(precision).real

    @wp.func
    def neo_hookean_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        return R(0.5) * law[m, 1]

    return neo_hookean_parameters


@cache
def mandel(precision: str) -> Any:
    """The function (E, C10) -> 2 C10 dev C of the isochoric C = I + 2 E."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def neo_hookean_stress(E: mat33, C10: R):
        M = (R(4.0) * C10) * E
        mean = R(THIRD) * wp.trace(M)
        for i in range(3):
            M[i, i] = M[i, i] - mean
        return M

    return neo_hookean_stress


@cache
def stored(precision: str) -> Any:
    """The function (E, C10) -> C10 (I1 - 3) [J/m^3]."""
    t = scalars(precision)
    R, mat33, trace_of = t.real, t.mat33, trace_function(precision)

    @wp.func
    def neo_hookean_energy(E: mat33, C10: R):
        return R(2.0) * C10 * trace_of(E)

    return neo_hookean_energy
