"""Owns the damage of Johnson and Cook, Eng. Fract. Mech. 21 (1985) 31: D = sum of dp / eps_f.

eps_f = (D1 + D2 exp(D3 eta)) (1 + D4 ln(rate / rate_0)) (1 + D5 T*), with the mean stress over the von Mises stress,
eta, 1.5 at most. A strain at failure below the seventh parameter counts as this.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.failure.criteria import parameter_type, point_type
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

PARAMETERS = 7
HIGHEST = 1.5  # triaxiality [-]


@cache
def damage(precision: str) -> Any:
    """As `kernels.failure.criteria` asks."""
    R, Point, row = scalars(precision).real, point_type(precision), parameter_type(precision, PARAMETERS)

    @wp.func
    def johnson_cook_damage(D: wp.float64, point: Point, c: row):
        mean = wp.trace(point.stress) / R(3.0)
        S = point.stress
        for i in range(3):
            S[i, i] = S[i, i] - mean
        q = wp.sqrt(R(1.5) * wp.ddot(S, S))
        found = D
        if point.dp > R(0.0) and q > R(0.0):
            eta = wp.min(mean / q, R(HIGHEST))
            strain = c[0] + c[1] * wp.exp(c[2] * eta)
            strain *= R(1.0) + c[3] * wp.log(wp.max(point.rate / c[5], R(1.0)))
            strain *= R(1.0) + c[4] * point.temperature
            found = D + wp.float64(point.dp / (point.scale * wp.max(strain, c[6])))
        return found

    return johnson_cook_damage
