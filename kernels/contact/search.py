"""Owns the broad phase of contact: which master faces each slave node may touch before the next search."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edges import SlaveFaces
from warp_mca.kernels.contact.pairs import Pairs, may_meet, spring_of
from warp_mca.kernels.contact.projection import area_vector, distance_to_face, project_on_face
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.thread_pool import count_one

# Entries of the flag array that the host reads with every batch of records.
FLAGS = OVERFLOW, STALE, TOO_DEEP, TURNED = 0, 1, 2, 3

EQUAL = 1e-6  # relative difference of distances up to which faces share the nearest point


@cache
def root_function(each: bool) -> Any:
    """The function that gives the root of the faces to search: those of scene k of a batch, or all."""

    @wp.func
    def root_of(bvh: wp.uint64, k: int):
        root = int(-1)
        if wp.static(each):
            root = wp.bvh_get_group_root(bvh, k)
        return root

    return root_of


@wp.func
def list_slave(
    f: int,
    row: int,
    k: int,
    face_count_out: wp.array(dtype=wp.int32),
    face_slave_out: wp.array2d(dtype=wp.int32),
    flag_out: wp.array2d(dtype=wp.int32),
):
    """Add a slave's list to those of face f, in any order; a full list raises the flag of scene k."""
    place = count_one(f, face_count_out)
    if place < face_slave_out.shape[1]:
        face_slave_out[f, place] = row
    else:
        flag_out[k, OVERFLOW] = 1


@wp.func
def sort_row(row: int, count: int, list_out: wp.array2d(dtype=wp.int32)):
    """Sort the first `count` entries of a row."""
    for a in range(1, count):
        value = list_out[row, a]
        b = a - 1
        while b >= 0 and list_out[row, wp.max(b, 0)] > value:  # Warp evaluates both sides of `and`
            list_out[row, b + 1] = list_out[row, b]
            b = b - 1
        list_out[row, b + 1] = value


@cache
def bounds_kernel(each: bool) -> Any:
    """Kernel: bounding box of each face, extended inwards by the size of the face and by the margin on all sides.

    Boxes are relative to `origin`, so that float32 resolves them.
    """
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique" if each else None)
    def face_bounds(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        face: wp.array2d(dtype=wp.int32),
        scene: Index,
        scene_origin: Vector,
        scene_margin: Real,
        lower_out: wp.array(dtype=wp.vec3f),
        upper_out: wp.array(dtype=wp.vec3f),
    ):
        f = wp.tid()
        k = of(scene, f)
        origin = of(scene_origin, k)
        margin = of(scene_margin, k)
        a = X[face[f, 0]] + u[face[f, 0]] - origin
        b = X[face[f, 1]] + u[face[f, 1]] - origin
        c = X[face[f, 2]] + u[face[f, 2]] - origin
        d = X[face[f, 3]] + u[face[f, 3]] - origin
        normal = wp.float64(0.5) * wp.cross(c - a, d - b)  # its length is the area
        area = wp.length(normal)
        inward = (-wp.sqrt(area) / area) * normal
        lower = wp.min(wp.min(a, b), wp.min(c, d))
        upper = wp.max(wp.max(a, b), wp.max(c, d))
        reach = wp.vec3d(margin, margin, margin)
        lower = wp.min(lower, lower + inward) - reach
        upper = wp.max(upper, upper + inward) + reach
        lower_out[f] = wp.vec3f(wp.float32(lower[0]), wp.float32(lower[1]), wp.float32(lower[2]))
        upper_out[f] = wp.vec3f(wp.float32(upper[0]), wp.float32(upper[1]), wp.float32(upper[2]))

    return face_bounds


@wp.func
def opposes(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    slaves: SlaveFaces,
    s: int,
    face: wp.array2d(dtype=wp.int32),
    f: int,
) -> bool:
    """Whether a face around slave node s looks against face f: else that is the far side of a layer."""
    normal = area_vector(X, u, face, f)
    found = bool(False)
    for j in range(slaves.offset[s], slaves.offset[s + 1]):
        own = area_vector(X, u, slaves.face, slaves.face_of_slave[j])
        found = found or wp.dot(own, normal) < wp.float64(0.0)
    return found


@wp.func
def is_listed(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    slaves: SlaveFaces,
    s: int,
    face: wp.array2d(dtype=wp.int32),
    f: int,
    pairs: Pairs,
) -> bool:
    """Whether slave node s may touch face f until the next search."""
    found = may_meet(pairs, s, f)
    if found and pairs.own[s] == pairs.body[f]:
        found = opposes(X, u, slaves, s, face, f)
    return found


@cache
def candidates_kernel(each: bool, sides: int, general: bool = False) -> Any:
    """Kernel: list the faces near each slave node from `first` on, and the slaves near each face.

    A full list raises the flag.

    The caller sets the counts of the slaves to 0. With `each`, faces are grouped by scene, and a slave searches the
    faces of its scene only. If a slave has several springs, for sides of the master or for bodies of a `general`
    contact, it has a list for each, and faces list the number of that list in place of the slave. Of a listed contact
    without sides, `slaves` have their `node` alone.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    of_face, Side, root_of = value_function(sides > 1), kind(wp.int32, sides > 1), root_function(each)

    @wp.kernel(enable_backward=False, module="unique" if each or general or sides > 1 else None)
    def find_candidates(
        first: int,
        bvh: wp.uint64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slaves: SlaveFaces,
        face: wp.array2d(dtype=wp.int32),
        pairs: Pairs,
        side: Side,
        scene: Index,
        origin: Vector,
        count_out: wp.array(dtype=wp.int32),
        candidate_out: wp.array2d(dtype=wp.int32),
        face_count_out: wp.array(dtype=wp.int32),
        face_slave_out: wp.array2d(dtype=wp.int32),
        u_search_out: wp.array(dtype=wp.vec3d),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        s = first + wp.tid()
        i = slaves.node[s]
        u_search_out[i] = u[i]
        k = of(scene, s)
        point = wp.vec3f(X[i] + u[i] - of(origin, k))
        for e in range(wp.static(sides) * s, wp.static(sides) * (s + 1)):
            count_out[e] = 0
        f = int(0)
        query = wp.bvh_query_aabb(bvh, point, point, root_of(bvh, k))
        while wp.bvh_query_next(query, f):
            listed = bool(True)
            if wp.static(general):
                listed = is_listed(X, u, slaves, s, face, f, pairs)
            if listed:
                e = wp.static(sides) * s + of_face(side, f)
                if wp.static(general):
                    e = spring_of(pairs, s, f, of_face(side, f), wp.static(sides))
                found = count_out[e]
                if found < candidate_out.shape[1]:
                    candidate_out[e, found] = f
                    count_out[e] = found + 1
                    list_slave(f, e, k, face_count_out, face_slave_out, flag_out)
                else:
                    flag_out[k, OVERFLOW] = 1

    return find_candidates


@cache
def clear_kernel(each: bool, sides: int) -> Any:
    """Kernel: set the depth at the start to 0 for slave nodes in front of their nearest face.

    If the master has several sides, a node behind its nearest face keeps a depth in the side of that face only. In a
    body thinner than its faces are long the candidate lists may hold only the far side, so the kernel searches as far
    as the boxes of faces are deep. If the nearest point lies on an edge, the face whose plane is farthest decides: for
    a node in the plane of one face but beyond its edge, the other face tells inside from outside.
    """
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)
    of_face, Side, root_of = value_function(sides > 1), kind(wp.int32, sides > 1), root_function(each)

    @wp.kernel(enable_backward=False, module="unique" if each or sides > 1 else None)
    def find_clear(
        bvh: wp.uint64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        face: wp.array2d(dtype=wp.int32),
        side: Side,
        scene: Index,
        origin: Vector,
        longest: Real,
        held_out: wp.array(dtype=wp.float64),
    ):
        s = wp.tid()
        i = slave[s]
        k = of(scene, s)
        x = X[i] + u[i]
        point = x - of(origin, k)
        reach = of(longest, k)
        lower = wp.vec3f(wp.float32(point[0] - reach), wp.float32(point[1] - reach), wp.float32(point[2] - reach))
        upper = wp.vec3f(wp.float32(point[0] + reach), wp.float32(point[1] + reach), wp.float32(point[2] + reach))
        query = wp.bvh_query_aabb(bvh, lower, upper, root_of(bvh, k))
        f = int(0)
        nearest = wp.float64(wp.inf)
        plane = wp.float64(-1.0)  # distance to the plane of the nearest face
        clear = bool(False)
        behind = int(0)  # side of the nearest face
        while wp.bvh_query_next(query, f):
            inside, at, away, area_normal, triangle = project_on_face(X, u, face, f, x)
            gap = wp.dot(away, wp.normalize(area_normal))
            depth = wp.abs(gap)
            distance = depth
            closer = depth < nearest or (depth == nearest and gap >= wp.float64(0.0))
            if wp.static(sides > 1):
                distance = distance_to_face(X, u, face, f, x, at, triangle)
                closer = distance < nearest
                if wp.abs(distance - nearest) <= wp.float64(EQUAL) * nearest:
                    closer = depth > plane or (depth == plane and gap >= wp.float64(0.0))
            if inside and closer:
                nearest = distance
                plane = depth
                clear = gap >= wp.float64(0.0)
                behind = of_face(side, f)
        for p in range(wp.static(sides)):
            if clear or p != behind:
                held_out[wp.static(sides) * s + p] = wp.float64(0.0)

    return find_clear


# Variants of a single scene belong to this module, so they must exist before it is loaded.
bounds_kernel(False)
candidates_kernel(False, 1)
clear_kernel(False, 1)


@wp.kernel(enable_backward=False)
def sort_lists(
    face_count: wp.array(dtype=wp.int32),
    face_slave_out: wp.array2d(dtype=wp.int32),
):
    """Sort each face's slaves: threads filled the lists in any order, and sums must repeat bit for bit."""
    f = wp.tid()
    sort_row(f, wp.min(face_count[f], face_slave_out.shape[1]), face_slave_out)


@wp.kernel(enable_backward=False)
def mark_masters(
    u: wp.array(dtype=wp.vec3d),
    node: wp.array(dtype=wp.int32),
    u_search_out: wp.array(dtype=wp.vec3d),
):
    """Remember where the master nodes were at the search."""
    i = node[wp.tid()]
    u_search_out[i] = u[i]


@wp.func
def moved_too_far(u: wp.vec3d, u_search: wp.vec3d, margin: wp.float64) -> bool:
    """Whether a node moved more than half the margin since the search, so that a contact might be missed."""
    return wp.length_sq(u - u_search) > wp.float64(0.25) * margin * margin
