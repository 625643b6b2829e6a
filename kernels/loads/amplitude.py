"""Owns factors over time: the mean of a table over an interval, so that impulses of a load are exact."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.struct
class Tables:
    """Factors of loads over time, linear between entries and constant beyond the ends.

    Attributes:
        first: entry of each load's table at which it begins and, last, the number of all, shape (load_count + 1,),
            int32.
        times, values: of all tables [s], [-], float64.
        sums: integral from the first entry of a table to each [s], float64.
    """

    first: wp.array(dtype=wp.int32)
    times: wp.array(dtype=wp.float64)
    values: wp.array(dtype=wp.float64)
    sums: wp.array(dtype=wp.float64)


@wp.func
def piece_of(tables: Tables, load: int, t: wp.float64):
    """The last entry of a load's table that is not later than t; its first where all are."""
    low = tables.first[load]
    high = tables.first[load + 1]
    while high - low > 1:
        middle = (low + high) // 2
        if tables.times[middle] <= t:
            low = middle
        else:
            high = middle
    return low


@wp.func
def value_at(tables: Tables, load: int, t: wp.float64):
    """The factor at a time."""
    k = piece_of(tables, load, t)
    if t <= tables.times[k] or k + 1 == tables.first[load + 1]:
        return tables.values[k]
    share = (t - tables.times[k]) / (tables.times[k + 1] - tables.times[k])
    return tables.values[k] + share * (tables.values[k + 1] - tables.values[k])


@wp.func
def integral_to(tables: Tables, load: int, t: wp.float64):
    """Integral of the factor from the first time of the table to t [s]; negative before."""
    k = piece_of(tables, load, t)
    mean = wp.float64(0.5) * (tables.values[k] + value_at(tables, load, t))
    return tables.sums[k] + (t - tables.times[k]) * mean


@wp.func
def mean_value(tables: Tables, load: int, a: wp.float64, b: wp.float64):
    """Mean of the factor from a to b, a < b."""
    if tables.first[load + 1] - tables.first[load] == 1:
        return tables.values[tables.first[load]]
    if piece_of(tables, load, a) == piece_of(tables, load, b) and a >= tables.times[tables.first[load]]:
        return wp.float64(0.5) * (value_at(tables, load, a) + value_at(tables, load, b))
    return (integral_to(tables, load, b) - integral_to(tables, load, a)) / (b - a)


@wp.func
def mean_of_step(tables: Tables, load: int, step: int, dt: wp.float64, start: bool):
    """Mean over step number `step`, from half a step before t(n) to half a step after it; `start`: over [-dt/2, 0]."""
    half = wp.float64(0.5) * dt
    t = dt * wp.float64(step)
    if start:
        return mean_value(tables, load, -half, wp.float64(0.0))
    return mean_value(tables, load, t - half, t + half)
