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

from warp_mca.kernels.hardware.block import block_sum
from warp_mca.kernels.nodes.coupling import Response, inertia_about
from warp_mca.kernels.records.extremes import keep_speed

SUM_COUNT = 20  # sums over a cluster: q (1), q r (3), q r r (6), s q (1), s q r (3), s q r r (6); the momenta follow
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
        part: parts of clusters that blocks of threads take: coupling, 0 or 1 for its first or second cluster, and in
            `node` the first node and the end, shape (part_count,), vec4i; those of a cluster follow each other.
        first_part: first parts of both clusters of each coupling, and the end of the latter, shape
            (coupling_count,), vec3i; pins of rigid bodies have no parts.
    """

    begin: wp.array(dtype=wp.vec3i)
    node: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.float64)
    place: wp.array(dtype=wp.vec3d)
    base: wp.array(dtype=wp.int32)
    axis: wp.array(dtype=wp.vec3d)
    arm: wp.array2d(dtype=wp.vec3d)
    part: wp.array(dtype=wp.vec4i)
    first_part: wp.array(dtype=wp.vec3i)


@wp.struct
class Mean:
    """Mean motion of a cluster, and its response to impulses.

    Attributes:
        mass: sum q [kg]; 0 for the ground.
        lightness: 1 / sum q [1/kg]; 0 for the ground.
        centre: c, from the place where the joint was [m].
        velocity: V after the free step [m/s].
        spin: w after the free step [rad/s].
        inverse: of I [1/(kg m^2)].
        response: at the joint.
    """

    mass: wp.float64
    lightness: wp.float64
    centre: wp.vec3d
    velocity: wp.vec3d
    spin: wp.vec3d
    inverse: wp.mat33d
    response: Response


@wp.func
def arm_before(
    i: int, place: wp.vec3d, dt: wp.float64, X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), v: wp.vec3d
) -> wp.vec3d:
    """Position of a node, relative to a place, before the step that took it to u [m]."""
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
    """A block sums over some nodes, with arms from `place` at t(n): moments with q and with s q, then momenta."""
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
    return block_sum(total)


@wp.func
def mean_response(total: Sums, P: wp.vec3d) -> Mean:
    """Mean position of a cluster from its moments, and its response at the point P; both have one origin [m].

    With h = sum s q r and K = sum s q (r^2 - r r^T) about c, the mean motion answers F and T about c by

        dV = (sum s q F / sum q - h x I^-1 T) / sum q,   dw = I^-1 (h x F / sum q + K I^-1 T).
    """
    Q = total[0]
    c = wp.vec3d(total[1], total[2], total[3]) / Q
    H = total[10]
    about = wp.vec3d(total[11], total[12], total[13])
    h = about - H * c
    moment = second_moment(total, 14) - wp.outer(c, about) - wp.outer(about, c) + H * wp.outer(c, c)
    found = Mean()
    found.mass = Q
    found.lightness = wp.float64(1.0) / Q
    found.centre = c
    found.inverse = wp.inverse(inertia(second_moment(total, 4)) - inertia_about(Q, c))
    # J and T at P are F = J and T + a x J at c, with a = P - c, and P moves with V + w x a
    cross = wp.skew(P - c)
    tilt = (wp.float64(-1.0) / Q) * (wp.skew(h) * found.inverse)
    found.response.turn = found.inverse * inertia(moment) * found.inverse
    found.response.mixed = tilt - cross * found.response.turn
    straight = (H / (Q * Q)) * wp.identity(3, dtype=wp.float64)
    found.response.point = straight - cross * wp.transpose(tilt) + found.response.mixed * cross
    return found


@wp.func
def mean_motion(total: Sums, P: wp.vec3d) -> Mean:
    """Mean motion from the sums of a cluster, and its response at P, see `mean_response`."""
    found = mean_response(total, P)
    p = wp.vec3d(total[20], total[21], total[22])
    found.velocity = p / found.mass
    found.spin = found.inverse * (wp.vec3d(total[23], total[24], total[25]) - wp.cross(found.centre, p))
    return found


@wp.func
def spin_after(mean: Mean, free: wp.vec3d, J: wp.vec3d, T: wp.vec3d) -> wp.vec3d:
    """Angular velocity [rad/s] after J and T act at the joint; `free` is the one without them."""
    return free + wp.transpose(mean.response.mixed) * J + mean.response.turn * T


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
    """Distribute the impulse J and the angular impulse T about the mean position to the nodes."""
    straight = J / mean.mass
    turn = mean.inverse * T
    for k in range(begin + lane, end, wp.block_dim()):
        i = clusters.node[k]
        r = arm_before(i, place, dt, X, u_out, v_out[i]) - mean.centre
        change = clusters.weight[k] * (straight + wp.cross(turn, r))
        u_out[i] = u_out[i] + dt * change
        v_out[i] = v_out[i] + change
        keep_speed(i, v_out[i], speed_square_out)
