"""Owns couplings: joints between the mean motions of clusters, nodes of a body near the joint."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import mean_pose
from warp_mca.scene.bodies import Vec3
from warp_mca.scene.joints import Joint
from warp_mca.scene.ties import Clusters, Side
from warp_mca.system.joints import Coupling

APART = 1e-3  # of a cluster's extent: distance of the points of both clusters, at most
FLAT = 1e-3  # of a cluster's radius of inertia: distance from a line below which nodes are on it
ALIGNED = math.cos(math.radians(1.0))  # between the axes of both bodies, at least


class _Pose(NamedTuple):
    """Mean position of a cluster, the joint's point and the direction of its axis, each shape (3,)."""

    centre: Array
    place: Array
    axis: Array


def _pose(joint: Joint, side: Side, nodes: Index, weights: Array, at: Vec3, axis: Vec3) -> _Pose:
    """Of a cluster that has followed its body from the body's frame."""
    points, X = side.mesh.points[nodes], side.X[nodes]
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False) if len(nodes) > 2 else np.zeros(3)
    if spread[1] <= FLAT * spread[0]:
        pin = getattr(joint, "pin", None)
        hole = pin is not None and pin.hole
        where, remedy = ("on such a hole", "give the hole's radius") if hole else ("within it", "give a larger one")
        what = f"{len(nodes)} nodes of {side.body} lie {where}, on one line or none, and the mean needs more"
        raise bad_value(f"{joint.title}.pin_radius", pin and pin.radius, f"{what}; {remedy}")
    a, b, R = mean_pose(points, X, weights)
    return _Pose(b, b + R @ (np.asarray(at) - a), R @ np.asarray(axis) / np.linalg.norm(axis))


def coupling(
    joint: Joint, clusters: Clusters, sides: Sequence[Side | None], masses: Sequence[Array | None], start: int
) -> Coupling:
    """The coupling of a joint, whose pairs begin at `start`.

    Args:
        joint: for messages.
        clusters: that it joins.
        sides: both bodies; the second is None for the ground.
        masses: lumped masses of their nodes [kg], each shape (node_count,), float64; None for the ground.
        start: first pair.

    Raises:
        RequestError: a cluster has too few nodes, or its point or axis is not where that of the other one is.
    """

    first, second = sides
    assert first is not None

    def weights(nodes: Index, weight: Array, mass: Array | None) -> Array:
        assert mass is not None
        return weight * mass[nodes]

    own = weights(clusters.first, clusters.first_weight, masses[0])
    a = _pose(joint, first, clusters.first, own, clusters.at, clusters.axis)
    middle = end = start + len(clusters.first)
    weight, place, arm = clusters.first_weight, a.place, np.zeros((2, 3))
    if second is not None:
        assert clusters.second is not None and clusters.second_weight is not None
        own = weights(clusters.second, clusters.second_weight, masses[1])
        b = _pose(joint, second, clusters.second, own, clusters.other_at, clusters.axis)
        apart = float(np.linalg.norm(a.place - b.place))
        if apart > APART * np.ptp(first.X[clusters.first], axis=0).max():
            remedy = f"it is {apart:.3g} m from other_at = {clusters.other_at} of {second.body}; let both coincide"
            raise bad_value(f"{joint.title}.at", clusters.at, remedy)
        if a.axis @ b.axis < ALIGNED:
            remedy = f"it has another direction on {first.body} than on {second.body}; turn the bodies"
            raise bad_value(f"{joint.title}.axis", clusters.axis, remedy)
        place = 0.5 * (a.place + b.place)
        weight, end = np.concatenate([weight, clusters.second_weight]), middle + len(clusters.second)
        arm[1] = place - b.centre
    arm[0] = place - a.centre
    return Coupling(start=start, middle=middle, end=end, weight=weight, place=place, axis=a.axis, arm=arm)
