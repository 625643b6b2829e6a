"""Owns springs and dashpots between points of bodies, or a point and the ground.

A point is the mean x = sum w X of some nodes, so that a force F on it is w F on each. With the direction n from the
first point to the second one, and the length L between them, the tension is

    T = T_s(L - L_0) + T_d(dL/dt),   w T n on the nodes of the first point, -w T n on those of the second.

T_s and T_d are piecewise linear, beyond their ends with the slope there. At t(n) the speed is known half a step before;
what T itself adds until t(n) counts, by the lightness l of both points (1/m of a mass):

    T (1 + dt l T_d' / 2) = T_s + T_d(speed at n-1/2),

so that a dashpot between two masses sees the mean of the speeds before and after, as central differences want it.

While a bolt is tightened its springs slip: T_s stays 0, and is taken at L - L_0 less this slip ever after. Meanwhile
the preload grows as s^2 (3 - 2 s) over the share s of its rise, and the work of that on the spring is external.
"""

import warp as wp

from warp_mca.kernels.hardware.block import block_sum, wait_for_block

LEAST = 1e-12  # share of the length at the start below which the direction is not known


@wp.struct
class Springs:
    """The springs of a model.

    Attributes:
        begin: first entry in `node` of the first and the second point of each, and the number of all, shape (2
            spring_count + 1,), int32; a second point without nodes stays in place.
        node: shape (entry_count,), int32.
        weight: w of each [-], shape (entry_count,), float64.
        ground: place of second points without nodes [m], shape (spring_count,), vec3d.
        direction: n where it stays as it is, else zero [-], shape (spring_count,), vec3d.
        length: L_0 [m], shape (spring_count,), float64.
        preload: tension at L_0 beside that of the table [N], shape (spring_count,), float64.
        rest: elongation at which no energy is stored [m], shape (spring_count,), float64.
        lightness: l [1/kg], shape (spring_count,), float64.
        tables: first entry of T_s and T_d of each in `x` and `y`, and the number of all, shape (2 spring_count + 1,),
            int32.
        x: elongations [m] and speeds [m/s], float64.
        y: tensions [N], float64.
        rise: time in which the preload of one that slips grows [s]; 0 for others, shape (spring_count,), float64.
        tightens: 1 while it is [-], shape (1,), int32.
    """

    begin: wp.array(dtype=wp.int32)
    node: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)
    ground: wp.array(dtype=wp.vec3d)
    direction: wp.array(dtype=wp.vec3d)
    length: wp.array(dtype=wp.float64)
    preload: wp.array(dtype=wp.float64)
    rest: wp.array(dtype=wp.float64)
    lightness: wp.array(dtype=wp.float64)
    tables: wp.array(dtype=wp.int32)
    x: wp.array(dtype=wp.float64)
    y: wp.array(dtype=wp.float64)
    rise: wp.array(dtype=wp.float64)
    tightens: wp.array(dtype=wp.int32)


@wp.struct
class SpringState:
    """What the springs keep at t(n).

    Attributes:
        energy: stored in each [J], shape (spring_count,), float64.
        taken: by its dashpot, or given by what tightens a bolt [J], shape (spring_count,), float64.
        tension: T [N], shape (spring_count,), float64.
        elongation: L - L_0 [m], shape (spring_count,), float64.
        damper: tension of its dashpot along n [N], shape (spring_count,), vec3d.
        clock: 1 once it has taken a step [-], shape (spring_count,), int32.
        slip: elongation at which T_s is taken at 0 [m], shape (spring_count,), float64.
        pull: T n [N], shape (spring_count,), vec3d.
        along: n [-], shape (spring_count,), vec3d.
        turned: time for which it has been tightened [s], shape (spring_count,), float64.
    """

    energy: wp.array(dtype=wp.float64)
    taken: wp.array(dtype=wp.float64)
    tension: wp.array(dtype=wp.float64)
    elongation: wp.array(dtype=wp.float64)
    damper: wp.array(dtype=wp.vec3d)
    clock: wp.array(dtype=wp.int32)
    slip: wp.array(dtype=wp.float64)
    pull: wp.array(dtype=wp.vec3d)
    along: wp.array(dtype=wp.vec3d)
    turned: wp.array(dtype=wp.float64)


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
def ends_of(j: int, lane: int, springs: Springs, values: wp.array(dtype=wp.vec3d)):
    """Values of nodes at the second point of spring j, if it has nodes, less those at the first one.

    All threads of the block call this and get it.
    """
    found = wp.vec3d()
    begin = springs.begin[2 * j]
    middle = springs.begin[2 * j + 1]
    for e in range(begin + lane, springs.begin[2 * j + 2], wp.block_dim()):
        value = springs.weight[e] * values[springs.node[e]]
        if e < middle:
            value = -value
        found += value
    return block_sum(found)


@wp.func
def count_taken(j: int, damper: wp.vec3d, speed: wp.vec3d, dt: wp.float64, state_out: SpringState):
    """Add what the dashpot took since the step before: half of both tensions times the speed between."""
    if state_out.clock[j] > 0:
        taken = wp.float64(0.5) * dt * wp.dot(state_out.damper[j] + damper, speed)
        state_out.taken[j] = state_out.taken[j] + taken
    state_out.damper[j] = damper
    state_out.clock[j] = 1


@wp.func
def share_of(turned: wp.float64, rise: wp.float64) -> wp.float64:
    """Share of the preload [-]; 1 of springs that are none of a bolt."""
    if rise == wp.float64(0.0):
        return wp.float64(1.0)
    s = wp.min(turned / rise, wp.float64(1.0))
    return s * s * (wp.float64(3.0) - wp.float64(2.0) * s)


@wp.func
def keep_state(
    j: int,
    springs: Springs,
    e: wp.float64,
    slip: wp.float64,
    turned: wp.float64,
    stored: wp.float64,
    state_out: SpringState,
):
    """Keep elongation, slip and energy at t(n), with the work of a growing preload; `stored` is the integral of T_s."""
    rest = springs.rest[j]
    rise = springs.rise[j]
    share = share_of(turned, rise)
    at_rest = wp.where(rise == wp.float64(0.0), rest, wp.float64(0.0))
    lowest = table_at(springs.tables[2 * j], springs.tables[2 * j + 1], springs.x, springs.y, at_rest)
    state_out.energy[j] = share * springs.preload[j] * (e - rest) + stored - lowest[2]
    if rise > wp.float64(0.0):
        way = wp.float64(0.5) * (e + state_out.elongation[j]) - rest
        grown = (share - share_of(state_out.turned[j], rise)) * springs.preload[j]
        state_out.taken[j] = state_out.taken[j] + grown * way
    state_out.turned[j] = turned
    state_out.elongation[j] = e
    state_out.slip[j] = slip


@wp.kernel(enable_backward=False)
def pull_springs(
    first: wp.array(dtype=wp.int32),
    springs: Springs,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    keeps: bool,
    nodal_force_out: wp.array(dtype=wp.vec3d),
    state_out: SpringState,
):
    """Add the forces of springs; a block of threads takes the springs of a scene in turn, which may share nodes.

    With `keeps`, their state at t(n) is kept: energy, what dashpots took, tension and elongation.
    """
    scene, lane = wp.tid()
    for j in range(first[scene], first[scene + 1]):
        begin = springs.begin[2 * j]
        middle = springs.begin[2 * j + 1]
        end = springs.begin[2 * j + 2]
        between = ends_of(j, lane, springs, X) + ends_of(j, lane, springs, u)
        speed = ends_of(j, lane, springs, v)
        if end == middle:
            between += springs.ground[j]
        n = springs.direction[j]
        if wp.length_sq(n) == wp.float64(0.0):
            n = between / wp.max(wp.length(between), wp.float64(LEAST) * wp.abs(springs.length[j]) + wp.float64(1e-300))
        e = wp.dot(n, between) - springs.length[j]
        rate = wp.dot(n, speed)
        slip = state_out.slip[j]
        turned = state_out.turned[j]
        rise = springs.rise[j]
        if rise > wp.float64(0.0) and springs.tightens[0] > 0:
            slip = e
            if keeps:
                turned += dt
        stiff = table_at(springs.tables[2 * j], springs.tables[2 * j + 1], springs.x, springs.y, e - slip)
        damp = table_at(springs.tables[2 * j + 1], springs.tables[2 * j + 2], springs.x, springs.y, rate)
        spring = share_of(turned, rise) * springs.preload[j] + stiff[0]
        T = spring + damp[0]
        if keeps:  # else the speed is that at t = 0
            T /= wp.float64(1.0) + wp.float64(0.5) * dt * springs.lightness[j] * damp[1]
        for k in range(begin + lane, middle, wp.block_dim()):
            i = springs.node[k]
            nodal_force_out[i] = nodal_force_out[i] + springs.weight[k] * T * n
        wait_for_block()  # points may share nodes
        for k in range(middle + lane, end, wp.block_dim()):
            i = springs.node[k]
            nodal_force_out[i] = nodal_force_out[i] - springs.weight[k] * T * n
        if keeps and lane == 0:
            keep_state(j, springs, e, slip, turned, stiff[2], state_out)
            state_out.tension[j] = T
            state_out.pull[j] = T * n
            state_out.along[j] = n
            count_taken(j, (T - spring) * n, speed, dt, state_out)
        wait_for_block()  # the next spring may share nodes with this one


@wp.kernel(enable_backward=False)
def read_bolts(
    begin: wp.array(dtype=wp.int32),
    pull: wp.array(dtype=wp.vec3d),
    along: wp.array(dtype=wp.vec3d),
    axial_out: wp.array(dtype=wp.float64),
    shear_out: wp.array(dtype=wp.float64),
):
    """Axial and shear force of bolts, whose springs begin at `begin`; their mean direction is that of the shank."""
    b = wp.tid()
    force = wp.vec3d()
    axis = wp.vec3d()
    for j in range(begin[b], begin[b + 1]):
        force += pull[j]
        axis += along[j]
    axis = wp.normalize(axis)
    axial = wp.dot(force, axis)
    axial_out[b] = axial
    shear_out[b] = wp.length(force - axial * axis)
