"""Owns which sides of a master can press a slave node: those within reach, but none if it slides above another."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edges import Surfaces, opposition
from warp_mca.kernels.contact.nearest import (
    Nearest,
    edge_of,
    is_outside,
    nearest_again,
    nearest_of,
    passes_by,
    reachable,
    shared_function,
)
from warp_mca.kernels.contact.pairs import same_solid
from warp_mca.kernels.contact.projection import area_vector, lies_below
from warp_mca.kernels.contact.side_choice import NodeSprings
from warp_mca.kernels.contact.spring import FAR
from warp_mca.kernels.contact.way_back import OPPOSES, slides_at, usual_depth
from warp_mca.kernels.hardware.shared_memory import group_exchange


@wp.func
def belongs_to_other_side(
    at: Surfaces,
    s: int,
    near: Nearest,
    other: int,
    gap: wp.float64,
    recent_force: wp.array(dtype=wp.vec3d),
) -> bool:
    """Whether slave node s meets face `other`, at `gap` in front of it, not the nearest face across an edge."""
    across = area_vector(at.X, at.u, at.master.face, other)
    found = bool(False)
    if same_solid(at.pairs, near.face, other) and lies_below(at.X, at.u, at.master.face, near.face, other, across):
        mine = opposition(at, s, near.normal)
        its = opposition(at, s, across)
        if mine < wp.float64(OPPOSES) or (near.beside and mine < its + wp.float64(OPPOSES)):
            found = bool(True)
        elif its >= wp.float64(OPPOSES):
            edge = edge_of(near)
            usual = usual_depth(at, s, other, wp.normalize(across), recent_force)
            found = slides_at(gap, usual, edge)
    return found


@wp.func
def in_reach(near: Nearest, node: NodeSprings, held: wp.float64, fold: wp.float64, approach: wp.float64) -> bool:
    """Whether the node can have come to its depth in the nearest face, from this side or from one that released it.

    `fold` is the distance to the nearest face that has the node in front of it, or 0 if the side did not press it
    before.
    """
    edge = edge_of(near)
    found = reachable(-near.gap, held, fold, approach, edge)
    if node.released > wp.float64(0.0) and not node.holding:  # it may have slid over an edge
        found = found or reachable(-near.gap, node.released, wp.float64(0.0), approach, edge)
    return found


@cache
def fronts_type(sides: int) -> Any:
    """The struct of the faces near a slave node, of each of its sides."""
    Gaps, Faces = wp.types.vector(sides, wp.float64), wp.types.vector(sides, wp.int32)

    @wp.struct
    class Fronts:
        """What `nearest_face` finds for each side, if one has candidates.

        Attributes:
            gap: `Nearest.front` [m].
            rank: `Nearest.front_rank` [m].
            face: `Nearest.front_face`.
            below: `Nearest.face`.
        """

        gap: Gaps
        rank: Gaps
        face: Faces
        below: Faces

    return Fronts


@cache
def front_functions(sides: int, lanes: int) -> tuple[Any, Any, Any, Any]:
    """The functions that find and use the faces near a node.

    `near_faces` looks at the candidates of all sides, which `lanes` threads of a GPU share. `near_side` gives what
    `nearest_face` finds for a side, `least_gap` the least distance [m] to a face in front, if several sides have
    candidates. `may_press` says whether the nearest face can press the node, given the faces of the other sides and
    whether its own side `pressed` the node before.
    """
    Gaps, Faces = wp.types.vector(sides, wp.float64), wp.types.vector(sides, wp.int32)
    Fronts, shared = fronts_type(sides), shared_function(lanes, group_exchange(lanes))

    @wp.func
    def near_faces(at: Surfaces, node: NodeSprings, x: wp.vec3d, along: wp.vec3f, lane: int) -> Fronts:
        gaps = Gaps(wp.float64(FAR))
        ranks = Gaps(wp.float64(FAR))
        faces = Faces(-1)
        below = Faces(-1)
        if node.listed > 0:
            for e in range(node.begin, node.begin + wp.static(sides)):
                p = e - node.begin
                near = nearest_of(at.X, at.u, at.master, e, x, along, lane, wp.static(lanes))
                front, rank, face, pressing = shared(at.X, at.u, at.master, near)
                gaps[p] = front
                ranks[p] = rank
                faces[p] = face
                below[p] = pressing
        fronts = Fronts()
        fronts.gap = gaps
        fronts.rank = ranks
        fronts.face = faces
        fronts.below = below
        return fronts

    @wp.func
    def near_side(at: Surfaces, fronts: Fronts, p: int, x: wp.vec3d) -> Nearest:
        near = nearest_again(at.X, at.u, at.master.face, fronts.below[p], x)
        near.front = fronts.gap[p]
        near.front_rank = fronts.rank[p]
        near.front_face = fronts.face[p]
        return near

    @wp.func
    def least_gap(node: NodeSprings, fronts: Fronts) -> wp.float64:
        least = wp.float64(FAR)
        if node.listed > 1:
            for p in range(wp.static(sides)):
                least = wp.min(least, fronts.gap[p])
        return least

    @wp.func
    def may_press(
        at: Surfaces,
        s: int,
        near: Nearest,
        held: wp.float64,
        pressed: bool,
        du: wp.vec3d,
        node: NodeSprings,
        fronts: Fronts,
        recent_force: wp.array(dtype=wp.vec3d),
    ) -> bool:
        edge = edge_of(near)
        fold = wp.where(pressed, near.front, wp.float64(0.0))
        found = in_reach(near, node, held, fold, -wp.dot(du, near.normal))
        if found and is_outside(at.X, at.u, at.master.face, near):
            found = bool(False)
        for e in range(node.begin, node.begin + wp.static(sides)):
            p = e - node.begin
            if node.listed > 1 and passes_by(bool(True), wp.max(held, node.released), fronts.gap[p], edge):
                if belongs_to_other_side(at, s, near, fronts.face[p], fronts.gap[p], recent_force):
                    found = bool(False)
        return found

    return near_faces, near_side, least_gap, may_press
