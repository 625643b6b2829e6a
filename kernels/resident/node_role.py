"""Owns the blocks of threads that move nodes in every step: free ones, those of master faces, and bound ones.

Values that do not change from step to step are read before the forces are there.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.gather import TOUCHABLE, NodeData, NodeState, hold
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for


@wp.struct
class Nodes:
    """What moves the nodes of a model.

    Attributes:
        data: of all nodes.
        free: nodes that neither belong to a master nor are bound, shape (free_count,), int32.
        gravity: [m/s^2].
        weight: acceleration of each node by its weight [m/s^2], shape (node_count,), vec3d; empty where it is gravity.
    """

    data: NodeData
    free: wp.array(dtype=wp.int32)
    gravity: wp.vec3d
    weight: wp.array(dtype=wp.vec3d)


@wp.struct
class Held:
    """What a thread knows about a node before the forces are there.

    Attributes:
        node: its number.
        role: as in `Nodes`.
        inverse: of its mass [1/kg].
        turn: rotation of its floating frame.
        pair: its first slots.
        row0, row1, row2: rows of more slots, -1 where there is none.
        row: first row of further slots after those.
        end: end of those rows.
    """

    node: wp.int32
    role: wp.int32
    inverse: wp.float64
    turn: wp.quatd
    pair: wp.vec2i
    row0: wp.vec4i
    row1: wp.vec4i
    row2: wp.vec4i
    row: wp.int32
    end: wp.int32


@wp.func
def hold_node(i: int, nodes: Nodes):
    """Read what is known about node i before the forces are there."""
    held = Held()
    held.node = i
    if nodes.data.role.shape[0] > 0:
        held.role = int(nodes.data.role[i])
    held.inverse = nodes.data.inverse_mass[i]
    if nodes.data.frames.of_node.shape[0] > 0:
        held.turn = nodes.data.frames.rotation[nodes.data.frames.of_node[i]]
    held.pair = nodes.data.first_slots[i]
    none = wp.vec4i(-1, -1, -1, 0)
    held.row0 = none
    held.row1 = none
    held.row2 = none
    held.row = -2 - held.pair[1]
    held.end = held.row
    if held.row >= 0:
        held.row0 = nodes.data.more_slots[held.row]
        held.end = held.row + held.row0[3]
        if held.row + 1 < held.end:
            held.row1 = nodes.data.more_slots[held.row + 1]
        if held.row + 2 < held.end:
            held.row2 = nodes.data.more_slots[held.row + 2]
        held.row += 3
    return held


@wp.func
def next_velocity(held: Held, v: wp.vec3d, total: wp.vec3d, nodes: Nodes, dt: wp.float64):
    """Velocity after the step, as `kernels.nodes.node.integrate_kernel` computes it [m/s]."""
    gravity = nodes.gravity
    if nodes.weight.shape[0] > 0:
        gravity = nodes.weight[held.node]
    return v + dt * hold(held.role, held.inverse * total + gravity)


@cache
def gather_function(precision: str, turned: bool) -> Any:
    """The function that sums the forces of elements on a node; with `turned` they are given in its floating frame."""
    vec3 = scalars(precision).vec3

    @wp.func
    def force_at(slot: int, force: wp.array(dtype=vec3)):
        f = force[wp.max(slot, 0)]
        return wp.vec3d(wp.float64(f[0]), wp.float64(f[1]), wp.float64(f[2]))

    @wp.func
    def add_row(total: wp.vec3d, row: wp.vec4i, f0: wp.vec3d, f1: wp.vec3d, f2: wp.vec3d):
        if row[0] >= 0:
            total += f0
        if row[1] >= 0:
            total += f1
        if row[2] >= 0:
            total += f2
        return total

    @wp.func
    def gather_held(held: Held, more_slots: wp.array(dtype=wp.vec4i), force: wp.array(dtype=vec3)):
        """Sum in the order of `kernels.nodes.node.gather_function`, with all loads under way at once."""
        a0 = force_at(held.row0[0], force)
        a1 = force_at(held.row0[1], force)
        a2 = force_at(held.row0[2], force)
        b0 = force_at(held.row1[0], force)
        b1 = force_at(held.row1[1], force)
        b2 = force_at(held.row1[2], force)
        c0 = force_at(held.row2[0], force)
        c1 = force_at(held.row2[1], force)
        c2 = force_at(held.row2[2], force)
        second = force_at(held.pair[1], force)
        total = force_at(held.pair[0], force)
        if held.pair[1] >= 0:
            total += second
        total = add_row(total, held.row0, a0, a1, a2)
        total = add_row(total, held.row1, b0, b1, b2)
        total = add_row(total, held.row2, c0, c1, c2)
        for k in range(held.row, held.end):
            r = more_slots[k]
            total = add_row(total, r, force_at(r[0], force), force_at(r[1], force), force_at(r[2], force))
        if wp.static(turned):
            return wp.quat_rotate(held.turn, total)
        return total

    return gather_held


@cache
def total_function(precision: str, pushed: bool, turned: bool) -> Any:
    """The function that sums the forces of elements and contact on a node, and clears the latter."""
    vec3 = scalars(precision).vec3
    gather_held = gather_function(precision, turned)

    @wp.func
    def all_forces(
        held: Held,
        more_slots: wp.array(dtype=wp.vec4i),
        force: wp.array(dtype=vec3),
        nodal_force_out: wp.array(dtype=wp.vec3d),
    ):
        f = wp.vec3d()
        if wp.static(pushed):
            if held.role & wp.static(TOUCHABLE) != 0:
                f = nodal_force_out[held.node]  # loaded together with the others
        total = gather_held(held, more_slots, force)
        if wp.static(pushed):
            total += f
            if f[0] != wp.float64(0.0) or f[1] != wp.float64(0.0) or f[2] != wp.float64(0.0):
                nodal_force_out[held.node] = wp.vec3d()
        return total

    return all_forces


@cache
def free_role(precision: str, pushed: bool, turned: bool) -> Any:
    """The function that moves free nodes in each of the kernel's steps."""
    vec3 = scalars(precision).vec3
    all_forces = total_function(precision, pushed, turned)

    @wp.func
    def move_others(
        begin: int,
        stride: int,
        nodes: Nodes,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        state_out: NodeState,
    ):
        for k in range(begin, nodes.free.shape[0], stride):
            held = hold_node(nodes.free[k], nodes)
            total = all_forces(held, nodes.data.more_slots, force, state_out.nodal_force)
            v = next_velocity(held, state_out.v[held.node], total, nodes, dt)
            state_out.v[held.node] = v
            state_out.u[held.node] = state_out.u[held.node] + dt * v
            keep_speed(held.node, v, state_out.speed_square)

    @wp.func
    def move_free(
        block: int,
        lane: int,
        blocks: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        count_out: wp.array(dtype=wp.int32),
        state_out: NodeState,
    ):
        """The work of the first PATCH threads of each block. `pushers` is the number of blocks that give forces."""
        free = nodes.free.shape[0]
        item = block * wp.static(PATCH) + lane
        mine = item < free and lane < wp.static(PATCH)
        held = hold_node(nodes.free[wp.min(item, free - 1)], nodes)
        u = state_out.u[held.node]
        v = state_out.v[held.node]
        for n in range(steps):
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if mine:
                total = all_forces(held, nodes.data.more_slots, force, state_out.nodal_force)
                v = next_velocity(held, v, total, nodes, dt)
                u = u + dt * v
                state_out.v[held.node] = v
                state_out.u[held.node] = u
                stride = blocks * wp.static(PATCH)
                move_others(item + stride, stride, nodes, dt, force, state_out)
            arrive(wp.static(NODES), count_out)
            if mine:
                keep_speed(held.node, v, state_out.speed_square)

    return move_free
