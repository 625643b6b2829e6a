"""Owns limits of figures as a small parameter goes to zero: observed order, Richardson extrapolation, what is left.

The small parameter is the size of the cells, the time step, or the compliance of contact springs (1/penalty). With
f(h) = f0 + C h^p, three values give the order p and the limit f0 (Roache, Annu. Rev. Fluid Mech. 29, 1997; Celik et
al., J. Fluids Eng. 130, 2008):

    (f1 - f2) / (f2 - f3) = (h1^p - h2^p) / (h2^p - h3^p),    f0 = f3 + (f3 - f2) h3^p / (h2^p - h3^p)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

ORDERS = (
    0.5,
    2.0,
)  # of elements with linear shape functions [-]; steeper or flatter series are extrapolated with these
LEAST_ORDER = 0.25  # below which differences hardly shrink: no limit can be told [-]
SINGULAR = -3.0  # order of the strongest singularity that counts as one, that of strain energy near a point load [-]
SETTLING = 0.1  # share of a figure; irregular series that move by less are taken at their last value [-]
STEADY = 0.02  # share of a figure; a series that moves by less has its limit there, whatever its differences do [-]

NO_RUN = "no run has this figure"


@dataclass(frozen=True)
class Limit:
    """Limit of a series of values as its small parameter goes to zero.

    Attributes:
        value: the limit; None if there is none, or if it cannot be found.
        left: greatest error that `value` is expected to have, as a share of it [-]; None without `value`.
        order: observed order p [-]; None where fewer than three values, or irregular ones, give none.
        ratio: of the last two differences [-], below 1 in size where they shrink; None with fewer than three values,
            and where the first two are equal.
        why: the reason why there is no value, in one sentence; empty otherwise.
    """

    value: float | None
    left: float | None = None
    order: float | None = None
    ratio: float | None = None
    why: str = ""


def limit_of(sizes: Sequence[float], values: Sequence[float | None], resolution: float = 0.0) -> Limit:
    """The limit of a series from its last three values; two are extrapolated with order 1, one gives no error.

    Args:
        sizes: the small parameter, each smaller than the one before, shape (count,).
        values: of the figure for each, None where a run has none.
        resolution: to which values are known, as a contact's duration is to the output interval; in their unit.
    """
    known = [value for value in values if value is not None]
    if not known or len(known) < len(values):
        return Limit(None, why="not every run has this figure" if known else NO_RUN)
    h, f = tuple(sizes)[-3:], tuple(known)[-3:]
    if len(f) == 1 or f[-1] == 0.0:
        return Limit(f[-1])
    if len(f) == 2:
        return _extrapolated(h, f, 1.0, resolution)
    return _of_three(h, f, resolution)


def limits(
    sizes: Sequence[float], runs: Sequence[Mapping[str, float | None]], resolution: Mapping[str, float] | None = None
) -> dict[str, Limit]:
    """The limit of each figure of a series of runs; arguments as in `limit_of`, figures by name."""
    fine = resolution or {}
    return {name: limit_of(sizes, [run.get(name) for run in runs], fine.get(name, 0.0)) for name in runs[0]}


def observed_order(sizes: Sequence[float], values: Sequence[float]) -> float | None:
    """Order p with which three values approach their limit, -8 to 8 [-]; None if they oscillate or do not change.

    A series that grows without bound has a negative order, a logarithm the order zero.
    """
    first, last = values[1] - values[0], values[2] - values[1]
    if first * last <= 0.0:
        return None
    low, high = -8.0, 8.0
    for _ in range(60):  # the ratio of differences grows with p
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _ratio(sizes, middle) < first / last else (low, middle)
    return 0.5 * (low + high)


def _ratio(sizes: Sequence[float], p: float) -> float:
    """First over second difference of h^p, of ln h for p = 0."""
    if abs(p) < 1e-9:
        h1, h2, h3 = (math.log(size) for size in sizes)
    else:
        h1, h2, h3 = (size**p for size in sizes)
    return (h1 - h2) / (h2 - h3)


def _of_three(h: Sequence[float], f: Sequence[float], resolution: float) -> Limit:
    first, last = f[1] - f[0], f[2] - f[1]
    ratio = last / first if first else None
    spread = max(abs(first), abs(last))
    if spread <= max(resolution, STEADY * abs(f[-1])):
        return _steady(h, f, ratio, resolution)
    order = observed_order(h, f)
    if order is not None and order >= LEAST_ORDER:
        found = _extrapolated(h, f, min(max(order, ORDERS[0]), ORDERS[1]), resolution)
        return Limit(found.value, found.left, order, ratio)
    if ratio is not None and -0.5 <= ratio <= 0.0:  # values oscillate around a limit
        return Limit(f[-1], (abs(last) + resolution) / abs(f[-1]), None, ratio)
    irregular = order is None or order < SINGULAR  # as for coarse meshes, whose first change is small by chance
    if irregular and spread + resolution <= SETTLING * abs(f[-1]):
        return Limit(f[-1], (spread + resolution) / abs(f[-1]), None, ratio)
    moves = f"the last two are {_share(first, f)} and {_share(last, f)}"
    what = "its changes swing" if ratio is not None and ratio < 0.0 else "its changes keep one sign"
    return Limit(None, None, order, ratio, f"{what} and do not shrink as they must: {moves}")


def _steady(h: Sequence[float], f: Sequence[float], ratio: float | None, resolution: float) -> Limit:
    """Limit of a series that hardly changes: extrapolated if it shows an order, else its last value."""
    order = observed_order(h, f)
    if order is not None and order >= ORDERS[0]:
        found = _extrapolated(h, f, min(order, ORDERS[1]), resolution)
        return Limit(found.value, found.left, order, ratio)
    spread = max(f) - min(f)
    return Limit(f[-1], (spread + resolution) / abs(f[-1]), order, ratio)


def _extrapolated(h: Sequence[float], f: Sequence[float], p: float, resolution: float) -> Limit:
    """Richardson's limit of the last two values with order p; what it adds is the expected error."""
    step = (f[-1] - f[-2]) * h[-1] ** p / (h[-2] ** p - h[-1] ** p)
    value = f[-1] + step
    if value == 0.0:
        return Limit(f[-1], abs(step / f[-1]))
    return Limit(value, (abs(step) + resolution) / abs(value))


def _share(change: float, values: Sequence[float]) -> str:
    return f"{100.0 * change / abs(values[-1]):+.1f} %"
