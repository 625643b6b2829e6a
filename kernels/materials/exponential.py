"""Owns exponential and power, on a CPU without a function call, so that elements vectorise."""

import math
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.logarithm import log_function

wp.set_module_options({"enable_backward": False})

# e^y = 2^n e^r with n whole and |r| <= ln 2 / 2, where the first omitted term of the series is below rounding; ln 2 is
# split, so that n times its first part is exact.
_FLOAT = """
    float w = y < -87.0f ? -87.0f : (y > 88.0f ? 88.0f : y);
    int n = (int)(w * 1.44269504f + (w < 0 ? -0.5f : 0.5f));
    float r = (w - n * 0.693359375f) + n * 2.12194440e-4f;
    unsigned bits = (unsigned)(n + 127) << 23;
    float scale;
    __builtin_memcpy(&scale, &bits, 4);
"""
_DOUBLE = """
    double w = y < -708.0 ? -708.0 : (y > 709.0 ? 709.0 : y);
    int n = (int)(w * 1.4426950408889634 + (w < 0 ? -0.5 : 0.5));
    double r = (w - n * 0.693147180369123816490) - n * 1.90821492927058770002e-10;
    unsigned long long bits = (unsigned long long)(n + 1023) << 52;
    double scale;
    __builtin_memcpy(&scale, &bits, 8);
"""


def _source(reduced: str, suffix: str, terms: int) -> str:
    series = f"{1.0 / math.factorial(terms)!r}{suffix}"
    for k in range(terms - 1, -1, -1):
        series = f"({1.0 / math.factorial(k)!r}{suffix} + r * {series})"
    return f"\n#if defined(__CUDA_ARCH__)\n    return exp(y);\n#else{reduced}    return scale * {series};\n#endif\n"


@cache
def exp_function(precision: str) -> Any:
    """The function y -> e^y to 2 units in the last place; beyond the range of normal numbers it gives their ends."""
    R = scalars(precision).real
    source = _source(_FLOAT, "f", 7) if precision == "mixed" else _source(_DOUBLE, "", 13)

    @wp.func_native(source)
    def natural_exp(y: R) -> R: ...

    return natural_exp


@cache
def power_function(precision: str) -> Any:
    """The function (x, n) -> x^n of a positive, normal number x; 0 for x = 0."""
    R = scalars(precision).real
    ln, exp, least = log_function(precision), exp_function(precision), 1e-37 if precision == "mixed" else 1e-307

    @wp.func
    def power(x: R, n: R):
        return wp.where(x == R(0.0), R(0.0), exp(n * ln(wp.where(x < R(least), R(least), x))))

    return power
