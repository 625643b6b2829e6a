"""Owns node-to-surface penalty contact: slave forces, and their reactions gathered by the master nodes."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.bond import HOLDS, hold_bond
from warp_mca.kernels.contact.laws import PLAIN, Laws
from warp_mca.kernels.contact.nearest import Master, nearest_function
from warp_mca.kernels.contact.pairs import Pairs, pair_factor
from warp_mca.kernels.contact.search import STALE, TOO_DEEP, moved_too_far
from warp_mca.kernels.contact.settle import meet_side, settle_functions
from warp_mca.kernels.contact.spring import Spring, pressure_function, release_function, rest_function, spring_function
from warp_mca.kernels.contact.switching import GONE, face_left
from warp_mca.kernels.contact.way_back import recent
from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.records.extremes import add_normal_force

BLOCK_DIM = 128  # threads of a block, which needs no more registers than a block of elements
LANES = 4  # GPU threads of a slave node, which share its candidate faces, and of a master node, which share its own
MOST_THREADS = 1 << 15  # of all slaves, beyond which they fill a GPU with one thread each


def slave_lanes(lanes: int, count: int, sides: int, bonded: bool) -> int:
    """How many of `lanes` threads share the candidate faces of each of `count` slaves of a master with these `sides`.

    Where sides meet, few nodes have faces near them, and all wait for those that have most. A bond takes one thread:
    others might miss that it broke.
    """
    if sides > 1:
        return 1 if bonded else lanes
    return lanes if lanes * count <= MOST_THREADS else 1


@cache
def surface_kernel(
    friction: bool, each: bool, laws: Laws = PLAIN, noted: bool = False, general: bool = False, lanes: int = 1
) -> Any:
    """Kernel: push each slave node that penetrates a candidate face back along the normal of that face.

    `nearest_face` chooses the face, and `reachable` checks that the node can have come to that depth. The kernel takes
    the slaves from `first` on. With `each`, values differ between the scenes of a batch, and each slave has the number
    of its scene.

    The stiffness of a spring is that of the node or of the face that it touches first, whichever is lower. It falls
    where the node slides on to a softer face, and the energy that the spring loses then is booked; it does not rise
    until the spring opens.
    `noted`: keep the recent force on each node, which masters with several sides need. `general`: springs have the
    factors of `Pairs`. On a GPU, `lanes` threads share the candidates of a slave; the one that found the face goes on.
    """
    settle, let_go, leave = settle_functions(friction, laws)
    pressure, nearest_face = pressure_function(friction), nearest_function(lanes)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)
    Table = Pairs if general else wp.int32

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, launch_bounds=(BLOCK_DIM, 4))
    def touch_surface(
        first: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        u_search: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        stiffness: wp.array(dtype=wp.float64),
        master: Master,
        pairs: Table,
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
        lane = wp.tid() % wp.static(lanes)
        s = first + wp.tid() // wp.static(lanes)
        i = slave[s]
        k = of(scene, s)
        along = wp.vec3f(pressure(s, spring))
        held = spring.held[s]
        bonded = bool(False)
        if wp.static(laws.bond):
            bonded = spring.bond[s] == wp.static(HOLDS)
        near, holds = nearest_face(X, u, master, s, X[i] + u[i], along, lane)
        if wp.static(laws.bond):
            if bonded and lane == 0:
                force = hold_bond(
                    s, i, k, X, u, v, master, stiffness[s], of(per_newton, k), dt, spring, normal_force_out
                )
                nodal_force_out[i] = nodal_force_out[i] + force
                if wp.static(noted):
                    recent_out[i] = recent(recent_out[i], force)
        if near.face >= 0 and holds and not bonded:
            touch = meet_side(X, u, v, master, i, near, stiffness[s], dt, held, along)
            if wp.static(general):
                factor = pair_factor(pairs, s, near.face)
                touch.own *= factor
                touch.limit *= factor
            force = leave(s, i, X, u, v, master, touch, spring)
            force += settle(s, k, near, touch, of(mu, k), of(per_newton, k), spring, normal_force_out, flag_out)
            nodal_force_out[i] = nodal_force_out[i] + force
            if wp.static(noted):
                recent_out[i] = recent(recent_out[i], force)
        elif holds and not bonded:
            force = let_go(s, i, X, u, v, master, dt, near.front, held, spring)
            if wp.static(laws.returns):
                nodal_force_out[i] = nodal_force_out[i] + force
        if lane == 0 and moved_too_far(u[i], u_search[i], of(margin, k)):
            flag_out[k, STALE] = 1

    return begins_early(touch_surface)


@cache
def react_kernel(each: bool, lanes: int, noted: bool = False) -> Any:
    """Kernel: each master node gathers its share of the reactions on the faces around it, in a fixed order.

    The kernel takes the masters from `first` on. On a GPU, `lanes` threads share the faces of a master. `noted` as in
    `surface_kernel`.
    """
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)
    _, exchange = shared_functions("float64")

    @wp.kernel(enable_backward=False, module="unique" if each or lanes > 1 or noted else None, grid_stride=False)
    def react(
        first: int,
        u: wp.array(dtype=wp.vec3d),
        u_search: wp.array(dtype=wp.vec3d),
        master: wp.array(dtype=wp.int32),
        face_offset: wp.array(dtype=wp.int32),
        face_of_node: wp.array(dtype=wp.int32),
        face: wp.array2d(dtype=wp.int32),
        face_count: wp.array(dtype=wp.int32),
        face_slave: wp.array2d(dtype=wp.int32),
        scene: Index,
        margin: Real,
        spring: Spring,
        nodal_force_out: wp.array(dtype=wp.vec3d),
        recent_out: wp.array(dtype=wp.vec3d),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        lane = wp.tid() % wp.static(lanes)
        m = first + wp.tid() // wp.static(lanes)
        i = master[m]
        k = of(scene, m)
        total = wp.vec3d()
        touched = wp.float64(0.0)
        for j in range(face_offset[m] + lane, face_offset[m + 1], wp.static(lanes)):
            f = face_of_node[j]
            corners = wp.vec4i(face[f, 0], face[f, 1], face[f, 2], face[f, 3])
            for q in range(wp.min(face_count[f], face_slave.shape[1])):
                s = face_slave[f, q]
                w = spring.weight[s]  # read before it is known whether they count, to hide the latency of memory
                force = spring.force[s]
                if face_left(spring.face[s]) == f:
                    touched = wp.float64(1.0)
                    for c in range(4):
                        if corners[c] == i:
                            total -= w[c] * force
        if wp.static(lanes > 1):
            for step in range(wp.static(lanes.bit_length() - 1)):
                touched += exchange(touched, 1 << step)
                for c in range(3):
                    total[c] += exchange(total[c], 1 << step)
        if lane == 0:
            if touched > wp.float64(0.0):
                nodal_force_out[i] = nodal_force_out[i] + total
                if wp.static(noted):
                    recent_out[i] = recent(recent_out[i], total)
            if moved_too_far(u[i], u_search[i], of(margin, k)):
                flag_out[k, STALE] = 1

    return begins_early(react)


react_kernel(False, 1)  # this variant belongs to the module, so it must exist before the module is loaded


@cache
def plane_kernel(
    friction: bool, each: bool, may_overlap: bool = False, laws: Laws = PLAIN, renewed: bool = False
) -> Any:
    """Kernel: contact of slave nodes with an analytic plane that may move along itself; as for surfaces.

    Where the slave's surface is `renewed` in a run, a spring keeps the stiffness with which it began: one that became
    stiffer while it is pressed would make energy.
    """
    press = spring_function(friction, laws)
    let_open = release_function(friction, laws)
    gap_from_rest = rest_function(laws.pressed)
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique")
    def touch_plane(
        first: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        stiffness: wp.array(dtype=wp.float64),
        scene: Index,
        plane_point: Vector,
        plane_normal: Vector,
        plane_velocity: Vector,
        mu: Real,
        deepest: Real,
        per_newton: Real,
        dt: wp.float64,
        spring: Spring,
        nodal_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        s = first + wp.tid()
        i = slave[s]
        k = of(scene, s)
        normal = of(plane_normal, k)
        velocity = of(plane_velocity, k)
        gap = wp.dot(X[i] - of(plane_point, k) + u[i], normal)
        if wp.static(may_overlap):
            gap, rest = gap_from_rest(s, gap, spring.rest[s], spring)
            spring.rest[s] = rest
        before = spring.tangential[s]
        du = dt * (v[i] - velocity)
        if gap < -of(deepest, k):
            flag_out[k, TOO_DEEP] = 1
        own = stiffness[s]
        if wp.static(renewed):
            if spring.face[s] >= 0:
                own = spring.stiffness[s]
            spring.stiffness[s] = own
        if gap < wp.float64(0.0):
            force, F_n = press(s, gap, normal, normal, du, own, own, of(mu, k), dt, spring)
            add_normal_force(k, F_n, of(per_newton, k), normal_force_out)
            spring.face[s] = 0
            nodal_force_out[i] = nodal_force_out[i] + force
        elif spring.face[s] != GONE:
            nodal_force_out[i] = nodal_force_out[i] + let_open(s, du, normal, own, True, spring)
        if wp.static(friction):  # work of the plane's own motion, trapezoidal as for slip
            half = wp.float64(0.5)
            spring.drive[s] = spring.drive[s] + half * dt * wp.dot(before + spring.tangential[s], velocity)

    return begins_early(touch_plane)
