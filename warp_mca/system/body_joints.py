"""Owns joints between whole bodies on the host: their freedoms as screws, and what is recorded of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.joining import AS_IS, SCENE, joinable, of
from warp_mca.base.rotation import rotation_matrix
from warp_mca.kernels.nodes import joint_arrays as columns
from warp_mca.scene.amplitude import Amplitude

if TYPE_CHECKING:
    from warp_mca.system.model import Model


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
        turned, moved: pose of the body on its freedoms at the start: a unit quaternion [-], shape (4,), and a way [m],
            shape (3,), float64.
        kind: of each rate, HINGE, SLIDE or BALL of `kernels.nodes.joint_arrays`, shape (rate_count,), int32.
        part: 0, 1, 2 of the three rates of a ball, else 0, shape (rate_count,), int32.
        axis: where all positions are 0, unit vectors [-], shape (rate_count, 3), float64.
        point: of each axis there [m], shape (rate_count, 3), float64.
        position: of each rate at the start [rad], [m], shape (rate_count,), float64.
        motor: of each rate, NO_MOTOR, TORQUE, SERVO or HELD, shape (rate_count,), int32.
        drive: columns of `RigidJoints.drive`, shape (rate_count, COLUMNS), float64.
        tables: torque or target of each rate over time.
        scene: number of the scene in a batch.
        ENERGIES: entries of the ledger to which their columns add.
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
                own, way = exponential(int(self.kind[e]), self.axis[e], self.point[e], float(self.position[e]))
                R, p = own @ R, way + own @ p
        return found


def check_alike(models: Sequence[Model]) -> None:
    """Refuse scenes of a batch whose joints between whole bodies are others, for records list them by place, or that a
    function drives.

    Raises:
        RequestError: there are such scenes.
    """
    named = [[(item.name, item.kind.tolist()) for item in model.body_joints] for model in models]
    for k, own in enumerate(named):
        if own != named[0]:
            names = [name for name, _ in own]
            remedy = "scenes of a batch have the same joints between whole bodies; run them apart"
            raise bad_value(f"joints of scenes[{k}]", names, remedy)
        for item in models[k].body_joints:
            if (item.motor == columns.HELD).any():
                remedy = "a batch asks no functions; use run in place of run_batch"
                raise bad_value(f"motor of joint {item.name}", "Controller", remedy)


def readings(items: Sequence[BodyJoint]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Columns of the history of the joints of a scene: means over the interval before, and values of the moment."""
    means = [name for item in items for name in item.loads] + [name for item in items for name in item.drives]
    return tuple(means), tuple(name for item in items for name in item.positions)


def exponential(kind: int, axis: Array, point: Array, value: float) -> tuple[Array, Array]:
    """Motion of a hinge or a slide: R, shape (3, 3), and p [m], shape (3,), of y -> R y + p."""
    if kind == columns.SLIDE:
        return np.eye(3), value * axis
    R = rotation_matrix(value * axis)
    return R, point - R @ point
