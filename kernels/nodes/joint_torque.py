"""Owns torques in hinges about z: of drives, and of Coulomb and viscous friction.

A torque tau that turns the outer link to greater theta is the couple -tau about z on the nodes near the hinge of that
link, and +tau on those of the link before it. With r_i the arm of node i from the mass centre of these nodes and
S = sum m |r|^2, the forces

    f_i = couple * m_i (z x r_i) / S

have no resultant and the moment `couple`. They accelerate the nodes as a rigid body and do the work couple * omega with
the rate omega = sum m (r x v)_z / S of that body. The rate of the hinge is w = -(omega_outer - omega_inner), because
theta grows clockwise.
"""

import warp as wp

from warp_mca.kernels.nodes.constraint import table_value

wp.set_module_options({"enable_backward": False})

SOLVES = 64  # steps of Newton's method at most
PRECISION = 1e-14  # of the rate, at which they end


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
def block_sum(value: wp.float64) -> wp.float64:
    """Sum over the threads of a block, in a fixed order."""
    total = wp.tile_sum(wp.tile(value))
    return total[0]


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
) -> wp.vec4d:
    """x and y of the mass centre of some nodes [m], their spin sum m (r x v)_z [kg m^2/s] and inertia S [kg m^2]."""
    m = wp.float64(0.0)
    m_x = wp.float64(0.0)
    m_y = wp.float64(0.0)
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = X[i] + u[i]
        m += mass[i]
        m_x += mass[i] * x[0]
        m_y += mass[i] * x[1]
    total = wp.max(block_sum(m), wp.float64(1e-300))
    c_x = block_sum(m_x) / total
    c_y = block_sum(m_y) / total
    spin = wp.float64(0.0)
    S = wp.float64(0.0)
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = X[i] + u[i]
        r_x = x[0] - c_x
        r_y = x[1] - c_y
        spin += mass[i] * (r_x * v[i][1] - r_y * v[i][0])
        S += mass[i] * (r_x * r_x + r_y * r_y)
    return wp.vec4d(c_x, c_y, block_sum(spin), block_sum(S))


@wp.func
def friction_torque(
    w: wp.float64, drive: wp.float64, step: wp.float64, c: wp.float64, tau_C: wp.float64, w_0: wp.float64
) -> wp.float64:
    """tau = -c w' - tau_C tanh(w' / w_0) at the rate w' = w + step (drive + tau) after a step (backward Euler).

    `step` = dt / S_outer + dt / S_inner [rad/s per N m]. So friction stops a hinge but never turns it back, however
    small w_0 is. Newton's method from 0 approaches |w'| from below, since tanh is concave there.
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
    motion: wp.vec4d,
    begin: int,
    end: int,
    lane: int,
    node: wp.array(dtype=wp.int32),
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    load_out: wp.array(dtype=wp.vec3d),
):
    """Add the forces of a couple about z [N m] to those on some nodes; `motion` is theirs."""
    share = couple * inverse(motion[3])
    for k in range(begin + lane, end, wp.block_dim()):
        i = node[k]
        x = X[i] + u[i]
        f = share * mass[i]
        load_out[i] = load_out[i] + wp.vec3d(f * (motion[1] - x[1]), f * (x[0] - motion[0]), wp.float64(0.0))


@wp.kernel(enable_backward=False)
def joint_torques(
    first: wp.array(dtype=wp.int32),
    loads: HingeLoads,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    counts: wp.bool,
    load_out: wp.array(dtype=wp.vec3d),
    torque_out: wp.array(dtype=wp.vec2d),
    inertia_out: wp.array(dtype=wp.vec2d),
    work_out: wp.array(dtype=wp.vec2d),
    clock_out: wp.array(dtype=wp.int32),
):
    """Forces of the torques at t(n), and their work up to then. A block of threads takes the hinges of a scene in turn.

    As of driven nodes, the work of the torque at t(n) is half that at the rate from v(n-1/2) and half that from
    v(n+1/2), which the next step adds: the spin about the mass centre is the same with the arms of t(n) and t(n+1), so
    that S(n) is all that must be kept. `first`: first hinge of each scene, and the number of all. Without `counts`, no
    step is taken: only load_out is written.
    """
    scene, lane = wp.tid()
    for j in range(first[scene], first[scene + 1]):
        n = clock_out[j]
        a = loads.begin[2 * j]
        b = loads.begin[2 * j + 1]
        c = loads.begin[2 * j + 2]
        inner = side_motion(a, b, lane, loads.node, X, mass, u, v)
        outer = side_motion(b, c, lane, loads.node, X, mass, u, v)
        rate = inner[2] * inverse(inner[3]) - outer[2] * inverse(outer[3])
        t = wp.float64(n) * dt
        drive = table_value(loads.times, loads.torques, loads.table[j], loads.table[j + 1], t)
        step = dt * (inverse(inner[3]) + inverse(outer[3]))
        friction = friction_torque(rate, drive, step, loads.damping[j], loads.friction[j], loads.friction_rate[j])
        couple = drive + friction
        twist(couple, inner, a, b, lane, loads.node, X, mass, u, load_out)
        twist(-couple, outer, b, c, lane, loads.node, X, mass, u, load_out)
        if lane == 0 and counts:
            half = wp.float64(0.5) * dt
            S = inertia_out[j]
            work = work_out[j] + half * (inner[2] * inverse(S[0]) - outer[2] * inverse(S[1])) * torque_out[j]
            torque_out[j] = wp.vec2d(drive, friction)
            work_out[j] = work + half * rate * torque_out[j]
            inertia_out[j] = wp.vec2d(inner[3], outer[3])
            clock_out[j] = n + 1
