"""Owns the arrays of rigid bodies, and of what binds them, and extremes of a run that warnings read."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, SCENE, joinable, of


@joinable
@dataclass(frozen=True, kw_only=True)
class RigidBody:
    """A rigid body with its riders: nodes of flexible bodies that joints tie to its own nodes.

    Attributes:
        name: of the body.
        own: its nodes, shape (node_count,), int32.
        loaded: those among them on which contact or loads may act, int32.
        riders: shape (rider_count,), int32.
        pairs: pair of `Model.joint_first` that ties each rider, shape (rider_count,), int32.
        signs: 1 where a rider is the first node of its pair, -1 where it is the second, shape (rider_count,), float64.
        mass: of nodes and riders [kg].
        centre: of this mass at the reference positions [m], shape (3,), float64.
        inertia: about the centre, J = sum m (r . r I - r r^T) [kg m^2], shape (3, 3), float64.
        scene: number of the scene in a batch.
    """

    name: str = field(metadata=AS_IS)
    own: Index = field(metadata=of("nodes"))
    loaded: Index = field(metadata=of("nodes"))
    riders: Index = field(metadata=of("nodes"))
    pairs: Index = field(metadata=of("pairs"))
    signs: Array = field(metadata=AS_IS)
    mass: float = field(metadata=AS_IS)
    centre: Array = field(metadata=AS_IS)
    inertia: Array = field(metadata=AS_IS)
    scene: int = field(default=0, metadata=SCENE)

    @property
    def radius(self) -> float:
        """Of inertia [m]."""
        return float(np.sqrt(0.5 * np.trace(self.inertia) / self.mass))

    @property
    def nodes(self) -> Index:
        """All that move with the body, shape (node_count + rider_count,), int32."""
        return np.concatenate([self.own, self.riders]).astype(np.int32)


@joinable
@dataclass(frozen=True, kw_only=True)
class RigidRow:
    """A scalar condition of `kernels.nodes.rigid_rows`.

    Attributes:
        first, second: places of the bodies in `Model.rigid_bodies`; second is GROUND for the ground.
        point: reference position of the common point [m], shape (3,), float64.
        direction: n at the reference positions [-], shape (3,), float64.
        pair: of `Model.joint_first` that takes the impulse, -1 where none does.
        sign: of this impulse: -1 where the first body is the second one of its joint.
        pin: place in `Model.rigid_pins` of the cluster that stands in for the second body, -1 without one.
        twist: axis of a row that holds a direction of a pin [-], shape (3,), float64; n is 0 there.
        joint: place in `Model.body_joints` of the joint that finds the direction itself, -1 of other rows.
        rate: of that joint that the row holds back, -1 of rows that hold the joint.
        geared, leader: places in `Model.body_joints` of the joints whose rates a coupler ties, -1 of other rows.
        rates: of these two joints.
        ratio: of the coupler: rate of the one over that of the other.
    """

    first: int = field(metadata=of("rigid bodies"))
    second: int = field(metadata=of("rigid bodies"))
    point: Array = field(metadata=AS_IS)
    direction: Array = field(metadata=AS_IS)
    pair: int = field(default=-1, metadata=of("pairs"))
    sign: float = field(default=1.0, metadata=AS_IS)
    pin: int = field(default=-1, metadata=of("rigid pins"))
    twist: Array = field(default_factory=lambda: np.zeros(3), metadata=AS_IS)
    joint: int = field(default=-1, metadata=of("body joints"))
    rate: int = field(default=-1, metadata=AS_IS)
    geared: int = field(default=-1, metadata=of("body joints"))
    leader: int = field(default=-1, metadata=of("body joints"))
    rates: tuple[int, int] = field(default=(0, 0), metadata=AS_IS)
    ratio: float = field(default=0.0, metadata=AS_IS)


@joinable
@dataclass(frozen=True, kw_only=True)
class RigidPin:
    """A pin between a rigid body and a cluster of nodes of a flexible one.

    Attributes:
        body: place of the rigid body in `Model.rigid_bodies`.
        start, end: nodes of the cluster are those of the pairs [start, end) of `Model.joint_first`.
        weight: of each of these, shape (end - start,), float64; this and the following are as in `Coupling`.
        place: [m], shape (3,), float64.
        axis: [-], shape (3,), float64.
        arm: from the mean position of the cluster [m], shape (3,), float64.
    """

    body: int = field(metadata=of("rigid bodies"))
    start: int = field(metadata=of("pairs"))
    end: int = field(metadata=of("pairs"))
    weight: Array = field(metadata=AS_IS)
    place: Array = field(metadata=AS_IS)
    axis: Array = field(metadata=AS_IS)
    arm: Array = field(metadata=AS_IS)


@dataclass(frozen=True, kw_only=True)
class RigidExtremes:
    """What single steps of a run say of rigid bodies of a scene and of joints between whole bodies.

    Attributes:
        dt: step of bodies and joints [s].
        turn: greatest turn of each body in a step [rad], shape (body_count,), float64.
        alone, rank: as in `JointState`, shapes (joint_count, 2) and (joint_count, 4), float64; empty without joints.
    """

    dt: float
    turn: Array
    alone: Array
    rank: Array
