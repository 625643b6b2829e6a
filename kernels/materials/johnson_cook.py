"""Owns the law of Johnson and Cook: (A + B p^n) (1 + C ln(rate / rate_0)) (1 - T*^m), with adiabatic heating.

Proc. 7th Int. Symp. Ballistics (1983) 541. T* is the temperature from T_room = 0 to T_melt = 1; its rise is
beta work / (rho c_p), with the share beta of the plastic work that becomes heat (Taylor and Quinney, Proc. R. Soc. A
143 (1934) 307). Below rate_0 the rate has no effect. A step takes the temperature at its start.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials import radial
from warp_mca.kernels.materials.exponential import power_function
from warp_mca.kernels.materials.logarithm import log_function

wp.set_module_options({"enable_backward": False})

HISTORY = radial.HISTORY  # of whose work the temperature is a function


@cache
def parameters_type(precision: str) -> Any:
    """A, B [Pa], n, C [-], rate_0 [1/s], m [-], T* at the start [-], its growth with the plastic work [m^3/J]."""
    return wp.types.vector(8, scalars(precision).real)


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> parameters of row m of `Model.law`, from column 3 on; stresses times `scale`."""
    R, row = scalars(precision).real, parameters_type(precision)

    @wp.func
    def johnson_cook_parameters(law: wp.array2d(dtype=R), m: int, scale: R):
        c = row()
        for i in range(8):
            c[i] = law[m, 3 + i]
        c[0] = scale * c[0]
        c[1] = scale * c[1]
        return c

    return johnson_cook_parameters


@cache
def hardening(precision: str) -> Any:
    """As `kernels.materials.radial` asks."""
    R, row, power = scalars(precision).real, parameters_type(precision), power_function(precision)

    @wp.func
    def johnson_cook_hardening(p: R, c: row):
        hard = c[1] * power(p, c[2])
        return c[0] + hard, c[2] * hard / p

    return johnson_cook_hardening


@cache
def rate_factor(precision: str) -> Any:
    """As `kernels.materials.radial` asks."""
    R, row, ln = scalars(precision).real, parameters_type(precision), log_function(precision)

    @wp.func
    def johnson_cook_rate(dp: R, dt: R, c: row):
        rate = dp / (dt * c[4])
        factor = R(1.0) + c[3] * ln(wp.max(rate, R(1.0)))
        return factor, wp.where(rate > R(1.0), c[3] / dp, R(0.0))

    return johnson_cook_rate


@cache
def heated(precision: str) -> Any:
    """The function (c, work) -> c with A and B as the heat of the plastic work [J/m^3] leaves them."""
    R, row, power = scalars(precision).real, parameters_type(precision), power_function(precision)

    @wp.func
    def heated_parameters(c: row, work: R):
        hot = wp.clamp(c[6] + c[7] * work, R(0.0), R(1.0))
        soft = R(1.0) - power(hot, c[5])
        found = c
        found[0] = soft * c[0]
        found[1] = soft * c[1]
        return found

    return heated_parameters


@cache
def flow(precision: str) -> Any:
    """The radial return; four iterations leave 1e-4 of the stress in a first step of flow, and none in the next."""
    law = parameters_type(precision), hardening(precision), rate_factor(precision)
    return radial.rated_return(precision, *law, iterations=4, heated=heated(precision))


@cache
def temperature(precision: str) -> Any:
    """The function (history, c) -> T*, which criteria of failure read."""
    R, row = scalars(precision).real, parameters_type(precision)
    rows = wp.types.vector(radial.SIZE, R)

    @wp.func
    def johnson_cook_temperature(h: rows, c: row):
        return wp.clamp(c[6] + c[7] * h[wp.static(radial.WORK)], R(0.0), R(1.0))

    return johnson_cook_temperature


@cache
def plastic_work(precision: str) -> Any:
    """Of the history."""
    return radial.kept_work(precision, parameters_type(precision))
