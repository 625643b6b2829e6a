"""Owns what kernels keep over all steps: greatest strain, loss of volume, speed and contact force; lost energy."""

from functools import cache
from typing import Any

import warp as wp

# Rows of the extremes of elements; the last one only where internal vectors lag behind:
STRAIN_SQUARE, VOLUME_LOSS, LAG_LOSS = 0, 1, 2

# Rows of `ElementState.peak`: records so far; greatest von Mises stress and equivalent plastic strain, each followed by
# the number of its record, from 0 on. The last two only of elements that flow.
RECORDS, VON_MISES, PLASTIC_STRAIN = 0, 1, 3


# Smaller values are left to check records, so that most elements write nothing in a step.
_FLOOR = {"strain": 1e-6, "volume": 0.02}  # e : e and 1 - J [-]


def _keep(index: str, double: bool, floor: float) -> str:
    """Source of `array[index] = max(array[index], value)` for values above `floor`, which is not below 0.

    Non-negative floats are ordered as the integers of their bits. On a GPU the atomic maximum returns nothing that a
    thread would wait for, and a predicate in place of a branch costs no registers.
    """
    size, name, suffix, number, word = (64, "double", "", "d", "l") if double else (32, "float", "f", "f", "r")
    bits = "__double_as_longlong" if double else "__float_as_int"
    return f"""
    {name}* place = wp::address(greatest_out, {index});
#if defined(__CUDA_ARCH__)
    asm volatile("{{.reg .pred p; setp.gt.f{size} p, %0, %3; @p red.max.s{size} [%1], %2;}}"
        :: "{number}"(value), "l"(place), "{word}"({bits}(value)), "{number}"({floor}{suffix}));
#else
    *place = value > {floor}{suffix} && value > *place ? value : *place;
#endif
"""


@cache
def keep_functions(scalar: Any) -> tuple[Any, Any, Any]:
    """Functions for one scalar type.

    (Keep in greatest_out[0, e] the greatest square e : e of the deviatoric strain of an element so far; in
    greatest_out[1, e] its greatest loss of volume 1 - J; e : e from the invariant J2 = S : S / 2 of its elastic stress
    S = 2 G e.)
    """

    @wp.func_native(_keep("0, e", scalar is wp.float64, _FLOOR["strain"]))
    def keep_strain(e: int, value: scalar, greatest_out: wp.array2d(dtype=scalar)): ...

    @wp.func_native(_keep("1, e", scalar is wp.float64, _FLOOR["volume"]))
    def keep_volume(e: int, value: scalar, greatest_out: wp.array2d(dtype=scalar)): ...

    @wp.func
    def strain_square(J2: scalar, G: scalar):
        compliance = scalar(1.0) / G
        return (scalar(0.5) * compliance) * (compliance * J2)

    return keep_strain, keep_volume, strain_square


@wp.func
def keep_peak(row: int, e: int, value: wp.float32, record: wp.float32, peak_out: wp.array2d(dtype=wp.float32)):
    """Keep the greatest value of an element in a row and its record in the next, without branches for `vectorised`."""
    least = peak_out[row, e]
    peak_out[row, e] = wp.max(least, value)
    peak_out[row + 1, e] = wp.where(value > least, record, peak_out[row + 1, e])


_KEEP_SPEED = """
    float* place = wp::address(greatest_out, i);
#if defined(__CUDA_ARCH__)
    if (value > *place)  // threads share an entry: few of them exceed it
        atomicMax((int*)place, __float_as_int(value));
#else
    *place = value > *place ? value : *place;
#endif
"""


@wp.func_native(_KEEP_SPEED)
def keep_value(i: int, value: wp.float32, greatest_out: wp.array(dtype=wp.float32)):
    """Keep the greatest non-negative value so far in greatest_out[i]."""
    ...


@wp.func
def keep_speed(i: int, v: wp.vec3d, speed_square_out: wp.array(dtype=wp.float32)):
    """Keep the greatest square of a velocity so far in entry i, or in the only one [m^2/s^2]."""
    keep_value(wp.min(i, speed_square_out.shape[0] - 1), wp.float32(wp.dot(v, v)), speed_square_out)


@wp.func
def add_normal_force(k: int, F_n: wp.float64, per_newton: wp.float64, normal_force_out: wp.array(dtype=wp.int64)):
    """Add the normal force of a spring [N] to the sum of scene k, which counts `per_newton` for a newton [1/N].

    Sums of integers do not depend on the order.
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

    Thread i of `count` takes every count-th scene. Each range of slaves, which CPU threads compute in parallel, has a
    row of sums.
    """
    ...
