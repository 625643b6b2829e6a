"""Owns the way back: a machine after an impact, whose motion is put on its joints so that momenta are kept."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix, rotation_vector
from warp_mca.robots.drives import three_hinges
from warp_mca.robots.gearing import joint_name
from warp_mca.robots.handoff import REST
from warp_mca.robots.machine import Machine
from warp_mca.robots.sockets import axes_of
from warp_mca.scene import Body, Scene

if TYPE_CHECKING:
    from warp_mca.results.result import Result
    from warp_mca.robots.robot import Robot
    from warp_mca.robots.swing import RobotSwing


@dataclass(frozen=True, kw_only=True)
class HandBack:
    """A machine after an impact.

    Attributes:
        robot: that swings on from there, its clock and what stands beside it moved on.
        momentum: generalised momenta that the impact left [kg m/s, kg m^2/s], shape (nv,), float64.
        kinetic_energy: of the machine's joints with them [J].
        vibration: kinetic and elastic energy of its bodies that this motion does not have [J]; it is lost.
    """

    robot: Robot
    momentum: Array
    kinetic_energy: float
    vibration: float


def hand_back(robot: Robot, swing: RobotSwing, scene: Scene, result: Result) -> HandBack:
    """The machine after the impact `result` of `scene`, which `robot` handed over after `swing`.

    Rates are M^-1 p with the generalised momenta p = sum (J_v^T P + J_w^T L) + rotors of the bodies' momenta P and
    spins L; with loops, those of their free motion.

    Raises:
        RequestError: the result is not one of the scene, a flexible link yielded, or a flexible body beside moves.
    """
    summary = result.summary
    _check(robot, scene, summary)
    machine = Machine(robot)
    q = swing.qpos.copy()
    rotor = np.zeros(machine.nv)
    ends = _Ends(scene, summary, robot.flexible)
    for link in range(1, machine.model.nbody):
        _take_joints(machine, link, q, rotor, swing, ends)
    y = np.concatenate([q, np.zeros(machine.nv + 2)])
    machine.advance(y)
    momentum, kinetic = machine.armature() * rotor, 0.5 * float(machine.armature() @ rotor**2)
    for link in range(1, machine.model.nbody):
        name = machine.names.body(link)
        for body in (name, name + REST):
            if body in ends.moved:
                momentum += machine.momenta(link, *ends.moved[body][:3])
                kinetic += ends.moved[body][3]
    rates = machine.mobility() @ momentum
    own = 0.5 * float(rates @ machine.mass_matrix() @ rates)
    beside = tuple(ends.beside(item) if isinstance(item, Body) else item for item in robot.against)
    following = replace(
        robot,
        keyframe=None,
        qpos=tuple(q),
        qvel=tuple(rates),
        ctrl=tuple(swing.ctrl),
        against=beside,
        clock=robot.clock + swing.t_end + float(summary["simulated_time"]),
    )
    lost = kinetic + float(summary["energy"]["elastic"]) - own
    return HandBack(robot=following, momentum=momentum, kinetic_energy=own, vibration=lost)


def _check(robot: Robot, scene: Scene, summary: Mapping[str, Any]) -> None:
    if summary["scene"] != scene.name or "rigid_bodies" not in summary:
        raise bad_value("Robot.after: result", summary["scene"], f"give the result of the scene {scene.name}")
    end = float(summary["simulated_time"]) - 1.5 * scene.impact.output_interval
    if any(last > end for _, last in summary["contacts"]):
        remedy = "a contact is still closed at its end; give it a longer one, in which all open"
        raise bad_value("ImpactPhase.duration", float(summary["simulated_time"]), remedy)
    if summary["max_plastic_strain"] > 0.0 and robot.flexible:
        remedy = "flexible links yielded, and their permanent shape would be lost; go on with finite elements"
        raise bad_value("max_plastic_strain", float(summary["max_plastic_strain"]), remedy)
    fixed = {item.body for item in scene.fixed}
    for item in robot.against:
        if isinstance(item, Body) and not item.rigid and item.name not in fixed:
            raise bad_value("Robot.against", item.name, "a flexible body beside must be held by fixed to go on")


class _Ends:
    """Bodies of a scene at the end of its impact.

    Attributes:
        moved: mass centre [m], momentum [kg m/s], spin [kg m^2/s], each shape (3,), and kinetic energy [J], by name.
    """

    def __init__(self, scene: Scene, summary: Mapping[str, Any], flexible: Mapping[str, Body]) -> None:
        self._summary, self._flexible = summary, flexible
        self._bodies = {body.name: body for body in scene.bodies}
        self._facts = {**summary["rigid_bodies"], **summary["flexible_bodies"]}
        self.moved: dict[str, tuple[Array, Array, Array, float]] = {}
        self._turned: dict[str, Array] = {}
        for name, found in summary["rigid_bodies"].items():
            P, L = np.array(found["momentum"]), np.array(found["spin"])
            self._turned[name] = rotation_matrix(found["rotation"])
            own = 0.5 * float(P @ P) / found["mass"] + 0.5 * float(L @ self.spin(name, L))
            self.moved[name] = np.array(found["centre"]), P, L, own
        for name, found in summary["flexible_bodies"].items():
            self._turned[name] = rotation_matrix(found["rotation"])
            centre, P, L = (np.array(found[key]) for key in ("centre", "momentum", "spin"))
            self.moved[name] = centre, P, L, float(found["kinetic"])

    def rotation(self, name: str) -> Array:
        """From the frame of a link or body to the world at the end, shape (3, 3); of flexible ones as a mean."""
        name = self._holder(name)
        return self._turned[name] @ self._frame(name)[1]

    def spin(self, name: str, L: Array) -> Array:
        """Angular velocity of a rigid body at an angular momentum L about its centre [rad/s], shape (3,)."""
        turned = self._turned[name]
        inertia = turned @ np.array(self._summary["rigid_bodies"][name]["inertia"]) @ turned.T
        return np.asarray(np.linalg.solve(inertia, L), dtype=np.float64)

    def origin(self, name: str) -> Array:
        """Of that frame at the end [m], shape (3,)."""
        name = self._holder(name)
        found = self._facts[name]
        before = np.array(found["centre"]) - np.array(found["displacement"])
        return self.moved[name][0] + self._turned[name] @ (self._frame(name)[0] - before)

    def start(self, name: str) -> Array:
        """From the frame of a link to the world at the start, shape (3, 3)."""
        return self._frame(self._holder(name))[1]

    def _holder(self, name: str) -> str:
        """What rides on a flexible link in its place, where something does."""
        return name + REST if name + REST in self.moved else name

    def _frame(self, name: str) -> tuple[Array, Array]:
        """Origin [m], shape (3,), and rotation, shape (3, 3), of such a frame at the start."""
        body = self._bodies[name]
        origin, rotation = np.array(body.position), rotation_matrix(body.rotation)
        if name in self._flexible:
            own = self._flexible[name]
            rotation = rotation @ rotation_matrix(own.rotation).T
            origin = origin - rotation @ np.array(own.position)
        return origin, rotation

    def joint(self, name: str) -> tuple[Array, Array]:
        """Positions and rates of the freedoms of a joint, each shape (count,)."""
        found = self._summary["joints"][name]
        position, rate = (np.array([item["value"] for item in found[key]]) for key in ("position", "rate"))
        return position, rate

    def beside(self, body: Body) -> Body:
        """A body beside the machine where it is at the end, with its motion; flexible ones are held."""
        if body.name not in self._summary["rigid_bodies"]:
            return body
        centre, P, L, _ = self.moved[body.name]
        spin = self.spin(body.name, L)
        origin = self.origin(body.name)
        velocity = P / self._summary["rigid_bodies"][body.name]["mass"] + np.cross(spin, origin - centre)
        turn = rotation_vector(self.rotation(body.name))
        vectors = {"position": origin, "rotation": turn, "velocity": velocity, "angular_velocity": spin}
        return replace(body, **{key: tuple(float(v) for v in value) for key, value in vectors.items()})


def _take_joints(machine: Machine, link: int, q: Array, rotor: Array, swing: RobotSwing, ends: _Ends) -> None:
    """Put coordinates of the joints of a link into q, and rates of hinges and slides into `rotor`."""
    model, name = machine.model, machine.names.body(link)
    first, count = int(model.body_jntadr[link]), int(model.body_jntnum[link])
    if not count:
        return
    kind, at = int(model.jnt_type[first]), int(model.jnt_qposadr[first])
    if kind == int(machine.mj.mjtJoint.mjJNT_FREE):
        q[at : at + 3], q[at + 3 : at + 7] = ends.origin(name), machine.quaternion(ends.rotation(name))
        return
    if kind == int(machine.mj.mjtJoint.mjJNT_BALL):
        parent = machine.carrier(int(model.body_parentid[link]))
        carried = parent and machine.names.body(parent) in ends.moved
        before = ends.rotation(machine.names.body(parent)) if carried else np.eye(3)
        turned = machine.matrix(model.body_quat[link]).T @ before.T @ ends.rotation(name)
        q[at : at + 4] = machine.quaternion(turned)
        dof = int(model.jnt_dofadr[first])
        if model.dof_armature[dof]:
            positions, rates = ends.joint(joint_name(machine, link))
            if three_hinges(machine, first):
                turns = _turning(axes_of(swing.qpos[at : at + 4]), positions, rates)
            else:
                turns = ends.start(name).T @ rates
            rotor[dof : dof + 3] = turns
        return
    positions, rates = ends.joint(joint_name(machine, link))
    for k, (position, rate) in enumerate(zip(positions, rates, strict=True)):
        place = int(model.jnt_qposadr[first + k])
        q[place] = position + float(model.qpos0[place])
        rotor[int(model.jnt_dofadr[first + k])] = rate


def _turning(axes: Array, positions: Array, rates: Array) -> Array:
    """Angular velocity in the frame that three hinges along axes in it carry in turn [rad/s], shape (3,)."""
    found = np.zeros(3)
    for axis, position, rate in zip(axes, positions, rates, strict=True):
        found = rotation_matrix(position * axis).T @ found + rate * axis
    return found
