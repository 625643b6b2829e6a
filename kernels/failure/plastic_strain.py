"""Owns failure by the equivalent plastic strain: D = p / eps_f."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.failure.criteria import parameter_type, point_type

wp.set_module_options({"enable_backward": False})

PARAMETERS = 1


@cache
def damage(precision: str) -> Any:
    """As `kernels.failure.criteria` asks."""
    Point, row = point_type(precision), parameter_type(precision, PARAMETERS)

    @wp.func
    def plastic_strain_damage(D: wp.float64, point: Point, c: row):
        return wp.float64(point.p / (point.scale * c[0]))

    return plastic_strain_damage
