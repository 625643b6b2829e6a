"""Owns the arrays of joints: pairs of tied nodes, and couplings between clusters."""

from __future__ import annotations

from dataclasses import dataclass, field

from warp_mca.base.arrays import Array
from warp_mca.base.joining import AS_IS, joinable, of


@joinable
@dataclass(frozen=True, kw_only=True)
class JointPairs:
    """A joint's pairs: [start, end) of `Model.joint_first` and `joint_second`."""

    name: str = field(metadata=AS_IS)
    start: int = field(metadata=of("pairs"))
    end: int = field(metadata=of("pairs"))


@joinable
@dataclass(frozen=True, kw_only=True)
class Coupling:
    """A hinge between two clusters, or a cluster and the ground.

    Attributes:
        start, middle, end: its nodes are those of the pairs [start, middle) of `Model.joint_first` for the first body
            and of [middle, end) for the second; the latter are none for the ground.
        weight: s of each of its nodes [-], shape (end - start,), float64.
        place: of the hinge at the start [m], shape (3,), float64.
        axis: of the hinge at the start, a unit vector [-], shape (3,), float64.
        arm: from the mean position of each cluster to `place` [m], shape (2, 3), float64; 0 for the ground.
    """

    start: int = field(metadata=of("pairs"))
    middle: int = field(metadata=of("pairs"))
    end: int = field(metadata=of("pairs"))
    weight: Array = field(metadata=AS_IS)
    place: Array = field(metadata=AS_IS)
    axis: Array = field(metadata=AS_IS)
    arm: Array = field(metadata=AS_IS)
