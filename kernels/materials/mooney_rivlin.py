"""Owns the law of Mooney and Rivlin: C10 (I1 - 3) + C01 (I2 - 3) of the isochoric stretch.

Rivlin, Phil. Trans. R. Soc. A 241 (1948) 379. With C = I + B: -dev C^-1 = dev (I1 C - C^2) = dev ((1 + tr B) B - B^2)
as det C = 1, and I2 - 3 = 2 tr B + ((tr B)^2 - B : B) / 2.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.isochoric import trace_function

wp.set_module_options({"enable_backward": False})


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (C10, C01) [Pa] of row m of `Model.law`."""
    R = scalars(precision).real
    pair = wp.types.vector(2, R)

    @wp.func
    def mooney_rivlin_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        return pair(law[m, 3], law[m, 4])

    return mooney_rivlin_parameters


@cache
def mandel(precision: str) -> Any:
    """The function (E, c) -> dev (2 C10 C - 2 C01 C^-1) of the isochoric C = I + 2 E."""
    t = scalars(precision)
    R, mat33, pair = t.real, t.mat33, wp.types.vector(2, t.real)

    @wp.func
    def mooney_rivlin_stress(E: mat33, c: pair):
        B = R(2.0) * E
        M = (R(2.0) * (c[0] + c[1] * (R(1.0) + wp.trace(B)))) * B - (R(2.0) * c[1]) * (B * B)
        mean = R(THIRD) * wp.trace(M)
        for i in range(3):
            M[i, i] = M[i, i] - mean
        return M

    return mooney_rivlin_stress


@cache
def stored(precision: str) -> Any:
    """The function (E, c) -> energy [J/m^3]."""
    t = scalars(precision)
    R, mat33, pair, trace_of = t.real, t.mat33, wp.types.vector(2, t.real), trace_function(precision)

    @wp.func
    def mooney_rivlin_energy(E: mat33, c: pair):
        trace = R(2.0) * trace_of(E)
        return c[0] * trace + c[1] * (R(2.0) * trace + R(0.5) * (trace * trace - R(4.0) * wp.ddot(E, E)))

    return mooney_rivlin_energy
