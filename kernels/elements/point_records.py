"""Owns what elements store at their integration points: the plastic history, and the stress that is written out."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import HISTORY_SIZE

wp.set_module_options({"enable_backward": False})


@cache
def history_functions(precision: str) -> tuple[Any, Any]:
    """Functions that read and write the plastic history of one integration point.

    Points g and g + 4, which differ along zeta, lie side by side: a lane of `kernels.elements.hex8_patch` takes both.
    """
    t = scalars(precision)
    R, mat33 = t.real, t.mat33

    @wp.func
    def read_plastic_strain(history: wp.array2d(dtype=R), point: int, e: int):
        k = (2 * (point & 3) + (point >> 2)) * wp.static(HISTORY_SIZE)
        xx = history[k, e]
        yy = history[k + 1, e]
        xy = history[k + 2, e]
        yz = history[k + 3, e]
        xz = history[k + 4, e]
        return mat33(xx, xy, xz, xy, yy, yz, xz, yz, -xx - yy), history[k + 5, e]

    @wp.func
    def write_plastic_strain(history_out: wp.array2d(dtype=R), point: int, e: int, eps_p: mat33, p: R):
        k = (2 * (point & 3) + (point >> 2)) * wp.static(HISTORY_SIZE)
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
