"""Owns how a slave node comes back over an edge to the side of a master that it slides on."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.edges import Surfaces, greatest_stiffness, is_on_rim, opposes_both, opposition
from warp_mca.kernels.contact.nearest import ABOVE, SLACK, Nearest, edge_of, is_beside, nearest_again
from warp_mca.kernels.contact.pairs import same_solid
from warp_mca.kernels.contact.projection import lies_below
from warp_mca.kernels.contact.spring import ANY_DEPTH, FAR, Spring

OPPOSES = 0.5  # difference of cosines by which the faces of a slave clearly oppose one side more than another
_USUAL = 4.0  # largest depth of a node that comes over an edge, over the depth at which a spring bears the recent force
_SAGS = 5e-3  # the same of a node that was pressed, besides, as a share of an edge: bodies sag under stiff springs
_RIM = 0.01  # fraction of half an edge by which such a node may lie off the face to which it comes
_FADES = 0.99  # share of a recent force that is kept from step to step
_EVEN = 0.1  # difference of the depths behind two sides of a node that meets their edge head-on, as a share of an edge
_ALIKE = 0.5  # least speed with which it moves into one of them, as a share of that into the other
_ALONG = 0.7  # least cosine between that force and the normal


@wp.struct
class WayBack:
    """The side to which a slave node comes over an edge.

    Attributes:
        spring: of that side, or -1 if there is none.
        face: the face of that side below which the node lies.
        normal: of that face.
        begins: compression with which the spring may begin [m].
    """

    spring: wp.int32
    face: wp.int32
    normal: wp.vec3d
    begins: wp.float64


@wp.func
def recent(before: wp.vec3d, force: wp.vec3d) -> wp.vec3d:
    """The present force of a contact pass on a node, or the decayed value of a greater earlier force [N].

    Springs of a sliding node tremble, and their depth in a single step may be close to zero.
    """
    faded = wp.float64(_FADES) * before
    return wp.where(wp.length_sq(force) > wp.length_sq(faded), force, faded)


@wp.func
def along_normal(force: wp.vec3d, normal: wp.vec3d) -> wp.float64:
    """Component of a force along a unit normal [N]; 0 where it points elsewhere."""
    component = wp.dot(force, normal)
    return wp.where(component > wp.float64(_ALONG) * wp.length(force), component, wp.float64(0.0))


@wp.func
def usual_depth(
    at: Surfaces,
    s: int,
    face: int,
    normal: wp.vec3d,
    recent_force: wp.array(dtype=wp.vec3d),
) -> wp.float64:
    """Depth at which the spring of slave node s bears its recent contact force, or that on a corner of the face [m].

    The force on the node may come from another master, flush with this one. If this node has not been touched yet, the
    forces on the corners of the face stand for those of other nodes of the slave.
    """
    force = along_normal(recent_force[at.slaves.node[s]], normal)
    for c in range(4):
        force = wp.max(force, along_normal(-recent_force[at.master.face[face, c]], normal))
    return force / greatest_stiffness(at, s, face)


@wp.func
def slides_at(depth: wp.float64, usual: wp.float64, edge: wp.float64) -> bool:
    """Whether a node at this distance from a face, on either side, may slide on it, given the `usual_depth`."""
    slack = wp.float64(wp.where(usual > wp.float64(0.0), _SAGS, SLACK))
    return wp.abs(depth) <= wp.float64(_USUAL) * usual + slack * edge


@wp.func
def head_on(
    at: Surfaces, s: int, du: wp.vec3d, one: wp.vec3d, other: wp.vec3d, depths: wp.float64, edge: wp.float64
) -> bool:
    """Whether slave node s, which moves by `du`, meets an edge head-on.

    Then a face of the slave lies across the edge, the node moves into both of its sides, whose normals are `one` and
    `other`, about as fast, and the difference of its `depths` behind them is small.
    """
    least, most = wp.min(-wp.dot(du, one), -wp.dot(du, other)), wp.max(-wp.dot(du, one), -wp.dot(du, other))
    found = bool(False)
    if least > wp.float64(0.0) and least >= wp.float64(_ALIKE) * most and wp.abs(depths) <= wp.float64(_EVEN) * edge:
        found = opposes_both(at, s, one, other)
    return found


@wp.func
def way_ends(near: Nearest, elsewhere: bool) -> bool:
    """Whether a node that a side does not press is no more on its way over the edge: it is in front of the side, or
    below it without being pressed, or another side presses it `elsewhere`."""
    return elsewhere or near.front < wp.float64(FAR) or (near.face >= 0 and not near.beside)


@wp.func
def note_way(e: int, presses: bool, ends: bool, spring: Spring):
    """Keep the last compression by a side until the node's way over the edge ends; no slave edge rests there."""
    spring.support[e] = -1
    if presses:
        spring.left[e] = spring.held[e] - spring.rest[e]
    elif ends:
        spring.left[e] = wp.float64(0.0)


@cache
def way_back_function(sides: int) -> Any:
    """The function that finds the side to which a slave node comes over an edge."""
    Faces = wp.types.vector(sides, wp.int32)

    @wp.func
    def way_back(
        at: Surfaces,
        s: int,
        begin: int,
        e: int,
        near: Nearest,
        du: wp.vec3d,
        below: Faces,
        spring: Spring,
        recent_force: wp.array(dtype=wp.vec3d),
    ) -> WayBack:
        """The side across an edge of the nearest face of spring e, which slave node s has run into.

        A node that slid off a side lies below that side as it comes back, by the depth of its spring and by the sag of
        the slave. So does a node that slides over from another master, flush with this one. Such a node then runs into
        the face across the edge, although it slides on the side. It belongs to the side if faces of the slave oppose
        the side and if it lies no deeper below it than usual. If it slid off that side, or if no face of the slave
        opposes the face that it runs into, it may lie as deep as nodes in front of a face count as above it. Of several
        sides, that on which it was pressed goes first, then the shallowest; it never leaves such a side for others.
        """
        i = at.slaves.node[s]
        way = WayBack()
        way.spring = -1
        shallowest = wp.float64(FAR)
        edge = edge_of(near)
        slides = usual_depth(at, s, near.face, near.normal, recent_force) > wp.float64(0.0)
        for q in range(begin, begin + wp.static(sides)):
            if q != e and spring.held[e] < wp.float64(ANY_DEPTH):
                home = nearest_again(at.X, at.u, at.master.face, below[q - begin], at.X[i] + at.u[i])
                f = wp.max(home.face, 0)
                above = not is_beside(home.at, at.master.face[f, 2] == at.master.face[f, 3], wp.float64(_RIM))
                if home.face >= 0 and above and same_solid(at.pairs, near.face, f):
                    if lies_below(at.X, at.u, at.master.face, near.face, home.face, home.normal):
                        usual = usual_depth(at, s, home.face, home.normal, recent_force)
                        left = spring.left[q]
                        mine = opposition(at, s, near.normal)
                        slid = left > wp.float64(0.0)
                        limit = wp.float64(0.0)
                        if mine >= wp.float64(OPPOSES):
                            if slid:
                                limit = wp.float64(ABOVE) * edge
                        elif slid or not is_on_rim(at.slaves, s):
                            limit = wp.float64(0.5) * edge
                        its = opposition(at, s, home.normal)
                        within = -home.gap <= limit or slides_at(home.gap, usual, edge)
                        pressed = usual > wp.float64(0.0)
                        if head_on(at, s, du, near.normal, home.normal, home.gap - near.gap, edge):
                            within = bool(False)
                        better = pressed and not slides
                        if pressed == slides:
                            better = -home.gap < shallowest
                        if its >= wp.float64(OPPOSES) and within and (better or (slid and way.spring < 0)):
                            shallowest = -home.gap
                            slides = slides or pressed
                            way.spring = q
                            way.face = home.face
                            way.normal = home.normal
                            way.begins = left
        return way

    return way_back
