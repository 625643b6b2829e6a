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
from warp_mca.kernels.hardware.shared_memory import ahead_functions, shared_functions, wait_for_copies

wp.set_module_options({"enable_backward": False})

# Rows of the extremes of viscous elements: J - 1 and q of the latest step, c1 rho c h and c2^2 rho h^2, energy taken.
DILATATION, VISCOUS_PRESSURE, LINEAR, QUADRATIC, TAKEN = range(3, 8)
VISCOUS_READ, VISCOUS_ROWS = 4, 8  # of these, those that an element reads; all rows of extremes
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


def _add(double: bool) -> str:
    """Source of `extreme_out[TAKEN, e] += energy`; on a GPU no thread waits for the sum."""
    name, size, word = ("double", 64, "d") if double else ("float", 32, "f")
    return f"""
    {name}* place = wp::address(extreme_out, {TAKEN}, e);
#if defined(__CUDA_ARCH__)
    asm volatile("red.global.add.f{size} [%0], %1;" :: "l"(place), "{word}"(energy) : "memory");
#else
    *place = *place + energy;
#endif
"""


@cache
def taken_function(precision: str) -> Any:
    """The function (e, energy, extreme_out) that adds to the energy taken."""
    R = scalars(precision).real

    @wp.func_native(_add(precision == "float64"))
    def take(e: int, energy: R, extreme_out: wp.array2d(dtype=R)): ...

    return take


@cache
def viscosity_function(precision: str, finite: bool, viscous: int = 1, ahead: bool = False) -> Any:
    """The function (e, J - 1, volume, dt, kept, extreme_out) -> q [Pa], which goes with dJ.

    Where the result is `kept`, the function stores it and the energy taken; otherwise the element is computed again.
    Without a time step q is that of the step before; of elements that are not viscous, `NOTHING`. Where they are
    HEATED, the pressure of the thermal strain joins it.

    Args:
        ahead: `patch_kernel` began to copy what the element of a thread reads into shared memory.
    """
    R, thermal, take = scalars(precision).real, thermal_function(precision, finite), taken_function(precision)
    pool, (_, read_ahead) = shared_functions(precision)[0], ahead_functions(precision, VISCOUS_READ)

    @wp.func
    def read(e: int, k: int, extreme: wp.array2d(dtype=R)):
        if wp.static(ahead):
            return read_ahead(pool(), k - wp.static(DILATATION))
        return extreme[k, e]

    @wp.func
    def viscous_pressure(e: int, theta: R, volume: R, dt: R, kept: bool, extreme_out: wp.array2d(dtype=R)):
        q = R(NOTHING)
        if wp.static(viscous):
            if wp.static(ahead):
                wait_for_copies()
            before = read(e, DILATATION, extreme_out)
            q_before = read(e, VISCOUS_PRESSURE, extreme_out)
            moves = dt > R(0.0)
            change = wp.where(moves and before > R(-1.5), theta - before, R(0.0))
            rate = change / wp.where(moves, dt, R(1.0))
            if wp.static(finite):
                rate = rate / (R(1.0) + theta)
            linear = read(e, LINEAR, extreme_out)
            q = rate * (linear + read(e, QUADRATIC, extreme_out) * wp.max(-rate, R(0.0)))
            q = wp.where(moves, q, q_before)
            if kept:
                extreme_out[DILATATION, e] = theta
                extreme_out[VISCOUS_PRESSURE, e] = q
                take(e, R(0.5) * (q_before + q) * change * volume, extreme_out)
        if wp.static(viscous == HEATED):
            q = q - thermal(e, theta, extreme_out)
        return q

    return viscous_pressure
