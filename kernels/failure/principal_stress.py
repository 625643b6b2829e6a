"""Owns failure by the greatest principal stress: D = sigma_1 / sigma_f, the greatest so far."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.failure.criteria import greatest_function, parameter_type, point_type

wp.set_module_options({"enable_backward": False})

PARAMETERS = 1


@cache
def damage(precision: str) -> Any:
    """As `kernels.failure.criteria` asks."""
    Point, row = point_type(precision), parameter_type(precision, PARAMETERS)
    greatest = greatest_function(precision)

    @wp.func
    def principal_stress_damage(D: wp.float64, point: Point, c: row):
        return wp.max(D, wp.float64(greatest(point.stress) / c[0]))

    return principal_stress_damage
