"""Owns torques in hinges about z: of drives, and of Coulomb and viscous friction.

A torque tau that turns the outer link to greater theta is the couple -tau about z on free nodes near the hinge of that
link, and +tau on those of the link before it. With r_i the arm of node i at t(n) from the mass centre of these nodes
and S = sum m |r|^2, the forces

    f_i = couple * m_i (z x r_i) / S

have no resultant and the moment `couple`. They accelerate the nodes as a rigid body and do the work couple * omega with
the rate omega = sum m (r x v)_z / S of that body. The rate of the hinge is w = -(omega_outer - omega_inner), because
theta grows clockwise.
"""

import warp as wp

from warp_mca.kernels.hardware.block import block_sum, wait_for_block
from warp_mca.kernels.nodes.constraint import table_value
from warp_mca.kernels.nodes.slide import place_before
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.records.half_steps import add_half_steps

SOLVES = 64  # steps of Newton's method at most
PRECISION = 1e-14  # change of the rate, relative, at which the steps end


@wp.struct
class HingeLoads:
    """The loaded hinges of a model.

    Attributes:
        node: on which torques act, shape (entry_count,), int32.
        begin: first entry in `node` of the inner and the outer nodes of each hinge, and the number of all, shape
            (2 hinge_count + 1,), int32.
        friction, damping, friction_rate: tau_C [N m], c [N m s/rad], w_0 [rad/s], shape (hinge_count,), float64.
        table: first entry of each hinge's table, and the number of all, shape (hinge_count + 1,), int32.
        times, torques: of all drives [s], [N m], float64.
    """

    node: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.int32)
    friction: wp.array(dtype=wp.float64)
    damping: wp.array(dtype=wp.float64)
    friction_rate: wp.array(dtype=wp.float64)
    table: wp.array(dtype=wp.int32)
    times: wp.array(dtype=wp.float64)
    torques: wp.array(dtype=wp.float64)


@wp.func
def inverse(S: wp.float64) -> wp.float64:
    """1 / S; 0 for the ground, which has no nodes."""
    if S > wp.float64(0.0):
        return wp.float64(1.0) / S
    return wp.float64(0.0)


@wp.func
def side_motion(
    begin: int,
    end: int,
    lane: int,
    node: wp.array(dtype=wp.int32),
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    drift: wp.float64,
) -> wp.vec4d:
    """x and y of the mass centre of some nodes [m], their spin sum m (r x v)_z [kg m^2/s] and inertia S [kg m^2].

    Places are those before the nodes moved by drift v.
    """
    m = wp.float64(0.0)
    m_x = wp.float64(0.0)
    m_y = wp.float64(0.0)
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = place_before(X, u, v, i, drift)
        m += mass[i]
        m_x += mass[i] * x[0]
        m_y += mass[i] * x[1]
    total = block_sum(m)
    c_x = block_sum(m_x) * inverse(total)
    c_y = block_sum(m_y) * inverse(total)
    spin = wp.float64(0.0)
    S = wp.float64(0.0)
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = place_before(X, u, v, i, drift)
        r_x = x[0] - c_x
        r_y = x[1] - c_y
        spin += mass[i] * (r_x * v[i][1] - r_y * v[i][0])
        S += mass[i] * (r_x * r_x + r_y * r_y)
    return wp.vec4d(c_x, c_y, block_sum(spin), block_sum(S))


@wp.func
def friction_torque(
    w: wp.float64, drive: wp.float64, step: wp.float64, c: wp.float64, tau_C: wp.float64, w_0: wp.float64
) -> wp.float64:
    """tau = -c w' - tau_C tanh(w' / w_0) at the rate w' = w + step (drive + tau) at the end of the step.

    w is the rate there without the hinge's own torque, step = dt / S_outer + dt / S_inner [rad/s per N m]. Friction
    stops a hinge in a step but never turns it back, however small w_0 is (backward Euler). Newton's method from 0
    approaches |w'| from below, since tanh is concave there.
    """
    free = w + step * drive
    size = wp.abs(free)
    A = wp.float64(1.0) + step * c
    B = step * tau_C
    rate = wp.float64(0.0)
    for _ in range(SOLVES):
        sign = wp.tanh(rate / w_0)
        slope = A + (B / w_0) * (wp.float64(1.0) - sign * sign)
        change = (size - A * rate - B * sign) / slope
        rate += change
        if wp.abs(change) <= wp.float64(PRECISION) * rate:
            break
    return -wp.sign(free) * (c * rate + tau_C * wp.tanh(rate / w_0))


@wp.func
def twist(
    couple: wp.float64,
    kick: wp.float64,
    drift: wp.float64,
    motion: wp.vec4d,
    begin: int,
    end: int,
    lane: int,
    node: wp.array(dtype=wp.int32),
    X: wp.array(dtype=wp.vec3d),
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
):
    """Apply a couple about z [N m] for `kick` [s] to nodes that move on for `drift` [s]; `motion` is theirs."""
    turn = kick * couple * inverse(motion[3])
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = place_before(X, u_out, v_out, i, drift)
        change = wp.vec3d(turn * (motion[1] - x[1]), turn * (x[0] - motion[0]), wp.float64(0.0))
        u_out[i] = u_out[i] + drift * change
        v_out[i] = v_out[i] + change
        keep_speed(i, v_out[i], speed_square_out)


@wp.kernel(enable_backward=False)
def joint_torques(
    first: wp.array(dtype=wp.int32),
    loads: HingeLoads,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    kick: wp.float64,
    drift: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    spin_out: wp.array(dtype=wp.vec2d),
    work_out: wp.array(dtype=wp.vec2d),
    work_after_out: wp.array(dtype=wp.vec2d),
    clock_out: wp.array(dtype=wp.int32),
):
    """Apply torques to nodes that all other forces have advanced; a block of threads takes a scene's hinges in turn.

    The torque at t(n) works over half a step before t(n), which completes work_out [J], and over half a step after it,
    which work_after_out [J] holds for the next step; see `constraint.drive`. spin_out [kg m^2/s] keeps the spins of the
    inner and outer nodes, which are the same about their mass centre with the arms of t(n) and of t(n+1). `first` are
    the first hinge of each scene, and the number of all. Where drift is 0, drives alone take the velocities to the half
    step before the start, and no step is counted.
    """
    scene, lane = wp.tid()
    for j in range(first[scene], first[scene + 1]):
        n = clock_out[j]
        begin = loads.begin[2 * j]
        middle = loads.begin[2 * j + 1]
        end = loads.begin[2 * j + 2]
        inner = side_motion(begin, middle, lane, loads.node, X, mass, u_out, v_out, drift)
        outer = side_motion(middle, end, lane, loads.node, X, mass, u_out, v_out, drift)
        lightness = inverse(inner[3]) + inverse(outer[3])
        free = inner[2] * inverse(inner[3]) - outer[2] * inverse(outer[3])
        drive = table_value(loads.times, loads.torques, loads.table[j], loads.table[j + 1], wp.float64(n) * drift)
        friction = wp.float64(0.0)
        if drift > wp.float64(0.0):
            step = kick * lightness
            friction = friction_torque(free, drive, step, loads.damping[j], loads.friction[j], loads.friction_rate[j])
        couple = drive + friction
        twist(couple, kick, drift, inner, begin, middle, lane, loads.node, X, u_out, v_out, speed_square_out)
        twist(-couple, kick, drift, outer, middle, end, lane, loads.node, X, u_out, v_out, speed_square_out)
        if lane == 0:
            rate_before = spin_out[j][0] * inverse(inner[3]) - spin_out[j][1] * inverse(outer[3])
            rate_after = free + kick * lightness * couple
            half = wp.float64(0.5) * drift
            torques = wp.vec2d(drive, friction)
            add_half_steps(j, half * rate_before * torques, half * rate_after * torques, work_out, work_after_out)
            spin_out[j] = wp.vec2d(inner[2] + kick * couple, outer[2] - kick * couple)
            if drift > wp.float64(0.0):
                clock_out[j] = n + 1
        wait_for_block()  # the next hinge may share nodes with this one
