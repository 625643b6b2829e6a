"""Owns the blocks of threads that move nodes of master faces in every step; LANES threads share the faces of a node."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.contact.switching import face_left
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.records.extremes import keep_speed
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.kernels.resident.node_role import Nodes, gather_function, hold_node, next_velocity

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
    """1 for each corner of face f that is node i, else 0."""
    found = wp.vec4d()
    for c in range(4):
        if faces.face[f, c] == i:
            found[c] = wp.float64(1.0)
    return found


@wp.func
def less_reaction(total: wp.vec3d, mine: wp.vec4d, pressed: int, f: int, w: wp.vec4d, force: wp.vec3d):
    """Subtract the node's share of the force of a spring that presses face f from the force on the node."""
    if face_left(pressed) == f:
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


@wp.struct
class Near:
    """What a lane knows about the first of its faces of a master node before the forces are there.

    Attributes:
        face: its number.
        count: slaves in its list.
        mine: 1 for each corner that is the node, else 0.
        s0, s1, s2, s3: the first of these slaves.
        begin, end: entries of the lane's other faces, every LANES-th.
    """

    face: wp.int32
    count: wp.int32
    mine: wp.vec4d
    s0: wp.int32
    s1: wp.int32
    s2: wp.int32
    s3: wp.int32
    begin: wp.int32
    end: wp.int32


@wp.func
def faces_near(m: int, lane: int, i: int, faces: Faces):
    """Read what `lane` needs of the faces of the m-th master node, node i."""
    near = Near()
    begin = faces.offset[m] + lane
    near.end = faces.offset[m + 1]
    near.begin = begin + wp.static(LANES)
    if begin < near.end:
        f = faces.of_node[begin]
        near.face = f
        near.count = wp.min(faces.count[f], faces.slave.shape[1])
        near.mine = corners_of_node(f, i, faces)
        last = wp.max(near.count - 1, 0)
        near.s0 = wp.where(near.count > 0, faces.slave[f, 0], 0)
        near.s1 = wp.where(near.count > 0, faces.slave[f, wp.min(last, 1)], 0)
        near.s2 = wp.where(near.count > 0, faces.slave[f, wp.min(last, 2)], 0)
        near.s3 = wp.where(near.count > 0, faces.slave[f, wp.min(last, 3)], 0)
    return near


@wp.func
def reaction(i: int, near: Near, faces: Faces, spring: Spring):
    """Reactions of the springs that press a lane's faces of node i, in the order of `contact.react_kernel` [N]."""
    total = wp.vec3d()
    if near.count > 0:
        f = near.face
        p0 = spring.face[near.s0]  # all loads are under way at once
        p1 = wp.where(near.count > 1, spring.face[near.s1], -1)
        p2 = wp.where(near.count > 2, spring.face[near.s2], -1)
        p3 = wp.where(near.count > 3, spring.face[near.s3], -1)
        w0 = spring.weight[near.s0]
        w1 = spring.weight[near.s1]
        w2 = spring.weight[near.s2]
        w3 = spring.weight[near.s3]
        f0 = spring.force[near.s0]
        f1 = spring.force[near.s1]
        f2 = spring.force[near.s2]
        f3 = spring.force[near.s3]
        total = less_reaction(total, near.mine, p0, f, w0, f0)
        total = less_reaction(total, near.mine, p1, f, w1, f1)
        total = less_reaction(total, near.mine, p2, f, w2, f2)
        total = less_reaction(total, near.mine, p3, f, w3, f3)
        total = less_listed(total, near.mine, f, 4, near.count, faces, spring)
    for j in range(near.begin, near.end, wp.static(LANES)):
        g = faces.of_node[j]
        length = wp.min(faces.count[g], faces.slave.shape[1])
        total = less_listed(total, corners_of_node(g, i, faces), g, 0, length, faces, spring)
    return total


@cache
def master_role(precision: str, turned: bool) -> Any:
    """The function that gives nodes of master faces their reactions and moves them, in each of the kernel's steps."""
    vec3 = scalars(precision).vec3
    gather_held = gather_function(precision, turned)

    @wp.func
    def move_masters(
        block: int,
        lane: int,
        steps: int,
        pushers: int,
        nodes: Nodes,
        faces: Faces,
        dt: wp.float64,
        force: wp.array(dtype=vec3),
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        state_out: NodeState,
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """The work of the first PATCH threads of each block. `pushers` is the number of blocks that give forces."""
        item = (block * wp.static(PATCH) + lane) // wp.static(LANES)
        last = faces.master.shape[0] - 1
        m = wp.min(item, last)
        mine = item <= last and lane < wp.static(PATCH) and lane % wp.static(LANES) == 0
        held = hold_node(faces.master[m], nodes)
        near = faces_near(m, lane % wp.static(LANES), held.node, faces)
        searched = faces.u_search[held.node]
        u = state_out.u[held.node]
        v = state_out.v[held.node]
        for n in range(steps):
            if mine and moved_too_far(u, searched, faces.margin):
                flag_out[0, wp.static(STALE)] = 1
            wait_for(wp.static(FORCES), (n + 1) * pushers, count_out)
            if lane < wp.static(PATCH):
                total = gather_held(held, nodes.data.more_slots, force)
                share = reaction(held.node, near, faces, spring)
                for k in range(wp.static(LANES.bit_length() - 1)):
                    for c in range(3):
                        share[c] += exchange(share[c], 1 << k)
                if mine:
                    v = next_velocity(held, v, total + share, nodes, dt)
                    u = u + dt * v
                    state_out.v[held.node] = v
                    state_out.u[held.node] = u
            arrive(wp.static(NODES), count_out)
            if mine:
                keep_speed(held.node, v, state_out.speed_square)

    return move_masters
