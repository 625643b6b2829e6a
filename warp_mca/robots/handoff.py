"""Owns the hand-off: a machine at the end of its swing as a scene of rigid and flexible bodies, joints and contacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.robots.contacts import Contacts
from warp_mca.robots.drives import freedoms_of, refuse_at_hand_off
from warp_mca.robots.gearing import Gearing, joint_name
from warp_mca.robots.gravity import gravity_of
from warp_mca.robots.masses import MassProperties, of_link
from warp_mca.scene import Articulation, Body, Fixed, Freedom, Scene
from warp_mca.scene.phases import ImpactPhase

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine, Motion
    from warp_mca.robots.robot import Robot
    from warp_mca.robots.swing import RobotSwing
    from warp_mca.robots.touching import Pair

REST = " rest"  # added to the name of a flexible link for the rigid body that rides on it


class HandOff:
    """Turns a machine that has swung into a scene.

    Attributes:
        robot, machine, swing: what swung.
        bodies: of the scene so far.
    """

    def __init__(self, robot: Robot, machine: Machine, swing: RobotSwing) -> None:
        """Place the machine at the end of the swing.

        Raises:
            RequestError: it has something that the impact phase does not carry.
        """
        self.robot, self.machine, self.swing = robot, machine, swing
        machine.ctrl = swing.ctrl
        machine.advance(np.concatenate([swing.qpos, swing.qvel, np.zeros(2)]))
        refuse_at_hand_off(machine)
        self.names = machine.names
        self.bodies: list[Body] = []
        self.joints: list[Articulation] = []

    def scene(
        self,
        impact: ImpactPhase,
        pairs: Sequence[Pair],
        springs: tuple[float, float, int],
        name: str,
        drawn: bool = False,
    ) -> Scene:
        """The scene; `springs` are stiffness, mu and faces of `Robot.strike`, which has the other arguments too.

        Raises:
            RequestError: a flexible link is held nowhere, or a surface cannot be made.
        """
        self._gearing = Gearing(self.machine, impact.duration)
        contacts = Contacts(self.robot, self.machine, self.swing, impact.duration, springs, drawn)
        contacts.add(pairs)
        model = self.machine.model
        for link in range(1, model.nbody):
            if self._moves(link) and self.machine.carrier(link) == link:
                self._add_link(link, contacts)
        for k in range(model.neq):
            if model.eq_active0[k] and int(model.eq_type[k]) != int(self.machine.mj.mjtEq.mjEQ_JOINT):
                self._add_loop(k)
        self.bodies += [*self._gearing.bodies, *contacts.beside()]
        self.joints += self._gearing.joints
        gravity, loads = gravity_of(self.robot, self.machine, REST)
        touch = self.swing.touch
        facts: dict[str, object] = {"robot": str(self.robot.path), "swing": self.swing.t_end}
        if touch:
            facts |= {"first": touch.first, "second": touch.second, "effective_mass": touch.effective_mass}
            facts |= {"v_n": -float(touch.velocity @ touch.normal)}
        return Scene(
            name=name,
            bodies=tuple(self.bodies),
            joints=tuple(self.joints),
            fixed=tuple(Fixed(body=body, nodes="boundary") for body in contacts.held),
            contacts=tuple(contacts.found),
            gravity=gravity,
            loads=loads,
            impact=impact,
            parameters=facts,
        )

    def _moves(self, link: int) -> bool:
        return int(self.machine.model.body_weldid[link]) != 0

    def _add_link(self, link: int, contacts: Contacts) -> None:
        """The body or bodies of a link, and the joint that holds it."""
        name, machine = self.names.body(link), self.machine
        motion = machine.motion(link)
        flexible = self.robot.flexible.get(name)
        if flexible is None:
            geometry = contacts.geometry(link)
            self.bodies.append(_rigid(name, of_link(machine, link), motion, geometry))
        else:
            self.bodies.append(_placed(flexible, motion))
            rest = self.machine.rests.get(name)
            if rest is not None:
                self.bodies.append(_rigid(name + REST, rest, motion, None))
                nodes = mount(self.robot, name, None)
                self.joints.append(Articulation(name=f"{name} mount", body=name + REST, other=name, other_nodes=nodes))
        self._add_joint(link)

    def _holder(self, link: int, neighbour: int) -> tuple[str | None, str | None]:
        """The body that stands for a link in its joints, and its node set if flexible; None for the ground."""
        if not self._moves(link):
            return None, None
        name = self.names.body(link)
        if name not in self.robot.flexible:
            return name, None
        if self.machine.rests.get(name) is not None:
            return name + REST, None
        return name, mount(self.robot, name, self.names.body(neighbour))

    def _add_joint(self, link: int) -> None:
        """The joint between a link and its parent; none where it flies freely."""
        machine, model = self.machine, self.machine.model
        first, count = int(model.body_jntadr[link]), int(model.body_jntnum[link])
        joints = range(first, first + count) if count else range(0)
        if any(int(model.jnt_type[k]) == int(machine.mj.mjtJoint.mjJNT_FREE) for k in joints):
            return
        parent = self.machine.carrier(int(model.body_parentid[link]))
        body, nodes = self._holder(link, parent)
        other, other_nodes = self._holder(parent, link)
        assert body is not None
        if len(joints) > 1 and any(int(model.jnt_type[k]) == int(machine.mj.mjtJoint.mjJNT_BALL) for k in joints):
            remedy = "a ball beside other joints of one link is not carried; give three hinges, or a link between"
            raise bad_value("Robot: joints of link", self.names.body(link), remedy)
        freedoms = tuple(item for k in joints for item in freedoms_of(machine, k, self.swing.qpos, self._gearing))
        name = joint_name(machine, link)
        if nodes is not None:  # the frame of a flexible body is not that of its link
            freedoms, at = self._in_frame(body, link, freedoms)
        else:
            at = freedoms[0].at if freedoms and freedoms[0].at else (0.0, 0.0, 0.0)
        self.joints.append(
            Articulation(
                name=name, body=body, other=other, nodes=nodes, other_nodes=other_nodes, at=at, freedoms=freedoms
            )
        )

    def _in_frame(self, body: str, link: int, freedoms: tuple[Freedom, ...]) -> tuple[tuple[Freedom, ...], Any]:
        """Freedoms and the point of a joint in the frame of a flexible body."""
        own = self.robot.flexible[body]
        turned = rotation_matrix(own.rotation)
        place = lambda point: _vec(turned.T @ (np.array(point) - np.array(own.position)))  # noqa: E731
        moved = tuple(
            replace(item, axis=_vec(turned.T @ np.array(item.axis)), at=place(item.at or (0.0, 0.0, 0.0)))
            for item in freedoms
        )
        return moved, moved[0].at if moved else place((0.0, 0.0, 0.0))

    def _add_loop(self, k: int) -> None:
        """The joint of an equality constraint."""
        machine, model, mj = self.machine, self.machine.model, self.machine.mj
        name, kind = self.names.equality(k), int(model.eq_type[k])
        if int(model.eq_objtype[k]) != int(mj.mjtObj.mjOBJ_BODY):
            remedy = "an impact carries connect and weld between bodies, not sites; name the bodies"
            raise bad_value("Robot: equality", name, remedy)
        ends = int(model.eq_obj1id[k]), int(model.eq_obj2id[k])
        links = [self.machine.carrier(end) for end in ends]
        point = machine.point(ends[0], model.eq_data[k, :3] if kind == int(mj.mjtEq.mjEQ_CONNECT) else np.zeros(3))
        if not self._moves(links[0]):
            links.reverse()
        (body, nodes), (other, other_nodes) = self._holder(*links), self._holder(*links[::-1])
        if body is None or nodes or other_nodes:
            raise bad_value("Robot: equality", name, "it must hold two links of which neither is flexible")
        at = machine.local(links[0], point)
        freedoms = (Freedom(kind="ball", at=_vec(at)),) if kind == int(mj.mjtEq.mjEQ_CONNECT) else ()
        self.joints.append(Articulation(name=name, body=body, other=other, at=_vec(at), freedoms=freedoms))


def mount(robot: Robot, link: str, other: str | None) -> str:
    """Node set by which a flexible link is held to another link, or to what rides on it.

    Raises:
        RequestError: none was given.
    """
    given = robot.mounts.get(link)
    found = given.get(other) if isinstance(given, Mapping) else given
    if not isinstance(found, str):
        held = "what rides on it" if other is None else other
        sets = ", ".join(sorted(robot.meshes[link].node_sets))
        remedy = f"name the node set that holds it to {held}; its mesh has {sets}"
        raise bad_value(f"Robot.mounts[{link!r}]", given, remedy)
    return found


def _rigid(name: str, own: MassProperties, motion: Motion, geometry: Any) -> Body:
    """A rigid body with given mass, centre and inertia in its link's frame, with the link's motion."""
    return Body(
        name=name,
        geometry=geometry,
        rigid=True,
        mass=own.mass,
        centre=_vec(own.centre),
        inertia=tuple(tuple(float(v) for v in row) for row in own.inertia),
        position=_vec(motion.origin),
        rotation=_vec(motion.turn()),
        velocity=_vec(motion.velocity),
        angular_velocity=_vec(motion.spin),
    )


def _placed(body: Body, motion: Motion) -> Body:
    """A flexible body in its link's frame, with the link's motion."""
    arm = motion.rotation @ np.array(body.position)
    return replace(
        body,
        position=_vec(motion.origin + arm),
        rotation=_vec(motion.turn(body.rotation)),
        velocity=_vec(motion.velocity + np.cross(motion.spin, arm)),
        angular_velocity=_vec(motion.spin),
    )


def _vec(values: Array) -> Any:
    return tuple(float(v) for v in values)
