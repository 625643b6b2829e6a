"""Owns the edges of a slave's faces that rest on the edge of a master, where their outer node slid off a side.

Between two rows of slave nodes, nothing else bears the slave there, and it would tip as its outer row slides off. The
spring of the outer node then presses the point where the slave's edge crosses that of the master; both its nodes take
their share, which are their shape functions at that point.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edge_shares import slid_off
from warp_mca.kernels.contact.edges import Surfaces, greatest_stiffness, neighbour
from warp_mca.kernels.contact.laws import Laws
from warp_mca.kernels.contact.nearest import ABOVE, Nearest, edge_of, nearest_face, reachable
from warp_mca.kernels.contact.pairs import neighbours_spring, same_solid
from warp_mca.kernels.contact.projection import area_vector, lies_below, middle
from warp_mca.kernels.contact.settle import Touch, meet, settle_functions
from warp_mca.kernels.contact.side_choice import NodeSprings
from warp_mca.kernels.contact.side_reach import fronts_type
from warp_mca.kernels.contact.spring import FAR, Spring, pressure_function
from warp_mca.kernels.contact.way_back import note_way, slides_at, usual_depth

_FLAT = 0.9  # least cosine between the reversed normal of a face that rests and that of the side
_SLOW = 5e-5  # largest motion into the side in a step with which a crossing begins to rest, as a share of an edge
_SLIDES = 0.01  # the same for its whole motion


@wp.struct
class Support:
    """Where an edge of a slave's face rests on a master.

    Attributes:
        edge: 2 f for the edge from a node to the next one of face f of the slave, 2 f + 1 to the one before; or -1.
        inner: the node at its other end, which still lies above the side.
        share: shape function of the outer node at the crossing.
        near: the face of the master that the crossing has penetrated; its normal is across both edges.
    """

    edge: wp.int32
    inner: wp.int32
    share: wp.float64
    near: Nearest


@wp.func
def no_support() -> Support:
    """No edge rests."""
    support = Support()
    support.edge = -1
    support.share = wp.float64(1.0)
    return support


@wp.func
def lies_on(
    at: Surfaces,
    e: int,
    x: wp.vec3d,
    own: wp.vec3d,
    along: wp.vec3f,
) -> bool:
    """Whether the node of spring e, at x, lies on or just in front of a face of its side that `own` opposes."""
    near = nearest_face(at.X, at.u, at.master, e, x, along)
    f = wp.max(near.face, near.front_face)
    found = bool(False)
    if f >= 0:
        across = area_vector(at.X, at.u, at.master.face, f)
        edge = wp.sqrt(wp.float64(0.5) * wp.length(across))
        found = wp.where(near.face >= 0, wp.abs(near.gap), near.front) < wp.float64(ABOVE) * edge
        found = found and -wp.dot(wp.normalize(own), wp.normalize(across)) > wp.float64(_FLAT)
    return found


@wp.func
def hovers(at: Surfaces, near: Nearest) -> bool:
    """Whether a node is just in front of a face of its side, so that it did not slide off the side."""
    found = bool(False)
    if near.front_face >= 0:
        across = area_vector(at.X, at.u, at.master.face, near.front_face)
        found = near.front_rank < wp.float64(ABOVE) * wp.sqrt(wp.float64(0.5) * wp.length(across))
    return found


@wp.func
def meet_edge(
    v: wp.array(dtype=wp.vec3d),
    at: Surfaces,
    s: int,
    e: int,
    support: Support,
    dt: wp.float64,
    along: wp.vec3f,
    spring: Spring,
    recent_force: wp.array(dtype=wp.vec3d),
) -> Touch:
    """How the crossing meets the side of spring e.

    An impact does not catch the crossing. It begins to rest only if it came into the side as slowly as nodes that slide
    there. It starts free of force and is pressed as the slave tips.
    """
    i = at.slaves.node[s]
    near = support.near
    touch = meet(v, at.master.face, i, near, dt, spring.held[e], along)
    touch.du += dt * (wp.float64(1.0) - support.share) * (v[support.inner] - v[i])
    touch.own = greatest_stiffness(at, s, near.face)
    touch.limit = touch.own
    touch.begins = wp.float64(0.0)
    edge = edge_of(near)
    approach = wp.dot(touch.du, near.normal)
    if spring.support[e] >= 0:
        touch.touches = reachable(-near.gap, touch.held, wp.float64(FAR), approach, edge)
    elif touch.held == wp.float64(0.0):
        usual = usual_depth(at, s, near.face, near.normal, recent_force)
        slow = wp.abs(approach) <= wp.float64(_SLOW) * edge and wp.length(touch.du) < wp.float64(_SLIDES) * edge
        touch.touches = slow and slides_at(near.gap, usual, edge)
    return touch


@cache
def support_function(sides: int) -> Any:
    """The function that finds the edge of the slave which rests on the side of spring e."""
    Fronts = fronts_type(sides)

    @wp.func
    def face_across(e: int, begin: int, fronts: Fronts, spring: Spring) -> int:
        """The nearest face of another side that has the node in front of it, or -1; no other side presses the node."""
        found = int(-1)
        least = wp.float64(FAR)
        for p in range(wp.static(sides)):
            if begin + p != e:
                if fronts.gap[p] < least:
                    least = fronts.gap[p]
                    found = fronts.face[p]
        for p in range(wp.static(sides)):
            if begin + p != e and spring.face[begin + p] >= 0:
                found = int(-1)
        return found

    @wp.func
    def find_support(
        at: Surfaces,
        s: int,
        e: int,
        node: NodeSprings,
        fronts: Fronts,
        along: wp.vec3f,
        spring: Spring,
    ) -> Support:
        """Find an edge of the slave from the node to a pressed neighbour that crosses the plane of the face.

        The normal is across both edges, so that the crossing may move along them without work.
        """
        support = no_support()
        f = int(-1)
        if slid_off(e, spring):
            f = face_across(e, node.begin, fronts, spring)
        if f >= 0:
            i = at.slaves.node[s]
            x = at.X[i] + at.u[i]
            across = wp.normalize(area_vector(at.X, at.u, at.master.face, f))
            at_edge = middle(at.X, at.u, at.master.face, f)
            outside = wp.max(wp.dot(x - at_edge, across), wp.float64(0.0))
            most = wp.float64(0.0)
            for j in range(at.slaves.offset[s], at.slaves.offset[s + 1]):
                g = at.slaves.face_of_slave[j]
                own = area_vector(at.X, at.u, at.slaves.face, g)
                for back in range(2):
                    other = neighbour(at.slaves.face, g, i, 1 + 2 * back)
                    inside = wp.dot(at_edge - at.X[other] - at.u[other], across)
                    e_other = neighbours_spring(at.pairs, s, e, at.slaves.number[other], wp.static(sides))
                    if inside > wp.float64(0.0) and spring.bears[e_other] == 1:
                        share = inside / (inside + outside)
                        if share > most and lies_on(at, e_other, at.X[other] + at.u[other], own, along):
                            most = share
                            support.edge = 2 * g + back
                            support.inner = other
            if support.edge >= 0:
                start = at.X[support.inner] + at.u[support.inner]
                support.share = most
                support.near = nearest_face(at.X, at.u, at.master, e, start + most * (x - start), along)
                own = area_vector(at.X, at.u, at.slaves.face, support.edge // 2)
                rests = support.near.face >= 0 and wp.dot(own, support.near.normal) < wp.float64(0.0)
                if rests:  # not `and`: Warp evaluates both of its sides
                    rests = lies_below(at.X, at.u, at.master.face, f, support.near.face, support.near.normal)
                    rests = rests and same_solid(at.pairs, f, support.near.face)
                if not rests:  # a face across a fold stands above the side
                    support.edge = -1
                else:
                    normal = wp.normalize(wp.cross(x - start, wp.cross(support.near.normal, across)))
                    cosine = wp.dot(normal, support.near.normal)
                    support.near.normal = wp.sign(cosine) * normal
                    support.near.gap = wp.abs(cosine) * support.near.gap
        return support

    return find_support


@cache
def release_function(friction: bool, sides: int, laws: Laws) -> Any:
    """The function that releases a node from a side that has no face below it, unless an edge of the slave rests there.

    It gives the force on the node [N]. `newcomer` is the spring that begins to press the node in this step, or -1.
    """
    settle, let_go, leave = settle_functions(friction, laws)
    pressure, find_support = pressure_function(friction), support_function(sides)
    Fronts = fronts_type(sides)

    @wp.func
    def release(
        at: Surfaces,
        v: wp.array(dtype=wp.vec3d),
        s: int,
        e: int,
        scene: int,
        near: Nearest,
        node: NodeSprings,
        newcomer: int,
        ends: bool,
        fronts: Fronts,
        along: wp.vec3f,
        mu: wp.float64,
        per_newton: wp.float64,
        dt: wp.float64,
        spring: Spring,
        normal_force_out: wp.array(dtype=wp.int64),
        recent_force: wp.array(dtype=wp.vec3d),
        flag_out: wp.array2d(dtype=wp.int32),
    ) -> wp.vec3d:
        support, i = no_support(), at.slaves.node[s]
        if node.listed > 1 and (newcomer < 0 or newcomer == e) and not hovers(at, near):
            support = find_support(at, s, e, node, fronts, along, spring)
        if support.edge < 0:
            force = let_go(e, i, at.X, at.u, v, at.master, dt, near.front, spring.held[e], spring)
            note_way(e, bool(False), ends, spring)
            return force
        touch = meet_edge(v, at, s, e, support, dt, wp.vec3f(pressure(e, spring)), spring, recent_force)
        left = leave(e, i, at.X, at.u, v, at.master, touch, spring)
        force = settle(e, scene, support.near, touch, mu, per_newton, spring, normal_force_out, flag_out)
        note_way(e, touch.touches, ends, spring)
        if touch.touches:
            spring.support[e] = support.edge
        spring.share[e] = support.share
        return left + support.share * force

    return release
