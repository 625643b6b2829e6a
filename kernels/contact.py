"""Owns node-to-surface penalty contact: slave forces, and their reactions gathered by the master nodes."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.each import kind, value_function
from warp_mca.kernels.friction import release, stick_slip
from warp_mca.kernels.ledger import run_of
from warp_mca.kernels.overlap import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.projection import interpolate, project_on_face, weights_at
from warp_mca.kernels.search import STALE, TOO_DEEP, TURNED, moved_too_far
from warp_mca.kernels.shared_memory import shared_functions

wp.set_module_options({"enable_backward": False})

BLOCK_DIM = 128  # threads of a block, which needs no more registers than a block of elements
LANES = 4  # of a GPU for each master: faces that it looks at side by side

_FOLD = 0.01  # of an edge: how much deeper a node may be at once in a neighbour that rises, past the edge between
_SLACK = 1e-4  # of an edge, that a node may be deeper in a face than it can have moved
_RIM = 1e-4  # of half an edge, that a node may lie off a face and still count as above it
_ABOVE = 0.04  # of an edge: who arrives beside a face, nearer than this above another, passes by
_FAR = 1e30  # further than anything [m]
_SHARP = 0.7  # cosine between normals below which a node that goes from one face to the next turned a sharp edge
_TURN = -0.9  # least cosine between the normals of a face that presses a node and of the next that does

# Depth before the first step: bodies may overlap from the start.
ANY_DEPTH = _FAR


@wp.struct
class Spring:
    """State of every slave node's springs; arrays have shape (slave_count,).

    tangential: friction force on the slave [N]. force: total force on it [N]. face: touched face or -1.
    weight: shape functions of the touched point. energy: elastic energy held [J]. friction: energy dissipated so
    far [J]. drive: work done by a moving plane so far [J]. impulse, normal_impulse, stick_impulse: force, normal
    force and normal force while sticking, summed over the steps since the last record [N]. depth: largest
    penetration so far [m]. held: depth in the touched face, or in the last one for a node that slid off its side; 0
    in front of all faces, ANY_DEPTH before the first step unless clear of them [m]; planes leave it alone.
    """

    tangential: wp.array(dtype=wp.vec3d)
    force: wp.array(dtype=wp.vec3d)
    face: wp.array(dtype=wp.int32)
    weight: wp.array(dtype=wp.vec4d)
    energy: wp.array(dtype=wp.float64)
    friction: wp.array(dtype=wp.float64)
    drive: wp.array(dtype=wp.float64)
    impulse: wp.array(dtype=wp.vec3d)
    normal_impulse: wp.array(dtype=wp.float64)
    stick_impulse: wp.array(dtype=wp.float64)
    depth: wp.array(dtype=wp.float64)
    held: wp.array(dtype=wp.float64)


@cache
def spring_function(friction: bool) -> Any:
    """The function that turns a gap into force and bookkeeping; without `friction` it has no tangential part."""

    @wp.func
    def press(s: int, gap: wp.float64, normal: wp.vec3d, du: wp.vec3d, k: wp.float64, mu: wp.float64, spring: Spring):
        # all is read before anything is written, so that a GPU waits for memory once
        impulse = spring.impulse[s]
        normal_impulse = spring.normal_impulse[s]
        depth = spring.depth[s]
        Fn = -k * gap
        force = Fn * normal
        squares = Fn * Fn
        if wp.static(friction):
            friction_work = spring.friction[s]
            stick_impulse = spring.stick_impulse[s]
            Ft, work, stick = stick_slip(spring.tangential[s], du, normal, mu * Fn, k)
            force += Ft
            squares += wp.dot(Ft, Ft)
            spring.tangential[s] = Ft
            spring.friction[s] = friction_work + work
            if stick == 1 and mu > wp.float64(0.0):  # a scene of a batch may have none
                spring.stick_impulse[s] = stick_impulse + Fn
        spring.energy[s] = wp.float64(0.5) * squares / k
        spring.force[s] = force
        spring.impulse[s] = impulse + force
        spring.normal_impulse[s] = normal_impulse + Fn
        spring.depth[s] = wp.max(depth, -gap)
        return force

    return press


@cache
def open_function(friction: bool) -> Any:
    """The function that clears the springs of a node that lost its contact."""

    @wp.func
    def open_contact(s: int, du: wp.vec3d, k: wp.float64, spring: Spring):
        if wp.static(friction):
            spring.friction[s] = spring.friction[s] + release(spring.tangential[s], du, k)
            spring.tangential[s] = wp.vec3d()
        spring.energy[s] = wp.float64(0.0)
        spring.force[s] = wp.vec3d()
        spring.face[s] = -1

    return open_contact


@wp.func
def master_velocity(
    v: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int, weight: wp.vec4d
) -> wp.vec3d:
    """Velocity [m/s] of the point of face f at these shape functions."""
    return interpolate(weight, v[face[f, 0]], v[face[f, 1]], v[face[f, 2]], v[face[f, 3]])


@wp.func
def reachable(depth: wp.float64, held: wp.float64, front: wp.float64, moved: wp.float64, edge: wp.float64) -> bool:
    """Whether a node can have come to this depth in a face; else it has not: it is beside the edge of a solid.

    There a node in front of one face lies behind the next, which stands across, by up to a whole face. But depth grows
    from nothing, and in a step by as much as the node moved along the normal.

    Args:
        depth: behind the face [m].
        held: depth before this step, as `Spring` has it [m].
        front: distance to the nearest face that has the node in front of it [m].
        moved: along the face's normal in this step, as the face sees it [m].
        edge: length of the face's edges [m].
    """
    slack = wp.float64(_SLACK) * edge
    if depth < front and held > wp.float64(0.0):  # inside already, and maybe past a fold since
        slack = held + wp.float64(_FOLD) * edge
    return depth <= held + wp.float64(2.0) * wp.abs(moved) + slack


@wp.func
def is_beside(at: wp.vec2d, triangle: bool) -> bool:
    """Whether a point at these coordinates of a face, as `weights_at` takes them, lies beside it."""
    if triangle:
        return wp.min(at[0], wp.min(at[1], wp.float64(1.0) - at[0] - at[1])) < wp.float64(wp.static(-0.5 * _RIM))
    return wp.max(wp.abs(at[0]), wp.abs(at[1])) > wp.float64(wp.static(1.0 + _RIM))


@cache
def surface_kernel(friction: bool, each: bool) -> Any:
    """Kernel: each slave node finds the face it penetrates among its candidates and is pushed back along its normal.

    Slaves are those from `first` on. With `each`, scenes of a batch have values of their own, and slaves know their
    scene. Of the faces below which a node lies the shallowest counts, if it is `reachable`; no deeper one is then.
    Where there is none, the deepest of those that it lies beside does, as a concave fold asks for. None does that would
    press the node back where the last one did not let it go: the other side of a thin body.
    """
    press = spring_function(friction)
    open_contact = open_function(friction)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, launch_bounds=(BLOCK_DIM, 4))
    def touch_surface(
        first: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        u_search: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        stiffness: wp.array(dtype=wp.float64),
        face: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        scene: Index,
        mu: Real,
        margin: Real,
        dt: wp.float64,
        spring: Spring,
        contact_force_out: wp.array(dtype=wp.vec3d),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        s = first + wp.tid()
        i = slave[s]
        k = of(scene, s)
        f = candidate[s, 0]  # read before it is known whether there is one: memory answers late
        best = int(-1)
        best_gap = wp.float64(0.0)
        best_area = wp.float64(0.0)
        best_normal = wp.vec3d()
        best_at = wp.vec2d()
        best_beside = bool(False)
        front = wp.float64(_FAR)
        pressed = spring.force[s]
        if wp.static(friction):
            pressed -= spring.tangential[s]
        along = wp.vec3f(pressed)  # of any length
        x = X[i] + u[i]
        for c in range(count[s]):
            inside, at, away, area_normal, triangle = project_on_face(X, u, face, f, x)
            if inside:
                area = wp.length(area_normal)  # a quarter of it: a face as large has edges of 2 sqrt(area)
                normal = (wp.float64(1.0) / area) * area_normal
                gap = wp.dot(away, normal)
                turn = wp.dot(wp.vec3f(normal), along)
                kept = turn >= 0.0 or turn * turn < wp.static(_TURN**2) * wp.dot(along, along)
                if gap < wp.float64(0.0) and gap * gap < wp.float64(4.0) * area and kept:
                    beside = is_beside(at, triangle)
                    better = (gap > best_gap) != beside
                    if beside != best_beside:
                        better = best_beside
                    elif gap == best_gap:
                        better = f < best  # whatever the order of the search
                    if better or best < 0:
                        best = f
                        best_gap = gap
                        best_normal = normal
                        best_at = at
                        best_beside = beside
                        best_area = area
                elif gap >= wp.float64(0.0):
                    front = wp.min(front, gap)
            f = candidate[s, wp.min(c + 1, candidate.shape[1] - 1)]
        held = spring.held[s]
        if best >= 0:
            weight = weights_at(best_at, face[best, 2] == face[best, 3])
            du = dt * (v[i] - master_velocity(v, face, best, weight))
            edge = wp.float64(2.0) * wp.sqrt(best_area)
            touches = reachable(-best_gap, held, front, wp.dot(du, best_normal), edge)
            if best_beside and held == wp.float64(0.0) and front < wp.float64(_ABOVE) * edge:
                touches = bool(False)
            # a spring with neither gap nor normal has no force, and is released as an open one
            gap_kept = wp.where(touches, best_gap, wp.float64(0.0))
            normal_kept = wp.where(touches, best_normal, wp.vec3d())
            force = press(s, gap_kept, normal_kept, du, stiffness[s], of(mu, k), spring)
            spring.face[s] = wp.where(touches, best, -1)
            spring.weight[s] = weight
            spring.held[s] = wp.where(touches or front < wp.float64(_FAR), -gap_kept, held)
            contact_force_out[i] = contact_force_out[i] + force
            if gap_kept * gap_kept > best_area:
                flag_out[k, TOO_DEEP] = 1
            turn = wp.dot(wp.vec3f(normal_kept), along)
            if touches and (turn < 0.0 or turn * turn < wp.static(_SHARP**2) * wp.dot(along, along)):
                flag_out[k, TURNED] = 1
        else:
            if spring.face[s] >= 0:
                du = dt * (v[i] - master_velocity(v, face, spring.face[s], spring.weight[s]))
                open_contact(s, du, stiffness[s], spring)
            if held == wp.float64(ANY_DEPTH) or (held > wp.float64(0.0) and front < wp.float64(_FAR)):
                spring.held[s] = wp.float64(0.0)
        if moved_too_far(u[i], u_search[i], of(margin, k)):
            flag_out[k, STALE] = 1

    return begins_early(touch_surface)


@cache
def react_kernel(each: bool, lanes: int) -> Any:
    """Kernel: each master node gathers its share of the reactions on the faces around it, in a fixed order.

    Masters are those from `first` on; with more `lanes`, on a GPU, each looks at so many faces side by side.
    """
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)
    _, exchange = shared_functions("float64")

    @wp.kernel(enable_backward=False, module="unique" if each or lanes > 1 else None, grid_stride=False)
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
        contact_force_out: wp.array(dtype=wp.vec3d),
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
                w = spring.weight[s]  # read before it is known whether they count: memory answers late
                force = spring.force[s]
                if spring.face[s] == f:
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
                contact_force_out[i] = contact_force_out[i] + total
            if moved_too_far(u[i], u_search[i], of(margin, k)):
                flag_out[k, STALE] = 1

    return begins_early(react)


react_kernel(False, 1)  # belongs to this module, so it is made before that is loaded; others have their own


@cache
def plane_kernel(friction: bool, each: bool) -> Any:
    """Kernel: contact of slave nodes with an analytic plane that may move along itself; as for surfaces."""
    press = spring_function(friction)
    open_contact = open_function(friction)
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
        dt: wp.float64,
        spring: Spring,
        contact_force_out: wp.array(dtype=wp.vec3d),
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
        before = spring.tangential[s]
        du = dt * (v[i] - velocity)
        if gap < -of(deepest, k):
            flag_out[k, TOO_DEEP] = 1
        if gap < wp.float64(0.0):
            force = press(s, gap, normal, du, stiffness[s], of(mu, k), spring)
            spring.face[s] = 0
            contact_force_out[i] = contact_force_out[i] + force
        elif spring.face[s] >= 0:
            open_contact(s, du, stiffness[s], spring)
        if wp.static(friction):  # work of the plane's own motion, trapezoidal as for slip
            half = wp.float64(0.5)
            spring.drive[s] = spring.drive[s] + half * dt * wp.dot(before + spring.tangential[s], velocity)

    return begins_early(touch_plane)


@wp.kernel(enable_backward=False)
def sum_springs(
    row: wp.array(dtype=wp.int32),
    column: int,
    first: wp.array(dtype=wp.int32),
    spring: Spring,
    partial_out: wp.array4d(dtype=wp.float64),
):
    """Sums over the slaves of each scene, which begin at `first`, into eight columns, as `kernels.ledger` sums.

    What is summed over the record interval then starts afresh.
    """
    scene, k, lane = wp.tid()
    energy = wp.float64(0.0)
    friction = wp.float64(0.0)
    drive = wp.float64(0.0)
    impulse = wp.vec3d()
    normal = wp.float64(0.0)
    stick = wp.float64(0.0)
    begin, end = run_of(first[scene], first[scene + 1], k)
    for s in range(begin + lane, end, wp.block_dim()):
        energy += spring.energy[s]
        friction += spring.friction[s]
        drive += spring.drive[s]
        impulse += spring.impulse[s]
        normal += spring.normal_impulse[s]
        stick += spring.stick_impulse[s]
        spring.impulse[s] = wp.vec3d()
        spring.normal_impulse[s] = wp.float64(0.0)
        spring.stick_impulse[s] = wp.float64(0.0)
    energy_sum = wp.tile_sum(wp.tile(energy))
    friction_sum = wp.tile_sum(wp.tile(friction))
    drive_sum = wp.tile_sum(wp.tile(drive))
    x_sum = wp.tile_sum(wp.tile(impulse[0]))
    y_sum = wp.tile_sum(wp.tile(impulse[1]))
    z_sum = wp.tile_sum(wp.tile(impulse[2]))
    normal_sum = wp.tile_sum(wp.tile(normal))
    stick_sum = wp.tile_sum(wp.tile(stick))
    if lane == 0:
        r = row[0]
        partial_out[r, scene, column, k] = energy_sum[0]
        partial_out[r, scene, column + 1, k] = friction_sum[0]
        partial_out[r, scene, column + 2, k] = drive_sum[0]
        partial_out[r, scene, column + 3, k] = x_sum[0]
        partial_out[r, scene, column + 4, k] = y_sum[0]
        partial_out[r, scene, column + 5, k] = z_sum[0]
        partial_out[r, scene, column + 6, k] = normal_sum[0]
        partial_out[r, scene, column + 7, k] = stick_sum[0]
