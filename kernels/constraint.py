"""Owns what binds nodes after they were advanced freely: the revolute re-joint and prescribed velocities."""

import warp as wp

wp.set_module_options({"enable_backward": False})


@wp.func
def weighted_mean(m_a: wp.float64, a: wp.vec3d, m_b: wp.float64, b: wp.vec3d) -> wp.vec3d:
    """Mass-weighted mean of two vectors: the common velocity that keeps their momentum."""
    return (m_a * a + m_b * b) / (m_a + m_b)


@wp.kernel(enable_backward=False)
def rejoin(
    mass: wp.array(dtype=wp.float64),
    first: wp.array(dtype=wp.int32),
    second: wp.array(dtype=wp.int32),
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    impulse_out: wp.array(dtype=wp.vec3d),
):
    """Coincident pairs take their mass-weighted mean motion; a pair without a second node is held by the ground.

    impulse_out [N s] sums the impulse that the joint gave to each pair's first node.
    """
    k = wp.tid()
    i = first[k]
    j = second[k]
    u = wp.vec3d()
    v = wp.vec3d()
    if j >= 0:
        u = weighted_mean(mass[i], u_out[i], mass[j], u_out[j])
        v = weighted_mean(mass[i], v_out[i], mass[j], v_out[j])
        u_out[j] = u
        v_out[j] = v
    impulse_out[k] = impulse_out[k] + mass[i] * (v - v_out[i])
    u_out[i] = u
    v_out[i] = v


@wp.func
def table_value(times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.float64), a: int, b: int, t: wp.float64):
    """Linear interpolation in the entries [a, b) of a table, constant beyond its ends."""
    if t <= times[a]:
        return values[a]
    for k in range(a + 1, b):
        if t <= times[k]:
            s = (t - times[k - 1]) / (times[k] - times[k - 1])
            return values[k - 1] + s * (values[k] - values[k - 1])
    return values[b - 1]


@wp.kernel(enable_backward=False)
def prescribe(
    mass: wp.array(dtype=wp.float64),
    node: wp.array(dtype=wp.int32),
    axis: wp.array(dtype=wp.int32),
    table: wp.array(dtype=wp.int32),
    table_offset: wp.array(dtype=wp.int32),
    times: wp.array(dtype=wp.float64),
    values: wp.array(dtype=wp.float64),
    step: wp.array(dtype=wp.int32),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    work_out: wp.array(dtype=wp.float64),
    work_after_out: wp.array(dtype=wp.float64),
):
    """Set v(n+1/2) from a table at its own time, and sum the work that this puts in.

    The reaction at t(n) works over v(n-1/2) dt / 2 before t(n), which completes work_out [J] at t(n), and over
    v(n+1/2) dt / 2 after it, which work_after_out [J] holds for the next step.
    """
    k = wp.tid()
    i = node[k]
    c = axis[k]
    t = (wp.float64(step[0]) + wp.float64(0.5)) * dt
    target = table_value(times, values, table_offset[table[k]], table_offset[table[k] + 1], t)
    # one component alone: other threads drive the others of this node
    free = v_out[i][c]
    v_out[i][c] = target
    u_out[i][c] = u_out[i][c] + dt * (target - free)
    before = table_value(times, values, table_offset[table[k]], table_offset[table[k] + 1], t - dt)
    half_impulse = wp.float64(0.5) * mass[i] * (target - free)
    work_out[k] = work_after_out[k] + half_impulse * before
    work_after_out[k] = work_out[k] + half_impulse * target


@wp.kernel(enable_backward=False)
def advance_clock(step_out: wp.array(dtype=wp.int32)):
    """Count the step; launched with one thread, and only in scenes with tables over time."""
    step_out[0] = step_out[0] + 1
