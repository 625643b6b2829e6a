"""Owns the block of threads that moves nodes in joints and driven ones in every step, and keeps the normal force."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.constraint import Bonds, bound_node, drive, weighted_mean
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.records.extremes import keep_normal_force, keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.kernels.resident.node_role import Nodes, gather_function, hold_node, next_velocity
from warp_mca.kernels.resident.patch_role import THREADS

KEEPERS = 32  # the last threads, which keep the greatest normal force
MOST_BOUND = THREADS - KEEPERS


@wp.struct
class Moved:
    """A node with its motion; `node` is -1 for none.

    Attributes:
        node: its number, or -1.
        mass: [kg].
        u: displacement [m].
        v: velocity [m/s].
    """

    node: wp.int32
    mass: wp.float64
    u: wp.vec3d
    v: wp.vec3d


@wp.func
def node_at(i: int, nodes: Nodes, u: wp.array(dtype=wp.vec3d), v: wp.array(dtype=wp.vec3d)):
    """Node i before a step; an empty entry for -1."""
    found = Moved()
    found.node = i
    if i >= 0:
        found.mass = nodes.data.mass[i]
        found.u = u[i]
        found.v = v[i]
    return found


@wp.func
def moved_to(moved: Moved, u: wp.vec3d, v: wp.vec3d):
    """The same node with another displacement and velocity."""
    found = Moved()
    found.node = moved.node
    found.mass = moved.mass
    found.u = u
    found.v = v
    return found


@wp.func
def put(moved: Moved, state_out: NodeState):
    """Give a node its displacement and velocity."""
    if moved.node >= 0:
        state_out.u[moved.node] = moved.u
        state_out.v[moved.node] = moved.v


@cache
def tie_function(partial: bool) -> Any:
    """The function that gives two nodes their common motion, as `constraint.bound_kernel` does."""

    @wp.func
    def tie(k: int, one: Moved, other: Moved, bonds: Bonds):
        u = wp.vec3d()
        v = wp.vec3d()
        if other.node >= 0:
            u = weighted_mean(one.mass, one.u, other.mass, other.u)
            v = weighted_mean(one.mass, one.v, other.mass, other.v)
        if wp.static(partial):
            P = bonds.tied[k]
            return (
                moved_to(one, one.u + P * (u - one.u), one.v + P * (v - one.v)),
                moved_to(other, other.u + P * (u - other.u), other.v + P * (v - other.v)),
            )
        else:
            return moved_to(one, u, v), moved_to(other, u, v)

    return tie


@cache
def bound_role(precision: str, partial: bool, turned: bool, driven: bool) -> Any:
    """The function that moves bound nodes and keeps the greatest normal force, in each of the kernel's steps.

    Without `driven`, there are pairs only.
    """
    vec3 = scalars(precision).vec3
    gather_held, tie = gather_function(precision, turned), tie_function(partial)

    @wp.func
    def move_bound(
        lane: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        bonds: Bonds,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        count_out: wp.array(dtype=wp.int32),
        normal_force_out: wp.array2d(dtype=wp.int64),
        state_out: NodeState,
        impulse_out: wp.array(dtype=wp.vec3d),
        work_out: wp.array(dtype=wp.vec3d),
        work_after_out: wp.array(dtype=wp.vec3d),
        clock_out: wp.array(dtype=wp.int32),
    ):
        """A thread for each pair and driven node."""
        pairs = bonds.first.shape[0]
        mine = lane < pairs + bonds.node.shape[0]
        i = int(-1)
        j = int(-1)
        if mine:
            i = bound_node(lane, bonds)
            if lane < pairs:
                j = bonds.second[lane]
        held = hold_node(wp.max(i, 0), nodes)
        other_held = hold_node(wp.max(j, 0), nodes)
        other_held.role = 0  # a pair keeps the axes at rest of its first node
        for n in range(steps):
            one = node_at(i, nodes, state_out.u, state_out.v)
            other = node_at(j, nodes, state_out.u, state_out.v)
            push = wp.vec3d()
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if mine:
                total = gather_held(held, nodes.data.more_slots, force)
                other_total = gather_held(other_held, nodes.data.more_slots, force)
                free = next_velocity(held, one.v, total, nodes, dt)
                one.v = free
                one.u = one.u + dt * free
                other.v = next_velocity(other_held, other.v, other_total, nodes, dt)
                other.u = other.u + dt * other.v
                if lane < pairs:
                    one, other = tie(lane, one, other, bonds)
                    push = one.mass * (one.v - free)
                elif wp.static(driven):
                    one.v = drive(lane - pairs, one.mass, dt, bonds, free, work_out, work_after_out, clock_out)
                    one.u = one.u + dt * (one.v - free)
                put(one, state_out)
                put(other, state_out)
            if lane >= wp.static(MOST_BOUND):
                keep_normal_force(lane - wp.static(MOST_BOUND), wp.static(KEEPERS), normal_force_out)
            arrive(wp.static(NODES), count_out)
            if mine:  # no node waits for what is counted
                if lane < pairs:
                    impulse_out[lane] = impulse_out[lane] + push
                keep_speed(i, one.v, state_out.speed_square)
                if j >= 0:
                    keep_speed(j, other.v, state_out.speed_square)

    return move_bound
