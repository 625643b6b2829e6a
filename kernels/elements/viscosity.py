"""Owns bulk viscosity: a pressure of the rate of an element's mean dilatation, which damps what cells cannot resolve.

    q = theta_dot (c1 rho c h + c2^2 rho h^2 max(-theta_dot, 0)),   theta_dot = (J - J_before) / (J dt)

joins the pressure of all points; J - 1 is the trace of the small strain. Von Neumann and Richtmyer, J. Appl. Phys. 21
(1950) 232; Landshoff, LANL report LA-1930 (1955). The rate is that of the mean gradient between two steps, so that
elements need no velocities, and work is counted as central differences do it: by the mean of q before and after.

Elements of bodies with a thermal strain take its pressure here, too: with a strain e in all directions, and its
logarithm at finite strain, the energy K (ln J - 3 e)^2 / 2 gives the pressure K ln J / J - 3 K e / J, and small strain
K (tr - 3 e). No law of flow sees it, since the deviatoric strain stays what it is.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

# Rows of the extremes of viscous elements: J - 1 and q of the latest step, energy taken, c1 rho c h and c2^2 rho h^2.
DILATATION, VISCOUS_PRESSURE, TAKEN, LINEAR, QUADRATIC = range(3, 8)
VISCOUS_ROWS = 8
THERMAL = VISCOUS_ROWS  # a row behind them: 3 K e of the thermal strain e [Pa]
VISCOUS, HEATED = 1, 2  # what joins the pressure of an element, 0 nothing: viscosity, or a thermal strain besides
UNKNOWN = -2.0  # in place of J - 1 before the first step


@cache
def thermal_function(precision: str, finite: bool) -> Any:
    """The function (e, J - 1, extreme) -> what a thermal strain takes off the pressure of an element [Pa]."""
    R = scalars(precision).real

    @wp.func
    def thermal_pressure(e: int, theta: R, extreme: wp.array2d(dtype=R)):
        if wp.static(finite):
            return extreme[THERMAL, e] / (R(1.0) + theta)
        return extreme[THERMAL, e]

    return thermal_pressure


@cache
def kept_pressure_function(precision: str, viscous: int) -> Any:
    """The function (e, extreme) -> what joined the pressure in this step [Pa], as it was kept, at small strain."""
    R = scalars(precision).real

    @wp.func
    def kept_pressure(e: int, extreme: wp.array2d(dtype=R)):
        if wp.static(viscous == HEATED):
            return extreme[VISCOUS_PRESSURE, e] - extreme[THERMAL, e]
        return extreme[VISCOUS_PRESSURE, e]

    return kept_pressure


@cache
def viscosity_function(precision: str, finite: bool, viscous: int = 1) -> Any:
    """The function (e, J - 1, volume, dt, extreme_out) -> q [Pa], which goes with dJ; it keeps the energy taken.

    Without a time step it is that of the step before; of elements that are not viscous, `NOTHING`. Where they are
    HEATED, the pressure of the thermal strain joins it.
    """
    R, thermal = scalars(precision).real, thermal_function(precision, finite)

    @wp.func
    def viscous_pressure(e: int, theta: R, volume: R, dt: R, extreme_out: wp.array2d(dtype=R)):
        q = R(NOTHING)
        if wp.static(viscous):
            before = extreme_out[DILATATION, e]
            moves = dt > R(0.0)
            change = wp.where(moves and before > R(-1.5), theta - before, R(0.0))
            rate = change / wp.where(moves, dt, R(1.0))
            if wp.static(finite):
                rate = rate / (R(1.0) + theta)
            q = rate * (extreme_out[LINEAR, e] + extreme_out[QUADRATIC, e] * wp.max(-rate, R(0.0)))
            q = wp.where(moves, q, extreme_out[VISCOUS_PRESSURE, e])
            work = R(0.5) * (extreme_out[VISCOUS_PRESSURE, e] + q) * change * volume
            extreme_out[DILATATION, e] = theta
            extreme_out[VISCOUS_PRESSURE, e] = q
            extreme_out[TAKEN, e] = extreme_out[TAKEN, e] + work
        if wp.static(viscous == HEATED):
            q = q - thermal(e, theta, extreme_out)
        return q

    return viscous_pressure
