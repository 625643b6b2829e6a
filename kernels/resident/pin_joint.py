"""Owns how one block of threads computes a hinge with pins: nodes of its clusters, their sums, its impulses.

All threads take part in the sums; two of them solve, one for each cluster.
`kernels.nodes.hinge` has the equations.
"""

from ctypes import sizeof

import warp as wp

from warp_mca.kernels.nodes.cluster import Clusters, Mean, Sums, spin_after
from warp_mca.kernels.nodes.coupling import Inverse
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.nodes.hinge import (
    Ahead,
    Side,
    hinge_impulses,
    joint_point,
    look_ahead,
    place_after,
    quickly_turned,
    side_of,
)
from warp_mca.kernels.resident.node_role import Nodes
from warp_mca.kernels.resident.patch_role import THREADS

WARPS = THREADS // 32
COLUMNS = 16  # of a row of values that are summed together

# Rows: moments with q and with s q of the first, then of the second cluster; momenta of both
MOMENTS, MOMENTA, ROWS = (0, 2), 4, 5
# Vectors that threads share, of each cluster: what moves its nodes, and its mean position. Then of the joint: point,
# impulse, angular impulse, and sum of its impulses
STRAIGHT, TURN, CENTRE, VECTORS_OF_SIDE = range(4)
POINT, PULL, TWIST, PULLED, VECTORS = range(2 * VECTORS_OF_SIDE, 2 * VECTORS_OF_SIDE + 5)
# First entries in shared memory, in doubles: sums over warps, then over the block; structs, vectors, rotations
TOTALS = ROWS * WARPS * COLUMNS
SIDES = TOTALS + ROWS * COLUMNS
AHEAD = SIDES + 2 * sizeof(Side.ctype) // 8
INVERSE = AHEAD + 2 * sizeof(Ahead.ctype) // 8
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
        found.moving = found.weight * nodes.data.mass[i]
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
def find_side(
    j: int,
    side: int,
    clusters: Clusters,
    turn: wp.array(dtype=wp.quatd),
    pool: wp.array(dtype=wp.float64),
    side_out: wp.array(dtype=Side),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """What the impulses of coupling j need from the moments of one of its clusters."""
    P = joint_point(moments_at(wp.static(MOMENTS[0]), pool), turn[0], clusters.arm[j, 0])
    found = side_of(j, side, clusters, turn[side], moments_at(2 * side, pool), P, Mean())
    side_out[side] = found
    shared_out[wp.static(VECTORS_OF_SIDE) * side + wp.static(CENTRE)] = found.mean.centre
    if side == 0:
        shared_out[wp.static(POINT)] = P


@wp.func
def find_ahead(
    side: int,
    dt: wp.float64,
    pool: wp.array(dtype=wp.float64),
    sides: wp.array(dtype=Side),
    ahead_out: wp.array(dtype=Ahead),
):
    """Motion of a cluster after the free step."""
    ahead_out[side] = look_ahead(sides[side], vector_at(6 * side, pool), vector_at(6 * side + 3, pool), dt)


@wp.func
def find_impulses(
    side: int,
    rate: wp.float64,
    sides: wp.array(dtype=Side),
    inverse: wp.array(dtype=Inverse),
    ahead: wp.array(dtype=Ahead),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Impulses of a coupling, and the resulting motion of the nodes of one cluster; `rate` is 1 / dt [1/s]."""
    J, T = hinge_impulses(inverse[0], ahead[0], ahead[1], rate)
    if side == 0:
        shared_out[wp.static(PULL)] = J
        shared_out[wp.static(TWIST)] = T
    else:
        J = -J
        T = -T
    first = wp.static(VECTORS_OF_SIDE) * side
    arm = shared_out[wp.static(POINT)] - sides[side].mean.centre
    shared_out[first + wp.static(STRAIGHT)] = sides[side].mean.lightness * J
    shared_out[first + wp.static(TURN)] = sides[side].mean.inverse * (wp.cross(arm, J) + T)


@wp.func
def carry_joint(
    j: int,
    side: int,
    dt: wp.float64,
    start: wp.vec3d,
    sides: wp.array(dtype=Side),
    ahead: wp.array(dtype=Ahead),
    turn_out: wp.array(dtype=wp.quatd),
    shared_out: wp.array(dtype=wp.vec3d),
    place_out: wp.array(dtype=wp.vec3d),
):
    """Store the rotation of a cluster of coupling j after the step; for the first one also place and impulses."""
    J = shared_out[wp.static(PULL)]
    T = shared_out[wp.static(TWIST)]
    sign = wp.where(side == 0, wp.float64(1.0), wp.float64(-1.0))
    spin = spin_after(sides[side].mean, ahead[side].spin, sign * J, sign * T)
    turn_out[side] = quickly_turned(turn_out[side], dt * spin)
    if side == 0:
        place_out[j] = place_after(start, shared_out[wp.static(POINT)], sides[0], sides[1].mean, ahead[0], J, T, dt)
        shared_out[wp.static(PULLED)] = shared_out[wp.static(PULLED)] + J


@wp.func
def pulled(one: Pinned, side: int, dt: wp.float64, shared: wp.array(dtype=wp.vec3d)):
    """A node after the free step, which changed only its velocity, and after the impulses on its cluster."""
    r = (one.start + one.u) - shared[wp.static(VECTORS_OF_SIDE) * side + wp.static(CENTRE)]
    turn = wp.cross(shared[wp.static(VECTORS_OF_SIDE) * side + wp.static(TURN)], r)
    change = one.weight * (shared[wp.static(VECTORS_OF_SIDE) * side + wp.static(STRAIGHT)] + turn)
    found = Pinned()
    found.node = one.node
    found.weight = one.weight
    found.moving = one.moving
    found.start = one.start
    found.u = (one.u + dt * one.v) + dt * change
    found.v = one.v + change
    return found


@wp.func
def put_pinned(one: Pinned, state_out: NodeState):
    """Give a node its displacement and velocity."""
    if one.node >= 0:
        state_out.u[one.node] = one.u
        state_out.v[one.node] = one.v
