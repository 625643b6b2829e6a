"""Owns what mimic joints and fixed tendons are in an impact: couplers of freedoms, and drives and springs of joints.

Joints that equalities gear to each other move as one: q_i = f_i q + g_i of the one that none of them leads. A tendon of
such joints has the length l = pull q + zero, with pull = sum c_i f_i, and its tension is a torque of `pull` times as
much there. Impulses of couplers carry it to the others. Tendons of joints that are free of each other act on a relay.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.base.log import warn
from warp_mca.robots.drives import Drive, drive_of, motors
from warp_mca.robots.relays import relay
from warp_mca.scene import Articulation, Body, Coupler, Freedom, PositionServo

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine


class Gearing:
    """Couplers and tendons of a machine at its hand-off, whose data is up to date.

    Attributes:
        bodies, joints: of relays.
        duration: of the impact [s].
    """

    def __init__(self, machine: Machine, duration: float) -> None:
        """Read equalities and tendons; `duration` of the impact [s] says how much of what is held would change.

        Raises:
            RequestError: a joint is geared twice, or springs of a tendon are not carried.
        """
        self._machine, self.duration = machine, duration
        self._leader: dict[int, tuple[int, float]] = {}
        kind, model = int(machine.mj.mjtEq.mjEQ_JOINT), machine.model
        equalities = [k for k in range(model.neq) if model.eq_active0[k] and int(model.eq_type[k]) == kind]
        for k in sorted(equalities, key=lambda k: int(model.eq_obj2id[k]) < 0):  # those that hold a joint come last
            self._gear(k)
        self._drives: dict[int, list[Drive]] = {}
        self._springs: dict[int, list[tuple[float, float, float]]] = {}
        self.bodies: list[Body] = []
        self.joints: list[Articulation] = []
        for tendon in range(machine.model.ntendon):
            self._pull(tendon)

    def coupler(self, joint: int) -> Coupler | None:
        """That of a joint, or None."""
        if joint not in self._leader:
            return None
        return self._coupled(*self._leader[joint])

    def _coupled(self, leader: int, ratio: float) -> Coupler:
        model = self._machine.model
        link = int(model.jnt_bodyid[leader])
        number = 1 + leader - int(model.body_jntadr[link])
        return Coupler(joint=joint_name(self._machine, link), freedom=number, ratio=ratio)

    def carry(self, joint: int, servos: Sequence[PositionServo]) -> None:
        """Give further motors of a joint to a relay."""
        if servos:
            parts = [(joint, 1.0, self._coupled(joint, 1.0))]
            self._relay(f"{self._machine.names.joint(joint)} drive", parts, [Freedom(motor=item) for item in servos])

    def _relay(self, name: str, parts: list[tuple[int, float, Coupler]], carried: list[Freedom]) -> None:
        bodies, joints = relay(self._machine, name, parts, carried)
        self.bodies += bodies
        self.joints += joints

    def drives(self, joint: int) -> list[Drive]:
        """Torques of actuators of tendons on a joint."""
        return self._drives.get(joint, [])

    def spring(self, joint: int, stiffness: float, rest: float) -> tuple[float, float, float]:
        """Stiffness, rest and damping of a joint's own spring and those of tendons together."""
        damping = 0.0
        for k, at, c in self._springs.get(joint, []):
            if k:
                stiffness, rest = stiffness + k, (stiffness * rest + k * at) / (stiffness + k)
            damping += c
        return stiffness, rest, damping

    def _gear(self, k: int) -> None:
        """Take equality k between joints: q_1 - q_1(0) = p(q_2 - q_2(0)), p a polynomial."""
        machine, model = self._machine, self._machine.model
        name, (one, other) = machine.names.equality(k), (int(model.eq_obj1id[k]), int(model.eq_obj2id[k]))
        if other < 0:
            root, factor = self._root(one)
            if factor:  # else it is held already
                self._fix(name, root)
            return
        place, dof = int(model.jnt_qposadr[other]), int(model.jnt_dofadr[other])
        p = np.polynomial.Polynomial(model.eq_data[k, :5])
        x, rate = float(machine.data.qpos[place] - model.qpos0[place]), float(machine.data.qvel[dof])
        ratio, turns = float(p.deriv()(x)), float(p.deriv(2)(x))
        if one in self._leader and ratio and self._root(other)[0] != self._root(one)[0] and other not in self._leader:
            one, other, ratio = other, one, 1.0 / ratio
        if one in self._leader or self._root(other)[0] == one:
            remedy = "other equalities gear this joint already; leave one of them out"
            raise bad_value("Robot: equality", name, remedy)
        self._leader[one] = (other, ratio)
        if turns:
            change = abs(turns * rate) * self.duration
            text = (
                f"equality {name} has the ratio {ratio:.6g} in the impact, which {change:.2g} of the way would change"
            )
            warn([f"{text}; the file's polynomial is linear there"])

    def _fix(self, name: str, joint: int) -> None:
        """Keep a joint where it is: it follows another one at a ratio of 0."""
        machine = self._machine
        scalar = np.flatnonzero(machine.model.jnt_type >= int(machine.mj.mjtJoint.mjJNT_SLIDE)).tolist()
        others = [other for other in scalar if self._root(other)[0] != joint]
        if not others:
            remedy = f"it holds joint {machine.names.joint(joint)}, and no other one moves; leave out that joint"
            raise bad_value("Robot: equality", name, remedy)
        self._leader[joint] = (others[0], 0.0)

    def _root(self, joint: int) -> tuple[int, float]:
        """The joint that leads a joint in the end, and the rate of the one over that of the other."""
        factor = 1.0
        while joint in self._leader:
            joint, ratio = self._leader[joint]
            factor *= ratio
        return joint, factor

    def _pull(self, tendon: int) -> None:
        """Take a tendon: its actuators, spring and damper."""
        machine, model = self._machine, self._machine.model
        parts = [(joint, c) for joint, c in _parts(machine, tendon) if self._root(joint)[1]]
        actuators = [] if "ACTUATION" in machine.off else _actuators(machine, tendon)
        stiffness, damping = float(model.tendon_stiffness[tendon]), float(model.tendon_damping[tendon])
        if not parts or not (actuators or stiffness or damping):
            return
        for joint, _ in parts:
            if model.jnt_actfrclimited[joint] and actuators:
                name, remedy = (
                    machine.names.joint(joint),
                    "a tendon pulls it, whose actuator has limits itself; leave it out",
                )
                raise bad_value(f"actuatorfrcrange of joint {name}", True, remedy)
        pulls: dict[int, float] = {}
        for joint, c in parts:
            root, factor = self._root(joint)
            pulls[root] = pulls.get(root, 0.0) + c * factor
        pulls = {root: pull for root, pull in pulls.items() if pull} or {next(iter(pulls)): 0.0}
        places = {root: int(model.jnt_qposadr[root]) for root in pulls}
        ways = [pull * float(machine.data.qpos[places[k]] - model.qpos0[places[k]]) for k, pull in pulls.items()]
        zero = float(machine.data.ten_length[tendon]) - sum(ways)
        low, high = (float(v) for v in model.tendon_lengthspring[tendon])
        if stiffness and low != high:
            remedy = "its spring is slack between two lengths, which an impact does not carry; give it one springlength"
            raise bad_value("Robot: tendon", machine.names.tendon(tendon), remedy)
        if len(pulls) > 1:
            self._join(tendon, pulls, [drive_of(machine, k, 1.0, zero) for k in actuators], low - zero)
            return
        ((root, pull),) = pulls.items()
        self._drives.setdefault(root, []).extend(drive_of(machine, k, pull, zero) for k in actuators)
        if pull and (stiffness or damping):
            own = (stiffness * pull**2, (low - zero) / pull, damping * pull**2)
            self._springs.setdefault(root, []).append(own)

    def _join(self, tendon: int, pulls: dict[int, float], drives: list[Drive], rest: float) -> None:
        """Give a tendon whose joints are free of each other to a relay, which moves as its length."""
        machine, model = self._machine, self._machine.model
        name = machine.names.tendon(tendon)
        found = motors("Robot: tendon", name, drives)
        spring, damping = float(model.tendon_stiffness[tendon]), float(model.tendon_damping[tendon])
        stiffness = spring + found.beside.kp
        own = Freedom(
            stiffness=stiffness,
            rest=spring * rest / stiffness if stiffness else 0.0,
            damping=damping + found.beside.kv,
            motor=found.motor,
        )
        parts = [(root, pull, self._coupled(root, pull)) for root, pull in pulls.items()]
        self._relay(name, parts, [own, *(Freedom(motor=item) for item in found.more)])


def _parts(machine: Machine, tendon: int) -> Iterator[tuple[int, float]]:
    """Joints of a fixed tendon, and the coefficient of each."""
    model = machine.model
    first = int(model.tendon_adr[tendon])
    for k in range(first, first + int(model.tendon_num[tendon])):
        if model.wrap_prm[k]:
            yield int(model.wrap_objid[k]), float(model.wrap_prm[k])


def _actuators(machine: Machine, tendon: int) -> list[int]:
    model = machine.model
    own = model.actuator_trntype == int(machine.mj.mjtTrn.mjTRN_TENDON)
    return [int(k) for k in np.flatnonzero(own & (model.actuator_trnid[:, 0] == tendon))]


def joint_name(machine: Machine, link: int) -> str:
    """Name of the joint between a link and its parent: that of the file's joint where it is one."""
    if int(machine.model.body_jntnum[link]) == 1:
        return machine.names.joint(int(machine.model.body_jntadr[link]))
    return f"{machine.names.body(link)} joint"
