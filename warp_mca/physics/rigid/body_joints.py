"""Owns joints between whole bodies on the host: their freedoms as screws, and the clusters of flexible bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, SCENE, joinable, of
from warp_mca.base.rotation import mean_spin, point_velocity, rotation_matrix
from warp_mca.kernels.nodes import joint_arrays as columns
from warp_mca.model.assembly import GROUND, Assembly
from warp_mca.physics.joints.constraints import JointPairs
from warp_mca.physics.rigid.rows import RigidPin, RigidRow
from warp_mca.scene.amplitude import CONSTANT, Amplitude
from warp_mca.scene.freedoms import Freedom, PositionServo, Whole
from warp_mca.scene.joints import Joint

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.physics.rigid.bodies import RigidBody

APART = 1e-6  # of a joint's extent: distance of the points of both bodies, at most
ASTRAY = 1e-6  # of the speeds of both bodies: part of their relative motion that a joint does not allow, at most
FLAT = 1e-3  # of a cluster's extent: distance from a line below which nodes are on it
KINDS = {"hinge": columns.HINGE, "slide": columns.SLIDE, "ball": columns.BALL}


@joinable
@dataclass(frozen=True, kw_only=True)
class BodyJoint:
    """A joint between whole bodies; vectors are along the world's axes, places those at the start, from `place`.

    Attributes:
        name: of the joint.
        body, other: places of the bodies in `Model.rigid_bodies`; GROUND for a flexible one, or for the ground.
        pin: place in `Model.rigid_pins` of the cluster that stands for a flexible one, or -1.
        soft: whether that is the first body.
        place: point of the joint [m], shape (3,), float64.
        length: radius of inertia by which rotations become ways [m].
        turned, moved: pose of the body on its freedoms at the start: a unit quaternion [-], shape (4,), and [m], (3,).
        kind: of each rate, HINGE, SLIDE or BALL of `kernels.nodes.joint_arrays`, shape (rate_count,), int32.
        part: 0, 1, 2 of the three rates of a ball, else 0, shape (rate_count,), int32.
        axis: where all positions are 0, unit vectors [-], shape (rate_count, 3), float64.
        point: of each axis there [m], shape (rate_count, 3), float64.
        position: of each rate at the start [rad], [m], shape (rate_count,), float64.
        motor: of each rate, NO_MOTOR, TORQUE or SERVO, shape (rate_count,), int32.
        drive: columns of `RigidJoints.drive`, shape (rate_count, COLUMNS), float64.
        tables: torque or target of each rate over time.
        scene: number of the scene in a batch.
    """

    name: str = field(metadata=AS_IS)
    body: int = field(metadata=of("rigid bodies"))
    other: int = field(metadata=of("rigid bodies"))
    pin: int = field(metadata=of("rigid pins"))
    soft: bool = field(metadata=AS_IS)
    place: Array = field(metadata=AS_IS)
    length: float = field(metadata=AS_IS)
    turned: Array = field(metadata=AS_IS)
    moved: Array = field(metadata=AS_IS)
    kind: Index = field(metadata=AS_IS)
    part: Index = field(metadata=AS_IS)
    axis: Array = field(metadata=AS_IS)
    point: Array = field(metadata=AS_IS)
    position: Array = field(metadata=AS_IS)
    motor: Index = field(metadata=AS_IS)
    drive: Array = field(metadata=AS_IS)
    tables: tuple[Amplitude, ...] = field(metadata=AS_IS)
    scene: int = field(default=0, metadata=SCENE)

    ENERGIES: ClassVar[tuple[str, ...]] = ("kinetic", "spring", "joint", "external_work")

    @property
    def loads(self) -> tuple[str, ...]:
        """Columns of the history of its force and moment on the body, at the joint's point."""
        forces = [f"joint_{self.name}_F{axis}_N" for axis in "xyz"]
        return (*forces, *(f"joint_{self.name}_M{axis}_Nm" for axis in "xyz"))

    @property
    def drives(self) -> tuple[str, ...]:
        """Columns of the torque or force of the motor of each rate."""
        units = ["N" if kind == columns.SLIDE else "Nm" for kind in self.kind]
        return tuple(f"joint_{self.name}_drive{k + 1}_{unit}" for k, unit in enumerate(units))

    @property
    def positions(self) -> tuple[str, ...]:
        """Columns of the position of each rate; of a ball the turns about its axes, added up."""
        units = ["m" if kind == columns.SLIDE else "rad" for kind in self.kind]
        return tuple(f"joint_{self.name}_q{k + 1}_{unit}" for k, unit in enumerate(units))

    def screws(self) -> Array:
        """Twists of the rates at the start, rotations times `length`, along the axes of the body [m], (rate_count, 6).

        As `kernels.nodes.rigid_joints.place_screws`.
        """
        found = np.zeros((len(self.kind), 6))
        R, p = np.eye(3), np.zeros(3)
        for e in reversed(range(len(self.kind))):
            w, v = self.axis[e], np.cross(self.point[e], self.axis[e])
            if self.kind[e] == columns.SLIDE:
                w, v = np.zeros(3), self.axis[e]
            found[e] = np.concatenate([self.length * (R.T @ w), R.T @ (v + np.cross(w, p))])
            if self.kind[e] != columns.BALL:
                own, way = _exponential(int(self.kind[e]), self.axis[e], self.point[e], float(self.position[e]))
                R, p = own @ R, way + own @ p
        return found


def check_alike(models: Sequence[Model]) -> None:
    """Refuse scenes of a batch whose joints between whole bodies are others: records list them by place.

    Raises:
        RequestError: there are such scenes.
    """
    named = [[(item.name, item.kind.tolist()) for item in model.body_joints] for model in models]
    for k, own in enumerate(named):
        if own != named[0]:
            names = [name for name, _ in own]
            remedy = "scenes of a batch have the same joints between whole bodies; run them apart"
            raise bad_value(f"joints of scenes[{k}]", names, remedy)


def readings(items: Sequence[BodyJoint]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Columns of the history of the joints of a scene: means over the interval before, and values of the moment."""
    means = [name for item in items for name in item.loads] + [name for item in items for name in item.drives]
    return tuple(means), tuple(name for item in items for name in item.positions)


class Joined(NamedTuple):
    """Joints between whole bodies, their rows, and their clusters."""

    joints: tuple[BodyJoint, ...] = ()
    rows: tuple[RigidRow, ...] = ()
    pins: tuple[RigidPin, ...] = ()


def join_whole(
    parts: Assembly, pairs: Mapping[str, NDArray], found: Sequence[JointPairs], bodies: Sequence[RigidBody],
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
    place = {body.name: k for k, body in enumerate(bodies)}
    for joint, own in zip(parts.scene.joints, found, strict=True):
        whole = joint.whole()
        if whole is None:
            continue
        a, b = place.get(joint.body, GROUND), place.get(joint.other or "", GROUND)
        nodes = pairs["joint_first"][own.start : own.end]
        item = _body_joint(parts, joint, whole, bodies, a, b, first_pin + len(pins) if len(nodes) else -1)
        _check_motion(joint, item, bodies, parts, velocity, nodes)
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
    return Joined(tuple(joints), tuple(rows), tuple(pins))


def _frame(parts: Assembly, body: str | None) -> tuple[Array, Array]:
    """Rotation of a body's frame at the start, shape (3, 3), and the place of its origin [m], shape (3,)."""
    if body is None:
        return np.eye(3), np.zeros(3)
    R = rotation_matrix(parts.scene.body(body).rotation)
    return R, parts.X[parts.node_start[body]] - R @ parts.meshes[body].points[0]


def _body_joint(
    parts: Assembly, joint: Joint, whole: Whole, bodies: Sequence[RigidBody], a: int, b: int, pin: int
) -> BodyJoint:
    R, origin = _frame(parts, joint.body)
    place = origin + R @ np.array(whole.at)
    kind, part, axis, point, position, motor, drive, tables = [], [], [], [], [], [], [], []
    turned, moved = np.eye(3), np.zeros(3)
    for freedom, at in zip(whole.freedoms, whole.points, strict=True):
        o = origin + R @ np.array(at) - place
        axes = np.eye(3) if freedom.kind == "ball" else (R @ np.array(freedom.unit))[None]
        for k, direction in enumerate(axes):
            kind.append(KINDS[freedom.kind])
            part.append(k)
            axis.append(direction)
            point.append(o)
            position.append(freedom.position)
            drive.append(_drive(freedom))
            motor.append(_motor(freedom))
            tables.append(_table(freedom))
        if freedom.kind != "ball":
            own, way = _exponential(kind[-1], axis[-1], o, freedom.position)
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


def _drive(freedom: Freedom) -> list[float]:
    """Columns of `RigidJoints.drive`."""
    low, high = freedom.limits or (-np.inf, np.inf)
    servo = freedom.motor if isinstance(freedom.motor, PositionServo) else None
    least, most = servo.limits if servo and servo.limits else (-np.inf, np.inf)
    found = [freedom.stiffness, freedom.rest, freedom.damping, freedom.friction, freedom.friction_rate]
    found += [freedom.armature, low, high, freedom.limit_stiffness if freedom.limits else 0.0, freedom.limit_damping]
    return [*found, servo.kp if servo else 0.0, servo.kv if servo else 0.0, least, most]


def _motor(freedom: Freedom) -> int:
    if freedom.motor is None:
        return columns.NO_MOTOR
    return columns.SERVO if isinstance(freedom.motor, PositionServo) else columns.TORQUE


def _table(freedom: Freedom) -> Amplitude:
    return freedom.motor.table if isinstance(freedom.motor, PositionServo) else freedom.motor or CONSTANT


def _exponential(kind: int, axis: Array, point: Array, value: float) -> tuple[Array, Array]:
    """Motion of a hinge or a slide: R, shape (3, 3), and p [m], shape (3,), of y -> R y + p."""
    if kind == columns.SLIDE:
        return np.eye(3), value * axis
    R = rotation_matrix(value * axis)
    return R, point - R @ point


def _quaternion(R: Array) -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_matrix(R).as_quat(), dtype=np.float64)


def _pin(parts: Assembly, joint: Joint, item: BodyJoint, own: JointPairs, body: int, nodes: Index) -> RigidPin:
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


def _check_motion(
    joint: Joint, item: BodyJoint, bodies: Sequence[RigidBody], parts: Assembly, velocity: Array, nodes: Index
) -> None:
    """Refuse bodies whose velocities at the start a joint does not allow.

    Raises:
        RequestError: it does not.
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
    left = twist - screws.T @ np.linalg.lstsq(screws.T, twist, rcond=None)[0] if len(screws) else twist
    if np.linalg.norm(left) > ASTRAY * speed:
        what = f"part of their relative velocity at the start, {np.linalg.norm(left):.3g} m/s, it does not allow"
        bound = f"{joint.body} and {joint.other or 'the ground'}"
        raise bad_value(f"{joint.title}.body", joint.body, f"it joins {bound}, and {what}; give both one that fits")
