"""Owns springs and dashpots between points of bodies, or a point and the ground.

A point is the mean x = sum w X of some nodes, so that a force F on it is w F on each. With the direction n from the
first point to the second one, and the length L between them, the tension is

    T = T_s(L - L_0) + T_d(dL/dt),   w T n on the nodes of the first point, -w T n on those of the second.

A block of threads finds the force T n of a spring; then a thread for each node adds those of the springs at it. Where
points have many nodes, several blocks add up parts of them first.

T_s and T_d are piecewise linear, beyond their ends with the slope there. At t(n) the speed s is known half a step
before; what T itself adds until t(n) counts, by the lightness l of both points (1/m of a mass), and what all else adds
to it, as it was a step before:

    T (1 + dt l T_d' / 2) = T_s + T_d(s(n-1/2)) + dt T_d' a / 2,   a = (s(n-1/2) - s(n-3/2)) / dt + l T(n-1),

so that a dashpot sees the mean of the speeds before and after, as central differences want it. For a node of frequency
w and dashpots of a rate of decay b = T_d' l in all, stability asks for w^2 dt^2 + 4 b dt <= 4 at most.
"""

import warp as wp

from warp_mca.kernels.hardware.block import block_sum

LEAST = 1e-12  # share of the length at the start below which the direction is not known


@wp.struct
class Points:
    """The points of springs, or parts of them.

    Attributes:
        begin: first entry in `node` of each, and the number of all, shape (spring_count + 1,), int32.
        node: those of both points, shape (entry_count,), int32; a second point without nodes stays in place.
        weight: w of each, -w in the first point [-], shape (entry_count,), float64.
    """

    begin: wp.array(dtype=wp.int32)
    node: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)


@wp.struct
class Springs:
    """The springs of a model.

    Attributes:
        points: of each.
        between: way from the first to the second point in the reference configuration [m], shape (spring_count,),
            vec3d.
        direction: n where it stays as it is, else zero [-], shape (spring_count,), vec3d.
        rest: elongation at which no energy is stored [m], shape (spring_count,), float64.
        lowest: integral of T_s there [J], shape (spring_count,), float64.
        lightness: l [1/kg], shape (spring_count,), float64.
        tables: first entry of T_s and T_d of each in `x` and `y`, and the number of all, shape (2 spring_count + 1,),
            int32.
        x: elongations [m] and speeds [m/s], float64.
        y: tensions [N], float64.
    """

    points: Points
    between: wp.array(dtype=wp.vec3d)
    direction: wp.array(dtype=wp.vec3d)
    rest: wp.array(dtype=wp.float64)
    lowest: wp.array(dtype=wp.float64)
    lightness: wp.array(dtype=wp.float64)
    tables: wp.array(dtype=wp.int32)
    x: wp.array(dtype=wp.float64)
    y: wp.array(dtype=wp.float64)


@wp.struct
class Ends:
    """The springs at each node that has some.

    Attributes:
        node: shape (node_count,), int32.
        begin: first entry in `spring` of each, and the number of all, shape (node_count + 1,), int32.
        spring: shape (entry_count,), int32.
        weight: as in `Points` [-], shape (entry_count,), float64.
    """

    node: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.int32)
    spring: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)


@wp.struct
class SpringState:
    """What the springs keep at t(n).

    Attributes:
        energy: stored in each [J], shape (spring_count,), float64.
        taken: by its dashpot [J], shape (spring_count,), float64.
        tension: T [N], shape (spring_count,), float64.
        elongation: L - L_0 [m], shape (spring_count,), float64.
        damper: tension of its dashpot along n [N], shape (spring_count,), vec3d.
        speed: of its second point from its first one, half a step before [m/s], shape (spring_count,), vec3d.
        clock: 1 once it has taken a step [-], shape (spring_count,), int32.
    """

    energy: wp.array(dtype=wp.float64)
    taken: wp.array(dtype=wp.float64)
    tension: wp.array(dtype=wp.float64)
    elongation: wp.array(dtype=wp.float64)
    damper: wp.array(dtype=wp.vec3d)
    speed: wp.array(dtype=wp.vec3d)
    clock: wp.array(dtype=wp.int32)


@wp.func
def table_at(begin: int, end: int, x: wp.array(dtype=wp.float64), y: wp.array(dtype=wp.float64), at: wp.float64):
    """Value, slope, and integral from the first entry of a piecewise linear table; all zero without entries."""
    if end - begin < 2:
        return wp.vec3d()
    k = int(begin)
    area = wp.float64(0.0)
    while k < end - 2 and at > x[k + 1]:
        area += wp.float64(0.5) * (y[k] + y[k + 1]) * (x[k + 1] - x[k])
        k += 1
    slope = (y[k + 1] - y[k]) / (x[k + 1] - x[k])
    way = at - x[k]
    return wp.vec3d(y[k] + slope * way, slope, area + way * (y[k] + wp.float64(0.5) * slope * way))


@wp.func
def ends_of(j: int, lane: int, points: Points, values: wp.array(dtype=wp.vec3d)):
    """Value of nodes at the second point of spring j, if it has nodes, less that at the first one.

    All threads of the block call this and get it.
    """
    found = wp.vec3d()
    for e in range(points.begin[j] + lane, points.begin[j + 1], wp.block_dim()):
        found += points.weight[e] * values[points.node[e]]
    return block_sum(found)


@wp.kernel(enable_backward=False)
def sum_parts(
    parts: Points,
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
):
    """What each part of points adds to their displacement [m] and velocity [m/s], a block of threads for each."""
    p, lane = wp.tid()
    way = ends_of(p, lane, parts, u)
    speed = ends_of(p, lane, parts, v)
    if lane == 0:
        u_out[p] = way
        v_out[p] = speed


@wp.func
def count_taken(j: int, damper: wp.vec3d, speed: wp.vec3d, dt: wp.float64, state_out: SpringState):
    """Add what the dashpot took since the step before: half of both tensions times the speed between."""
    if state_out.clock[j] > 0:
        taken = wp.float64(0.5) * dt * wp.dot(state_out.damper[j] + damper, speed)
        state_out.taken[j] = state_out.taken[j] + taken
    state_out.damper[j] = damper
    state_out.speed[j] = speed
    state_out.clock[j] = 1


@wp.func
def direction_of(j: int, springs: Springs, between: wp.vec3d, length: wp.float64) -> wp.vec3d:
    """Along which spring j acts: n."""
    n = springs.direction[j]
    if wp.length_sq(n) == wp.float64(0.0):
        n = between / wp.max(wp.length(between), wp.float64(LEAST) * wp.abs(length) + wp.float64(1e-300))
    return n


@wp.kernel(enable_backward=False)
def pull_springs(
    springs: Springs,
    length: wp.array(dtype=wp.float64),
    preload: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    keeps: bool,
    force_out: wp.array(dtype=wp.vec3d),
    state_out: SpringState,
):
    """Find the force T n of each spring [N], a block of threads for each.

    `u` and `v` are those of nodes or of parts. `length` is L_0 [m] of each, `preload` its tension there beside that of
    the table [N]. With `keeps`, their state at t(n) is kept: energy, what dashpots took, tension and elongation.
    """
    j, lane = wp.tid()
    between = springs.between[j] + ends_of(j, lane, springs.points, u)
    speed = ends_of(j, lane, springs.points, v)
    if lane == 0:
        n = direction_of(j, springs, between, length[j])
        e = wp.dot(n, between) - length[j]
        stiff = table_at(springs.tables[2 * j], springs.tables[2 * j + 1], springs.x, springs.y, e)
        damp = table_at(springs.tables[2 * j + 1], springs.tables[2 * j + 2], springs.x, springs.y, wp.dot(n, speed))
        spring = preload[j] + stiff[0]
        T = spring + damp[0]
        if keeps:  # else the speed is that at t = 0
            half = wp.float64(0.5) * dt * damp[1]
            if state_out.clock[j] > 0:
                given = wp.dot(n, speed - state_out.speed[j]) / dt
                T += half * (given + springs.lightness[j] * state_out.tension[j])
            T /= wp.float64(1.0) + half * springs.lightness[j]
            state_out.energy[j] = preload[j] * (e - springs.rest[j]) + stiff[2] - springs.lowest[j]
            state_out.tension[j] = T
            state_out.elongation[j] = e
            count_taken(j, (T - spring) * n, speed, dt, state_out)
        force_out[j] = T * n


@wp.kernel(enable_backward=False)
def add_pulls(ends: Ends, force: wp.array(dtype=wp.vec3d), nodal_force_out: wp.array(dtype=wp.vec3d)):
    """Add the forces of springs [N] to their nodes, a thread for each."""
    k = wp.tid()
    i = ends.node[k]
    added = nodal_force_out[i]
    for e in range(ends.begin[k], ends.begin[k + 1]):
        added -= ends.weight[e] * force[ends.spring[e]]
    nodal_force_out[i] = added
