"""Owns the blocks of threads that press slave nodes on the faces of a master in every step: LANES threads for each.

Each of these looks at candidate faces of its own; the one that found the face that presses the node goes on.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.nearest import (
    Master,
    Nearest,
    goes_before,
    nearer,
    nearest_of,
    nothing_near,
    passes_by,
    reachable,
)
from warp_mca.kernels.contact.projection import interpolate, project, weights_at
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.settle import Touch, meet, meet_at, settle_functions
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.model.patches import PATCH

wp.set_module_options({"enable_backward": False})

_, exchange = shared_functions("float64")


@wp.struct
class Slaves:
    """Slave nodes of a contact pass, and what they may touch.

    Attributes:
        node: shape (slave_count,), int32.
        stiffness: penalty stiffness [N/m], shape (slave_count,), float64.
        u_search: displacement of each node at the latest search [m], shape (node_count,), vec3d.
        mu: coefficient of friction [-].
        margin: of the search [m].
        per_newton: what sums of normal forces count for a newton [1/N].
    """

    node: wp.array(dtype=wp.int32)
    stiffness: wp.array(dtype=wp.float64)
    u_search: wp.array(dtype=wp.vec3d)
    mu: wp.float64
    margin: wp.float64
    per_newton: wp.float64


@wp.struct
class Prepared:
    """What a lane knows of its first candidate face before nodes have moved.

    Attributes:
        face: its number.
        exists: whether there is one.
        corner: its nodes.
        X0, X1, X2, X3: their reference positions [m].
        stiffness: penalty stiffness of the face [N/m].
    """

    face: wp.int32
    exists: wp.bool
    corner: wp.vec4i
    X0: wp.vec3d
    X1: wp.vec3d
    X2: wp.vec3d
    X3: wp.vec3d
    stiffness: wp.float64


@wp.func
def prepare(X: wp.array(dtype=wp.vec3d), master: Master, s: int, q: int):
    """The q-th candidate of spring s."""
    p = Prepared()
    p.exists = q < master.count[s]
    if p.exists:
        p.face = master.candidate[s, q]
        p.corner = wp.vec4i(
            master.face[p.face, 0], master.face[p.face, 1], master.face[p.face, 2], master.face[p.face, 3]
        )
        p.stiffness = master.stiffness[p.face]
        p.X0 = X[p.corner[0]]
        p.X1 = X[p.corner[1]]
        p.X2 = X[p.corner[2]]
        p.X3 = X[p.corner[3]]
    return p


@wp.func
def nearest_of_lanes(
    p: Prepared,
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    master: Master,
    s: int,
    x: wp.vec3d,
    along: wp.vec3f,
    q: int,
):
    """`nearest_face`, by LANES lanes: what lane q found, and whether that, or its absence, holds for the node."""
    near = nothing_near()
    if p.exists:
        triangle = p.corner[2] == p.corner[3]
        p0 = p.X0 + u[p.corner[0]] - x
        p1 = p.X1 + u[p.corner[1]] - x
        p2 = p.X2 + u[p.corner[2]] - x
        p3 = p.X3 + u[p.corner[3]] - x
        inside, at, away, area_normal = project(p0, p1, p2, p3, triangle)
        near = nearer(near, p.face, inside, at, away, area_normal, triangle, along)
        near = nearest_of(X, u, master, s, x, along, near, q + wp.static(LANES), wp.static(LANES))
    gap = near.gap
    beside = near.beside
    face = near.face
    for k in range(wp.static(LANES.bit_length() - 1)):
        other_gap = exchange(gap, 1 << k)
        other_beside = exchange(wp.where(beside, wp.float64(1.0), wp.float64(0.0)), 1 << k) > wp.float64(0.0)
        other = int(exchange(wp.float64(face), 1 << k))
        near.front = wp.min(near.front, exchange(near.front, 1 << k))
        if other >= 0 and (face < 0 or goes_before(other_gap, other_beside, other, gap, beside, face)):
            gap = other_gap
            beside = other_beside
            face = other
    holds = near.face >= 0 and near.face == face
    if face < 0:
        holds = q == 0
    return near, holds


@wp.func
def last_pressure(s: int, friction: bool, spring: Spring):
    """Contact force of a spring along the normal of the face that it pressed last [N]."""
    pressed = spring.force[s]
    if friction:
        pressed -= spring.tangential[s]
    return wp.vec3f(pressed)


@wp.func
def presses(near: Nearest, touch: Touch) -> bool:
    """Whether the nearest face presses a node that meets it so, as in `contact.surface_kernel`."""
    edge = wp.float64(2.0) * wp.sqrt(near.area)
    found = reachable(-near.gap, touch.held, near.front, wp.dot(touch.du, near.normal), edge)
    if passes_by(near.beside, touch.held, near.front, edge):
        found = bool(False)
    return found


@wp.func
def touch_of(
    p: Prepared,
    near: Nearest,
    i: int,
    v: wp.array(dtype=wp.vec3d),
    v0: wp.vec3d,
    v1: wp.vec3d,
    v2: wp.vec3d,
    v3: wp.vec3d,
    master: Master,
    own: wp.float64,
    dt: wp.float64,
    held: wp.float64,
    along: wp.vec3f,
):
    """How node i meets the nearest face; v0 to v3 are the velocities of the corners of the first candidate [m/s]."""
    touch = Touch()
    touch.held = held
    if near.face >= 0:
        if near.face == p.face:
            weight = weights_at(near.at, p.corner[2] == p.corner[3])
            touch = meet_at(v[i] - interpolate(weight, v0, v1, v2, v3), weight, dt, held, along)
            touch.limit = p.stiffness
        else:
            touch = meet(v, master.face, i, near, dt, held, along)
            touch.limit = master.stiffness[near.face]
        touch.touches = presses(near, touch)
        touch.own = own
    return touch


@cache
def contact_role(friction: bool, stress_free: bool, law: str) -> Any:
    """The function that gives slave nodes their contact forces in each of some steps."""
    settle, let_go = settle_functions(friction, stress_free, law)

    @wp.func
    def touch_slave(
        q: int,
        s: int,
        i: int,
        exists: bool,
        p: Prepared,
        along: wp.vec3f,
        held: wp.float64,
        own: wp.float64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        v0 = v[p.corner[0]]  # under way while the node is projected
        v1 = v[p.corner[1]]
        v2 = v[p.corner[2]]
        v3 = v[p.corner[3]]
        near, holds = nearest_of_lanes(p, X, u, master, s, X[i] + u[i], along, q)
        if exists and holds:
            touch = touch_of(p, near, i, v, v0, v1, v2, v3, master, own, dt, held, along)
            if near.face >= 0:
                contact_force_out[i] = contact_force_out[i] + settle(
                    s, 0, near, touch, slaves.mu, slaves.per_newton, spring, normal_force_out, flag_out
                )
            else:
                let_go(s, i, v, master.face, dt, near.front, held, spring)

    @wp.func
    def touch_slaves(
        block: int,
        lane: int,
        steps: int,
        movers: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """The first PATCH threads of each block; `movers`: blocks of threads that move nodes."""
        item = (block * wp.static(PATCH) + lane) // wp.static(LANES)
        last = slaves.node.shape[0] - 1
        s = wp.min(item, last)
        exists = item <= last
        q = lane % wp.static(LANES)
        i = slaves.node[s]
        own = slaves.stiffness[s]
        searched = slaves.u_search[i]
        p = prepare(X, master, s, q)
        for n in range(steps):
            along = last_pressure(s, wp.static(friction), spring)
            held = spring.held[s]
            if n > 0:
                wait_for(wp.static(NODES), n * movers, count_out)
            if lane < wp.static(PATCH):
                touch_slave(
                    q, s, i, exists, p, along, held, own, X, u, v, slaves, master, dt, spring,
                    contact_force_out, normal_force_out, flag_out,
                )  # fmt: skip
                if q == 0 and moved_too_far(u[i], searched, slaves.margin):
                    flag_out[0, wp.static(STALE)] = 1
            arrive(wp.static(FORCES), count_out)

    return touch_slaves
