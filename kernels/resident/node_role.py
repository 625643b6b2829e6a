"""Owns the blocks of threads that move nodes in every step: free ones, those of master faces, and bound ones.

Values that do not change from step to step are read before the forces are there.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.nodes.floating import Frames
from warp_mca.kernels.nodes.gather import TOUCHABLE, hold
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for

wp.set_module_options({"enable_backward": False})


@wp.struct
class Nodes:
    """What moves the nodes of a model.

    Attributes:
        mass, inverse_mass: [kg], [1/kg], shape (node_count,), float64.
        role: of each node, shape (node_count,), uint8; empty where nothing is bound, at rest or touched.
        frames: floating frames.
        first_slots, more_slots: slots of the forces on each node, see `elements.stage.gather_lists`.
        free: nodes that neither belong to a master nor are bound, shape (free_count,), int32.
        gravity: [m/s^2].
        weight: acceleration of each node by its weight [m/s^2], shape (node_count,), vec3d; empty where it is gravity.
    """

    mass: wp.array(dtype=wp.float64)
    inverse_mass: wp.array(dtype=wp.float64)
    role: wp.array(dtype=wp.uint8)
    frames: Frames
    first_slots: wp.array(dtype=wp.vec2i)
    more_slots: wp.array(dtype=wp.vec4i)
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
    if nodes.role.shape[0] > 0:
        held.role = int(nodes.role[i])
    held.inverse = nodes.inverse_mass[i]
    if nodes.frames.of_node.shape[0] > 0:
        held.turn = nodes.frames.rotation[nodes.frames.of_node[i]]
    held.pair = nodes.first_slots[i]
    none = wp.vec4i(-1, -1, -1, 0)
    held.row0 = none
    held.row1 = none
    held.row2 = none
    held.row = -2 - held.pair[1]
    held.end = held.row
    if held.row >= 0:
        held.row0 = nodes.more_slots[held.row]
        held.end = held.row + held.row0[3]
        if held.row + 1 < held.end:
            held.row1 = nodes.more_slots[held.row + 1]
        if held.row + 2 < held.end:
            held.row2 = nodes.more_slots[held.row + 2]
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
def total_function(precision: str, contact: bool, turned: bool) -> Any:
    """The function that sums the forces of elements and contact on a node, and clears the latter."""
    vec3 = scalars(precision).vec3
    gather_held = gather_function(precision, turned)

    @wp.func
    def all_forces(
        held: Held,
        more_slots: wp.array(dtype=wp.vec4i),
        force: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
    ):
        fc = wp.vec3d()
        if wp.static(contact):
            if held.role & wp.static(TOUCHABLE) != 0:
                fc = contact_force_out[held.node]  # loaded together with the others
        total = gather_held(held, more_slots, force)
        if wp.static(contact):
            total += fc
            if fc[0] != wp.float64(0.0) or fc[1] != wp.float64(0.0) or fc[2] != wp.float64(0.0):
                contact_force_out[held.node] = wp.vec3d()
        return total

    return all_forces


@cache
def free_role(precision: str, contact: bool, turned: bool) -> Any:
    """The function that moves free nodes in each of the kernel's steps."""
    vec3 = scalars(precision).vec3
    all_forces = total_function(precision, contact, turned)

    @wp.func
    def move_others(
        begin: int,
        stride: int,
        nodes: Nodes,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
    ):
        for k in range(begin, nodes.free.shape[0], stride):
            held = hold_node(nodes.free[k], nodes)
            total = all_forces(held, nodes.more_slots, force, contact_force_out)
            v = next_velocity(held, v_out[held.node], total, nodes, dt)
            v_out[held.node] = v
            u_out[held.node] = u_out[held.node] + dt * v
            keep_speed(held.node, v, speed_square_out)

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
        contact_force_out: wp.array(dtype=wp.vec3d),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
    ):
        """The work of the first PATCH threads of each block. `pushers` is the number of blocks that give forces."""
        free = nodes.free.shape[0]
        item = block * wp.static(PATCH) + lane
        mine = item < free and lane < wp.static(PATCH)
        held = hold_node(nodes.free[wp.min(item, free - 1)], nodes)
        u = u_out[held.node]
        v = v_out[held.node]
        for n in range(steps):
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if mine:
                total = all_forces(held, nodes.more_slots, force, contact_force_out)
                v = next_velocity(held, v, total, nodes, dt)
                u = u + dt * v
                v_out[held.node] = v
                u_out[held.node] = u
                stride = blocks * wp.static(PATCH)
                move_others(item + stride, stride, nodes, dt, force, contact_force_out, u_out, v_out, speed_square_out)
            arrive(wp.static(NODES), count_out)
            if mine:
                keep_speed(held.node, v, speed_square_out)

    return move_free
