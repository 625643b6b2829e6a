"""Owns J2 plasticity with bilinear hardening, kinematic to isotropic, as a closed-form radial return.

Simo and Hughes, Computational Inelasticity (1998), box 3.2, in total form: with Prager's rule the back stress is
(2/3) (1 - beta) H eps_p, so that the plastic strain and its equivalent are all the history there is.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import THIRD, scalars

wp.set_module_options({"enable_backward": False})


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (sigma_y, H, beta) of row m of `Model.law`; sigma_y, H [Pa] times `scale`."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3

    @wp.func
    def j2_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        return vec3(scale * law[m, 2], scale * law[m, 3], law[m, 4])

    return j2_parameters


@cache
def return_map(precision: str) -> Any:
    """The function (elastic, eps_p, p, G, c) -> (S, eps_p, p) in the scalars of `precision`; c: sigma_y, H, beta.

    elastic: 2 G e of the deviatoric strain e [Pa], which callers often have already; eps_p: plastic strain [-],
    symmetric and traceless; p: equivalent plastic strain [-]; G, sigma_y, H [Pa]; beta [-]; S: deviatoric stress [Pa].
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def j2_return(elastic: mat33, eps_p: mat33, p: R, G: R, c: vec3):
        sigma_y, H, beta = c[0], c[1], c[2]
        xi = elastic - (R(2.0) * G + R(2.0) * R(THIRD) * (R(1.0) - beta) * H) * eps_p
        shear2 = xi[0, 1] * xi[0, 1] + xi[1, 2] * xi[1, 2] + xi[0, 2] * xi[0, 2]
        direct2 = xi[0, 0] * xi[0, 0] + xi[1, 1] * xi[1, 1] + xi[2, 2] * xi[2, 2]
        xi_eq2 = R(1.5) * direct2 + R(3.0) * shear2
        radius = sigma_y + beta * H * p
        xi_eq = wp.sqrt(xi_eq2)
        p_new = p + wp.max(xi_eq - radius, R(0.0)) / (R(3.0) * G + H)
        dp = p_new - p  # the increment after rounding of p: the next step corrects the rest, and errors do not add up
        eps_p = eps_p + wp.where(dp > R(0.0), R(1.5) * dp / xi_eq, R(0.0)) * xi
        return elastic - R(2.0) * G * eps_p, eps_p, p_new

    return j2_return


@cache
def plastic_energy(precision: str) -> Any:
    """The function (eps_p, p, c) -> plastic work per volume [J/m^3]: a function of state here; c: sigma_y, H, beta.

    The integral of sigma : d eps_p = sigma_y p + beta H p^2 / 2 + (1 - beta) H (eps_p : eps_p) / 3.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def j2_plastic_energy(eps_p: mat33, p: R, c: vec3):
        sigma_y, H, beta = c[0], c[1], c[2]
        stored = (R(1.0) - beta) * H * wp.ddot(eps_p, eps_p) / R(3.0)
        return sigma_y * p + R(0.5) * beta * H * p * p + stored

    return j2_plastic_energy
