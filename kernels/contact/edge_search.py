"""Owns the broad phase of contact between edges: which edges of the master each edge of the slave may touch."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edge_pairs import REACH, SkinEdges, pair_factor
from warp_mca.kernels.contact.search import OVERFLOW, list_slave, root_function, sort_row
from warp_mca.kernels.hardware.per_scene import kind, value_function


@wp.func
def distance_of_edges(p: wp.vec3d, d: wp.vec3d, q: wp.vec3d, e: wp.vec3d) -> wp.float64:
    """Distance between the segments p to p + d and q to q + e (C. Ericson, Real-time collision detection, 5.1.9)."""
    r = p - q
    zero = wp.float64(0.0)
    one = wp.float64(1.0)
    dd = wp.dot(d, d)
    ee = wp.dot(e, e)
    de = wp.dot(d, e)
    dr = wp.dot(d, r)
    er = wp.dot(e, r)
    det = dd * ee - de * de
    s = zero
    if det > zero:
        s = wp.clamp((de * er - dr * ee) / det, zero, one)
    t = (de * s + er) / ee
    if t < zero:
        t = zero
        s = wp.clamp(-dr / dd, zero, one)
    elif t > one:
        t = one
        s = wp.clamp((de - dr) / dd, zero, one)
    return wp.length(r + s * d - t * e)


@cache
def edge_bounds_kernel(each: bool) -> Any:
    """Kernel: boxes around the master's edges, extended on all sides by how deep and far ahead is looked."""
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)

    @wp.kernel(enable_backward=False, module="unique")
    def edge_bounds(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        edges: SkinEdges,
        scene: Index,
        scene_origin: Vector,
        scene_margin: Real,
        lower_out: wp.array(dtype=wp.vec3f),
        upper_out: wp.array(dtype=wp.vec3f),
    ):
        e = wp.tid()
        k = of(scene, e)
        origin = of(scene_origin, k)
        i = edges.node[e, 0]
        j = edges.node[e, 1]
        a = X[i] + u[i] - origin
        b = X[j] + u[j] - origin
        far = of(scene_margin, k) + wp.float64(REACH) * edges.size[e]
        reach = wp.vec3d(far, far, far)
        lower_out[e] = wp.vec3f(wp.min(a, b) - reach)
        upper_out[e] = wp.vec3f(wp.max(a, b) + reach)

    return edge_bounds


@cache
def near_edges_kernel(each: bool) -> Any:
    """Kernel: list the master's edges near each of the slave's, in their order, and the other way round.

    The caller sets the counts to 0. A full list raises the flag.
    """
    of, Real, Vector, Index = value_function(each), kind(wp.float64, each), kind(wp.vec3d, each), kind(wp.int32, each)
    root_of = root_function(each)

    @wp.kernel(enable_backward=False, module="unique")
    def find_near_edges(
        bvh: wp.uint64,
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        slave: SkinEdges,
        master: SkinEdges,
        scene: Index,
        scene_origin: Vector,
        scene_margin: Real,
        count_out: wp.array(dtype=wp.int32),
        candidate_out: wp.array2d(dtype=wp.int32),
        edge_count_out: wp.array(dtype=wp.int32),
        edge_slave_out: wp.array2d(dtype=wp.int32),
        flag_out: wp.array2d(dtype=wp.int32),
    ):
        a = wp.tid()
        k = of(scene, a)
        i = slave.node[a, 0]
        j = slave.node[a, 1]
        start = X[i] + u[i]
        along = X[j] + u[j] - start
        p = wp.vec3f(start - of(scene_origin, k))
        q = wp.vec3f(start + along - of(scene_origin, k))
        query = wp.bvh_query_aabb(bvh, wp.min(p, q), wp.max(p, q), root_of(bvh, k))
        b = int(0)
        found = int(0)
        while wp.bvh_query_next(query, b):
            factor = pair_factor(slave, master, a, b)
            m = master.node[b, 0]
            n = master.node[b, 1]
            other = X[m] + u[m]
            far = of(scene_margin, k) + wp.float64(REACH) * wp.min(slave.size[a], master.size[b])
            near = distance_of_edges(start, along, other, X[n] + u[n] - other) < far
            if near and factor > wp.float64(0.0):
                if found < candidate_out.shape[1]:
                    candidate_out[a, found] = b
                    list_slave(b, a, k, edge_count_out, edge_slave_out, flag_out)
                    found += 1
                else:
                    flag_out[k, OVERFLOW] = 1
        sort_row(a, found, candidate_out)
        count_out[a] = found

    return find_near_edges
