"""Owns the natural logarithm of positive numbers, on a CPU without a function call, so that elements vectorise."""

import math
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

# y = 2^n m with m between the roots of 1/2 and 2, by the bits of y; ln m = 2 artanh s with s = (m - 1) / (m + 1), whose
# square is below 0.03, so that the first omitted term of the series is below rounding.
_FLOAT = """
    unsigned bits;
    __builtin_memcpy(&bits, &y, 4);
    int n = (int)(bits - 0x3f3504f3u) >> 23;
    bits -= (unsigned)n << 23;
    float m;
    __builtin_memcpy(&m, &bits, 4);
"""
_DOUBLE = """
    unsigned long long bits;
    __builtin_memcpy(&bits, &y, 8);
    int n = (int)((unsigned)(bits >> 32) - 0x3fe6a09eu) >> 20;
    bits -= (unsigned long long)(long long)n << 52;
    double m;
    __builtin_memcpy(&m, &bits, 8);
"""


def _source(bits: str, real: str, suffix: str, terms: int) -> str:
    series = f"{2.0 / (2 * terms + 1)!r}{suffix}"
    for k in range(terms - 1, -1, -1):
        series = f"({2.0 / (2 * k + 1)!r}{suffix} + q * {series})"
    value = f"n * {math.log(2.0)!r}{suffix} + s * {series}"
    chosen = f'y > 0 && y < __builtin_inf() ? {value} : __builtin_nan{suffix}("")'
    steps = f"{real} s = (m - 1) / (m + 1), q = s * s;\n    return {chosen};"
    return f"\n#if defined(__CUDA_ARCH__)\n    return log(y);\n#else{bits}    {steps}\n#endif\n"


@cache
def log_function(precision: str) -> Any:
    """The function y -> ln y of a positive, normal number, to 3 units in the last place; NaN for others on a CPU."""
    R = scalars(precision).real
    source = _source(_FLOAT, "float", "f", 5) if precision == "mixed" else _source(_DOUBLE, "double", "", 11)

    @wp.func_native(source)
    def natural_log(y: R) -> R: ...

    return natural_log
