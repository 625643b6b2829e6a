"""Owns joints: what ties nodes of two bodies, or of a body and the ground.

A joint is plain, immutable data with one method, `ties`, that says which nodes move as one and in which directions. A
new kind is a dataclass made of `Joint` with a place in the table `JOINTS`; the solver needs nothing else.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import NoneType
from typing import ClassVar, Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.freedoms import Freedom, Whole
from warp_mca.scene.ties import Clusters, Index, Pin, Rails, Side, Ties, coincident, rails_along


@dataclass(frozen=True, kw_only=True)
class Joint:
    """Base class of joints.

    Attributes:
        name: unique in the scene; `joint_impulse` of the summary goes by it.
        body: first body, to which the reported impulse is given.
        other: second body, or None for the ground.
        place: name of the field that says which nodes are tied, for errors.
    """

    name: str
    body: str
    other: str | None = None
    place: ClassVar[str] = "nodes"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts(type(self).__name__, name=self.name, body=self.body)
        validate.kinds(self.title, (str, NoneType), "name a body, or None for the ground", other=self.other)
        if self.other == self.body:
            raise bad_value(f"{self.title}.other", self.other, "name a body other than the first, or None")

    @property
    def title(self) -> str:
        """Kind and name, for errors."""
        return f"{type(self).__name__} {self.name}"

    def ties(self, first: Side, second: Side | None) -> Ties | Rails | Clusters:
        """Pairs that the joint ties, nodes on rails, or clusters; `second` is None for the ground.

        Raises:
            RequestError: the bodies have no such nodes.
        """
        raise NotImplementedError("its class has no ties()")

    def whole(self) -> Whole | None:
        """Its freedoms where it joins whole bodies, one of them rigid, in place of nodes; None where it ties nodes."""
        return None

    def sets(self) -> dict[str, tuple[str, str]]:
        """Node sets that it names, by field: the body and the set."""
        return {}


@dataclass(frozen=True, kw_only=True)
class Revolute(Joint):
    """A hinge ("re-joint"): pairs of coincident nodes on the hinge axis move as one, or the mean of those around it.

    Attributes:
        at: a point of the hinge axis in the frame of `body` [m].
        other_at: the same point in the frame of `other` [m].
        axis: direction of the hinge axis in the frame of both bodies [-].
        nodes: "axis" ties every node on the axis; "ends" the two outermost pairs, as the paper does; "pin" ties the
            mean motion of all nodes near the axis, which need not coincide; "hole" that of the surfaces of shaft holes
            around the axis.
        pin_radius: distance from the axis up to which "pin" takes nodes [m]; their weight decreases from 1 on the axis
            to 0 there. With "hole", the radius of the holes.
    """

    at: Vec3
    other_at: Vec3 = (0.0, 0.0, 0.0)
    axis: Vec3 = (0.0, 0.0, 1.0)
    nodes: Literal["axis", "ends", "pin", "hole"] | None = "axis"
    pin_radius: float | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.vectors(self.title, at=self.at, other_at=self.other_at)
        validate.directions(self.title, axis=self.axis)
        if self.nodes is not None:
            validate.choice(self.title, ("axis", "ends", "pin", "hole"), nodes=self.nodes)
        pinned = self.nodes in ("pin", "hole")
        if (self.pin_radius is not None) != pinned:
            remedy = f"give the radius of the {self.nodes} [m]" if pinned else 'it needs nodes="pin"; leave it out'
            raise bad_value(f"{self.title}.pin_radius", self.pin_radius, remedy)
        if self.pin_radius is not None:
            validate.positive(self.title, pin_radius=self.pin_radius)

    @property
    def pin(self) -> Pin | None:
        """Which nodes around the axis share a mean motion; None where those on it are tied."""
        return None if self.pin_radius is None else Pin(self.pin_radius, hole=self.nodes == "hole")

    def whole(self) -> Whole | None:
        """A hinge, without nodes."""
        if self.nodes is not None:
            return None
        return Whole((Freedom(axis=self.axis),), self.at, self.other_at if self.other else None)

    def ties(self, first: Side, second: Side | None) -> Ties | Clusters:
        """Nodes on the axis, in the order along it, or those around it."""
        if self.pin is not None:
            a = first.on_pin(self.at, self.axis, self.pin)
            b = (None, None) if second is None else second.on_pin(self.other_at, self.axis, self.pin)
            return Clusters(*a, self.at, self.axis, *b, self.other_at)
        a = self._nodes(first, self.at)
        if len(a) < 2:
            what = f"{len(a)} nodes of {self.body} lie on this axis; two are needed, or nodes=None for rigid bodies"
            raise bad_value(f"{self.title}.at", self.at, what)
        return Ties(a, None if second is None else self._nodes(second, self.other_at))

    def _nodes(self, side: Side, at: Vec3) -> Index:
        found = side.on_axis(at, self.axis)
        return found[[0, -1]] if self.nodes == "ends" and len(found) > 1 else found


@dataclass(frozen=True, kw_only=True)
class Weld(Joint):
    """All coincident nodes of two node sets move as one, or those of one set stay at rest.

    Attributes:
        nodes: node set of `body`; None joins rigid bodies as a whole, in the place where they stand.
        other_nodes: node set of `other`; None for the ground. Nodes without a partner there stay free.
    """

    nodes: str | None = None
    other_nodes: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_sets(self, self.nodes, self.other_nodes)

    def whole(self) -> Whole | None:
        """No freedom, without nodes."""
        return Whole() if self.nodes is None else None

    def sets(self) -> dict[str, tuple[str, str]]:
        """Those of both bodies."""
        return _sets(self, self.nodes, self.other_nodes)

    def ties(self, first: Side, second: Side | None) -> Ties:
        """Each node of the set, with the one of the other set at its place."""
        assert self.nodes is not None
        a, b = first.mesh.nodes(self.nodes), None
        if second is not None:
            assert self.other_nodes is not None
            a, b = coincident(first, a, second, second.mesh.nodes(self.other_nodes))
        if _on_a_line(first, a):
            where = f" coincide with nodes of {self.other_nodes} of {self.other}" if second else ""
            what = f"{len(a)} of these nodes{where}, and a weld needs three that are not on a line"
            raise bad_value(f"{self.title}.nodes", self.nodes, f"{what}; name sets that meet, of equal meshes")
        return Ties(a, b)


@dataclass(frozen=True, kw_only=True)
class Spherical(Joint):
    """A ball joint: two coincident nodes move as one, or one node stays at rest.

    Attributes:
        at: place of the node in the frame of `body` [m].
        other_at: place of the other node in the frame of `other` [m].
        nodes: "nearest" ties the nodes there; None needs no nodes: rigid bodies hang together as a whole.
    """

    at: Vec3
    other_at: Vec3 = (0.0, 0.0, 0.0)
    nodes: Literal["nearest"] | None = "nearest"
    place = "at"

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.vectors(self.title, at=self.at, other_at=self.other_at)
        if self.nodes not in ("nearest", None):
            raise bad_value(f"{self.title}.nodes", self.nodes, 'give "nearest", or None for rigid bodies without nodes')

    def whole(self) -> Whole | None:
        """A ball, without nodes."""
        if self.nodes is not None:
            return None
        return Whole((Freedom(kind="ball"),), self.at, self.other_at if self.other else None)

    def ties(self, first: Side, second: Side | None) -> Ties:
        """The node at the joint, of each body."""
        a = self._node("at", first, self.at)
        return Ties(a, None if second is None else self._node("other_at", second, self.other_at))

    def _node(self, field: str, side: Side, at: Vec3) -> Index:
        away = np.linalg.norm(side.mesh.points - np.asarray(at), axis=1)
        nearest = int(np.argmin(away))
        if away[nearest] > side.tolerance:
            what = f"the nearest node of {side.body} is {away[nearest]:.3g} m away"
            raise bad_value(f"{self.title}.{field}", at, f"{what}; give the place of a node, or nodes=None")
        return np.array([nearest], dtype=np.int32)


@dataclass(frozen=True, kw_only=True)
class Prismatic(Joint):
    """The nodes of a set slide along a direction that is fixed in space, or along lines of nodes of the other body.

    Each node slides by itself. On another body, its rail is the line of nodes, parallel to the axis at the start, that
    the node is on; rails bend and turn with the body that they belong to, and go on straight beyond their ends.

    Attributes:
        nodes: node set of `body`; relative to another body, those that are on none of its lines stay free. None lets
            rigid bodies slide as a whole, along a direction that turns with them.
        other_nodes: node set of `other` that holds the rails; None for the ground.
        axis: direction of the slide in the frame of `body` at the start [-].
    """

    axis: Vec3
    nodes: str | None = None
    other_nodes: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.directions(self.title, axis=self.axis)
        _check_sets(self, self.nodes, self.other_nodes)

    def whole(self) -> Whole | None:
        """A slide, without nodes."""
        return Whole((Freedom(kind="slide", axis=self.axis),)) if self.nodes is None else None

    def sets(self) -> dict[str, tuple[str, str]]:
        """Those of both bodies."""
        return _sets(self, self.nodes, self.other_nodes)

    def ties(self, first: Side, second: Side | None) -> Ties | Rails:
        """The nodes of the set, across the axis."""
        assert self.nodes is not None
        a, axis = first.mesh.nodes(self.nodes), first.frame @ np.asarray(self.axis) / np.linalg.norm(self.axis)
        if second is None:
            return Ties(a, tied=np.eye(3) - np.outer(axis, axis))
        assert self.other_nodes is not None
        rails = rails_along(first, a, second, second.mesh.nodes(self.other_nodes), axis)
        sliders = np.concatenate([np.zeros(0, np.int32), *rails.sliders])
        if _on_a_line(first, sliders):
            where = f"are on lines of {self.other_nodes} of {self.other} along the axis"
            what = f"{len(sliders)} of these nodes {where}, and a slide needs three that are not on one line"
            raise bad_value(f"{self.title}.nodes", self.nodes, what)
        return rails


def _check_sets(joint: Joint, nodes: str | None, other_nodes: str | None) -> None:
    """Refuse one node set where both bodies have one, or none.

    Raises:
        RequestError: so it is.
    """
    if nodes is not None:
        validate.texts(joint.title, nodes=nodes)
    if (other_nodes is None) != (joint.other is None or nodes is None):
        remedy = "name a node set of the other body" if joint.other else "leave it out, the ground has no nodes"
        remedy = "give nodes too, or leave both out for rigid bodies" if joint.other and nodes is None else remedy
        raise bad_value(f"{joint.title}.other_nodes", other_nodes, remedy)


def _sets(joint: Joint, nodes: str | None, other_nodes: str | None) -> dict[str, tuple[str, str]]:
    """As `Joint.sets`."""
    found = {} if nodes is None else {"nodes": (joint.body, nodes)}
    if joint.other is not None and other_nodes is not None:
        found["other_nodes"] = (joint.other, other_nodes)
    return found


def _on_a_line(side: Side, nodes: Index) -> bool:
    """Whether nodes are on one line, at one point or none."""
    offset = side.X[nodes] - side.X[nodes].mean(axis=0) if len(nodes) else np.zeros((1, 3))
    return bool(np.linalg.matrix_rank(offset, tol=side.tolerance) < 2)


JOINTS: dict[str, type[Joint]] = {kind.__name__: kind for kind in (Revolute, Weld, Spherical, Prismatic)}
