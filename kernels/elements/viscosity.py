"""Owns bulk viscosity: a pressure of the rate of an element's mean dilatation, which damps what cells cannot resolve.

    q = theta_dot (c1 rho c h + c2^2 rho h^2 max(-theta_dot, 0)),   theta_dot = (J - J_before) / (J dt)

joins the pressure of all points; J - 1 is the trace of the small strain. Von Neumann and Richtmyer, J. Appl. Phys. 21
(1950) 232; Landshoff, LANL report LA-1930 (1955). The rate is that of the mean gradient between two steps, so that
elements need no velocities, and work is counted as central differences do it: by the mean of q before and after.
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
UNKNOWN = -2.0  # in place of J - 1 before the first step


@cache
def viscosity_function(precision: str, finite: bool, viscous: bool = True) -> Any:
    """The function (e, J - 1, volume, dt, extreme_out) -> q [Pa], which goes with dJ; it keeps the energy taken.

    Without a time step it is that of the step before; of elements that are not viscous, `NOTHING`.
    """
    R = scalars(precision).real

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
        return q

    return viscous_pressure
