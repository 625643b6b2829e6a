"""Owns what elements store at their integration points: the plastic history, and the stress that is written out."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import HISTORY_SIZE

wp.set_module_options({"enable_backward": False})


@cache
def history_functions(precision: str, points: int = 0) -> tuple[Any, Any]:
    """Functions that read and write the plastic history of one integration point.

    Points lie one after the other. A point that the block's history has no rows for reads as NaN, so that a guard stops
    the run, and is not written. With so many `points` for certain, loops that are unrolled need not ask for the rows,
    which costs `hex8` 15 % of a plastic step on a CPU.
    """
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    size = HISTORY_SIZE

    @wp.func
    def kept(history: wp.array2d(dtype=R), point: int):
        if wp.static(points > 0):
            return point >= 0 and point < wp.static(points)
        return point >= 0 and (point + 1) * wp.static(size) <= history.shape[0]

    @wp.func
    def read_plastic_strain(history: wp.array2d(dtype=R), point: int, e: int):
        if not kept(history, point):
            return mat33(R(wp.nan)), R(wp.nan)
        k = point * wp.static(size)
        xx = history[k, e]
        yy = history[k + 1, e]
        xy = history[k + 2, e]
        yz = history[k + 3, e]
        xz = history[k + 4, e]
        return mat33(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy), history[k + 5, e]

    @wp.func
    def write_plastic_strain(history_out: wp.array2d(dtype=R), point: int, e: int, eps_p: mat33, p: R):
        if kept(history_out, point):
            k = point * wp.static(size)
            history_out[k, e] = eps_p[0, 0]
            history_out[k + 1, e] = eps_p[1, 1]
            history_out[k + 2, e] = eps_p[0, 1]
            history_out[k + 3, e] = eps_p[1, 2]
            history_out[k + 4, e] = eps_p[0, 2]
            history_out[k + 5, e] = p

    return read_plastic_strain, write_plastic_strain


@cache
def stress_function(precision: str) -> Any:
    """The function that writes a stress tensor and a plastic strain in rows xx, yy, zz, xy, yz, xz, p."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def write_stress(stress_out: wp.array2d(dtype=wp.float32), slot: int, sigma: mat33, p: R):
        stress_out[0, slot] = wp.float32(sigma[0, 0])
        stress_out[1, slot] = wp.float32(sigma[1, 1])
        stress_out[2, slot] = wp.float32(sigma[2, 2])
        stress_out[3, slot] = wp.float32(sigma[0, 1])
        stress_out[4, slot] = wp.float32(sigma[1, 2])
        stress_out[5, slot] = wp.float32(sigma[0, 2])
        stress_out[6, slot] = wp.float32(p)

    return write_stress
