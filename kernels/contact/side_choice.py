"""Owns which sides of a master press a slave node, where the sides meet at sharp edges."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.contact.balance import compression_kept
from warp_mca.kernels.contact.edges import Surfaces, greatest_stiffness, opposition
from warp_mca.kernels.contact.nearest import Nearest, edge_of
from warp_mca.kernels.contact.projection import area_vector, is_edge
from warp_mca.kernels.contact.settle import Touch
from warp_mca.kernels.contact.spring import ANY_DEPTH, FAR, Spring, pressure_function
from warp_mca.kernels.contact.way_back import OPPOSES, WayBack, head_on, way_back_function

_ROUNDING = 1e-6  # a node penetrates a side beyond this depth, as a fraction of an edge
_BEHIND = 0.01  # depth that a node has more in a side than it can have reached, where it meets their edge head-on


@wp.struct
class NodeSprings:
    """What the springs of a slave node, one for each side, hold before a step.

    Attributes:
        begin: number of the first of them.
        pressed: sum of their normal forces on the node [N].
        holding: whether a side presses the node.
        released: greatest depth at which a side released the node [m].
        active: whether a spring has candidate faces, or a depth.
        listed: number of springs that have candidate faces.
        last_listed: the last of those, or -1.
    """

    begin: wp.int32
    pressed: wp.vec3d
    holding: wp.bool
    released: wp.float64
    active: wp.bool
    listed: wp.int32
    last_listed: wp.int32


@wp.struct
class Choice:
    """The side that begins to press a node in this step, as far as the sides have been looked at.

    Attributes:
        newcomer: its spring, or -1.
        leaver: the spring that it replaces at an edge, or -1.
        face: the face of the newcomer where no side pressed the node before, or -1.
        normal: the normal of that face.
        depth: depth behind that face before the step [m].
        approach: motion of the node into that face in this step [m].
        returns: whether the node comes to that face over an edge.
        passed: bit of each side whose spring does not press the node, because the other side of an edge does.
        begins: compression with which the newcomer may begin, if it is deeper than it can reach by itself [m].
    """

    newcomer: wp.int32
    leaver: wp.int32
    face: wp.int32
    normal: wp.vec3d
    depth: wp.float64
    approach: wp.float64
    returns: wp.bool
    passed: wp.int32
    begins: wp.float64


@wp.func
def first_choice(node: NodeSprings) -> Choice:
    """The choice before any side was compared; if only one side has candidates, it is already final."""
    choice = Choice()
    choice.newcomer = wp.where(node.listed > 1, -1, node.last_listed)
    choice.leaver = -1
    choice.face = -1
    choice.depth = wp.float64(FAR)
    choice.begins = wp.float64(FAR)
    return choice


@cache
def springs_function(friction: bool, sides: int) -> Any:
    """The function that gathers what the springs of a slave node hold, from `begin` on."""
    pressure = pressure_function(friction)

    @wp.func
    def springs_of_node(begin: int, count: wp.array(dtype=wp.int32), spring: Spring) -> NodeSprings:
        node = NodeSprings()
        node.begin = begin
        node.last_listed = -1
        for e in range(node.begin, node.begin + wp.static(sides)):
            held = spring.held[e]
            if spring.face[e] >= 0:
                node.pressed = node.pressed + pressure(e, spring)
                node.holding = bool(True)
            elif held < wp.float64(ANY_DEPTH):
                node.released = wp.max(node.released, held)
            if count[e] > 0:
                node.listed = node.listed + 1
                node.last_listed = e
            node.active = node.active or count[e] > 0 or held > wp.float64(0.0)
        return node

    return springs_of_node


@cache
def choice_functions(friction: bool, sides: int) -> tuple[Any, Any]:
    """The functions (choose: the choice after one more side; confirm: how a side meets the node, given it)."""
    way_back, pressure, Faces = way_back_function(sides), pressure_function(friction), wp.types.vector(sides, wp.int32)

    @wp.func
    def keeper(at: Surfaces, f: int, begin: int, spring: Spring):
        """Spring of a side that presses the node and meets face f at the edge of a solid, or -1."""
        found = int(-1)
        for e in range(begin, begin + wp.static(sides)):
            if spring.face[e] >= 0:  # not `and`: Warp evaluates both of its sides
                g = spring.face[e]
                if is_edge(at.X, at.u, at.master.face, f, g, area_vector(at.X, at.u, at.master.face, g)):
                    found = e
        return found

    @wp.func
    def takes_over(
        at: Surfaces,
        s: int,
        near: Nearest,
        du: wp.vec3d,
        other: int,
        spring: Spring,
    ) -> bool:
        """Whether the nearest face takes the node over from spring `other`: no deeper in it, and not moving in."""
        across = area_vector(at.X, at.u, at.master.face, spring.face[other])
        better = opposition(at, s, near.normal) - opposition(at, s, across)
        enters = -wp.dot(du, near.normal) > -wp.dot(du, wp.normalize(across))
        shallower = -near.gap <= spring.held[other] and not near.beside
        return shallower and not enters and better > wp.float64(-OPPOSES)

    @wp.func
    def choose(
        at: Surfaces,
        s: int,
        e: int,
        near: Nearest,
        touch: Touch,
        touches: bool,
        below: Faces,
        node: NodeSprings,
        choice: Choice,
        spring: Spring,
        recent_force: wp.array(dtype=wp.vec3d),
    ) -> Choice:
        """A free node goes to the side behind which it was least deep before; ties go to the fastest approach.

        A node that comes over an edge goes to the side on which it slides. `below` are the faces that may press it.
        """
        chosen = choice
        other = int(-1)
        way = WayBack()
        way.spring = -1
        if spring.face[e] < 0:
            if node.holding:
                other = keeper(at, near.face, node.begin, spring)
            if touches and other < 0:
                way = way_back(at, s, node.begin, e, near, touch.du, below, spring, recent_force)
        edge = edge_of(near)
        approach = -wp.dot(touch.du, near.normal)
        before = wp.max(-near.gap - approach - wp.float64(_ROUNDING) * edge, wp.float64(0.0))
        if other >= 0 or way.spring >= 0:
            chosen.passed = choice.passed | (1 << (e - node.begin))
        if way.spring >= 0:
            chosen.returns = bool(True)
            chosen.newcomer = way.spring
            chosen.leaver = -1
            chosen.face = way.face
            chosen.normal = way.normal
            chosen.begins = way.begins
        elif choice.returns:
            pass
        elif not node.holding:
            faster = before == choice.depth and approach > choice.approach
            if touches and (before < choice.depth or faster):
                chosen.depth = before
                chosen.approach = approach
                chosen.newcomer = e
                chosen.face = near.face
                chosen.normal = near.normal
        elif other >= 0:
            if takes_over(at, s, near, touch.du, other, spring):
                chosen.newcomer = e
                chosen.leaver = other
                stored, k = spring.normal_energy[other], greatest_stiffness(at, s, near.face)
                chosen.begins = compression_kept(stored, pressure(other, spring), touch.du, near.normal, k)
        return chosen

    @wp.func
    def slip_normal(at: Surfaces, e: int, near: Nearest, begin: int, spring: Spring) -> wp.vec3d:
        """Unit normal of the plane in which a node slips on a side: midway to others that press it across an edge."""
        total = near.normal
        for q in range(begin, begin + wp.static(sides)):
            if q != e and spring.face[q] >= 0:
                across = area_vector(at.X, at.u, at.master.face, spring.face[q])
                if is_edge(at.X, at.u, at.master.face, near.face, spring.face[q], across):
                    total += wp.normalize(across)
        return wp.normalize(total)

    @wp.func
    def confirm(
        at: Surfaces,
        s: int,
        e: int,
        near: Nearest,
        touch: Touch,
        touches: bool,
        node: NodeSprings,
        choice: Choice,
        spring: Spring,
    ) -> Touch:
        """The choice applied to a side. A node that meets an edge head-on is pressed by both sides: the sum of their
        forces halves the angle between them.
        """
        found = touch
        found.touches = touches
        if e == choice.newcomer:
            if not (choice.returns and touches):
                found.begins = choice.begins
            if found.begins == wp.float64(FAR) and touch.held < wp.float64(ANY_DEPTH):
                found.begins = wp.max(-wp.dot(touch.du, near.normal), wp.float64(0.0))
            found.touches = touches or choice.leaver >= 0 or choice.returns
        elif e == choice.leaver or (choice.passed >> (e - node.begin)) % 2 == 1:
            found.touches = bool(False)
        elif spring.face[e] < 0 and choice.face >= 0:
            approach = -wp.dot(touch.du, near.normal)
            if is_edge(at.X, at.u, at.master.face, near.face, choice.face, choice.normal):
                depths = -near.gap - approach - choice.depth
                even = head_on(at, s, touch.du, near.normal, choice.normal, depths, edge_of(near))
                inside = near.front == wp.float64(FAR) and wp.abs(depths) <= wp.float64(_BEHIND) * edge_of(near)
                found.touches = even and (touches or inside)
                found.begins = wp.max(approach, wp.float64(0.0))
        if wp.static(friction):
            found.slip = slip_normal(at, e, near, node.begin, spring)
        found.own = greatest_stiffness(at, s, near.face)
        found.limit = found.own
        return found

    return choose, confirm
