"""Owns the blocks of threads that move nodes of master faces in every step: LANES threads for each, a face apiece."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.kernels.resident.node_role import Nodes, hold_node, motion_functions

wp.set_module_options({"enable_backward": False})

_, exchange = shared_functions("float64")


@wp.struct
class Faces:
    """Faces of a master, and the slave nodes near them.

    Attributes:
        master: nodes of the faces, shape (master_count,), int32.
        offset, of_node: faces of each master node: of_node[offset[m]:offset[m + 1]], int32.
        face: nodes of each face, shape (face_count, 4), int32.
        count: slaves in the list of each face, shape (face_count,), int32.
        slave: these slaves, sorted, shape (face_count, room), int32.
        u_search: displacement of each node at the latest search [m], shape (node_count,), vec3d.
        margin: of the search [m].
    """

    master: wp.array(dtype=wp.int32)
    offset: wp.array(dtype=wp.int32)
    of_node: wp.array(dtype=wp.int32)
    face: wp.array2d(dtype=wp.int32)
    count: wp.array(dtype=wp.int32)
    slave: wp.array2d(dtype=wp.int32)
    u_search: wp.array(dtype=wp.vec3d)
    margin: wp.float64


@wp.func
def corners_of_node(f: int, i: int, faces: Faces):
    """1 for the corners of face f that node i is."""
    found = wp.vec4d()
    for c in range(4):
        if faces.face[f, c] == i:
            found[c] = wp.float64(1.0)
    return found


@wp.func
def less_reaction(total: wp.vec3d, mine: wp.vec4d, pressed: int, f: int, w: wp.vec4d, force: wp.vec3d):
    """Take from the force on a node its shares of the force of a spring, if that presses face f."""
    if pressed == f:
        for c in range(4):
            if mine[c] > wp.float64(0.0):
                total -= w[c] * force
    return total


@wp.func
def less_listed(total: wp.vec3d, mine: wp.vec4d, f: int, begin: int, end: int, faces: Faces, spring: Spring):
    """`less_reaction` of the slaves of face f from entry `begin` of its list on."""
    for q in range(begin, end):
        s = faces.slave[f, q]
        total = less_reaction(total, mine, spring.face[s], f, spring.weight[s], spring.force[s])
    return total


@cache
def master_role(precision: str) -> Any:
    """The function that gives nodes of master faces their reactions and moves them, in each of some steps."""
    vec3 = scalars(precision).vec3
    gather_held, move_held = motion_functions(precision)

    @wp.func
    def move_masters(
        item: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        faces: Faces,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        u_out: wp.array(dtype=wp.vec3d),
        v_out: wp.array(dtype=wp.vec3d),
        speed_square_out: wp.array(dtype=wp.float32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """Lane `item` of all lanes; `pushers`: blocks of threads that give forces."""
        last = faces.master.shape[0] - 1
        m = wp.min(item // wp.static(LANES), last)
        exists = item // wp.static(LANES) <= last
        lane = item % wp.static(LANES)
        held = hold_node(faces.master[m], nodes)
        searched = faces.u_search[held.node]
        begin = faces.offset[m] + lane
        end = faces.offset[m + 1]
        # of the first face: its list is short
        f = faces.of_node[wp.min(begin, end - 1)]
        count = wp.where(begin < end, wp.min(faces.count[f], faces.slave.shape[1]), 0)
        mine = corners_of_node(f, held.node, faces)
        s0 = wp.where(count > 0, faces.slave[f, 0], 0)
        s1 = wp.where(count > 1, faces.slave[f, 1], s0)
        s2 = wp.where(count > 2, faces.slave[f, 2], s0)
        s3 = wp.where(count > 3, faces.slave[f, 3], s0)
        for n in range(steps):
            if exists and lane == 0 and moved_too_far(u_out[held.node], searched, faces.margin):
                flag_out[0, wp.static(STALE)] = 1
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            total = wp.vec3d()
            if count > 0:
                p0 = spring.face[s0]
                p1 = wp.where(count > 1, spring.face[s1], -1)
                p2 = wp.where(count > 2, spring.face[s2], -1)
                p3 = wp.where(count > 3, spring.face[s3], -1)
                w0 = spring.weight[s0]
                w1 = spring.weight[s1]
                w2 = spring.weight[s2]
                w3 = spring.weight[s3]
                f0 = spring.force[s0]
                f1 = spring.force[s1]
                f2 = spring.force[s2]
                f3 = spring.force[s3]
                total = less_reaction(total, mine, p0, f, w0, f0)
                total = less_reaction(total, mine, p1, f, w1, f1)
                total = less_reaction(total, mine, p2, f, w2, f2)
                total = less_reaction(total, mine, p3, f, w3, f3)
                total = less_listed(total, mine, f, 4, count, faces, spring)
            for j in range(begin + wp.static(LANES), end, wp.static(LANES)):
                g = faces.of_node[j]
                length = wp.min(faces.count[g], faces.slave.shape[1])
                total = less_listed(total, corners_of_node(g, held.node, faces), g, 0, length, faces, spring)
            for k in range(wp.static(LANES.bit_length() - 1)):
                for c in range(3):
                    total[c] += exchange(total[c], 1 << k)
            v = wp.vec3d()
            if exists and lane == 0:
                v = move_held(held, gather_held(held, nodes.more_slots, force) + total, nodes.gravity, dt, u_out, v_out)
            arrive(wp.static(NODES), count_out)
            if exists and lane == 0:
                keep_speed(held.node, v, speed_square_out)

    return move_masters
