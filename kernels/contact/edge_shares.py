"""Owns the share of the force on a resting edge that its inner node takes, and the search for faces below edges."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edges import SlaveFaces, neighbour
from warp_mca.kernels.contact.pairs import Pairs, may_meet, spring_of
from warp_mca.kernels.contact.search import list_slave, root_function, sort_row
from warp_mca.kernels.contact.spring import Spring
from warp_mca.kernels.hardware.early_launch import begins_early, let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.per_scene import kind, value_function
from warp_mca.kernels.hardware.shared_memory import group_exchange


@wp.func
def slid_off(e: int, spring: Spring) -> bool:
    """Whether the node of spring e slid off its side, and has not come back."""
    return spring.bears[e] == 1 and (spring.face[e] < 0 or spring.support[e] >= 0)


@wp.func
def has_support(start: int, end: int, spring: Spring) -> int:
    """1 where one of these springs has a support, else 0."""
    found = int(0)
    for e in range(start, end):
        found = wp.where(spring.support[e] >= 0, 1, found)
    return found


@cache
def carry_kernel(sides: int) -> Any:
    """Kernel: each slave node takes its share of the forces on its edges to nodes that slid off, in a fixed order."""

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def carry(
        first: int,
        slaves: SlaveFaces,
        spring: Spring,
        nodal_force_out: wp.array(dtype=wp.vec3d),
    ):
        wait_for_previous()
        let_next_begin()
        s = first + wp.tid()
        i = slaves.node[s]
        total = wp.vec3d()
        pressed = bool(False)
        for e in range(wp.static(sides) * s, wp.static(sides) * (s + 1)):
            pressed = pressed or (spring.face[e] >= 0 and spring.support[e] < 0)
        if pressed:
            for e in range(wp.static(sides) * s, wp.static(sides) * (s + 1)):
                spring.bears[e] = wp.where(spring.face[e] >= 0 and spring.support[e] < 0, 1, 0)
        for j in range(slaves.offset[s], slaves.offset[s + 1]):
            g = slaves.face_of_slave[j]
            for back in range(2):
                outer = slaves.number[neighbour(slaves.face, g, i, 3 - 2 * back)]
                if spring.rests[outer] == 1:
                    for e in range(wp.static(sides) * outer, wp.static(sides) * (outer + 1)):
                        if spring.support[e] == 2 * g + back:
                            total += (wp.float64(1.0) - spring.share[e]) * spring.force[e]
        if wp.length_sq(total) > wp.float64(0.0):
            nodal_force_out[i] = nodal_force_out[i] + total

    return begins_early(carry)


@wp.func
def end_of(
    X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), slaves: SlaveFaces, i: int, j: int, origin: wp.vec3d
) -> wp.vec3f:
    """Where the edge of a slave's face ends that begins at node i, relative to `origin` [m]; each entry j has two."""
    other = neighbour(slaves.face, slaves.face_of_slave[j // 2], i, 1 + 2 * (j % 2))
    return wp.vec3f(X[other] + u[other] - origin)


@wp.func
def boxes_meet(a_lower: wp.vec3f, a_upper: wp.vec3f, b_lower: wp.vec3f, b_upper: wp.vec3f) -> bool:
    """Whether two boxes have a point in common."""
    meet = bool(True)
    for k in range(3):
        meet = meet and a_lower[k] <= b_upper[k] and b_lower[k] <= a_upper[k]
    return meet


@cache
def along_edges_kernel(each: bool, sides: int, lanes: int = 1) -> Any:
    """Kernel: add the faces along the slave's edges to the lists of nodes that slid off, or may; sort all lists.

    On a GPU, `lanes` threads share the edges and the list of a slave.
    """
    exchange, Counts = group_exchange(lanes), wp.types.vector(sides, wp.int32)
    of, Vector, Index = value_function(each), kind(wp.vec3d, each), kind(wp.int32, each)
    root_of = root_function(each)

    @wp.kernel(enable_backward=False, module="unique")
    def list_along_edges(
        first: int,
        bvh: wp.uint64,
        lower: wp.array(dtype=wp.vec3f),
        upper: wp.array(dtype=wp.vec3f),
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slaves: SlaveFaces,
        side: wp.array(dtype=wp.int32),
        scene: Index,
        scene_origin: Vector,
        pairs: Pairs,
        spring: Spring,
        count_out: wp.array(dtype=wp.int32),
        candidate_out: wp.array2d(dtype=wp.int32),
        face_count_out: wp.array(dtype=wp.int32),
        face_slave_out: wp.array2d(dtype=wp.int32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        lane, s = wp.tid() % wp.static(lanes), first + wp.tid() // wp.static(lanes)
        i, k = slaves.node[s], of(scene, s)
        slid, listed, f, known = bool(False), int(0), int(0), Counts()  # entries before the first thread adds some
        for p in range(wp.static(sides)):
            e = wp.static(sides) * s + p
            slid = slid or slid_off(e, spring)
            known[p] = count_out[e]
            listed += wp.where(known[p] > 0, 1, 0)
        if slid or listed > 1:  # near an edge, over which it may slide before the next search
            origin = of(scene_origin, k)
            x = wp.vec3f(X[i] + u[i] - origin)
            low, high = wp.vec3f(x), wp.vec3f(x)  # one query for all edges looks at each face once
            for j in range(2 * slaves.offset[s], 2 * slaves.offset[s + 1]):
                end = end_of(X, u, slaves, i, j, origin)
                low, high = wp.min(low, end), wp.max(high, end)
            query = wp.bvh_query_aabb(bvh, low, high, root_of(bvh, k))
            while wp.bvh_query_next(query, f):
                if may_meet(pairs, s, f):
                    row = spring_of(pairs, s, f, side[f], wp.static(sides))
                    again = wp.float64(0.0)
                    for c in range(lane, known[row - wp.static(sides) * s], wp.static(lanes)):
                        if candidate_out[row, c] == f:
                            again += wp.float64(1.0)
                    met = wp.float64(0.0)
                    for j in range(2 * slaves.offset[s] + lane, 2 * slaves.offset[s + 1], wp.static(lanes)):
                        end = end_of(X, u, slaves, i, j, origin)
                        if boxes_meet(wp.min(x, end), wp.max(x, end), lower[f], upper[f]):
                            met += wp.float64(1.0)
                    if wp.static(lanes > 1):
                        for q in range(wp.static(lanes.bit_length() - 1)):
                            again += exchange(again, 1 << q)
                            met += exchange(met, 1 << q)
                    found = count_out[row]  # a list that is full takes no further faces
                    new = met > wp.float64(0.0) and again == wp.float64(0.0) and found < candidate_out.shape[1]
                    if new and lane == 0:
                        candidate_out[row, found] = f
                        count_out[row] = found + 1
                        list_slave(f, row, k, face_count_out, face_slave_out, flag_out)
        if lane == 0:
            for p in range(wp.static(sides)):  # crossings lie on seams, where the first of equally near faces is taken
                sort_row(wp.static(sides) * s + p, count_out[wp.static(sides) * s + p], candidate_out)

    return list_along_edges
