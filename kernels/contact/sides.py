"""Owns contact with a master whose sides meet at sharp edges: a slave node has one spring for each side.

Where two sides meet in a fold, both press a node at once. At the edge of a solid all do if it meets the node head-on
(`way_back.head_on`); else only the side that the node penetrated first, until the node is nearer to another side that
the faces of the slave oppose too.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.bond import hold_node
from warp_mca.kernels.contact.contact import BLOCK_DIM
from warp_mca.kernels.contact.edge_rest import release_function
from warp_mca.kernels.contact.edge_shares import has_support
from warp_mca.kernels.contact.edges import Surfaces
from warp_mca.kernels.contact.laws import PLAIN, Laws
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.settle import meet, settle_functions
from warp_mca.kernels.contact.side_choice import (
    choice_functions,
    first_choice,
    springs_function,
)
from warp_mca.kernels.contact.side_reach import front_functions
from warp_mca.kernels.contact.spring import Spring, pressure_function
from warp_mca.kernels.contact.way_back import note_way, recent, way_ends
from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function


@wp.func
def add_force(i: int, force: wp.vec3d, nodal_force_out: wp.array(dtype=wp.vec3d), recent_out: wp.array(dtype=wp.vec3d)):
    """Add a contact force to those of a node, and to its recent one."""
    nodal_force_out[i] = nodal_force_out[i] + force
    recent_out[i] = recent(recent_out[i], force)


@cache
def sided_kernel(friction: bool, each: bool, sides: int, laws: Laws = PLAIN, slots: int = 1, lanes: int = 1) -> Any:
    """Kernel: as `kernels.contact.contact.surface_kernel`, for a master with several sides.

    Springs and lists are ordered by slave, then by side. A node that no side presses goes to the side behind which it
    was least deep before the step; ties go to the side with the greatest approach speed. It may be as deep there as in
    the side that released it, because it may have slid over an edge. If several sides have candidates, step 0 chooses
    among them; step 1 presses the node. Each of the `slots` bodies that a node may touch at once has its own springs.
    On a GPU, `lanes` threads share the candidates of a slave; the first one does the rest.
    """
    settle, _, leave = settle_functions(friction, laws)
    choose, confirm = choice_functions(friction, sides)
    pressure, springs_of_node = pressure_function(friction), springs_function(friction, sides)
    near_faces, near_side, least_gap, may_press = front_functions(sides, lanes)
    release = release_function(friction, sides, laws)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, launch_bounds=(BLOCK_DIM, 4))
    def touch_sides(
        first: int,
        at: Surfaces,
        v: wp.array(dtype=wp.vec3d),
        u_search: wp.array(dtype=wp.vec3d),
        scene: Index,
        mu: Real,
        margin: Real,
        per_newton: Real,
        dt: wp.float64,
        spring: Spring,
        nodal_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        recent_out: wp.array(dtype=wp.vec3d),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        lane, s = wp.tid() % wp.static(lanes), first + wp.tid() // wp.static(lanes)
        i, k = at.slaves.node[s], of(scene, s)
        x, total, scale, active = at.X[i] + at.u[i], wp.vec3d(), of(per_newton, k), bool(False)
        start, end = wp.static(sides * slots) * s, wp.static(sides * slots) * (s + 1)
        if wp.static(laws.bond):
            start, total = hold_node(at, s, k, start, end, v, scale, dt, spring, normal_force_out)
            active = start == end
        for begin in range(start, end, wp.static(sides)):
            node = springs_of_node(begin, at.master.count, spring)
            along = wp.vec3f(node.pressed)
            fronts = near_faces(at, node, x, along, lane)
            front = least_gap(node, fronts)
            pick = first_choice(node)
            active = active or node.active
            begins = wp.where(node.listed > 1, 0, wp.where(node.active, 1, 2))
            for step in range(wp.where(lane == 0, begins, 2), 2):
                for e in range(node.begin, node.begin + wp.static(sides)):
                    near = near_side(at, fronts, e - node.begin, x)
                    ends = way_ends(near, node.holding and spring.face[e] < 0)
                    front = wp.min(front, near.front)
                    near.front = front  # of every side so far
                    held, pressed = spring.held[e], spring.face[e] >= 0
                    if near.face >= 0:
                        touch = meet(v, at.master.face, i, near, dt, held, wp.vec3f(pressure(e, spring)))
                        touches = may_press(at, s, near, held, pressed, touch.du, node, fronts, recent_out)
                        if step == 0:
                            pick = choose(at, s, e, near, touch, touches, fronts.below, node, pick, spring, recent_out)
                        else:
                            touch = confirm(at, s, e, near, touch, touches, node, pick, spring)
                            total += leave(e, i, at.X, at.u, v, at.master, touch, spring)
                            total += settle(e, k, near, touch, of(mu, k), scale, spring, normal_force_out, flag_out)
                            note_way(e, touch.touches, ends, spring)
                    elif step == 1:
                        total += release(
                            at, v, s, e, k, near, node, pick.newcomer, ends, fronts, along,
                            of(mu, k), scale, dt, spring, normal_force_out, recent_out, flag_out
                        )  # fmt: skip
        if active and lane == 0:
            add_force(i, total, nodal_force_out, recent_out)
            spring.rests[s] = has_support(start, end, spring)
        if lane == 0 and moved_too_far(at.u[i], u_search[i], of(margin, k)):
            flag_out[k, STALE] = 1

    return begins_early(touch_sides)
