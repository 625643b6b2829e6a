"""Owns the blocks of threads that press slave nodes on the faces of a master in every step.

LANES threads share the candidate faces of a slave; the thread that found the pressing face continues with it.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import LANES
from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.nearest import Master, Nearest, nearest_function
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.settle import meet_side, settle_functions
from warp_mca.kernels.contact.spring import Spring, pressure_function
from warp_mca.kernels.elements.patch_layout import PATCH
from warp_mca.kernels.nodes.gather import NodeState
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for


@wp.struct
class Slaves:
    """Slave nodes of a contact pass, and what they may touch.

    Attributes:
        node: shape (slave_count,), int32.
        stiffness: penalty stiffness [N/m], shape (slave_count,), float64.
        u_search: displacement of each node at the latest search [m], shape (node_count,), vec3d.
        mu: coefficient of friction [-].
        margin: of the search [m].
        per_newton: count of a newton in the integer sums of normal forces [1/N].
    """

    node: wp.array(dtype=wp.int32)
    stiffness: wp.array(dtype=wp.float64)
    u_search: wp.array(dtype=wp.vec3d)
    mu: wp.float64
    margin: wp.float64
    per_newton: wp.float64


@cache
def contact_role(friction: bool, laws: Laws) -> Any:
    """The function that gives slave nodes their contact forces in each of the kernel's steps."""
    settle, let_go, leave = settle_functions(friction, laws)
    pressure, nearest_face = pressure_function(friction), nearest_function(LANES)

    @wp.func
    def touch_nearest(
        s: int,
        i: int,
        X: wp.array(dtype=wp.vec3d),
        near: Nearest,
        along: wp.vec3f,
        held: wp.float64,
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        state_out: NodeState,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """Press a node or release it, as `contact.surface_kernel` does."""
        if near.face >= 0:
            touch = meet_side(X, state_out.u, state_out.v, master, i, near, slaves.stiffness[s], dt, held, along)
            left = leave(s, i, X, state_out.u, state_out.v, master, touch, spring)
            state_out.nodal_force[i] = state_out.nodal_force[i] + (
                left + settle(s, 0, near, touch, slaves.mu, slaves.per_newton, spring, normal_force_out, flag_out)
            )
        else:
            left = let_go(s, i, X, state_out.u, state_out.v, master, dt, near.front, held, spring)
            if wp.static(laws.returns):
                state_out.nodal_force[i] = state_out.nodal_force[i] + left

    @wp.func
    def touch_slaves(
        block: int,
        lane: int,
        steps: int,
        movers: int,
        X: wp.array(dtype=wp.vec3d),
        slaves: Slaves,
        master: Master,
        dt: wp.float64,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        state_out: NodeState,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """The work of the first PATCH threads of each block. `movers` is the number of blocks that move nodes."""
        item = (block * wp.static(PATCH) + lane) // wp.static(LANES)
        last = slaves.node.shape[0] - 1
        s = wp.min(item, last)
        exists = item <= last
        q = lane % wp.static(LANES)
        i = slaves.node[s]
        x = X[i]
        searched = slaves.u_search[i]
        for n in range(steps):
            along = wp.vec3f(pressure(s, spring))
            held = spring.held[s]
            if n > 0:
                wait_for(wp.static(NODES), n * movers, count_out)
            if lane < wp.static(PATCH):
                near, holds = nearest_face(X, state_out.u, master, s, x + state_out.u[i], along, q)
                if exists and holds:
                    touch_nearest(
                        s, i, X, near, along, held, slaves, master, dt, spring, state_out, normal_force_out, flag_out
                    )  # fmt: skip
                if q == 0 and moved_too_far(state_out.u[i], searched, slaves.margin):
                    flag_out[0, wp.static(STALE)] = 1
            arrive(wp.static(FORCES), count_out)

    return touch_slaves
