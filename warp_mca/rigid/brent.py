"""Owns Brent's search for a root (Algorithms for Minimization without Derivatives, chapter 4).

The arithmetic and its order are those of SciPy's `brentq`, so roots have the same bits; importing that takes 0.3 s.
"""

from __future__ import annotations

import math
from collections.abc import Callable

Point = tuple[float, float]  # where, and the value there
MOST = 100  # evaluations, as `brentq` has them


def brent_root(
    value: Callable[[float], float], low: float, high: float, ends: tuple[float, float], accuracy: float
) -> float:
    """Where a value that has opposite signs at two ends is zero.

    Args:
        value: of which the root is sought.
        low, high: the ends.
        ends: values there.
        accuracy: of the root, absolute and relative.
    """
    before, now, f_before, f_now = low, high, *ends
    if f_before == 0.0:
        return before
    other, f_other, last, step = before, f_before, 0.0, 0.0  # the root is between `now` and `other`
    for _ in range(MOST):
        if f_before != 0.0 and f_now != 0.0 and (f_before < 0.0) != (f_now < 0.0):
            other, f_other = before, f_before
            last = step = now - before
        if abs(f_other) < abs(f_now):
            before, now, other = now, other, now
            f_before, f_now, f_other = f_now, f_other, f_now
        least, half = (accuracy + accuracy * abs(now)) / 2, (other - now) / 2
        if f_now == 0.0 or abs(half) < least:
            return now
        tried = math.inf
        if abs(last) > least and abs(f_now) < abs(f_before):
            tried = _tried((before, f_before), (now, f_now), (other, f_other))
        if 2 * abs(tried) < min(abs(last), 3 * abs(half) - least):
            last, step = step, tried
        else:
            last = step = half
        before, f_before = now, f_now
        now += step if abs(step) > least else math.copysign(least, half)
        f_now = value(now)
    return now


def _tried(before: Point, now: Point, other: Point) -> float:
    """The way from `now` to where a line through two points is zero, or an inverse parabola through three."""
    (x, f), (x_now, f_now), (x_other, f_other) = before, now, other
    if x == x_other:
        return -f_now * (x_now - x) / (f_now - f)
    slope, slope_other = (f - f_now) / (x - x_now), (f_other - f_now) / (x_other - x_now)
    return -f_now * (f_other * slope_other - f * slope) / (slope_other * slope * (f_other - f))
