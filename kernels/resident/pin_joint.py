"""Owns what a hinge with pins is for one block of threads: the nodes of its clusters, their sums, and its impulses.

Threads share sums and what follows from them; one of them solves. `kernels.nodes.cluster` has the equations.
"""

from ctypes import sizeof

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters, Mean, Sums, mean_response, mean_spin, spin_after
from warp_mca.kernels.nodes.couple import hinge_impulses, hinge_inverse, joint_point, place_after
from warp_mca.kernels.nodes.coupling import Inverse, turned
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.patch_role import THREADS

wp.set_module_options({"enable_backward": False})

WARPS = THREADS // 32
COLUMNS = 16  # of a row of values that are summed together

# Rows: moments with q and with s q of the first, then of the second cluster; momenta of both
MOMENTS, MOMENTA, ROWS = (0, 2), 4, 5
# Vectors that threads share: what moves the nodes of the first, then of the second cluster; point of the joint, its
# impulse, angular impulse, and the sum of its impulses
STRAIGHT, TURN, CENTRE, POINT, PULL, TWIST, PULLED, VECTORS = 0, 1, 2, 6, 7, 8, 9, 10
# First entries in shared memory, in doubles: sums over warps, then over the block; structs, vectors, rotations
TOTALS = ROWS * WARPS * COLUMNS
MEANS = TOTALS + ROWS * COLUMNS
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
def find_responses(
    j: int,
    clusters: Clusters,
    pool: wp.array(dtype=wp.float64),
    turn: wp.array(dtype=wp.quatd),
    mean_out: wp.array(dtype=Mean),
    inverse_out: wp.array(dtype=Inverse),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """All that the impulses of coupling j need and moments give; of the ground all is zero."""
    total = moments_at(wp.static(MOMENTS[0]), pool)
    P = joint_point(total, turn[0], clusters.arm[j, 0])
    a = mean_response(total, P)
    b = Mean()
    if clusters.begin[j][2] > clusters.begin[j][1]:
        b = mean_response(moments_at(wp.static(MOMENTS[1]), pool), P)
    mean_out[0] = a
    mean_out[1] = b
    inverse_out[0] = hinge_inverse(a, b, wp.quat_rotate(turn[0], clusters.axis[j]))
    shared_out[wp.static(POINT)] = P
    shared_out[wp.static(CENTRE)] = a.centre
    shared_out[wp.static(3 + CENTRE)] = b.centre


@wp.func
def find_impulses(
    j: int,
    clusters: Clusters,
    dt: wp.float64,
    pool: wp.array(dtype=wp.float64),
    turn: wp.array(dtype=wp.quatd),
    inverse: wp.array(dtype=Inverse),
    mean_out: wp.array(dtype=Mean),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Impulses of coupling j from the momenta, and what moves the nodes of both clusters."""
    a = mean_out[0]
    b = mean_out[1]
    a.velocity = vector_at(0, pool) / a.mass
    a.spin = mean_spin(a, vector_at(0, pool), vector_at(3, pool))
    if b.mass > wp.float64(0.0):
        b.velocity = vector_at(6, pool) / b.mass
        b.spin = mean_spin(b, vector_at(6, pool), vector_at(9, pool))
    J, T = hinge_impulses(j, clusters, inverse[0], a, b, turn[0], turn[1], dt)
    P = shared_out[wp.static(POINT)]
    shared_out[wp.static(STRAIGHT)] = J / a.mass
    shared_out[wp.static(TURN)] = a.inverse * (wp.cross(P - a.centre, J) + T)
    if b.mass > wp.float64(0.0):
        shared_out[wp.static(3 + STRAIGHT)] = -J / b.mass
        shared_out[wp.static(3 + TURN)] = -(b.inverse * (wp.cross(P - b.centre, J) + T))
    shared_out[wp.static(PULL)] = J
    shared_out[wp.static(TWIST)] = T
    mean_out[0] = a
    mean_out[1] = b


@wp.func
def carry_joint(
    j: int,
    dt: wp.float64,
    start: wp.vec3d,
    mean: wp.array(dtype=Mean),
    turn_out: wp.array(dtype=wp.quatd),
    shared_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
):
    """Place and rotations of coupling j after the step, and the sum of its impulses."""
    J = shared_out[wp.static(PULL)]
    T = shared_out[wp.static(TWIST)]
    turn_out[0] = turned(turn_out[0], dt * spin_after(mean[0], J, T))
    turn_out[1] = turned(turn_out[1], dt * spin_after(mean[1], -J, -T))
    place_out[j] = place_after(start, shared_out[wp.static(POINT)], mean[0], mean[1], J, T, dt)
    shared_out[wp.static(PULLED)] = shared_out[wp.static(PULLED)] + J


@wp.func
def pulled(one: Pinned, side: int, dt: wp.float64, shared: wp.array(dtype=wp.vec3d)):
    """A node after the free step, which has changed its velocity alone, and the impulses on its cluster."""
    r = (one.start + one.u) - shared[3 * side + wp.static(CENTRE)]
    turn = wp.cross(shared[3 * side + wp.static(TURN)], r)
    change = one.weight * (shared[3 * side + wp.static(STRAIGHT)] + turn)
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
