"""Owns joints between clusters: nodes near a hinge, which take its impulse and give it their mean motion.

A cluster has weights s_i; with q_i = s_i m_i and arms r_i from the mean position c = sum q x / sum q, its mean motion
is

    V = sum q v / sum q,   w = I^-1 sum q r x v,   I = sum q (r^2 - r r^T),

and an impulse F with an angular impulse T about c changes the velocities of its nodes by

    dv_i = s_i (F / sum q + (I^-1 T) x r_i),

which add up to the momentum F and the angular momentum T about c: a distributing coupling, in which no node is rigidly
bound to another. The point P = c + R P_0 of the joint follows the cluster, turned by its mean rotation R, which w
carries on. After the free step, an impulse J at the common point and, of a hinge, an angular impulse across its axis
take the points and the axes of both clusters to one place and one direction at t(n+1), with the arms of t(n): SHAKE, as
in `kernels.nodes.slide`. What one linear solve leaves of order (dt w)^2 is made up for in the next step.
"""

import warp as wp

from warp_mca.kernels.nodes.base import Bases, base_velocity
from warp_mca.kernels.nodes.coupling import Response, inertia_about, joint_impulses, sum_of, turned
from warp_mca.kernels.records.extremes import keep_speed

wp.set_module_options({"enable_backward": False})

SUM_COUNT = 20  # sums over a cluster: q (1), q r (3), q r r (6), s q (1), s q r (3), s q r r (6); then momenta
TOTALS = SUM_COUNT + 6
Sums = wp.types.vector(length=TOTALS, dtype=wp.float64)


@wp.struct
class Clusters:
    """The couplings of a model, each of two clusters or of one and the ground.

    Attributes:
        begin: in `node`, the first nodes of the first and the second cluster of each, and the end of the latter, shape
            (coupling_count,), vec3i; the second is empty for the ground.
        node: those of each cluster, shape (pair_count,), int32.
        weight: s_i of each of these [-], shape (pair_count,), float64.
        place: of each pin of a rigid body at the start [m], shape (coupling_count,), vec3d; others are in the state.
        base: that each joint hangs on, -1 without, shape (coupling_count,), int32; empty where none moves or slides.
        axis: of each hinge at the start, a unit vector [-], shape (coupling_count,), vec3d.
        arm: from the mean position of the first and the second cluster to the joint at the start [m], shape
            (coupling_count, 2), vec3d.
    """

    begin: wp.array(dtype=wp.vec3i)
    node: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)
    place: wp.array(dtype=wp.vec3d)
    base: wp.array(dtype=wp.int32)
    axis: wp.array(dtype=wp.vec3d)
    arm: wp.array2d(dtype=wp.vec3d)


@wp.struct
class Mean:
    """Mean motion of a cluster, and how it answers impulses.

    Attributes:
        mass: sum q [kg]; 0 for the ground.
        centre: c, from the place where the joint was [m].
        velocity: V after the free step [m/s].
        spin: w after the free step [rad/s].
        inverse: of I [1/(kg m^2)].
        response: at the joint.
    """

    mass: wp.float64
    centre: wp.vec3d
    velocity: wp.vec3d
    spin: wp.vec3d
    inverse: wp.mat33d
    response: Response


@wp.func
def arm_before(
    i: int, place: wp.vec3d, dt: wp.float64, X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), v: wp.vec3d
) -> wp.vec3d:
    """Position of a node before the step that took it to u, from a place [m]."""
    return (X[i] - place) + (u[i] - dt * v)


@wp.func
def second_moment(total: Sums, first: int) -> wp.mat33d:
    """The symmetric matrix whose entries xx, xy, xz, yy, yz, zz a sum holds from `first` on."""
    a = total[first]
    b = total[first + 1]
    c = total[first + 2]
    d = total[first + 3]
    e = total[first + 4]
    f = total[first + 5]
    return wp.mat33d(a, b, c, b, d, e, c, e, f)


@wp.func
def inertia(moment: wp.mat33d) -> wp.mat33d:
    """tr(M) - M of the second moment M."""
    return wp.trace(moment) * wp.identity(3, dtype=wp.float64) - moment


@wp.func
def cluster_sums(
    begin: int,
    end: int,
    lane: int,
    place: wp.vec3d,
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
) -> Sums:
    """Sums over a cluster with arms from `place` at t(n): moments with q and with s q, then momenta; by a block."""
    total = Sums()
    for k in range(begin + lane, end, wp.block_dim()):
        i = clusters.node[k]
        s = clusters.weight[k]
        v_i = v[i]
        r = arm_before(i, place, dt, X, u, v_i)
        q = s * mass[i]
        for part in range(2):
            first = 10 * part
            total[first] += q
            total[first + 1] += q * r[0]
            total[first + 2] += q * r[1]
            total[first + 3] += q * r[2]
            total[first + 4] += q * r[0] * r[0]
            total[first + 5] += q * r[0] * r[1]
            total[first + 6] += q * r[0] * r[2]
            total[first + 7] += q * r[1] * r[1]
            total[first + 8] += q * r[1] * r[2]
            total[first + 9] += q * r[2] * r[2]
            q *= s
        p = s * mass[i] * v_i
        L = wp.cross(r, p)
        for c in range(3):
            total[wp.static(SUM_COUNT) + c] += p[c]
            total[wp.static(SUM_COUNT + 3) + c] += L[c]
    found = wp.tile_sum(wp.tile(total, preserve_type=True))
    return found[0]


@wp.func
def mean_motion(total: Sums, P: wp.vec3d) -> Mean:
    """Mean motion from the sums of a cluster, and its response at the point P, with the same origin [m].

    With h = sum s q r and K = sum s q (r^2 - r r^T) about c, the mean motion answers F and T about c by

        dV = (sum s q F / sum q - h x I^-1 T) / sum q,   dw = I^-1 (h x F / sum q + K I^-1 T).
    """
    Q = total[0]
    c = wp.vec3d(total[1], total[2], total[3]) / Q
    p = wp.vec3d(total[20], total[21], total[22])
    H = total[10]
    about = wp.vec3d(total[11], total[12], total[13])
    h = about - H * c
    moment = second_moment(total, 14) - wp.outer(c, about) - wp.outer(about, c) + H * wp.outer(c, c)
    found = Mean()
    found.mass = Q
    found.centre = c
    found.velocity = p / Q
    found.inverse = wp.inverse(inertia(second_moment(total, 4)) - inertia_about(Q, c))
    found.spin = found.inverse * (wp.vec3d(total[23], total[24], total[25]) - wp.cross(c, p))
    # J and T at P are F = J and T + a x J at c, with a = P - c, and P moves with V + w x a
    cross = wp.skew(P - c)
    tilt = (wp.float64(-1.0) / Q) * (wp.skew(h) * found.inverse)
    found.response.turn = found.inverse * inertia(moment) * found.inverse
    found.response.mixed = tilt - cross * found.response.turn
    straight = (H / (Q * Q)) * wp.identity(3, dtype=wp.float64)
    found.response.point = straight - cross * wp.transpose(tilt) + found.response.mixed * cross
    return found


@wp.func
def point_ahead(mean: Mean, q: wp.quatd, arm: wp.vec3d, dt: wp.float64) -> wp.vec3d:
    """Where a cluster or the ground, turned by q, carries the joint after the step, from the place where it was [m]."""
    return mean.centre + dt * mean.velocity + wp.quat_rotate(turned(q, dt * mean.spin), arm)


@wp.func
def axis_ahead(mean: Mean, q: wp.quatd, axis: wp.vec3d, dt: wp.float64) -> wp.vec3d:
    """Direction of the hinge's axis after the step, as a cluster or the ground carries it."""
    return wp.quat_rotate(turned(q, dt * mean.spin), axis)


@wp.func
def pull(
    begin: int,
    end: int,
    lane: int,
    place: wp.vec3d,
    mean: Mean,
    J: wp.vec3d,
    T: wp.vec3d,
    clusters: Clusters,
    X: wp.array(dtype=wp.vec3d),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
):
    """Give the impulse J and the angular impulse T about the mean position to the nodes."""
    straight = J / mean.mass
    turn = mean.inverse * T
    for k in range(begin + lane, end, wp.block_dim()):
        i = clusters.node[k]
        r = arm_before(i, place, dt, X, u_out, v_out[i]) - mean.centre
        change = clusters.weight[k] * (straight + wp.cross(turn, r))
        u_out[i] = u_out[i] + dt * change
        v_out[i] = v_out[i] + change
        keep_speed(i, v_out[i], speed_square_out)


@wp.func
def ground_motion(
    j: int,
    clusters: Clusters,
    bases: Bases,
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
) -> Mean:
    """Motion of the ground or the base that joint j hangs on, without the joint's impulse."""
    found = Mean()
    if clusters.base.shape[0] > 0:
        k = clusters.base[j]
        if k >= 0:
            e = bases.direction[k]
            b = base_velocity(bases, k, (wp.float64(clock[k]) + wp.float64(0.5)) * dt)
            free = carriage[k] + dt * bases.gravity[k]
            found.velocity = b + wp.dot(e, free - b) * e
            if bases.mass[k] > wp.float64(0.0):
                found.response.point = wp.outer(e, e) / bases.mass[k]
    return found


@wp.kernel(enable_backward=False)
def couple(
    clusters: Clusters,
    bases: Bases,
    X: wp.array(dtype=wp.vec3d),
    mass: wp.array(dtype=wp.float64),
    carriage: wp.array(dtype=wp.vec3d),
    clock: wp.array(dtype=wp.int32),
    dt: wp.float64,
    u_out: wp.array(dtype=wp.vec3d),
    v_out: wp.array(dtype=wp.vec3d),
    speed_square_out: wp.array(dtype=wp.float32),
    impulse_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
    orientation_out: wp.array2d(dtype=wp.quatd),
    latest_out: wp.array(dtype=wp.vec3d),
):
    """Join the clusters of each coupling, once `constraint.bound_kernel` has advanced their nodes as free ones.

    A block of threads for each coupling. impulse_out [N s] sums J at the first node of the first cluster. place_out
    follows the joint, where the ground or a base holds it exactly; orientation_out the mean rotation of both clusters.
    latest_out takes J where some base moves or slides; `bases`, `carriage` and `clock` are as in `base.move_bases`.
    """
    j, lane = wp.tid()
    begin = clusters.begin[j]
    place = place_out[j]
    q_a = orientation_out[j, 0]
    q_b = orientation_out[j, 1]
    total = cluster_sums(begin[0], begin[1], lane, place, clusters, X, mass, u_out, v_out, dt)
    P = wp.vec3d(total[1], total[2], total[3]) / total[0] + wp.quat_rotate(q_a, clusters.arm[j, 0])
    a = mean_motion(total, P)
    b = ground_motion(j, clusters, bases, carriage, clock, dt)
    if begin[2] > begin[1]:
        total = cluster_sums(begin[1], begin[2], lane, place, clusters, X, mass, u_out, v_out, dt)
        b = mean_motion(total, P)
    gap = point_ahead(a, q_a, clusters.arm[j, 0], dt) - point_ahead(b, q_b, clusters.arm[j, 1], dt)
    tilt = wp.cross(axis_ahead(b, q_b, clusters.axis[j], dt), axis_ahead(a, q_a, clusters.axis[j], dt))
    d = wp.quat_rotate(q_a, clusters.axis[j])
    held = wp.identity(3, dtype=wp.float64) - wp.outer(d, d)
    J, T = joint_impulses(sum_of(a.response, b.response), gap / dt, tilt / dt, held)
    arm_P = P - a.centre
    outer = -(wp.cross(P - b.centre, J) + T)
    # fmt: off
    pull(begin[0], begin[1], lane, place, a, J, wp.cross(arm_P, J) + T, clusters, X, dt, u_out, v_out, speed_square_out)
    if begin[2] > begin[1]:
        pull(begin[1], begin[2], lane, place, b, -J, outer, clusters, X, dt, u_out, v_out, speed_square_out)
    # fmt: on
    if lane == 0:
        if latest_out.shape[0] > 0:
            latest_out[j] = J
        spin = a.spin + wp.transpose(a.response.mixed) * J + a.response.turn * T
        v = a.velocity + wp.cross(a.spin, arm_P) + a.response.point * J + a.response.mixed * T
        orientation_out[j, 0] = turned(q_a, dt * spin)
        spin = b.spin - wp.transpose(b.response.mixed) * J - b.response.turn * T
        orientation_out[j, 1] = turned(q_b, dt * spin)
        if begin[2] == begin[1]:
            v = b.velocity - b.response.point * J
            P = wp.vec3d()
        place_out[j] = place + P + dt * v
        impulse_out[begin[0]] = impulse_out[begin[0]] + J
