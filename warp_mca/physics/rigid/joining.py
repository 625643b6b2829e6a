"""Owns the way from a scene's joints between whole bodies to `BodyJoint`s, with their rows and clusters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import mean_spin, point_velocity, rotation_matrix
from warp_mca.kernels.nodes import joint_arrays as columns
from warp_mca.physics.rigid.couplers import coupler_rows
from warp_mca.scene.amplitude import CONSTANT, Amplitude
from warp_mca.scene.freedoms import Controller, Freedom, PositionServo, Whole
from warp_mca.scene.joints import Joint
from warp_mca.system.bodies import GROUND, Bodies
from warp_mca.system.body_joints import BodyJoint, exponential
from warp_mca.system.joints import JointPairs
from warp_mca.system.rigid import RigidPin, RigidRow

if TYPE_CHECKING:
    from warp_mca.system.rigid import RigidBody

APART = 1e-6  # of a joint's extent: distance of the points of both bodies, at most
ASTRAY = 1e-6  # of the speeds of both bodies: part of their relative motion that a joint does not allow, at most
STILL = 1e-6  # speed [m/s] below which ASTRAY of it is rounding
FLAT = 1e-3  # of a cluster's extent: distance from a line below which nodes are on it
KINDS = {"hinge": columns.HINGE, "slide": columns.SLIDE, "ball": columns.BALL}


class Joined(NamedTuple):
    """Joints between whole bodies, their rows, and their clusters."""

    joints: tuple[BodyJoint, ...] = ()
    rows: tuple[RigidRow, ...] = ()
    pins: tuple[RigidPin, ...] = ()


def join_whole(
    parts: Bodies, pairs: Mapping[str, NDArray], found: Sequence[JointPairs], bodies: Sequence[RigidBody],
    velocity: Array, first_pin: int,
) -> Joined:  # fmt: skip
    """The joints between whole bodies of a scene.

    Args:
        parts: of the scene.
        pairs, found: nodes of flexible bodies, as in `Model`, and those of each joint.
        bodies: that are rigid.
        velocity: initial velocities [m/s], shape (node_count, 3), float64.
        first_pin: number of other pins.

    Raises:
        RequestError: a joint's points do not meet, its bodies move apart, or a cluster is too thin.
    """
    joints: list[BodyJoint] = []
    rows: list[RigidRow] = []
    pins: list[RigidPin] = []
    rates: list[tuple[Array, Array]] = []
    place = {body.name: k for k, body in enumerate(bodies)}
    for joint, own in zip(parts.scene.acting_joints, found, strict=True):
        whole = joint.whole()
        if whole is None:
            continue
        a, b = place.get(joint.body, GROUND), place.get(joint.other or "", GROUND)
        nodes = pairs["joint_first"][own.start : own.end]
        item = _body_joint(parts, joint, whole, bodies, a, b, first_pin + len(pins) if len(nodes) else -1)
        rates.append(_start_rates(joint, item, bodies, parts, velocity, nodes))
        if len(nodes):
            pins.append(_pin(parts, joint, item, own, max(a, b), nodes))
        first, second = (b, GROUND) if item.soft else (a, b)
        held = 6 - len(item.kind)
        rows += [
            RigidRow(
                first=first,
                second=second,
                point=item.place,
                direction=np.zeros(3),
                pin=item.pin,
                joint=len(joints),
                rate=k - held if k >= held else -1,
            )
            for k in range(6)
        ]
        joints.append(item)
    return Joined(tuple(joints), (*rows, *coupler_rows(parts.scene, joints, rates)), tuple(pins))


def _frame(parts: Bodies, body: str | None) -> tuple[Array, Array]:
    """Rotation of a body's frame at the start, shape (3, 3), and the place of its origin [m], shape (3,)."""
    if body is None:
        return np.eye(3), np.zeros(3)
    R = rotation_matrix(parts.scene.body(body).rotation)
    return R, parts.X[parts.node_start[body]] - R @ parts.meshes[body].points[0]


def _body_joint(
    parts: Bodies, joint: Joint, whole: Whole, bodies: Sequence[RigidBody], a: int, b: int, pin: int
) -> BodyJoint:
    R, origin = _frame(parts, joint.body)
    place = origin + R @ np.array(whole.at)
    kind, part, axis, point, position, motor, drive, tables = [], [], [], [], [], [], [], []
    turned, moved = np.eye(3), np.zeros(3)
    for freedom, at in zip(whole.freedoms, whole.points, strict=True):
        o = origin + R @ np.array(at) - place
        axes = np.eye(3) if freedom.kind == "ball" else (R @ np.array(freedom.unit))[None]
        rest = np.broadcast_to(freedom.rest, len(axes))
        rest = R @ rest if freedom.kind == "ball" else rest
        for k, direction in enumerate(axes):
            kind.append(KINDS[freedom.kind])
            part.append(k)
            axis.append(direction)
            point.append(o)
            position.append(freedom.position)
            drive.append(_drive(freedom, float(rest[k])))
            motor.append(_motor(freedom))
            tables.append(_table(freedom))
        if freedom.kind != "ball":
            own, way = exponential(kind[-1], axis[-1], o, freedom.position)
            turned, moved = turned @ own, moved + turned @ way
    radii = [bodies[k].radius for k in (a, b) if k != GROUND]
    item = BodyJoint(
        name=joint.name,
        body=a,
        other=b,
        pin=pin,
        soft=a == GROUND,
        place=place,
        length=float(np.exp(np.mean(np.log(radii)))),
        turned=_quaternion(turned),
        moved=moved,
        kind=np.array(kind, dtype=np.int32),
        part=np.array(part, dtype=np.int32),
        axis=np.array(axis).reshape(-1, 3),
        point=np.array(point).reshape(-1, 3),
        position=np.array(position, dtype=np.float64),
        motor=np.array(motor, dtype=np.int32),
        drive=np.array(drive).reshape(-1, columns.COLUMNS),
        tables=tuple(tables),
    )
    if whole.other_at is not None:
        other_R, other_origin = _frame(parts, joint.other)
        at = place - turned.T @ moved  # where the body has its point when all positions are 0
        apart = float(np.linalg.norm(other_origin + other_R @ np.array(whole.other_at) - at))
        if apart > APART * max(np.linalg.norm(whole.at), np.linalg.norm(whole.other_at), item.length):
            remedy = f"it is {apart:.3g} m from `at` of {joint.body} with all positions 0; let both coincide"
            raise bad_value(f"{joint.title}.other_at", whole.other_at, remedy)
    return item


def _drive(freedom: Freedom, rest: float) -> list[float]:
    """Columns of `RigidJoints.drive`."""
    low, high = freedom.limits or (-np.inf, np.inf)
    servo = freedom.motor if isinstance(freedom.motor, PositionServo) else None
    least, most = servo.limits if servo and servo.limits else (-np.inf, np.inf)
    found = [freedom.stiffness, rest, freedom.damping, freedom.friction, freedom.friction_rate]
    found += [freedom.armature, low, high, freedom.limit_stiffness if freedom.limits else 0.0, freedom.limit_damping]
    return [*found, servo.kp if servo else 0.0, servo.kv if servo else 0.0, least, most]


def _motor(freedom: Freedom) -> int:
    if freedom.motor is None:
        return columns.NO_MOTOR
    if isinstance(freedom.motor, Controller):
        return columns.HELD
    return columns.SERVO if isinstance(freedom.motor, PositionServo) else columns.TORQUE


def _table(freedom: Freedom) -> Amplitude:
    if isinstance(freedom.motor, PositionServo):
        return freedom.motor.table
    return freedom.motor if isinstance(freedom.motor, Amplitude) else CONSTANT


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat(), dtype=np.float64)


def _pin(parts: Bodies, joint: Joint, item: BodyJoint, own: JointPairs, body: int, nodes: Index) -> RigidPin:
    """The cluster of a joint's flexible side, all of whose nodes weigh as their mass.

    Raises:
        RequestError: its nodes lie on a line, so that they have no mean rotation.
    """
    X, mass = parts.X[nodes], parts.mass[nodes]
    centre = mass @ X / mass.sum()
    spread = np.linalg.svd(X - centre, compute_uv=False) if len(X) > 2 else np.zeros(3)
    if spread[1] <= FLAT * spread[0]:
        name = "nodes" if item.soft else "other_nodes"
        what = f"{len(nodes)} nodes that lie on one line or none have no mean rotation"
        raise bad_value(f"{joint.title}.{name}", joint.sets()[name][1], f"{what}; name a set with more of them")
    return RigidPin(
        body=body,
        start=own.start,
        end=own.end,
        weight=np.ones(len(nodes)),
        place=item.place,
        axis=np.zeros(3),
        arm=item.place - centre,
    )


def _start_rates(
    joint: Joint, item: BodyJoint, bodies: Sequence[RigidBody], parts: Bodies, velocity: Array, nodes: Index
) -> tuple[Array, Array]:
    """Rates of a joint at the start, and those that give its bodies their speed [rad/s], [m/s], (rate_count,), float64.

    Raises:
        RequestError: the bodies have velocities that it does not allow.
    """
    motions, speed = [], 0.0
    for k in (item.body, item.other):
        own = bodies[k].nodes if k != GROUND else nodes if item.soft == (len(motions) == 0) else np.zeros(0, np.int32)
        if not len(own):
            motions.append(np.zeros((2, 3)))
            continue
        X, V, mass = parts.X[own], velocity[own], parts.mass[own]
        motions.append(np.stack([mean_spin(X, V, mass), point_velocity(X, V, mass, item.place)]))
        speed = max(speed, float(np.linalg.norm(V, axis=1).max()))
    relative = motions[0] - motions[1]
    twist = np.concatenate([item.length * relative[0], relative[1]])
    screws = item.screws()
    rates = np.linalg.lstsq(screws.T, twist, rcond=None)[0] if len(screws) else np.zeros(0)
    left = twist - screws.T @ rates
    if np.linalg.norm(left) > ASTRAY * max(speed, STILL):
        what = f"part of their relative velocity at the start, {np.linalg.norm(left):.3g} m/s, it does not allow"
        bound = f"{joint.body} and {joint.other or 'the ground'}"
        raise bad_value(f"{joint.title}.body", joint.body, f"it joins {bound}, and {what}; give both one that fits")
    sizes = np.linalg.norm(screws, axis=1) if len(screws) else np.zeros(0)
    return np.asarray(rates, dtype=np.float64), max(speed, STILL) / sizes
