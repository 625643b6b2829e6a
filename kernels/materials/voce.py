"""Owns isotropic hardening that saturates: sigma_y + Q (1 - exp(-b p)) + H p, Voce, J. Inst. Metals 74 (1948) 537."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

_ITERATIONS = 6


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
def return_map(precision: str) -> Any:
    """The function (elastic, eps_p, p, G, c) -> (S, eps_p, p): q - 3 G dp is the flow stress at p + dp.

    Newton's method comes from below, because the residual is convex, and slopes of hardening are small beside 3 G. It
    has no branches, so that a CPU computes several elements at once.
    """
    t = scalars(precision)
    R, mat33, vec4 = t.real, t.mat33, wp.types.vector(4, t.real)

    @wp.func
    def voce_return(elastic: mat33, eps_p: mat33, p: R, G: R, c: vec4):
        trial = elastic - R(2.0) * G * eps_p
        q = wp.sqrt(R(1.5) * wp.ddot(trial, trial))
        dp = R(0.0)
        for _ in range(wp.static(_ITERATIONS)):
            left = c[1] * wp.exp(-c[2] * (p + dp))
            beyond = q - R(3.0) * G * dp - (c[0] + (c[1] - left) + c[3] * (p + dp))
            dp = wp.max(dp + beyond / (R(3.0) * G + c[2] * left + c[3]), R(0.0))
        p_new = p + dp
        dp = p_new - p  # what p takes of it: the next step corrects the rest, and rounding does not add up
        eps_p = eps_p + wp.where(dp > R(0.0), R(1.5) * dp / q, R(0.0)) * trial
        return elastic - R(2.0) * G * eps_p, eps_p, p_new

    return voce_return


@cache
def plastic_energy(precision: str) -> Any:
    """The function (eps_p, p, c) -> plastic work per volume [J/m^3], the integral of the flow stress over p."""
    t = scalars(precision)
    R, mat33, vec4 = t.real, t.mat33, wp.types.vector(4, t.real)

    @wp.func
    def voce_energy(eps_p: mat33, p: R, c: vec4):
        saturated = (R(1.0) - wp.exp(-c[2] * p)) / c[2]
        return c[0] * p + c[1] * (p - saturated) + R(0.5) * c[3] * p * p

    return voce_energy
