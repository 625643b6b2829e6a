"""Owns the broad phase of general contact: which faces of other bodies, or of its own, a slave node may touch next."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edge_shares import slid_off
from warp_mca.kernels.contact.edges import SlaveFaces
from warp_mca.kernels.contact.pairs import Pairs, may_meet, spring_of
from warp_mca.kernels.contact.projection import distance_to_face, project_on_face
from warp_mca.kernels.contact.search import EQUAL, is_listed, root_function
from warp_mca.kernels.contact.spring import ANY_DEPTH, Spring
from warp_mca.kernels.hardware.per_scene import kind, value_function

_NONE = 1 << 30  # larger than the number of any body


@cache
def slots_kernel(each: bool, sides: int) -> Any:
    """Kernel: give the bodies near each slave node from `first` on rows of springs of their own, as many as there are.

    A body keeps its row while it presses the node or remembers how it did. Free rows go to the bodies nearby with the
    lowest numbers, so that the order of the search does not matter.
    """
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    root_of = root_function(each)

    @wp.func
    def is_kept(e: int, spring: Spring) -> bool:
        held = spring.held[e]
        kept = spring.face[e] >= 0 or (held > wp.float64(0.0) and held < wp.float64(ANY_DEPTH))
        return kept or spring.left[e] > wp.float64(0.0) or slid_off(e, spring)

    @wp.kernel(enable_backward=False, module="unique")
    def find_slots(
        first: int,
        bvh: wp.uint64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slaves: SlaveFaces,
        face: wp.array2d(dtype=wp.int32),
        pairs: Pairs,
        scene: Index,
        origin: Vector,
        spring: Spring,
        slot_out: wp.array2d(dtype=wp.int32),
    ):
        s = first + wp.tid()
        each_body = wp.static(sides) // slot_out.shape[1]
        for q in range(slot_out.shape[1]):
            kept = bool(False)
            for e in range(wp.static(sides) * s + each_body * q, wp.static(sides) * s + each_body * (q + 1)):
                kept = kept or is_kept(e, spring)
            if not kept:
                slot_out[s, q] = -1
        i = slaves.node[s]
        k = of(scene, s)
        point = wp.vec3f(X[i] + u[i] - of(origin, k))
        for q in range(slot_out.shape[1]):
            if slot_out[s, q] < 0:
                lowest = int(_NONE)
                f = int(0)
                query = wp.bvh_query_aabb(bvh, point, point, root_of(bvh, k))
                while wp.bvh_query_next(query, f):
                    body = pairs.body[f]
                    taken = bool(False)
                    for p in range(slot_out.shape[1]):
                        taken = taken or slot_out[s, p] == body
                    if not taken and body < lowest:
                        if is_listed(X, u, slaves, s, face, f, pairs):
                            lowest = body
                if lowest == _NONE:
                    break
                slot_out[s, q] = lowest

    return find_slots


@cache
def clear_kernel(each: bool, sides: int) -> Any:
    """Kernel: as `search.clear_kernel`, for a general contact: faces of other bodies tell which nodes are inside."""
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)
    of_face, Side, root_of = value_function(sides > 1), kind(wp.int32, sides > 1), root_function(each)

    @wp.kernel(enable_backward=False, module="unique")
    def find_pair_clear(
        bvh: wp.uint64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slave: wp.array(dtype=wp.int32),
        face: wp.array2d(dtype=wp.int32),
        pairs: Pairs,
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
        reach = wp.vec3d(of(longest, k), of(longest, k), of(longest, k))
        for e in range(wp.static(sides) * s, wp.static(sides) * (s + 1)):
            held_out[e] = wp.float64(0.0)
        # each body near the node has its own nearest face: take them by their numbers
        body = int(-1)
        more = bool(True)
        while more:
            following = int(_NONE)
            nearest = wp.float64(wp.inf)
            plane = wp.float64(-1.0)
            clear = bool(True)
            behind = int(0)
            f = int(0)
            query = wp.bvh_query_aabb(bvh, wp.vec3f(point - reach), wp.vec3f(point + reach), root_of(bvh, k))
            while wp.bvh_query_next(query, f):
                if pairs.body[f] != pairs.own[s] and may_meet(pairs, s, f):
                    if pairs.body[f] > body:
                        following = wp.min(following, pairs.body[f])
                    if pairs.body[f] == body:
                        inside, at, away, area_normal, triangle = project_on_face(X, u, face, f, x)
                        gap = wp.dot(away, wp.normalize(area_normal))
                        depth = wp.abs(gap)
                        distance = distance_to_face(X, u, face, f, x, at, triangle)
                        closer = distance < nearest
                        if wp.abs(distance - nearest) <= wp.float64(EQUAL) * nearest:
                            closer = depth > plane or (depth == plane and gap >= wp.float64(0.0))
                        if inside and closer:
                            nearest = distance
                            plane = depth
                            clear = gap >= wp.float64(0.0)
                            behind = spring_of(pairs, s, f, of_face(side, f), wp.static(sides))
            if body >= 0 and not clear:
                held_out[behind] = wp.float64(ANY_DEPTH)
            body = following
            more = following < _NONE

    return find_pair_clear
