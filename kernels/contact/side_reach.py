"""Owns which sides of a master can press a slave node: those within reach, but none if it slides above another."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edges import Surfaces, opposition
from warp_mca.kernels.contact.nearest import Nearest, edge_of, is_outside, nearest_face, passes_by, reachable
from warp_mca.kernels.contact.pairs import same_solid
from warp_mca.kernels.contact.projection import area_vector, lies_below
from warp_mca.kernels.contact.side_choice import NodeSprings
from warp_mca.kernels.contact.spring import FAR
from warp_mca.kernels.contact.way_back import OPPOSES, slides_at, usual_depth


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
def front_functions(sides: int) -> tuple[Any, Any]:
    """The functions of the faces that have a node in front of them.

    `front_faces` gives the nearest such face of each side: distances [m], numbers, and the least distance; FAR if only
    one side has candidates. `may_press` says whether the nearest face can press the node, given the faces of the other
    sides and whether its own side `pressed` the node before.
    """
    Gaps, Faces = wp.types.vector(sides, wp.float64), wp.types.vector(sides, wp.int32)

    @wp.func
    def front_faces(
        at: Surfaces,
        node: NodeSprings,
        x: wp.vec3d,
        along: wp.vec3f,
    ):
        gaps = Gaps()
        faces = Faces()
        front = wp.float64(FAR)
        for p in range(wp.static(sides)):
            gaps[p] = wp.float64(FAR)
        if node.listed > 1:
            for e in range(node.begin, node.begin + wp.static(sides)):
                near = nearest_face(at.X, at.u, at.master, e, x, along)
                gaps[e - node.begin] = near.front
                faces[e - node.begin] = near.front_face
                front = wp.min(front, near.front)
        return gaps, faces, front

    @wp.func
    def may_press(
        at: Surfaces,
        s: int,
        near: Nearest,
        held: wp.float64,
        pressed: bool,
        du: wp.vec3d,
        node: NodeSprings,
        front_gap: Gaps,
        front_face: Faces,
        recent_force: wp.array(dtype=wp.vec3d),
    ) -> bool:
        edge = edge_of(near)
        fold = wp.where(pressed, near.front, wp.float64(0.0))
        found = in_reach(near, node, held, fold, -wp.dot(du, near.normal))
        if found and is_outside(at.X, at.u, at.master.face, near):
            found = bool(False)
        for p in range(wp.static(sides)):
            if passes_by(bool(True), wp.max(held, node.released), front_gap[p], edge):
                if belongs_to_other_side(at, s, near, front_face[p], front_gap[p], recent_force):
                    found = bool(False)
        return found

    return front_faces, may_press
