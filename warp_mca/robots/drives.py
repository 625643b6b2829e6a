"""Owns joints of a machine as freedoms of an impact: springs, dampers, limits, armature and what drives them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.log import warn
from warp_mca.robots.machine import FRICTION_RATE
from warp_mca.robots.sockets import axes_of, turned
from warp_mca.scene import Amplitude, Freedom, PositionServo

if TYPE_CHECKING:
    from warp_mca.robots.gearing import Gearing
    from warp_mca.robots.machine import Machine

NEVER = 1e3  # position that no hinge reaches in an impact [rad]
SOFT = 1e-9  # stiffness of the servo that stands for a constant torque with clamps, over that torque [1/rad, 1/m]


def refuse_at_hand_off(machine: Machine) -> None:
    """Refuse what swings but does not go through an impact.

    Raises:
        RequestError: the machine has something of it.
    """
    model, names, mj = machine.model, machine.names, machine.mj
    for k in range(model.njnt):
        dofs = slice(int(model.jnt_dofadr[k]), int(model.jnt_dofadr[k]) + machine.rates_of(k))
        if (least := float(model.dof_damping[dofs].min())) < 0.0:
            raise bad_value(f"damping of joint {names.joint(k)}", least, "it drives the joint; give 0 or more")
        free = int(model.jnt_type[k]) == int(mj.mjtJoint.mjJNT_FREE)
        for what, value in (
            ("stiffness", model.jnt_stiffness[k]),
            ("armature", model.dof_armature[dofs].max()),
            ("frictionloss", model.dof_frictionloss[dofs].max()),
            ("damping", model.dof_damping[dofs].max()),
        ):
            if free and value:
                remedy = "an impact carries it for joints between links; leave it out, as <freejoint/> does"
                raise bad_value(f"{what} of joint {names.joint(k)}", float(value), remedy)


class Drive(NamedTuple):
    """Torque of an actuator on a joint: clamp(constant - kp q - kv q').

    Attributes:
        constant: [N m], [N].
        kp, kv: [N m/rad], [N m s/rad]; [N/m], [N s/m].
        limits: least and greatest, or None.
    """

    constant: float
    kp: float
    kv: float
    limits: tuple[float, float] | None


NO_DRIVE = Drive(0.0, 0.0, 0.0, None)


class Motors(NamedTuple):
    """What drives a coordinate in an impact.

    Attributes:
        motor: of its freedom.
        beside: spring about 0 and damper beside it.
        more: servos with clamps of their own, for which it has no room.
    """

    motor: Amplitude | PositionServo | None
    beside: Drive
    more: tuple[PositionServo, ...]


def freedoms_of(machine: Machine, joint: int, qpos: Array, gearing: Gearing) -> tuple[Freedom, ...]:
    """The freedom of a joint of the file, at coordinates `qpos`, with what tendons and equalities do to it.

    A ball with dry friction or a range is three hinges, the first along the axis about which it is turned; that is
    right to first order in what it turns in the impact, of which a warning tells.

    Positions count from the pose in which axes are given, so that `ref` of the file is taken off.

    Raises:
        RequestError: its drives cannot be carried.
    """
    model, mj = machine.model, machine.mj
    kind, at = int(model.jnt_type[joint]), tuple(float(v) for v in model.jnt_pos[joint])
    dof, place = int(model.jnt_dofadr[joint]), int(model.jnt_qposadr[joint])
    if kind == int(mj.mjtJoint.mjJNT_BALL):
        if three_hinges(machine, joint):
            turn = float(np.linalg.norm(machine.data.qvel[dof : dof + 3])) * gearing.duration
            text = f"ball {machine.names.joint(joint)} has dry friction or a range and is three hinges in the impact"
            warn([f"{text}; their torques point wrong by up to the {turn:.2g} rad that it turns at its present rate"])
        return _ball(machine, joint, qpos[place : place + 4])
    zero = float(model.qpos0[place])
    motor, beside, more = _motor(machine, joint, zero, gearing)
    gearing.carry(joint, more)
    stiffness, rest, slowed = gearing.spring(
        joint, float(model.jnt_stiffness[joint]), float(model.qpos_spring[place]) - zero
    )
    if beside.kp:
        stiffness, rest = stiffness + beside.kp, stiffness * rest / (stiffness + beside.kp)
    found: dict[str, Any] = {}
    if dof in (listed := machine.limited.tolist()):
        k = listed.index(dof)
        low, high = (float(v) - zero for v in model.jnt_range[joint])
        found = {"limits": (low, high), "limit_stiffness": float(machine.limit_stiffness[k])}
        found |= {"limit_damping": float(machine.limit_damping[k])}
    own = Freedom(
        kind="slide" if kind == int(mj.mjtJoint.mjJNT_SLIDE) else "hinge",
        axis=tuple(float(v) for v in model.jnt_axis[joint]),  # type: ignore[arg-type]
        at=at,  # type: ignore[arg-type]
        position=float(qpos[place]) - zero,
        stiffness=stiffness,
        rest=rest,
        damping=float(model.dof_damping[dof]) + beside.kv + slowed,
        friction=float(model.dof_frictionloss[dof]),
        friction_rate=FRICTION_RATE,
        armature=float(model.dof_armature[dof]),
        motor=motor,
        follows=gearing.coupler(joint),
        **found,
    )
    return (own,)


def three_hinges(machine: Machine, joint: int) -> bool:
    """Whether three hinges stand for a ball: it has dry friction or a range."""
    dry = bool(machine.model.dof_frictionloss[int(machine.model.jnt_dofadr[joint])])
    return dry or any(item.joint == joint for item in machine.sockets)


def _ball(machine: Machine, joint: int, quaternion: Array) -> tuple[Freedom, ...]:
    """The freedoms of a ball: its spring gives -k r, r the rotation vector from rest in the link's frame."""
    model, dof = machine.model, int(machine.model.jnt_dofadr[joint])
    stiffness, armature = float(model.jnt_stiffness[joint]), float(model.dof_armature[dof])
    damping, friction = float(model.dof_damping[dof]), float(model.dof_frictionloss[dof])
    at: Any = tuple(float(v) for v in model.jnt_pos[joint])
    socket = next((item for item in machine.sockets if item.joint == joint), None)
    rotated, place = np.zeros(3), int(model.jnt_qposadr[joint])
    machine.mj.mju_subQuat(rotated, quaternion, model.qpos_spring[place : place + 4])
    if not three_hinges(machine, joint):
        rest: Any = tuple(float(-r) for r in rotated) if stiffness else 0.0
        return (Freedom(kind="ball", at=at, stiffness=stiffness, rest=rest, damping=damping, armature=armature),)
    own: dict[str, Any] = {"at": at, "stiffness": stiffness, "damping": damping, "armature": armature}
    own |= {"friction": friction, "friction_rate": FRICTION_RATE}
    axes = axes_of(quaternion)
    freedoms = [
        Freedom(axis=tuple(axis), rest=-float(r), **own) for axis, r in zip(axes.tolist(), axes @ rotated, strict=True)
    ]
    if socket:
        left = socket.most - turned(quaternion)[0]
        limit: dict[str, Any] = {"limit_stiffness": socket.stiffness, "limit_damping": socket.damping}
        freedoms[0] = replace(freedoms[0], limits=(-NEVER, left), **limit)
    return tuple(freedoms)


def _motor(machine: Machine, joint: int, zero: float, gearing: Gearing) -> Motors:
    """What drives a joint during an impact at held controls.

    Raises:
        RequestError: several actuators with clamps drive it whose sum has one, or one drives it away from rest.
    """
    model, name = machine.model, machine.names.joint(joint)
    tendon, own = int(machine.mj.mjtTrn.mjTRN_TENDON), model.actuator_trnid[:, 0] == joint
    drives = [drive_of(machine, int(k), 1.0, zero) for k in np.flatnonzero(own & (model.actuator_trntype != tendon))]
    drives += gearing.drives(joint)
    if "ACTUATION" in machine.off or not drives:
        return Motors(None, NO_DRIVE, ())
    if model.jnt_actfrclimited[joint]:  # effort of a URDF
        drives = [held(drive) for drive in drives]
        low, high = (float(v) for v in model.jnt_actfrcrange[joint])
        clamped = [drive for drive in drives if drive.limits]
        if clamped and len(drives) > 1:
            remedy = "actuators that share a joint whose sum is clamped are not carried; give the joint one"
            raise bad_value(f"actuatorfrcrange of joint {name}", (low, high), remedy)
        whole = clamped[0] if clamped else _sum(drives)
        least, most = whole.limits or (-np.inf, np.inf)
        drives = [whole._replace(limits=(max(low, least), min(high, most)))]
    return motors("Robot: actuators of joint", name, drives)


def motors(what: str, name: str, drives: Sequence[Drive]) -> Motors:
    """Drives of one coordinate as motors.

    One with a clamp that moves is the motor: the constant of those without moves its clamp, and what they follow is a
    spring and a damper. Further ones with such clamps are motors of their own.

    Raises:
        RequestError: one drives it away from rest.
    """
    drives = [held(drive) for drive in drives]
    clamped, free = [drive for drive in drives if drive.limits], _sum([drive for drive in drives if not drive.limits])
    if any(min(drive.kp, drive.kv) < 0.0 for drive in (*clamped, free)):
        remedy = "it drives the joint away from where it is; give a servo with kp and kv of 0 or above"
        raise bad_value(what, name, remedy)
    if not clamped and free.kp:
        return Motors(_servo(free), NO_DRIVE, ())
    if not clamped:
        table = Amplitude(times=(0.0,), values=(free.constant,)) if free.constant else None
        return Motors(table, free, ())
    first, *others = clamped
    if free.constant:
        low, high = (limit + free.constant for limit in first.limits or ())
        first = first._replace(constant=first.constant + free.constant, limits=(low, high))
    return Motors(_servo(first), free, tuple(map(_servo, others)))


def _servo(drive: Drive) -> PositionServo:
    """The servo with the torque of a drive."""
    constant, kp, kv, limits = drive
    kp = kp or SOFT * max(abs(constant), 1.0)
    return PositionServo(kp=kp, kv=kv, target=constant / kp, limits=limits)


def held(drive: Drive) -> Drive:
    """A drive that follows nothing, as the constant torque that its clamp leaves; others as they are."""
    if drive.limits is None or drive.kp or drive.kv:
        return drive
    return Drive(float(np.clip(drive.constant, *drive.limits)), 0.0, 0.0, None)


def _sum(drives: list[Drive]) -> Drive:
    """Drives without clamps as one."""
    constant, kp, kv = (sum(float(drive[k] or 0.0) for drive in drives) for k in range(3))  # type: ignore[arg-type]
    return Drive(constant, kp, kv, None)


def drive_of(machine: Machine, k: int, pull: float, zero: float) -> Drive:
    """The torque of actuator k on a joint: pull gear (gain ctrl + bias), each affine in gear l and gear l'.

    Of an actuator of the joint itself l is its coordinate; of one of a tendon, l = pull q + zero is its length.
    """
    model, mj = machine.model, machine.mj
    gear, ctrl = float(model.actuator_gear[k, 0]), float(machine.ctrl[k])
    if model.actuator_ctrllimited[k]:
        ctrl = float(np.clip(ctrl, *model.actuator_ctrlrange[k]))
    gain, bias = np.array(model.actuator_gainprm[k, :3]), np.zeros(3)
    if int(model.actuator_gaintype[k]) == int(mj.mjtGain.mjGAIN_FIXED):
        gain[1:] = 0.0
    if int(model.actuator_biastype[k]) == int(mj.mjtBias.mjBIAS_AFFINE):
        bias = np.array(model.actuator_biasprm[k, :3])
    b0, b1, b2 = gain * ctrl + bias
    limits = None
    if model.actuator_forcelimited[k]:
        low, high = sorted(pull * gear * float(v) for v in model.actuator_forcerange[k])
        limits = (low, high)
    return Drive(
        pull * (gear * b0 + gear**2 * b1 * zero), -((pull * gear) ** 2) * b1, -((pull * gear) ** 2) * b2, limits
    )
