"""Owns the greatest values that kernels keep from step to step: strain, loss of volume, speed, contact force."""

from functools import cache
from typing import Any

import warp as wp

wp.set_module_options({"enable_backward": False})

# Rows of the extremes of elements:
STRAIN_SQUARE, VOLUME_LOSS = 0, 1


def _keep(index: str, double: bool, together: bool) -> str:
    """Source of `array[index] = max(array[index], value)` for values of at least 0.

    Floats of one sign are ordered as the integers of their bits, and those below 0 lie below all others. An atomic
    maximum whose result is not used has nothing to wait for. With `together`, threads of a GPU that run side by side
    keep the greatest of their float32 values at the index of the first one: one request in place of 32.
    """
    name = "double" if double else "float"
    keep = "atomicMax((long long*)place, __double_as_longlong(value));"
    if not double:
        keep = "atomicMax((int*)place, __float_as_int(value));"
    if not double and together:
        keep = """const unsigned active = __activemask();
    const int greatest = __reduce_max_sync(active, __float_as_int(value));
    if ((threadIdx.x & 31) == __ffs(active) - 1)
        atomicMax((int*)place, greatest);"""
    return f"""
    {name}* place = wp::address(greatest_out, {index});
#if defined(__CUDA_ARCH__)
    {keep}
#else
    *place = *place > value ? *place : value;
#endif
"""


@cache
def keep_functions(scalar: Any, together: bool = False) -> tuple[Any, Any]:
    """Functions for one scalar type.

    (Keep in greatest_out[k, e] the greatest value so far, from 0 on; the square e : e of a deviatoric strain, from the
    invariant J2 = S : S / 2 of its elastic stress S = 2 G e.) `together`: threads side by side are of one scene, and it
    does not matter which of their entries keeps the greatest value.
    """

    @wp.func_native(_keep("k, e", scalar is wp.float64, together))
    def keep_greatest(k: int, e: int, value: scalar, greatest_out: wp.array2d(dtype=scalar)): ...

    @wp.func
    def strain_square(J2: scalar, G: scalar):
        compliance = scalar(1.0) / G
        return (scalar(0.5) * compliance) * (compliance * J2)

    return keep_greatest, strain_square


@cache
def keep_speed_function(together: bool) -> Any:
    """The function that keeps the greatest square of the velocity of node i so far [m^2/s^2]; as `keep_functions`."""

    @wp.func_native(_keep("i", False, together))
    def keep_value(i: int, value: wp.float32, greatest_out: wp.array(dtype=wp.float32)): ...

    @wp.func
    def keep_speed(i: int, v: wp.vec3d, speed_square_out: wp.array(dtype=wp.float32)):
        keep_value(i, wp.float32(wp.dot(v, v)), speed_square_out)

    return keep_speed


@wp.func
def add_normal_force(k: int, F_n: wp.float64, per_newton: wp.float64, normal_force_out: wp.array(dtype=wp.int64)):
    """Add the normal force of a spring [N] to the sum of scene k, which counts `per_newton` for a newton [1/N].

    Sums of whole numbers are the same in any order.
    """
    if F_n > wp.float64(0.0):
        wp.atomic_add(normal_force_out, k, wp.int64(F_n * per_newton))


_KEEP_SUMS = """
    for (int k = i; k < normal_force_out.shape[1]; k += count) {
        long long total = 0;
        #pragma unroll 1
        for (int r = 1; r < normal_force_out.shape[0]; ++r) {
            total += *wp::address(normal_force_out, r, k);
            *wp::address(normal_force_out, r, k) = 0;
        }
        if (total > *wp::address(normal_force_out, 0, k))
            *wp::address(normal_force_out, 0, k) = total;
    }
"""


@wp.func_native(_KEEP_SUMS)
def keep_normal_force(i: int, count: int, normal_force_out: wp.array2d(dtype=wp.int64)):
    """Keep in row 0 the greatest normal force of a step of each scene, and clear the sums for the next step.

    Thread i of `count` takes every count-th scene. There is a row of sums for each range of slaves, which threads of a
    CPU compute side by side.
    """
    ...
