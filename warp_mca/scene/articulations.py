"""Owns joints between whole bodies, which need no nodes that coincide, and what a scene must say of such bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.freedoms import Controller, Freedom, Whole
from warp_mca.scene.joints import JOINTS, Joint

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene

PARALLEL = 1e-6  # least singular value of the screws of a joint's freedoms, over their greatest entry


@dataclass(frozen=True, kw_only=True)
class WholeJoint(Joint):
    """Base class of joints that join whole bodies in every case.

    Attributes:
        at: the joint's point in the frame of `body` [m]; force and moment are those at this point.
        other_at: the same point in the frame of `other` [m], to check where the bodies stand; None: it is where `body`
            has it.
        nodes: node set of `body` where that is flexible: its nodes take part by their mean motion, weighted by mass,
            and share the impulses (a distributing coupling). None for a rigid body.
        other_nodes: likewise of `other`.
    """

    at: Vec3 = (0.0, 0.0, 0.0)
    other_at: Vec3 | None = None
    nodes: str | None = None
    other_nodes: str | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.vectors(self.title, at=self.at)
        if self.other_at is not None:
            validate.vectors(self.title, other_at=self.other_at)
        for name in ("nodes", "other_nodes"):
            if getattr(self, name) is not None:
                validate.texts(self.title, **{name: getattr(self, name)})
        if self.other is None and (self.other_nodes is not None or self.other_at is not None):
            name = "other_at" if self.other_nodes is None else "other_nodes"
            raise bad_value(f"{self.title}.{name}", getattr(self, name), "the ground has none; leave it out")

    def sets(self) -> dict[str, tuple[str, str]]:
        """Those of flexible bodies."""
        found = {} if self.nodes is None else {"nodes": (self.body, self.nodes)}
        if self.other is not None and self.other_nodes is not None:
            found["other_nodes"] = (self.other, self.other_nodes)
        return found

    def _whole(self, *freedoms: Freedom) -> Whole:
        return Whole(
            freedoms=freedoms,
            at=self.at,
            other_at=self.other_at,
            nodes=self.nodes,
            other_nodes=self.other_nodes,
        )


@dataclass(frozen=True, kw_only=True)
class Articulation(WholeJoint):
    """Any set of hinges, slides and balls between two bodies, or a body and the ground, as one joint; none is a weld.

    One of the bodies at least is rigid, and the other one is rigid, the ground, or flexible with a node set. No links
    without mass stand between the freedoms. Springs, dampers, friction, limits, motors and armature belong to a
    `Freedom`. A pose in which two axes of a joint become parallel is singular: leave it out by limits.

    Attributes:
        freedoms: in turn, the first carries the second; five rates at most, of which a ball has three.
    """

    freedoms: tuple[Freedom, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.members(self.title, Freedom, freedoms=self.freedoms)
        rates = sum(freedom.rates for freedom in self.freedoms)
        if rates > 5:
            remedy = "two bodies have six relative motions, and a joint holds one of them at least; give fewer"
            raise bad_value(f"{self.title}.freedoms", f"{rates} of them", remedy)

    def whole(self) -> Whole:
        """Its freedoms."""
        return self._whole(*self.freedoms)


@dataclass(frozen=True, kw_only=True)
class Universal(WholeJoint):
    """A cross of two hinges whose axes meet: the first belongs to `other`, the second to `body`.

    Attributes:
        axis, second_axis: of the hinges, in the frame of `body` at the start [-].
    """

    axis: Vec3
    second_axis: Vec3

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.directions(self.title, axis=self.axis, second_axis=self.second_axis)

    def whole(self) -> Whole:
        """Two hinges."""
        return self._whole(Freedom(axis=self.axis), Freedom(axis=self.second_axis))


@dataclass(frozen=True, kw_only=True)
class Cylindrical(WholeJoint):
    """A bolt that turns about its axis and slides along it.

    Attributes:
        axis: in the frame of `body` [-].
    """

    axis: Vec3

    def __post_init__(self) -> None:
        super().__post_init__()
        validate.directions(self.title, axis=self.axis)

    def whole(self) -> Whole:
        """A hinge and a slide along one axis."""
        return self._whole(Freedom(axis=self.axis), Freedom(kind="slide", axis=self.axis))


def check_whole(scene: Scene) -> None:
    """Refuse joints of whole bodies that cannot be, and contact of bodies without geometry.

    Raises:
        RequestError: both bodies are flexible, a flexible one has no node set, a rigid one has, the scene has
            phases before the impact, or such a body is in contact.
    """
    rigid = set(scene.rigid_names)
    bare = {body.name for body in scene.bodies if body.is_inertia}
    for contact in scene.listed:
        for name in ("slave", "master"):
            body = getattr(getattr(contact, name), "body", None)
            if body in bare:
                raise bad_value(f"Contact.{name}.body", body, "it is a mass without surface; give it a geometry")
    for joint in scene.acting_joints:
        whole = joint.whole()
        if whole is None:
            continue
        if scene.rigid is not None:
            remedy = "links of a RigidPhase hang on Revolute joints with nodes; leave the RigidPhase out"
            raise bad_value(f"{joint.title}.nodes", whole.nodes, remedy)
        sides = {"nodes": joint.body, "other_nodes": joint.other}
        if not rigid & {joint.body, joint.other}:
            remedy = "a joint of whole bodies needs a rigid one; set rigid=True, or tie nodes of both bodies"
            raise bad_value(f"{joint.title}.body", joint.body, remedy)
        for name, body in sides.items():
            given = getattr(whole, name)
            if body in rigid and given is not None:
                raise bad_value(f"{joint.title}.{name}", given, f"{body} moves as one rigid body; leave it out")
            if body is not None and body not in rigid and given is None:
                raise bad_value(f"{joint.title}.{name}", given, f"name a node set of {body}, which is flexible")
        _check_independent(joint.title, whole)
        for freedom in whole.freedoms:
            if isinstance(freedom.motor, Controller):
                _check_period(freedom.motor, scene.impact.output_interval)
            if freedom.follows is not None:
                _check_coupler(scene, joint, freedom)
        if scene.phases:
            remedy = f"joints between whole bodies, as {joint.title}, take part in the impact alone; leave phases out"
            raise bad_value("Scene.phases", [type(phase).__name__ for phase in scene.phases], remedy)


def _check_coupler(scene: Scene, joint: Joint, freedom: Freedom) -> None:
    """Refuse a coupler to a freedom that is not in the scene, or to its own.

    Raises:
        RequestError: so it is.
    """
    coupler = freedom.follows
    assert coupler is not None
    freedoms = {item.name: whole.freedoms for item in scene.acting_joints if (whole := item.whole()) is not None}
    if coupler.joint not in freedoms:
        known = ", ".join(sorted(freedoms))
        raise bad_value("Coupler.joint", coupler.joint, f"joints between whole bodies are {known}; name one of them")
    found = freedoms[coupler.joint]
    other = found[coupler.freedom - 1] if coupler.freedom <= len(found) else None
    if other is None or other.kind == "ball":
        scalar = [str(k + 1) for k, item in enumerate(found) if item.kind != "ball"]
        remedy = f"hinges and slides of {coupler.joint} have the numbers {', '.join(scalar) or 'none'}; name one"
        raise bad_value("Coupler.freedom", coupler.freedom, remedy)
    if other is freedom and coupler.joint == joint.name:
        raise bad_value("Coupler.joint", coupler.joint, "a freedom cannot follow itself; name another one")


def _check_independent(title: str, whole: Whole) -> None:
    """Refuse freedoms of which some make the same motion where the bodies stand.

    Raises:
        RequestError: there are such freedoms.
    """
    R, screws = np.eye(3), []
    place = np.zeros(3)  # where the freedoms so far take the origin
    for freedom, point in zip(whole.freedoms, whole.points, strict=True):
        at = place + R @ np.array(point)
        if freedom.kind == "ball":
            screws += [np.concatenate([axis, np.cross(at, axis)]) for axis in np.eye(3)]
            continue
        axis = np.array(freedom.axis) / np.linalg.norm(freedom.axis)
        along = R @ axis
        if freedom.kind == "slide":
            screws.append(np.concatenate([np.zeros(3), along]))
            place = place + freedom.position * along
        else:
            screws.append(np.concatenate([along, np.cross(at, along)]))
            R = R @ rotation_matrix(freedom.position * axis)
            place = at - R @ np.array(point)
    if screws and np.linalg.svd(np.array(screws), compute_uv=False)[-1] < PARALLEL * np.abs(screws).max():
        what = f"{len(whole.freedoms)} of them"
        raise bad_value(f"{title}.freedoms", what, "two make the same motion where the bodies stand; turn an axis")


def _check_period(controller: Controller, interval: float) -> None:
    """Refuse a period in which a whole number of output intervals does not fit.

    Raises:
        RequestError: so it is.
    """
    count = controller.period / interval
    if count < 0.5 or abs(count - round(count)) > 1e-6 * count:
        remedy = f"give a multiple of ImpactPhase.output_interval = {interval:g} s, at which it can be asked"
        raise bad_value("Controller.period", controller.period, remedy)


JOINTS.update({kind.__name__: kind for kind in (Articulation, Universal, Cylindrical)})
