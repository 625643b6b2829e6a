"""Owns the blocks of threads that move the nodes of hinges with pins in every step: one block for each coupling.

A thread has a node of the first and one of the second cluster. Moments, and what follows from them, are computed before
the forces are there; momenta, impulses and the motion of the nodes after that.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import barrier, shared_functions, slot_pools, warp_barrier
from warp_mca.kernels.nodes.cluster import Clusters
from warp_mca.kernels.nodes.coupling import Inverse
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.nodes.hinge import Ahead, Side, hinge_inverse
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.kernels.resident.node_role import Held, Nodes, gather_function, hold_node, next_velocity
from warp_mca.kernels.resident.patch_role import THREADS
from warp_mca.kernels.resident.pin_joint import (
    AHEAD,
    COLUMNS,
    INVERSE,
    MOMENTA,
    PULLED,
    SHARED,
    SIDES,
    TOTALS,
    TURNS,
    VECTORS,
    WARPS,
    Pinned,
    Row,
    carry_joint,
    find_ahead,
    find_impulses,
    find_side,
    moment_row,
    momentum_row,
    pinned_node,
    pulled,
    put_pinned,
)

MOST_PINNED = THREADS  # nodes of a cluster

Half = wp.types.vector(length=COLUMNS // 2, dtype=wp.float64)
Quarter = wp.types.vector(length=COLUMNS // 4, dtype=wp.float64)

_, exchange = shared_functions("float64")


@wp.func
def sum_in_warp(a: Row, lane: int) -> wp.float64:
    """Sum each value over the lanes of a warp; the two lanes whose bits 1 to 4 are the value's number get its sum."""
    b = Half()
    for k in range(wp.static(COLUMNS // 2)):
        mine = wp.where(lane & 16 != 0, a[wp.static(COLUMNS // 2) + k], a[k])
        b[k] = mine + exchange(wp.where(lane & 16 != 0, a[k], a[wp.static(COLUMNS // 2) + k]), 16)
    c = Quarter()
    for k in range(wp.static(COLUMNS // 4)):
        mine = wp.where(lane & 8 != 0, b[wp.static(COLUMNS // 4) + k], b[k])
        c[k] = mine + exchange(wp.where(lane & 8 != 0, b[k], b[wp.static(COLUMNS // 4) + k]), 8)
    d = wp.vec2d()
    for k in range(2):
        mine = wp.where(lane & 4 != 0, c[2 + k], c[k])
        d[k] = mine + exchange(wp.where(lane & 4 != 0, c[k], c[2 + k]), 4)
    e = wp.where(lane & 2 != 0, d[1], d[0]) + exchange(wp.where(lane & 2 != 0, d[0], d[1]), 2)
    return e + exchange(e, 1)


@wp.func
def keep_in_warp(a: Row, row: int, lane: int, pool_out: wp.array(dtype=wp.float64)):
    """Store the sums over a warp of the columns of a row."""
    total = sum_in_warp(a, lane)
    if lane & 1 == 0:
        warp = row * wp.static(WARPS) + lane // 32
        pool_out[warp * wp.static(COLUMNS) + (lane & 31) // 2] = total


@wp.func
def sum_warps(column: int, pool_out: wp.array(dtype=wp.float64)):
    """Sum a column, counted through all rows, over the warps of the block."""
    first = (column // wp.static(COLUMNS)) * wp.static(WARPS * COLUMNS) + column % wp.static(COLUMNS)
    total = wp.float64(0.0)
    for k in range(wp.static(WARPS)):
        total += pool_out[first + k * wp.static(COLUMNS)]
    pool_out[wp.static(TOTALS) + column] = total


@wp.func
def sum_moments(one: Pinned, other: Pinned, lane: int, pool_out: wp.array(dtype=wp.float64)):
    """Moments of both clusters, by a block."""
    for part in range(2):
        keep_in_warp(moment_row(one, part), part, lane, pool_out)
        keep_in_warp(moment_row(other, part), 2 + part, lane, pool_out)
    barrier()
    if lane < wp.static(MOMENTA * COLUMNS):
        sum_warps(lane, pool_out)
    barrier()


@wp.func
def sum_momenta(one: Pinned, other: Pinned, lane: int, pool_out: wp.array(dtype=wp.float64)):
    """Momenta of both clusters, by a block, for the first warp."""
    keep_in_warp(momentum_row(one, other), wp.static(MOMENTA), lane, pool_out)
    barrier()
    if lane < wp.static(COLUMNS):
        sum_warps(wp.static(MOMENTA * COLUMNS) + lane, pool_out)


@wp.func
def prepare_joint(
    j: int,
    lane: int,
    clusters: Clusters,
    turn: wp.array(dtype=wp.quatd),
    pool: wp.array(dtype=wp.float64),
    side_out: wp.array(dtype=Side),
    inverse_out: wp.array(dtype=Inverse),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Compute what the impulses need from the moments, by the first warp."""
    if lane < 32:
        warp_barrier()
        if lane < 2:
            find_side(j, lane, clusters, turn, pool, side_out, shared_out)
        warp_barrier()
        if lane == 0:
            inverse_out[0] = hinge_inverse(side_out[0].mean, side_out[1].mean, side_out[0].axis)


@wp.func
def solve_joint(
    lane: int,
    dt: wp.float64,
    rate: wp.float64,
    pool: wp.array(dtype=wp.float64),
    sides: wp.array(dtype=Side),
    inverse: wp.array(dtype=Inverse),
    ahead_out: wp.array(dtype=Ahead),
    shared_out: wp.array(dtype=wp.vec3d),
):
    """Impulses of the joint from the momenta, by the first warp, for all threads."""
    if lane < 32:
        warp_barrier()
        if lane < 2:
            find_ahead(lane, dt, pool, sides, ahead_out)
        warp_barrier()
        if lane < 2:
            find_impulses(lane, rate, sides, inverse, ahead_out, shared_out)
    barrier()


@cache
def pin_role(precision: str, turned: bool) -> Any:
    """The function that moves the nodes of one coupling in each step; `turned` as in `gather_function`."""
    vec3 = scalars(precision).vec3
    gather_held = gather_function(precision, turned)
    _, shared_pool, _ = slot_pools(precision)

    @wp.func
    def push(one: Pinned, held: Held, nodes: Nodes, force: wp.array(dtype=vec3), dt: wp.float64):
        """Velocity of a node after the free step."""
        return next_velocity(held, one.v, gather_held(held, nodes.data.more_slots, force), nodes, dt)

    @wp.func
    def move_pinned(
        j: int,
        lane: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        clusters: Clusters,
        X: wp.array(dtype=wp.vec3d),
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        count_out: wp.array(dtype=wp.int32),
        state_out: NodeState,
        impulse_out: wp.array(dtype=wp.vec3d),
        place_out: wp.array(dtype=wp.vec3d),
        orientation_out: wp.array2d(dtype=wp.quatd),
    ):
        """The work of all threads of a block. `pushers` is the number of blocks that give forces."""
        pool = wp.array(ptr=shared_pool(), shape=(SIDES,), dtype=wp.float64)
        sides = wp.array(ptr=shared_pool() + wp.uint64(wp.static(8 * SIDES)), shape=(2,), dtype=Side)
        ahead = wp.array(ptr=shared_pool() + wp.uint64(wp.static(8 * AHEAD)), shape=(2,), dtype=Ahead)
        inverse = wp.array(ptr=shared_pool() + wp.uint64(wp.static(8 * INVERSE)), shape=(1,), dtype=Inverse)
        shared = wp.array(ptr=shared_pool() + wp.uint64(wp.static(8 * SHARED)), shape=(VECTORS,), dtype=wp.vec3d)
        turn = wp.array(ptr=shared_pool() + wp.uint64(wp.static(8 * TURNS)), shape=(2,), dtype=wp.quatd)
        begin = clusters.begin[j]
        start = place_out[j]  # an explicit copy: a tuple of assignments would not make one
        one = pinned_node(begin[0] + lane, begin[1], start, clusters, nodes, X, state_out.u, state_out.v)
        other = pinned_node(begin[1] + lane, begin[2], start, clusters, nodes, X, state_out.u, state_out.v)
        held, other_held = hold_node(wp.max(one.node, 0), nodes), hold_node(wp.max(other.node, 0), nodes)
        if lane < 2:
            turn[lane] = orientation_out[j, lane]
            shared[wp.static(PULLED)] = impulse_out[begin[0]]
        rate = wp.float64(1.0) / dt
        for n in range(steps):
            sum_moments(one, other, lane, pool)
            prepare_joint(j, lane, clusters, turn, pool, sides, inverse, shared)
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            one.v = push(one, held, nodes, force, dt)
            other.v = push(other, other_held, nodes, force, dt)
            sum_momenta(one, other, lane, pool)
            solve_joint(lane, dt, rate, pool, sides, inverse, ahead, shared)
            one, other = pulled(one, 0, dt, shared), pulled(other, 1, dt, shared)
            put_pinned(one, state_out)
            put_pinned(other, state_out)
            arrive(wp.static(NODES), count_out)
            if lane < 2:  # no node waits for what follows
                carry_joint(j, lane, dt, start, sides, ahead, turn, shared, place_out)
            if one.node >= 0:
                keep_speed(one.node, one.v, state_out.speed_square)
            if other.node >= 0:
                keep_speed(other.node, other.v, state_out.speed_square)
        barrier()
        if lane == 0:
            impulse_out[begin[0]] = shared[wp.static(PULLED)]
            for side in range(2):
                orientation_out[j, side] = turn[side]

    return move_pinned
