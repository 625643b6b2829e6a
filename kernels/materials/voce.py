"""Owns isotropic hardening that saturates: sigma_y + Q (1 - exp(-b p)) + H p, Voce, J. Inst. Metals 74 (1948) 537."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.exponential import exp_function
from warp_mca.kernels.materials.radial import isotropic_return

wp.set_module_options({"enable_backward": False})


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (sigma_y, Q, b, H) of row m of `Model.law`; all but b [-] in Pa times `scale`."""
    t = scalars(precision)
    R, vec4 = t.real, wp.types.vector(4, t.real)

    @wp.func
    def voce_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        return vec4(scale * law[m, 2], scale * law[m, 3], law[m, 4], scale * law[m, 5])

    return voce_parameters


@cache
def hardening(precision: str) -> Any:
    """As `kernels.materials.radial` asks."""
    R = scalars(precision).real
    vec4, exp = wp.types.vector(4, R), exp_function(precision)

    @wp.func
    def voce_hardening(p: R, c: vec4):
        left = c[1] * exp(-c[2] * p)
        return c[0] + (c[1] - left) + c[3] * p, c[2] * left + c[3]

    return voce_hardening


@cache
def return_map(precision: str) -> Any:
    """The radial return."""
    return isotropic_return(precision, wp.types.vector(4, scalars(precision).real), hardening(precision))


@cache
def plastic_energy(precision: str) -> Any:
    """The function (eps_p, p, c) -> plastic work per volume [J/m^3], the integral of the flow stress over p."""
    t = scalars(precision)
    R, mat33, vec4, exp = t.real, t.mat33, wp.types.vector(4, t.real), exp_function(precision)

    @wp.func
    def voce_energy(eps_p: mat33, p: R, c: vec4):
        saturated = (R(1.0) - exp(-c[2] * p)) / c[2]
        return c[0] * p + c[1] * (p - saturated) + R(0.5) * c[3] * p * p

    return voce_energy
