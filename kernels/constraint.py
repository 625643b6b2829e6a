"""Owns what binds a node while it is advanced: the revolute re-joint and prescribed velocities."""

import warp as wp

wp.set_module_options({"enable_backward": False})

# Role of a node: the lowest three bits are its axes at rest, then at most one of these.
LEADS = 8  # is the first of a hinge's pair, whose thread moves both
FOLLOWS = 16  # is the second
DRIVEN = 32


@wp.struct
class Bonds:
    """What binds the nodes of a model; empty arrays where nothing does.

    Attributes:
        role: of each node, shape (node_count,), uint8.
        entry: pair of a leading node, or place of a driven node among all driven ones, shape (node_count,), int32.
        second: node that each pair's first is tied to, or -1 where that is the ground, shape (pair_count,), int32.
        mass: of each node [kg], shape (node_count,), float64.
        begin, end: entries of the table of each driven node's axes, -1 where an axis is free, shape (driven_count,),
            vec3i.
        times, values: of all tables [s], [m/s], float64.
    """

    role: wp.array(dtype=wp.uint8)
    entry: wp.array(dtype=wp.int32)
    second: wp.array(dtype=wp.int32)
    mass: wp.array(dtype=wp.float64)
    begin: wp.array(dtype=wp.vec3i)
    end: wp.array(dtype=wp.vec3i)
    times: wp.array(dtype=wp.float64)
    values: wp.array(dtype=wp.float64)


@wp.func
def weighted_mean(m_a: wp.float64, a: wp.vec3d, m_b: wp.float64, b: wp.vec3d) -> wp.vec3d:
    """Mass-weighted mean of two vectors: the common velocity that keeps their momentum."""
    return (m_a * a + m_b * b) / (m_a + m_b)


@wp.func
def count_impulse(k: int, m: wp.float64, v: wp.vec3d, free: wp.vec3d, impulse_out: wp.array(dtype=wp.vec3d)):
    """impulse_out [N s] sums the impulse that the joint gave to each pair's first node, which was free to take `free`."""
    impulse_out[k] = impulse_out[k] + m * (v - free)


@wp.func
def table_value(times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.float64), a: int, b: int, t: wp.float64):
    """Linear interpolation in the entries [a, b) of a table, constant beyond its ends."""
    if b == a + 1:
        return values[a]
    if t <= times[a]:
        return values[a]
    for k in range(a + 1, b):
        if t <= times[k]:
            s = (t - times[k - 1]) / (times[k] - times[k - 1])
            return values[k - 1] + s * (values[k] - values[k - 1])
    return values[b - 1]


@wp.func
def drive(
    k: int,
    m: wp.float64,
    dt: wp.float64,
    bonds: Bonds,
    free: wp.vec3d,
    work_out: wp.array(dtype=wp.vec3d),
    work_after_out: wp.array(dtype=wp.vec3d),
    clock_out: wp.array(dtype=wp.int32),
):
    """v(n+1/2) of a node whose driven axes take theirs from a table at its own time; sums the work that this puts in.

    The reaction at t(n) works over v(n-1/2) dt / 2 before t(n), which completes work_out [J] at t(n), and over
    v(n+1/2) dt / 2 after it, which work_after_out [J] holds for the next step. Each driven node counts its own steps
    in clock_out, so that no thread waits for another.
    """
    t = (wp.float64(clock_out[k]) + wp.float64(0.5)) * dt
    clock_out[k] = clock_out[k] + 1
    begin = bonds.begin[k]
    end = bonds.end[k]
    v = free
    work = work_after_out[k]
    after = work
    for c in range(3):
        if begin[c] >= 0:
            target = table_value(bonds.times, bonds.values, begin[c], end[c], t)
            before = table_value(bonds.times, bonds.values, begin[c], end[c], t - dt)
            half_impulse = wp.float64(0.5) * m * (target - free[c])
            v[c] = target
            work[c] = work[c] + half_impulse * before
            after[c] = work[c] + half_impulse * target
    work_out[k] = work
    work_after_out[k] = after
    return v
