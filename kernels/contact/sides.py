"""Owns contact with a master whose sides meet at sharp edges: a slave node has springs of its own for each side.

Where two sides meet in a fold, both press a node at once. Where they meet at the edge of a solid, one does: that
through which the node came, until it is nearer to another one that faces of the slave look against as well.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.contact import (
    BLOCK_DIM,
    master_velocity,
    nearest_face,
    passes_by,
    reachable,
    settle_functions,
)
from warp_mca.kernels.contact.laws import LINEAR
from warp_mca.kernels.contact.projection import weights_at
from warp_mca.kernels.contact.search import STALE, moved_too_far
from warp_mca.kernels.contact.spring import ANY_DEPTH, FAR, Spring
from warp_mca.kernels.hardware.each import kind, value_function
from warp_mca.kernels.hardware.overlap import begins_early, let_next_begin, wait_for_previous

wp.set_module_options({"enable_backward": False})

_ROUNDING = 1e-6  # of an edge, that a node may be behind a side before it runs into it
_BETTER = 0.5  # cosine by which faces of the slave look more against one side than against another that they mean it


@wp.func
def middle(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int):
    """Mean of the corners of face f [m]."""
    total = wp.vec3d()
    for c in range(4):
        total += X[face[f, c]] + u[face[f, c]]
    return wp.float64(0.25) * total


@wp.func
def area_vector(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int):
    """Along the normal of face f in its middle, twice as long as the face is large [m^2]."""
    across = X[face[f, 2]] + u[face[f, 2]] - X[face[f, 0]] - u[face[f, 0]]
    return wp.cross(across, X[face[f, 3]] + u[face[f, 3]] - X[face[f, 1]] - u[face[f, 1]])


@wp.func
def is_edge(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    g: int,
    normal: wp.vec3d,
) -> bool:
    """Whether faces f and g, which have a node in common, meet at the edge of a solid; `normal` is that of g."""
    shared = bool(False)
    for a in range(4):
        for b in range(4):
            if face[f, a] == face[g, b]:
                shared = bool(True)
    return shared and wp.dot(middle(X, u, face, f) - middle(X, u, face, g), normal) < wp.float64(0.0)


@wp.func
def opposition(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    offset: wp.array(dtype=wp.int32),
    face_of_node: wp.array(dtype=wp.int32),
    s: int,
    normal: wp.vec3d,
) -> wp.float64:
    """How much one of the faces around slave node s looks against a normal of any length: cosine, 1 at best."""
    most = wp.float64(-1.0)
    for j in range(offset[s], offset[s + 1]):
        own = area_vector(X, u, face, face_of_node[j])
        most = wp.max(most, -wp.dot(wp.normalize(own), wp.normalize(normal)))
    return most


@cache
def sided_kernel(friction: bool, each: bool, sides: int, stress_free: bool = False, law: str = LINEAR) -> Any:
    """Kernel: as `kernels.contact.contact.surface_kernel`, for a master of so many sides.

    Springs and lists are those of slave 0 with each side, then of slave 1, and so on. A node that no side presses is
    taken by the one behind which it was least before the step, of equals by that which it ran into fastest. It may be
    as deep there as it was in the side that let it go, for it may have slid over an edge.
    """
    settle, let_go = settle_functions(friction, stress_free, law)
    of, Real, Index = value_function(each), kind(wp.float64, each), kind(wp.int32, each)
    Gaps, Faces = wp.types.vector(sides, wp.float64), wp.types.vector(sides, wp.int32)

    @wp.func
    def pressure(e: int, spring: Spring):
        force = spring.force[e]
        if wp.static(friction):
            force -= spring.tangential[e]
        return force

    @wp.func
    def keeper(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        face: wp.array2d(dtype=wp.int32),
        f: int,
        begin: int,
        spring: Spring,
    ):
        """Spring of a side that presses the node and meets face f at the edge of a solid, or -1."""
        found = int(-1)
        for e in range(begin, begin + wp.static(sides)):
            if spring.face[e] >= 0:  # Warp evaluates both sides of `and`
                if is_edge(X, u, face, f, spring.face[e], pressure(e, spring)):
                    found = e
        return found

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, launch_bounds=(BLOCK_DIM, 4))
    def touch_sides(
        first: int,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        v: wp.array(dtype=wp.vec3d),
        u_search: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        slave_face: wp.array2d(dtype=wp.int32),
        slave_offset: wp.array(dtype=wp.int32),
        face_of_slave: wp.array(dtype=wp.int32),
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
        x = X[i] + u[i]
        begin = wp.static(sides) * s
        end = begin + wp.static(sides)
        pressed = wp.vec3d()
        holding = bool(False)
        lost = wp.float64(0.0)  # depth at which a side let the node go
        near = bool(False)
        listed = int(0)
        newcomer = int(-1)
        for e in range(begin, end):
            held = spring.held[e]
            if spring.face[e] >= 0:
                pressed += pressure(e, spring)
                holding = bool(True)
            elif held < wp.float64(ANY_DEPTH):
                lost = wp.max(lost, held)
            if count[e] > 0:
                listed += 1
                newcomer = e
            near = near or count[e] > 0 or held > wp.float64(0.0)
        along = wp.vec3f(pressed)
        front = wp.float64(FAR)
        open_gap = Gaps()  # of each side, to the nearest face that has the node in front of it, and that face
        open_face = Faces()
        for p in range(wp.static(sides)):
            open_gap[p] = wp.float64(FAR)
        if listed > 1:
            newcomer = -1
            for e in range(begin, end):
                _f, _gap, _normal, _at, _beside, _area, ahead, ahead_face = nearest_face(
                    X, u, face, candidate, e, count[e], x, along
                )
                open_gap[e - begin] = ahead
                open_face[e - begin] = ahead_face
                front = wp.min(front, ahead)
        leaver = int(-1)
        first_face = int(-1)  # that takes a free node, and its normal
        first_normal = wp.vec3d()
        least = wp.float64(FAR)
        fastest = wp.float64(0.0)
        total = wp.vec3d()
        # where there are more sides, first to see which of them may take the node, then to press it
        for turn in range(wp.where(listed > 1, 0, wp.where(near, 1, 2)), 2):
            for e in range(begin, end):
                f, gap, normal, at, beside, area, ahead, _face = nearest_face(
                    X, u, face, candidate, e, count[e], x, along
                )
                front = wp.min(front, ahead)
                depth = spring.held[e]
                if f >= 0:
                    weight = weights_at(at, face[f, 2] == face[f, 3])
                    du = dt * (v[i] - master_velocity(v, face, f, weight))
                    approach = -wp.dot(du, normal)
                    edge = wp.float64(2.0) * wp.sqrt(area)
                    fold = wp.where(spring.face[e] >= 0, front, wp.float64(0.0))  # none for a side that comes anew
                    touches = reachable(-gap, depth, fold, approach, edge)
                    if lost > wp.float64(0.0) and not holding:  # as deep as where it was let go
                        touches = touches or reachable(-gap, lost, wp.float64(0.0), approach, edge)
                    for p in range(wp.static(sides)):
                        if passes_by(bool(True), wp.max(depth, lost), open_gap[p], edge):
                            across = area_vector(X, u, face, open_face[p])
                            if is_edge(X, u, face, f, open_face[p], across):  # which of the two does it meet?
                                mine = opposition(X, u, slave_face, slave_offset, face_of_slave, s, normal)
                                its = opposition(X, u, slave_face, slave_offset, face_of_slave, s, across)
                                if mine < wp.float64(_BETTER) or (beside and mine < its + wp.float64(_BETTER)):
                                    touches = bool(False)
                    if turn == 0:
                        before = wp.max(-gap - approach - wp.float64(_ROUNDING) * edge, wp.float64(0.0))
                        if not holding:
                            if touches and (before < least or (before == least and approach > fastest)):
                                least = before
                                fastest = approach
                                newcomer = e
                                first_face = f
                                first_normal = normal
                        elif spring.face[e] < 0:
                            other = keeper(X, u, face, f, begin, spring)
                            if other >= 0:
                                holder = pressure(other, spring)
                                better = opposition(X, u, slave_face, slave_offset, face_of_slave, s, normal)
                                better -= opposition(X, u, slave_face, slave_offset, face_of_slave, s, holder)
                                if better > wp.float64(-_BETTER) and -gap <= spring.held[other] and not beside:
                                    newcomer = e
                                    leaver = other
                    else:
                        if e == newcomer:
                            touches = touches or leaver >= 0
                        elif e == leaver:
                            touches = bool(False)
                        elif spring.face[e] < 0:
                            if keeper(X, u, face, f, begin, spring) >= 0:
                                touches = bool(False)
                            if first_face >= 0:
                                if is_edge(X, u, face, f, first_face, first_normal):
                                    touches = bool(False)
                        last = wp.vec3f(pressure(e, spring))
                        total += settle(
                            e,
                            k,
                            f,
                            gap,
                            normal,
                            area,
                            weight,
                            du,
                            touches,
                            front,
                            depth,
                            last,
                            stiffness[s],
                            face_stiffness[f],
                            of(mu, k),
                            of(per_newton, k),
                            spring,
                            normal_force_out,
                            flag_out,
                        )
                elif turn == 1:
                    let_go(e, i, v, face, dt, front, depth, spring)
        if near:
            contact_force_out[i] = contact_force_out[i] + total
        if moved_too_far(u[i], u_search[i], of(margin, k)):
            flag_out[k, STALE] = 1

    return begins_early(touch_sides)
