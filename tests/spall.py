"""Failure by the mean stress, as an engineer outside the package would write it."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.failure.criteria import parameter_type, point_type
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

PARAMETERS = 1


@cache
def damage(precision: str) -> Any:
    """Mean stress over that at failure, the greatest so far."""
    R, Point, row = scalars(precision).real, point_type(precision), parameter_type(precision, PARAMETERS)

    @wp.func
    def spall_damage(D: wp.float64, point: Point, c: row):
        return wp.max(D, wp.float64(wp.trace(point.stress) / (R(3.0) * c[0])))

    return spall_damage
