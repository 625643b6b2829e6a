"""Owns how bound nodes are advanced: pairs that a joint ties, and nodes with prescribed velocities."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.gather import (
    Kind,
    NodeData,
    NodeState,
    acceleration_function,
    move,
    total_force_function,
)
from warp_mca.kernels.records.half_steps import add_half_steps


@wp.struct
class Bonds:
    """What binds the nodes of a model.

    Attributes:
        first, second: nodes of each tied pair, second -1 where that is the ground, shape (pair_count,), int32; first is
            -1 where the pair holds a rigid body's node.
        tied: orthogonal projector on the directions in which each pair moves as one [-], shape (pair_count,), mat33d;
            empty where all pairs are tied in all directions.
        node: driven nodes, shape (driven_count,), int32.
        begin, end: entries of the table of each driven node's axes, -1 where an axis is free, shape (driven_count,),
            vec3i.
        times, values: of all tables [s], [m/s], float64.
    """

    first: wp.array(dtype=wp.int32)
    second: wp.array(dtype=wp.int32)
    tied: wp.array(dtype=wp.mat33d)
    node: wp.array(dtype=wp.int32)
    begin: wp.array(dtype=wp.vec3i)
    end: wp.array(dtype=wp.vec3i)
    times: wp.array(dtype=wp.float64)
    values: wp.array(dtype=wp.float64)


@wp.func
def weighted_mean(m_a: wp.float64, a: wp.vec3d, m_b: wp.float64, b: wp.vec3d) -> wp.vec3d:
    """Mass-weighted mean of two vectors: the common velocity that keeps their momentum."""
    return (m_a * a + m_b * b) / (m_a + m_b)


@wp.func
def table_value(times: wp.array(dtype=wp.float64), values: wp.array(dtype=wp.float64), a: int, b: int, t: wp.float64):
    """Linear interpolation in the entries [a, b) of a table, constant beyond its ends."""
    if b == a + 1:
        return values[a]
    if t <= times[a]:
        return values[a]
    for k in range(a + 1, b):
        if t <= times[k]:
            s = (t - times[k - 1]) / (times[k] - times[k - 1])
            return values[k - 1] + s * (values[k] - values[k - 1])
    return values[b - 1]


@wp.func
def table_mean(
    times: wp.array(dtype=wp.float64),
    values: wp.array(dtype=wp.float64),
    a: int,
    b: int,
    start: wp.float64,
    end: wp.float64,
):
    """Mean of `table_value` from `start` to `end`: a velocity by which a step moves as far as the table says."""
    half = wp.float64(0.5)
    latest = start
    value = table_value(times, values, a, b, start)
    way = wp.float64(0.0)
    for k in range(a, b):
        if times[k] > latest and times[k] < end:
            way += half * (times[k] - latest) * (value + values[k])
            latest = times[k]
            value = values[k]
    last = table_value(times, values, a, b, end)
    if latest == start:  # straight over the step
        return half * (value + last)
    return (way + half * (end - latest) * (value + last)) / (end - start)


@wp.func
def drive(
    k: int,
    m: wp.float64,
    dt: wp.float64,
    bonds: Bonds,
    free: wp.vec3d,
    work_out: wp.array(dtype=wp.vec3d),
    work_after_out: wp.array(dtype=wp.vec3d),
    clock_out: wp.array(dtype=wp.int32),
):
    """v(n+1/2) of a node whose driven axes follow tables at its own time, their mean; sums the work of the drive.

    The reaction at t(n) works over v(n-1/2) dt / 2 before t(n), which completes work_out [J] at t(n), and over
    v(n+1/2) dt / 2 after it, which work_after_out [J] holds for the next step. Each node counts its own steps in
    clock_out, so that no thread waits for a common clock.
    """
    n = clock_out[k]
    t = wp.float64(n) * dt
    t_before = wp.float64(n - 1) * dt
    t_after = wp.float64(n + 1) * dt
    clock_out[k] = n + 1
    begin = bonds.begin[k]
    end = bonds.end[k]
    v = free
    work = wp.vec3d()
    work_after = wp.vec3d()
    for c in range(3):
        if begin[c] >= 0:
            target = table_mean(bonds.times, bonds.values, begin[c], end[c], t, t_after)
            before = table_mean(bonds.times, bonds.values, begin[c], end[c], t_before, t)
            half_impulse = wp.float64(0.5) * m * (target - free[c])
            v[c] = target
            work[c] = half_impulse * before
            work_after[c] = half_impulse * target
    add_half_steps(k, work, work_after, work_out, work_after_out)
    return v


@wp.func
def bound_node(k: int, bonds: Bonds):
    """First node of the k-th pair or, beyond the pairs, a driven node."""
    pairs = bonds.first.shape[0]
    i = int(-1)
    if k < pairs:
        i = bonds.first[k]
    else:
        i = bonds.node[k - pairs]
    return i


@cache
def bound_kernel(own: Kind, partial: bool = False, skips: bool = False, driven: bool = True) -> Any:
    """Kernel: a step of tied pairs, then of driven nodes; arguments as in `node.integrate_kernel`.

    Coincident pairs take their mass-weighted mean motion; a pair without a second node is held by the ground. With
    `partial`, they do so in the directions that are tied: v + P (mean - v) in place of the mean, for a projector P.
    impulse_out [N s] sums the impulse that the joint gave to each pair's first node. `skips`: some pairs hold nodes of
    rigid bodies, which `rigid_body.advance_kernel` advances. Without `driven`, there are pairs only.
    """
    vec3, Vector, Index = scalars(own.precision).vec3, kind(wp.vec3d, own.each), kind(wp.int32, own.each)
    total_force = total_force_function(own)
    acceleration, unheld = acceleration_function(own.each), acceleration_function(own.each, False)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def advance_bound(
        nodes: NodeData,
        force: wp.array(dtype=vec3),
        scene: Index,
        gravity: Vector,
        bonds: Bonds,
        dt: wp.float64,
        state_out: NodeState,
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        k = wp.tid()
        i = bound_node(k, bonds)
        if wp.static(skips) and i < 0:
            return
        m = nodes.mass[i]
        total = total_force(i, nodes.first_slots[i], nodes, force, state_out.nodal_force)
        free = state_out.v[i] + dt * acceleration(i, total, nodes.inverse_mass[i], nodes, scene, gravity)
        u_free = state_out.u[i] + dt * free
        u = wp.vec3d()
        v = wp.vec3d()
        if k < bonds.first.shape[0]:
            j = bonds.second[k]
            if j >= 0:
                total = total_force(j, nodes.first_slots[j], nodes, force, state_out.nodal_force)
                v_j = state_out.v[j] + dt * unheld(j, total, nodes.inverse_mass[j], nodes, scene, gravity)
                u_j = state_out.u[j] + dt * v_j
                u = weighted_mean(m, u_free, nodes.mass[j], u_j)
                v = weighted_mean(m, free, nodes.mass[j], v_j)
                if wp.static(partial):
                    u_j += bonds.tied[k] * (u - u_j)
                    v_j += bonds.tied[k] * (v - v_j)
                else:
                    u_j = u
                    v_j = v
                move(j, u_j, v_j, state_out)
            if wp.static(partial):
                u = u_free + bonds.tied[k] * (u - u_free)
                v = free + bonds.tied[k] * (v - free)
            impulse_out[k] = impulse_out[k] + m * (v - free)
        elif wp.static(driven):
            v = drive(k - bonds.first.shape[0], m, dt, bonds, free, work_out, work_after_out, clock_out)
            u = u_free + dt * (v - free)
        move(i, u, v, state_out)

    return begins_early(advance_bound)
