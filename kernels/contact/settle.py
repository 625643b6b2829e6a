"""Owns how a slave node is pressed by the face that was found for it, and how it is released if none was found."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.nearest import (
    SLACK,
    Master,
    Nearest,
    edge_of,
    is_outside,
    master_velocity,
    passes_by,
    reachable,
)
from warp_mca.kernels.contact.projection import area_vector, weights_at
from warp_mca.kernels.contact.search import TOO_DEEP, TURNED
from warp_mca.kernels.contact.spring import ANY_DEPTH, FAR, Spring, release_function, rest_function, spring_function
from warp_mca.kernels.contact.switching import GONE, face_left, returns_energy
from warp_mca.kernels.records.extremes import add_normal_force

_SHARP = 0.7  # a node has turned a sharp edge if successive normals have a smaller cosine


@wp.struct
class Touch:
    """How a node meets the nearest face in this step.

    Attributes:
        touches: whether the face presses it.
        weight: shape functions of the face at the projected point.
        du: motion of the node relative to the face [m].
        slip: unit normal of the plane in which friction acts: that of the face, or of an edge that meets it head-on.
        held: depth before this step, as `Spring` has it [m].
        along: contact force of the last step, of any length; float32.
        own: penalty stiffness of the node [N/m].
        limit: penalty stiffness of the face [N/m].
        begins: greatest compression with which the spring begins, FAR without a limit [m].
        dt: time step [s].
    """

    touches: wp.bool
    weight: wp.vec4d
    du: wp.vec3d
    slip: wp.vec3d
    held: wp.float64
    along: wp.vec3f
    own: wp.float64
    limit: wp.float64
    begins: wp.float64
    dt: wp.float64


@wp.func
def meet(
    v: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    i: int,
    near: Nearest,
    dt: wp.float64,
    held: wp.float64,
    along: wp.vec3f,
) -> Touch:
    """How node i meets the nearest face. `touches` is not set here."""
    touch = Touch()
    touch.weight = weights_at(near.at, face[near.face, 2] == face[near.face, 3])
    touch.du = dt * (v[i] - master_velocity(v, face, near.face, touch.weight))
    touch.slip = near.normal
    touch.held = held
    touch.along = along
    touch.begins = wp.float64(FAR)
    touch.dt = dt
    return touch


@wp.func
def meet_side(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    v: wp.array(dtype=wp.vec3d),
    master: Master,
    i: int,
    near: Nearest,
    own: wp.float64,
    dt: wp.float64,
    held: wp.float64,
    along: wp.vec3f,
) -> Touch:
    """How node i, whose penalty stiffness is `own`, meets the nearest face of a master that has a single side."""
    touch = meet(v, master.face, i, near, dt, held, along)
    edge = edge_of(near)
    touch.touches = reachable(-near.gap, held, near.front, wp.dot(touch.du, near.normal), edge)
    if passes_by(near.beside, held, near.front, edge):
        touch.touches = bool(False)
    if touch.touches and is_outside(X, u, master.face, near):
        touch.touches = bool(False)
    touch.own = own
    touch.limit = master.stiffness[near.face]
    if held < wp.float64(ANY_DEPTH):
        touch.begins = wp.max(-wp.dot(touch.du, near.normal), wp.float64(0.0))
    return touch


@wp.func
def jump(near: Nearest, touch: Touch) -> wp.float64:
    """By how much the depth of a pressed node that goes to another face changes beside its motion [m].

    0 up to what that motion explains. A face that comes into reach beyond a rim may have the node far deeper.
    """
    found = -near.gap - touch.held + wp.dot(touch.du, near.normal)
    most = wp.length(touch.du) + wp.float64(SLACK) * edge_of(near)
    return wp.where(wp.abs(found) > most, found, wp.float64(0.0))


@cache
def settle_functions(friction: bool, laws: Laws) -> tuple[Any, Any]:
    """The functions (settle: press a node on the face that it touches; let_go: release a node that found no face)."""
    press = spring_function(friction, laws)
    let_open = release_function(friction, laws)
    gap_from_rest = rest_function(laws.pressed)

    @wp.func
    def settle(
        s: int,
        scene: int,
        near: Nearest,
        touch: Touch,
        mu: wp.float64,
        per_newton: wp.float64,
        spring: Spring,
        normal_force_out: wp.array(dtype=wp.int64),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        """Force on the node [N]."""
        # a spring with neither gap nor normal has no force, and is released as an open one
        gap_kept = wp.where(touch.touches, near.gap, wp.float64(0.0))
        normal_kept = wp.where(touch.touches, near.normal, wp.vec3d())
        slip = wp.where(touch.touches, touch.slip, wp.vec3d())
        is_open = spring.face[s] < 0
        rest = spring.rest[s]
        if touch.touches and is_open and touch.begins < wp.float64(FAR):
            rest = wp.max(-near.gap - touch.begins, wp.float64(0.0))
        if touch.touches and not is_open and spring.face[s] != near.face:
            rest = wp.max(rest + jump(near, touch), wp.float64(0.0))
        gap_pressed, rest = gap_from_rest(s, gap_kept, rest, spring)
        k_old = wp.where(is_open, wp.min(touch.own, touch.limit), spring.stiffness[s])
        stiffness = wp.where(touch.touches, wp.min(k_old, touch.limit), k_old)
        force, F_n = wp.vec3d(), wp.float64(0.0)
        returns = bool(False)
        if wp.static(laws.returns):
            returns = returns_energy(s, spring)
        if touch.touches or not returns:  # else `leave` has released it
            force, F_n = press(s, gap_pressed, normal_kept, slip, touch.du, k_old, stiffness, mu, touch.dt, spring)
            spring.face[s] = wp.where(touch.touches, near.face, GONE)
            spring.weight[s] = touch.weight
        spring.rest[s] = rest
        spring.stiffness[s] = stiffness
        add_normal_force(scene, F_n, per_newton, normal_force_out)
        spring.held[s] = wp.where(touch.touches or near.front < wp.float64(FAR), -gap_kept, touch.held)
        if gap_pressed * gap_pressed > near.area:
            flag_out[scene, TOO_DEEP] = 1
        cosine = wp.dot(wp.vec3f(normal_kept), touch.along)  # the cosine times the size of the force
        sharp = cosine * cosine < wp.static(_SHARP**2) * wp.dot(touch.along, touch.along)
        if touch.touches and (cosine < 0.0 or sharp):
            flag_out[scene, TURNED] = 1
        return force

    @wp.func
    def release(
        s: int,
        i: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        master: Master,
        dt: wp.float64,
        spring: Spring,
    ):
        f = face_left(spring.face[s])
        du = dt * (v[i] - master_velocity(v, master.face, f, spring.weight[s]))
        normal, listed = wp.vec3d(), bool(False)
        if wp.static(laws.returns):
            normal = wp.normalize(area_vector(X, u, master.face, f))
            for c in range(master.count[s]):  # the face gathers its reaction only then
                listed = listed or master.candidate[s, c] == f
            if spring.support.shape[0] > 0:
                listed = listed and spring.support[s] < 0
        return let_open(s, du, normal, spring.stiffness[s], listed, spring)

    @wp.func
    def leave(
        s: int,
        i: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        master: Master,
        touch: Touch,
        spring: Spring,
    ):
        """Force [N] of a spring that returns what it owes on the node that no longer touches, before `settle`."""
        force = wp.vec3d()
        if wp.static(laws.returns):
            if not touch.touches and spring.face[s] != GONE and returns_energy(s, spring):
                force = release(s, i, X, u, v, master, touch.dt, spring)
        return force

    @wp.func
    def let_go(
        s: int,
        i: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        master: Master,
        dt: wp.float64,
        front: wp.float64,
        held: wp.float64,
        spring: Spring,
    ):
        force = wp.vec3d()
        if spring.face[s] != GONE:
            force = release(s, i, X, u, v, master, dt, spring)
            _gap, rest = gap_from_rest(s, wp.float64(0.0), spring.rest[s], spring)
            spring.rest[s] = rest
        if held == wp.float64(ANY_DEPTH) or (held > wp.float64(0.0) and front < wp.float64(FAR)):
            spring.held[s] = wp.float64(0.0)
        return force

    return settle, let_go, leave
