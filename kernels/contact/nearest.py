"""Owns the choice of the candidate face that a slave node penetrates, and the conditions under which they touch."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.projection import area_vector, interpolate, is_edge, project_on_face
from warp_mca.kernels.contact.spring import FAR
from warp_mca.kernels.hardware.shared_memory import shared_functions

# Lengths, as fractions of the edges of a face
_FOLD = 0.01  # extra depth allowed at once when a node slides through a fold into the rising neighbour
SLACK = 1e-4  # growth of the depth in a step allowed beyond the motion of the node
ABOVE = 0.04  # a node that arrives beside a face passes by if another face is nearer than this below it

_RIM = 1e-4  # fraction of half an edge by which a node may lie off a face and still count as above it
_BESIDE = 1e12  # a face in front that the node is beside counts as so many times farther
_OPPOSED = -0.9  # least cosine between a node's last contact force and the normal of the face that presses it next


@wp.struct
class Master:
    """Faces of a master surface, and those near each spring of its slave nodes.

    Attributes:
        face: nodes, shape (face_count, 4), int32; a triangle has its last node twice.
        stiffness: penalty stiffness of each face [N/m], shape (face_count,), float64.
        count: number of candidate faces of each spring, shape (spring_count,), int32.
        candidate: those faces, shape (spring_count, LIST_LENGTH), int32.
    """

    face: wp.array2d(dtype=wp.int32)
    stiffness: wp.array(dtype=wp.float64)
    count: wp.array(dtype=wp.int32)
    candidate: wp.array2d(dtype=wp.int32)


@wp.struct
class Nearest:
    """The face that may press a node, and where the node lies.

    Attributes:
        face: its number, or -1 if there is none; then only front and front_face have a meaning.
        gap: distance along the normal, negative behind the face [m].
        normal: unit normal of the face at the projected point.
        at: natural coordinates of that point, as `weights_at` takes them.
        beside: whether that point lies off the face, though within the reach of its edges.
        area: a quarter of the area of the face [m^2].
        front: distance to the nearest face that has the node in front of it, or FAR [m].
        front_face: the nearest one that the node is not beside, else the nearest; -1 if there is none.
        front_rank: distance to that face, many times as far where the node is beside it; the least goes first [m].
    """

    face: wp.int32
    gap: wp.float64
    normal: wp.vec3d
    at: wp.vec2d
    beside: wp.bool
    area: wp.float64
    front: wp.float64
    front_face: wp.int32
    front_rank: wp.float64


@wp.func
def edge_of(near: Nearest) -> wp.float64:
    """Edge of a square face as large as the nearest one [m]."""
    return wp.float64(2.0) * wp.sqrt(near.area)


@wp.func
def master_velocity(
    v: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int, weight: wp.vec4d
) -> wp.vec3d:
    """Velocity [m/s] of the point of face f at these shape functions."""
    return interpolate(weight, v[face[f, 0]], v[face[f, 1]], v[face[f, 2]], v[face[f, 3]])


@wp.func
def reachable(depth: wp.float64, held: wp.float64, front: wp.float64, moved: wp.float64, edge: wp.float64) -> bool:
    """Whether a node can have come to this depth in a face since the last step.

    Depth grows from zero, and in a step by no more than the node moves along the normal. At the edge of a solid a node
    in front of one face may lie far behind the plane of the next face: it does not touch that face.

    Args:
        depth: behind the face [m].
        held: depth before this step, as `Spring` has it [m].
        front: distance to the nearest face that has the node in front of it [m].
        moved: along the face's normal in this step, relative to the face [m].
        edge: length of the face's edges [m].
    """
    slack = wp.float64(SLACK) * edge
    if depth < front and held > wp.float64(0.0):  # already inside, and may have passed a fold since
        slack = held + wp.float64(_FOLD) * edge
    return depth <= held + wp.float64(2.0) * wp.abs(moved) + slack


@wp.func
def is_beside(at: wp.vec2d, triangle: bool, rim: wp.float64) -> bool:
    """Whether the point at these natural coordinates lies off the face by more than `rim` half edges."""
    if triangle:
        return wp.min(at[0], wp.min(at[1], wp.float64(1.0) - at[0] - at[1])) < wp.float64(-0.5) * rim
    return wp.max(wp.abs(at[0]), wp.abs(at[1])) > wp.float64(1.0) + rim


@wp.func
def passes_by(beside: bool, held: wp.float64, front: wp.float64, edge: wp.float64) -> bool:
    """Whether a node that arrives beside a face is above another face instead. Arguments as in `reachable`."""
    return beside and held == wp.float64(0.0) and front < wp.float64(ABOVE) * edge


@wp.func
def is_outside(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), near: Nearest
) -> bool:
    """Whether a node behind the nearest face, but off it, is in front of a face that meets it in a convex edge.

    Such a node left the solid as it slid over that edge.
    """
    f, g = near.face, near.front_face
    outside = bool(False)
    if g >= 0 and is_beside(near.at, face[f, 2] == face[f, 3], wp.float64(0.0)):
        outside = is_edge(X, u, face, f, g, area_vector(X, u, face, g))
    return outside


@wp.func
def comes_first(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    face: wp.array2d(dtype=wp.int32),
    f: int,
    gap: wp.float64,
    beside: wp.bool,
    g: int,
    other_gap: wp.float64,
    other_beside: wp.bool,
) -> bool:
    """Whether penetrated face f comes before g: the rule of `nearest_face`. Of two faces just one comes first."""
    first = (gap > other_gap) != beside
    if beside != other_beside:
        first = other_beside
    elif gap == other_gap:
        first = f < g  # so that the order of the search does not matter
    elif beside:
        low, high = wp.min(f, g), wp.max(f, g)
        if is_edge(X, u, face, low, high, area_vector(X, u, face, high)):
            first = gap > other_gap
    return first


@wp.func
def nearest_face(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), master: Master, s: int, x: wp.vec3d, along: wp.vec3f
) -> Nearest:
    """Among the candidates of spring s, the face that may press a node at x, whose last contact force was `along`.

    Choose the shallowest penetrated face that has the node right below it. If there is none, as in a concave fold,
    choose the deepest face that the node lies beside; of two that meet in a convex edge, the shallower. Ties go to the
    lower number. Skip faces whose normal opposes the last contact force: they are the far side of a thin body.
    """
    return nearest_of(X, u, master, s, x, along, 0, 1)


@wp.func
def nearest_of(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    master: Master,
    s: int,
    x: wp.vec3d,
    along: wp.vec3f,
    first: int,
    stride: int,
) -> Nearest:
    """`nearest_face` among every `stride`-th candidate, from `first` on."""
    f = master.candidate[s, first]  # read before the count is known, to hide the latency of memory
    best = Nearest()
    best.face = -1
    best.front = wp.float64(FAR)
    best.front_face = -1
    best.front_rank = wp.float64(FAR)
    for c in range(first, master.count[s], stride):
        inside, at, away, area_normal, triangle = project_on_face(X, u, master.face, f, x)
        if inside:
            area = wp.length(area_normal)  # a quarter of it: a face as large has edges of 2 sqrt(area)
            normal = (wp.float64(1.0) / area) * area_normal
            gap = wp.dot(away, normal)
            cosine = wp.dot(wp.vec3f(normal), along)  # the cosine times the size of the force
            kept = cosine >= 0.0 or cosine * cosine < wp.static(_OPPOSED**2) * wp.dot(along, along)
            if gap < wp.float64(0.0) and gap * gap < wp.float64(4.0) * area and kept:
                beside = is_beside(at, triangle, wp.float64(_RIM))
                better = best.face < 0
                if not better:
                    better = comes_first(X, u, master.face, f, gap, beside, best.face, best.gap, best.beside)
                if better:
                    best.face = f
                    best.gap = gap
                    best.normal = normal
                    best.at = at
                    best.beside = beside
                    best.area = area
            elif gap >= wp.float64(0.0):
                beside = is_beside(at, triangle, wp.float64(_RIM))
                rank = gap
                if beside:
                    rank = wp.float64(_BESIDE) * gap
                if rank < best.front_rank or (rank == best.front_rank and f < best.front_face):
                    best.front_face = f
                    best.front_rank = rank
                best.front = wp.min(best.front, gap)
        f = master.candidate[s, wp.min(c + stride, master.candidate.shape[1] - 1)]
    return best


@wp.func
def nearest_again(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), face: wp.array2d(dtype=wp.int32), f: int, x: wp.vec3d
) -> Nearest:
    """What `nearest_face` found, for the face that it chose, or none if f is -1; without the faces in front."""
    near = Nearest()
    near.face = f
    if f >= 0:
        _, at, away, area_normal, triangle = project_on_face(X, u, face, f, x)
        near.area = wp.length(area_normal)
        near.normal = (wp.float64(1.0) / near.area) * area_normal
        near.gap = wp.dot(away, near.normal)
        near.at = at
        near.beside = is_beside(at, triangle, wp.float64(_RIM))
    return near


@cache
def shared_function(lanes: int, exchange: Any) -> Any:
    """The function that gives front, front_rank, front_face and face of all candidates that `lanes` threads share."""

    @wp.func
    def shared(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), master: Master, near: Nearest):
        front = near.front
        rank = near.front_rank
        front_face = near.front_face
        gap = near.gap
        beside = near.beside
        face = near.face
        if wp.static(lanes > 1):
            for k in range(wp.static(lanes.bit_length() - 1)):
                other_gap = exchange(gap, 1 << k)
                other_beside = exchange(wp.where(beside, wp.float64(1.0), wp.float64(0.0)), 1 << k) > wp.float64(0.0)
                other = int(exchange(wp.float64(face), 1 << k))
                front = wp.min(front, exchange(front, 1 << k))
                other_rank = exchange(rank, 1 << k)
                other_front = int(exchange(wp.float64(front_face), 1 << k))
                if other_rank < rank or (other_rank == rank and other_front < front_face):
                    rank = other_rank
                    front_face = other_front
                first = comes_first(X, u, master.face, other, other_gap, other_beside, face, gap, beside)
                if other >= 0 and (face < 0 or first):
                    gap = other_gap
                    beside = other_beside
                    face = other
        return front, rank, front_face, face

    return shared


@cache
def nearest_function(lanes: int) -> Any:
    """The function that gives `nearest_face` by `lanes` threads of a GPU, which share the candidates of a spring.

    It returns what thread q found, and whether that, or that there is none, holds for the node.
    """
    shared = shared_function(lanes, shared_functions("float64")[1])

    @wp.func
    def nearest_of_lanes(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        master: Master,
        s: int,
        x: wp.vec3d,
        along: wp.vec3f,
        q: int,
    ):
        near = nearest_of(X, u, master, s, x, along, q, wp.static(lanes))
        holds = bool(True)
        if wp.static(lanes > 1):
            front, rank, front_face, face = shared(X, u, master, near)
            near.front = front
            near.front_rank = rank
            near.front_face = front_face
            holds = near.face >= 0 and near.face == face
            if face < 0:
                holds = q == 0
        return near, holds

    return nearest_of_lanes
