"""Owns node-to-surface penalty contact: slave forces, and their reactions gathered by the master nodes."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.laws import LINEAR
from warp_mca.kernels.contact.projection import interpolate, project_on_face, weights_at
from warp_mca.kernels.contact.search import STALE, TOO_DEEP, TURNED, moved_too_far
from warp_mca.kernels.contact.spring import (
    ANY_DEPTH,
    FAR,
    Spring,
    open_function,
    rest_function,
    spring_function,
)
from warp_mca.kernels.hardware.each import kind, value_function
from warp_mca.kernels.hardware.overlap import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.shared_memory import shared_functions
from warp_mca.kernels.records.extremes import add_normal_force

wp.set_module_options({"enable_backward": False})

BLOCK_DIM = 128  # threads of a block, which needs no more registers than a block of elements
LANES = 4  # of a GPU for each master: faces that it looks at side by side

_FOLD = 0.01  # of an edge: how much deeper a node may be at once in a neighbour that rises, past the edge between
_SLACK = 1e-4  # of an edge, that a node may be deeper in a face than it can have moved
_RIM = 1e-4  # of half an edge, that a node may lie off a face and still count as above it
_ABOVE = 0.04  # of an edge: who arrives beside a face, nearer than this above another, passes by
_SHARP = 0.7  # cosine between normals below which a node that goes from one face to the next turned a sharp edge
_TURN = -0.9  # least cosine between the normals of a face that presses a node and of the next that does


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
def is_beside(at: wp.vec2d, triangle: bool, rim: wp.float64) -> bool:
    """Whether a point at these coordinates of a face, as `weights_at` has them, is beside it by `rim` half edges."""
    if triangle:
        return wp.min(at[0], wp.min(at[1], wp.float64(1.0) - at[0] - at[1])) < wp.float64(-0.5) * rim
    return wp.max(wp.abs(at[0]), wp.abs(at[1])) > wp.float64(1.0) + rim


@wp.func
def nearest_face(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    candidate: wp.array2d(dtype=wp.int32),
    s: int,
    count: int,
    x: wp.vec3d,
    along: wp.vec3f,
):
    """Of the faces in row s of the lists the one that may press a node at x, on which a force `along` acts.

    Of those below which it lies the shallowest counts, and where there is none the deepest of those that it lies
    beside, as a concave fold asks for. None does that would press the node back where the last one did not let it go:
    the other side of a thin body.

    Returns the face or -1, gap, normal, natural coordinates, whether the node is beside it, a quarter of its area, the
    distance to the nearest face that has the node in front of it, and that face.
    """
    f = candidate[s, 0]  # read before it is known whether there is one: memory answers late
    best = int(-1)
    best_gap = wp.float64(0.0)
    best_area = wp.float64(0.0)
    best_normal = wp.vec3d()
    best_at = wp.vec2d()
    best_beside = bool(False)
    front = wp.float64(FAR)
    open_face = int(-1)
    for c in range(count):
        inside, at, away, area_normal, triangle = project_on_face(X, u, face, f, x)
        if inside:
            area = wp.length(area_normal)  # a quarter of it: a face as large has edges of 2 sqrt(area)
            normal = (wp.float64(1.0) / area) * area_normal
            gap = wp.dot(away, normal)
            turn = wp.dot(wp.vec3f(normal), along)
            kept = turn >= 0.0 or turn * turn < wp.static(_TURN**2) * wp.dot(along, along)
            if gap < wp.float64(0.0) and gap * gap < wp.float64(4.0) * area and kept:
                beside = is_beside(at, triangle, wp.float64(_RIM))
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
                if gap < front:
                    open_face = f
                front = wp.min(front, gap)
        f = candidate[s, wp.min(c + 1, candidate.shape[1] - 1)]
    return best, best_gap, best_normal, best_at, best_beside, best_area, front, open_face


@wp.func
def passes_by(beside: bool, held: wp.float64, front: wp.float64, edge: wp.float64) -> bool:
    """Whether a node that arrives beside a face flies above another one instead; arguments as of `reachable`."""
    return beside and held == wp.float64(0.0) and front < wp.float64(_ABOVE) * edge


@cache
def settle_functions(friction: bool, stress_free: bool, law: str) -> tuple[Any, Any]:
    """The functions that press a node on the face found, if it `touches` that, and that let one go which found none."""
    press = spring_function(friction, law)
    open_contact = open_function(friction)
    gap_from_rest = rest_function(stress_free)

    @wp.func
    def settle(
        s: int,
        scene: int,
        f: int,
        gap: wp.float64,
        normal: wp.vec3d,
        area: wp.float64,
        weight: wp.vec4d,
        du: wp.vec3d,
        touches: bool,
        front: wp.float64,
        held: wp.float64,
        along: wp.vec3f,
        own: wp.float64,
        limit: wp.float64,
        mu: wp.float64,
        per_newton: wp.float64,
        spring: Spring,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        # a spring with neither gap nor normal has no force, and is released as an open one
        gap_kept = wp.where(touches, gap, wp.float64(0.0))
        normal_kept = wp.where(touches, normal, wp.vec3d())
        gap_pressed = gap_from_rest(s, gap_kept, spring)
        k_old = wp.where(spring.face[s] < 0, wp.min(own, limit), spring.stiffness[s])
        stiffness = wp.where(touches, wp.min(k_old, limit), k_old)
        force, F_n = press(s, gap_pressed, normal_kept, du, k_old, stiffness, mu, spring)
        spring.stiffness[s] = stiffness
        add_normal_force(scene, F_n, per_newton, normal_force_out)
        spring.face[s] = wp.where(touches, f, -1)
        spring.weight[s] = weight
        spring.held[s] = wp.where(touches or front < wp.float64(FAR), -gap_kept, held)
        if gap_pressed * gap_pressed > area:
            flag_out[scene, TOO_DEEP] = 1
        turn = wp.dot(wp.vec3f(normal_kept), along)
        if touches and (turn < 0.0 or turn * turn < wp.static(_SHARP**2) * wp.dot(along, along)):
            flag_out[scene, TURNED] = 1
        return force

    @wp.func
    def let_go(
        s: int,
        i: int,
        v: wp.array(dtype=wp.vec3d),
        face: wp.array2d(dtype=wp.int32),
        dt: wp.float64,
        front: wp.float64,
        held: wp.float64,
        spring: Spring,
    ):
        if spring.face[s] >= 0:
            du = dt * (v[i] - master_velocity(v, face, spring.face[s], spring.weight[s]))
            open_contact(s, du, spring.stiffness[s], spring)
            gap_from_rest(s, wp.float64(0.0), spring)
        if held == wp.float64(ANY_DEPTH) or (held > wp.float64(0.0) and front < wp.float64(FAR)):
            spring.held[s] = wp.float64(0.0)

    return settle, let_go


@cache
def surface_kernel(friction: bool, each: bool, stress_free: bool = False, law: str = LINEAR) -> Any:
    """Kernel: each slave node finds the face it penetrates among its candidates and is pushed back along its normal.

    Slaves are those from `first` on. With `each`, scenes of a batch have values of their own, and slaves know their
    scene. Of the faces below which a node lies the shallowest counts, if it is `reachable`; no deeper one is then.
    Where there is none, the deepest of those that it lies beside does, as a concave fold asks for. None does that would
    press the node back where the last one did not let it go: the other side of a thin body.

    The stiffness of a spring is that of the node or of the face that it touches first, whichever is lower. It falls
    where the node slides on to a softer face, and what the spring then loses is booked; it does not rise until the
    spring opens.
    `stress_free`: springs of bodies that overlap at the start begin without force. `law`: module of the contact law.
    """
    settle, let_go = settle_functions(friction, stress_free, law)
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
        face_stiffness: wp.array(dtype=wp.float64),
        face: wp.array2d(dtype=wp.int32),
        count: wp.array(dtype=wp.int32),
        candidate: wp.array2d(dtype=wp.int32),
        scene: Index,
        mu: Real,
        margin: Real,
        per_newton: Real,
        dt: wp.float64,
        spring: Spring,
        contact_force_out: wp.array(dtype=wp.vec3d),
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        wait_for_previous()
        let_next_begin()
        s = first + wp.tid()
        i = slave[s]
        k = of(scene, s)
        pressed = spring.force[s]
        if wp.static(friction):
            pressed -= spring.tangential[s]
        x = X[i] + u[i]
        along = wp.vec3f(pressed)  # of any length
        best, best_gap, best_normal, best_at, best_beside, best_area, front, _face = nearest_face(
            X, u, face, candidate, s, count[s], x, along
        )
        held = spring.held[s]
        if best >= 0:
            weight = weights_at(best_at, face[best, 2] == face[best, 3])
            du = dt * (v[i] - master_velocity(v, face, best, weight))
            edge = wp.float64(2.0) * wp.sqrt(best_area)
            touches = reachable(-best_gap, held, front, wp.dot(du, best_normal), edge)
            if passes_by(best_beside, held, front, edge):
                touches = bool(False)
            contact_force_out[i] = contact_force_out[i] + settle(
                s,
                k,
                best,
                best_gap,
                best_normal,
                best_area,
                weight,
                du,
                touches,
                front,
                held,
                along,
                stiffness[s],
                face_stiffness[best],
                of(mu, k),
                of(per_newton, k),
                spring,
                normal_force_out,
                flag_out,
            )
        else:
            let_go(s, i, v, face, dt, front, held, spring)
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
def plane_kernel(friction: bool, each: bool, stress_free: bool = False, law: str = LINEAR) -> Any:
    """Kernel: contact of slave nodes with an analytic plane that may move along itself; as for surfaces."""
    press = spring_function(friction, law)
    open_contact = open_function(friction)
    gap_from_rest = rest_function(stress_free)
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
        contact_force_out: wp.array(dtype=wp.vec3d),
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
        gap = gap_from_rest(s, wp.dot(X[i] - of(plane_point, k) + u[i], normal), spring)
        before = spring.tangential[s]
        du = dt * (v[i] - velocity)
        if gap < -of(deepest, k):
            flag_out[k, TOO_DEEP] = 1
        if gap < wp.float64(0.0):
            force, F_n = press(s, gap, normal, du, stiffness[s], stiffness[s], of(mu, k), spring)
            add_normal_force(k, F_n, of(per_newton, k), normal_force_out)
            spring.face[s] = 0
            contact_force_out[i] = contact_force_out[i] + force
        elif spring.face[s] >= 0:
            open_contact(s, du, stiffness[s], spring)
        if wp.static(friction):  # work of the plane's own motion, trapezoidal as for slip
            half = wp.float64(0.5)
            spring.drive[s] = spring.drive[s] + half * dt * wp.dot(before + spring.tangential[s], velocity)

    return begins_early(touch_plane)
