"""Owns what a hinge with pins is for one block of threads: the nodes of its clusters, their sums, and its impulses.

Threads share sums and what follows from them; two of them solve, one for each cluster.
`kernels.nodes.cluster` has the equations.
"""

from ctypes import sizeof

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters, Mean, Sums, mean_response, spin_after
from warp_mca.kernels.nodes.couple import joint_point, place_after
from warp_mca.kernels.nodes.coupling import Inverse, joint_impulses, turned
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.patch_role import THREADS

wp.set_module_options({"enable_backward": False})

WARPS = THREADS // 32
COLUMNS = 16  # of a row of values that are summed together

# Rows: moments with q and with s q of the first, then of the second cluster; momenta of both
MOMENTS, MOMENTA, ROWS = (0, 2), 4, 5
# Vectors that threads share, of each cluster: what moves its nodes, its mean position; arm and axis of the joint on it,
# its point and axis after the free step. Then of the joint: point, impulse, angular impulse, sum of its impulses
STRAIGHT, TURN, CENTRE, ARM, AXIS, POINT_AHEAD, AXIS_AHEAD, SIDE = range(8)
POINT, PULL, TWIST, PULLED, VECTORS = range(2 * SIDE, 2 * SIDE + 5)
# First entries in shared memory, in doubles: sums over warps, then over the block, inverse masses of both clusters;
# structs, vectors, rotations
TOTALS = ROWS * WARPS * COLUMNS
LIGHTNESS = TOTALS + ROWS * COLUMNS
MEANS = LIGHTNESS + 2
INVERSE = MEANS + 2 * sizeof(Mean.ctype) // 8
SHARED = INVERSE + sizeof(Inverse.ctype) // 8
TURNS = SHARED + 3 * VECTORS

Row = wp.types.vector(length=COLUMNS, dtype=wp.float64)


@wp.struct
class Pinned:
    """A node of a cluster; -1 and no weight where a thread has none.

    Attributes:
        node: its number.
        weight: s [-].
        moving: q = s m [kg].
        start: its position at rest, from the place of the joint [m].
        u: displacement [m].
        v: velocity [m/s].
    """

    node: wp.int32
    weight: wp.float64
    moving: wp.float64
    start: wp.vec3d
    u: wp.vec3d
    v: wp.vec3d


@wp.func
def pinned_node(
    k: int,
    end: int,
    place: wp.vec3d,
    clusters: Clusters,
    nodes: Nodes,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
):
    """Node k of the clusters, if it comes before `end`."""
    found = Pinned()
    found.node = -1
    if k < end:
        i = clusters.node[k]
        found.node = i
        found.weight = clusters.weight[k]
        found.moving = found.weight * nodes.mass[i]
        found.start = X[i] - place
        found.u = u[i]
        found.v = v[i]
    return found


@wp.func
def moment_row(one: Pinned, part: int) -> Row:
    """Moments of a node in a row of columns: with q, or with s q for `part` 1; as `cluster.cluster_sums` has them."""
    r = one.start + one.u
    q = one.moving
    if part == 1:
        q *= one.weight
    a = Row()
    a[0] = q
    for c in range(3):
        a[1 + c] = q * r[c]
        a[4 + c] = q * r[0] * r[c]
    a[7] = q * r[1] * r[1]
    a[8] = q * r[1] * r[2]
    a[9] = q * r[2] * r[2]
    return a


@wp.func
def momentum_row(one: Pinned, other: Pinned) -> Row:
    """Momentum and angular momentum of both nodes, with arms of t(n), in a row of columns."""
    a = Row()
    p = one.moving * one.v
    L = wp.cross(one.start + one.u, p)
    p_b = other.moving * other.v
    L_b = wp.cross(other.start + other.u, p_b)
    for c in range(3):
        a[c] = p[c]
        a[3 + c] = L[c]
        a[6 + c] = p_b[c]
        a[9 + c] = L_b[c]
    return a


@wp.func
def moments_at(row: int, pool: wp.array(dtype=wp.float64)) -> Sums:
    """Moments of a cluster from two rows."""
    total = Sums()
    for c in range(10):
        total[c] = pool[wp.static(TOTALS) + row * wp.static(COLUMNS) + c]
        total[10 + c] = pool[wp.static(TOTALS) + (row + 1) * wp.static(COLUMNS) + c]
    return total


@wp.func
def vector_at(first: int, pool: wp.array(dtype=wp.float64)) -> wp.vec3d:
    """Three columns of the momenta."""
    at = wp.static(TOTALS + MOMENTA * COLUMNS) + first
    return wp.vec3d(pool[at], pool[at + 1], pool[at + 2])


@wp.func
def find_response(
    j: int,
    side: int,
    clusters: Clusters,
    turn: wp.array(dtype=wp.quatd),
    pool_out: wp.array(dtype=wp.float64),
    mean_out: wp.array(dtype=Mean),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """What impulses of coupling j need of one of its clusters, and moments give; of the ground all is zero."""
    P = joint_point(moments_at(wp.static(MOMENTS[0]), pool_out), turn[0], clusters.arm[j, 0])
    found = Mean()
    lightness = wp.float64(0.0)
    if clusters.begin[j][1 + side] > clusters.begin[j][side]:
        found = mean_response(moments_at(2 * side, pool_out), P)
        lightness = wp.float64(1.0) / found.mass
    mean_out[side] = found
    pool_out[wp.static(LIGHTNESS) + side] = lightness
    first = side * wp.static(SIDE)
    shared_out[first + wp.static(CENTRE)] = found.centre
    shared_out[first + wp.static(ARM)] = wp.quat_rotate(turn[side], clusters.arm[j, side])
    shared_out[first + wp.static(AXIS)] = wp.quat_rotate(turn[side], clusters.axis[j])
    if side == 0:
        shared_out[wp.static(POINT)] = P


@wp.func
def turned_by_little(r: wp.vec3d, angle: wp.vec3d) -> wp.vec3d:
    """A vector after a rotation by a small angle, by its series; the next step makes up for what is left of it."""
    a = wp.cross(angle, r)
    b = wp.cross(angle, a)
    return r + (a + (wp.float64(0.5) * b + wp.float64(1.0 / 6.0) * wp.cross(angle, b)))


@wp.func
def look_ahead(
    side: int,
    dt: wp.float64,
    pool: wp.array(dtype=wp.float64),
    mean_out: wp.array(dtype=Mean),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Mean motion of a cluster after the free step, and where it carries point and axis of the joint."""
    first = side * wp.static(SIDE)
    centre = shared_out[first + wp.static(CENTRE)]
    p = vector_at(6 * side, pool)
    V = pool[wp.static(LIGHTNESS) + side] * p
    w = mean_out[side].inverse * (vector_at(6 * side + 3, pool) - wp.cross(centre, p))
    ahead = turned_by_little(shared_out[first + wp.static(ARM)], dt * w)
    shared_out[first + wp.static(POINT_AHEAD)] = (centre + dt * V) + ahead
    shared_out[first + wp.static(AXIS_AHEAD)] = turned_by_little(shared_out[first + wp.static(AXIS)], dt * w)
    mean_out[side].velocity = V
    mean_out[side].spin = w


@wp.func
def find_impulses(
    side: int,
    rate: wp.float64,
    pool: wp.array(dtype=wp.float64),
    mean: wp.array(dtype=Mean),
    inverse: wp.array(dtype=Inverse),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Impulses of a coupling, and what moves the nodes of one of its clusters; `rate` is 1 / dt [1/s]."""
    gap = shared_out[wp.static(POINT_AHEAD)] - shared_out[wp.static(SIDE + POINT_AHEAD)]
    tilt = wp.cross(shared_out[wp.static(SIDE + AXIS_AHEAD)], shared_out[wp.static(AXIS_AHEAD)])
    J, T = joint_impulses(inverse[0], rate * gap, rate * tilt)
    if side == 0:
        shared_out[wp.static(PULL)] = J
        shared_out[wp.static(TWIST)] = T
    else:
        J = -J
        T = -T
    first = side * wp.static(SIDE)
    arm = shared_out[wp.static(POINT)] - shared_out[first + wp.static(CENTRE)]
    shared_out[first + wp.static(STRAIGHT)] = pool[wp.static(LIGHTNESS) + side] * J
    shared_out[first + wp.static(TURN)] = mean[side].inverse * (wp.cross(arm, J) + T)


@wp.func
def quickly_turned(q: wp.quatd, angle: wp.vec3d) -> wp.quatd:
    """`turned`, by series for small angles, which take no root and no quotient."""
    h = wp.float64(0.25) * wp.dot(angle, angle)
    if h > wp.float64(1e-6):
        return turned(q, angle)
    sine = wp.float64(0.5) * (wp.float64(1.0) - h * (wp.float64(1.0 / 6.0) - h * wp.float64(1.0 / 120.0)))
    cosine = wp.float64(1.0) - h * (wp.float64(0.5) - h * wp.float64(1.0 / 24.0))
    found = wp.quatd(sine * angle[0], sine * angle[1], sine * angle[2], cosine) * q
    square = found[0] * found[0] + found[1] * found[1] + found[2] * found[2] + found[3] * found[3]
    return (wp.float64(1.5) - wp.float64(0.5) * square) * found


@wp.func
def carry_joint(
    j: int,
    side: int,
    dt: wp.float64,
    start: wp.vec3d,
    mean: wp.array(dtype=Mean),
    turn_out: wp.array(dtype=wp.quatd),
    shared_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
):
    """Rotation of a cluster of coupling j after the step, and with the first one its place and sum of impulses."""
    J = shared_out[wp.static(PULL)]
    T = shared_out[wp.static(TWIST)]
    sign = wp.where(side == 0, wp.float64(1.0), wp.float64(-1.0))
    turn_out[side] = quickly_turned(turn_out[side], dt * spin_after(mean[side], sign * J, sign * T))
    if side == 0:
        place_out[j] = place_after(start, shared_out[wp.static(POINT)], mean[0], mean[1], J, T, dt)
        shared_out[wp.static(PULLED)] = shared_out[wp.static(PULLED)] + J


@wp.func
def pulled(one: Pinned, side: int, dt: wp.float64, shared: wp.array(dtype=wp.vec3d)):
    """A node after the free step, which has changed its velocity alone, and the impulses on its cluster."""
    r = (one.start + one.u) - shared[side * wp.static(SIDE) + wp.static(CENTRE)]
    turn = wp.cross(shared[side * wp.static(SIDE) + wp.static(TURN)], r)
    change = one.weight * (shared[side * wp.static(SIDE) + wp.static(STRAIGHT)] + turn)
    found = Pinned()
    found.node = one.node
    found.weight = one.weight
    found.moving = one.moving
    found.start = one.start
    found.u = (one.u + dt * one.v) + dt * change
    found.v = one.v + change
    return found


@wp.func
def put_pinned(one: Pinned, u_out: wp.array(dtype=wp.vec3d), v_out: wp.array(dtype=wp.vec3d)):
    """Give a node its displacement and velocity."""
    if one.node >= 0:
        u_out[one.node] = one.u
        v_out[one.node] = one.v
