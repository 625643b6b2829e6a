"""Owns the law of a material of the user's own: hardening that saturates, after Voce, J. Inst. Metals 74 (1948) 537.

sigma_y(p) = sigma_0 + (sigma_s - sigma_0) (1 - exp(-p / p_0)), isotropic. See `warp_mca.kernels.materials.laws`.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

_ITERATIONS = 8  # of Newton's method, which comes from below: the residual is convex


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (sigma_0, sigma_s, p_0) of row m of `Model.law`."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3

    @wp.func
    def voce_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        return vec3(scale * law[m, 2], scale * law[m, 3], law[m, 4])

    return voce_parameters


@cache
def return_map(precision: str) -> Any:
    """The function (elastic, eps_p, p, G, c) -> (S, eps_p, p): q - 3 G dp = sigma_y(p + dp) where q is beyond yield."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def voce_return(elastic: mat33, eps_p: mat33, p: R, G: R, c: vec3):
        trial = elastic - R(2.0) * G * eps_p
        q = wp.sqrt(R(1.5) * wp.ddot(trial, trial))
        dp = R(0.0)
        for _ in range(wp.static(_ITERATIONS)):
            left = (c[1] - c[0]) * wp.exp(-(p + dp) / c[2])
            beyond = q - R(3.0) * G * dp - (c[1] - left)
            dp = wp.max(dp + beyond / (R(3.0) * G + left / c[2]), R(0.0))
        p_new = p + dp
        dp = p_new - p
        eps_p = eps_p + wp.where(dp > R(0.0), R(1.5) * dp / q, R(0.0)) * trial
        return elastic - R(2.0) * G * eps_p, eps_p, p_new

    return voce_return


@cache
def plastic_energy(precision: str) -> Any:
    """The function (eps_p, p, c) -> plastic work per volume [J/m^3], the integral of sigma_y dp."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def voce_energy(eps_p: mat33, p: R, c: vec3):
        return c[1] * p - (c[1] - c[0]) * c[2] * (R(1.0) - wp.exp(-p / c[2]))

    return voce_energy
