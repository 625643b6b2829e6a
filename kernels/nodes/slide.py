"""Owns nodes that slide along a line of nodes of another body, a rail.

Slider x lies on the segment from a to b of the rail, at the share w of it. Velocities after the free step take the
impulse J on the slider, -(1 - w) J on a and -w J on b, across the segment as it is at t(n), so that x is on the line
through a and b again at t(n+1) (SHAKE: Ryckaert, Ciccotti and Berendsen, J. Comput. Phys. 23 (1977) 327). Momentum and
angular momentum are kept, because the impulses cancel and act at one point.
"""

import warp as wp

from warp_mca.kernels.records.extremes import keep_speed

SWEEPS = 200  # greatest number of sweeps over the sliders of a rail, which disturb each other where they share nodes
TOLERANCE = 1e-12  # distance from the rail at which sweeps end, as a share of the segment


@wp.func
def place_before(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), v: wp.array(dtype=wp.vec3d), i: int, dt: wp.float64
) -> wp.vec3d:
    """Position of a node before the step that took it to u [m]."""
    return X[i] + u[i] - dt * v[i]


@wp.func
def segment(
    node: wp.array(dtype=wp.int32),
    begin: int,
    end: int,
    x: wp.vec3d,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
) -> int:
    """Index in `node` of the first node of the rail's segment on which x lies; beyond the ends, the nearest segment."""
    along = place_before(X, u, v, node[end - 1], dt) - place_before(X, u, v, node[begin], dt)
    low = begin
    high = end - 1
    while high - low > 1:
        middle = (low + high) // 2
        if wp.dot(x - place_before(X, u, v, node[middle], dt), along) >= wp.float64(0.0):
            low = middle
        else:
            high = middle
    return low


@wp.func
def hold_on_rail(
    k: int,
    begin: int,
    end: int,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    node: wp.array(dtype=wp.int32),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    impulse_out: wp.array(dtype=wp.vec3d),
) -> wp.float64:
    """Press slider node[k] back on its rail. Returns its squared distance from it over the squared segment length."""
    i = node[k]
    x = place_before(X, u_out, v_out, i, dt)
    e = segment(node, begin, end, x, X, u_out, v_out, dt)
    a = node[e]
    b = node[e + 1]
    x_a = place_before(X, u_out, v_out, a, dt)
    line = place_before(X, u_out, v_out, b, dt) - x_a
    square = wp.dot(line, line)
    w = wp.dot(x - x_a, line) / square
    y_a = X[a] + u_out[a]
    ahead = X[b] + u_out[b] - y_a
    off = X[i] + u_out[i] - y_a
    off -= (wp.dot(off, ahead) / wp.dot(ahead, ahead)) * ahead
    off -= (wp.dot(off, line) / square) * line
    share = wp.float64(1.0) - w
    inverse = wp.float64(1.0) / mass[i] + share * share / mass[a] + w * w / mass[b]
    J = (wp.float64(-1.0) / (dt * inverse)) * off
    impulse_out[k] = impulse_out[k] + J
    v_out[i] = v_out[i] + J / mass[i]
    u_out[i] = u_out[i] + (dt / mass[i]) * J
    v_out[a] = v_out[a] - (share / mass[a]) * J
    u_out[a] = u_out[a] - (dt * share / mass[a]) * J
    v_out[b] = v_out[b] - (w / mass[b]) * J
    u_out[b] = u_out[b] - (dt * w / mass[b]) * J
    return wp.dot(off, off) / square


@wp.kernel(enable_backward=False)
def slide(
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    node: wp.array(dtype=wp.int32),
    rail: wp.array(dtype=wp.vec3i),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    impulse_out: wp.array(dtype=wp.vec3d),
):
    """Hold the sliders of each rail on it, after `constraint.bound_kernel` advanced all its nodes as free ones.

    rail: first, begin and end of each, shape (rail_count,): node[first] to node[begin - 1] slide, node[begin] to
    node[end - 1] are the rail. impulse_out [N s] sums the impulse on each slider.
    """
    r = wp.tid()
    first = rail[r][0]
    begin = rail[r][1]
    end = rail[r][2]
    for _ in range(SWEEPS):
        worst = wp.float64(0.0)
        for k in range(first, begin):
            off = hold_on_rail(k, begin, end, X, mass, node, dt, u_out, v_out, impulse_out)
            worst = wp.max(worst, off)
        if worst < wp.float64(TOLERANCE * TOLERANCE):
            break
    for k in range(first, end):
        keep_speed(node[k], v_out[node[k]], speed_square_out)
