"""Owns what a joint returns, tied nodes, nodes on rails or clusters, and what it may read of its bodies."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.scene.bodies import Vec3

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh


ON_HOLE = 1e-3  # distance from the surface of a hole, as a share of its radius
COINCIDENT = 1e-6  # distance of coincident nodes, as a share of the extent of the joint's first body


@dataclass(frozen=True)
class Side:
    """What a joint knows of one of its bodies.

    Attributes:
        body: its name.
        mesh: in the body's own frame.
        X: positions of its nodes at the start of the impact phase [m], shape (node_count, 3), float64.
        frame: rotation matrix from the body's frame to the scene's [-], shape (3, 3), float64.
    """

    body: str
    mesh: Mesh
    X: Array
    frame: Array

    @property
    def tolerance(self) -> float:
        """Distance within which nodes coincide [m]."""
        return COINCIDENT * float(np.ptp(self.mesh.points, axis=0).max())

    def on_axis(self, at: Vec3, axis: Vec3) -> Index:
        """Nodes on an axis through `at` [m], in the order along it; both in the body's frame."""
        direction = np.asarray(axis) / np.linalg.norm(axis)
        offset = self.mesh.points - np.asarray(at)
        along = offset @ direction
        away = np.linalg.norm(offset - along[:, None] * direction, axis=1)
        nodes = np.flatnonzero(away <= self.tolerance)
        return nodes[np.argsort(along[nodes])].astype(np.int32)

    def on_pin(self, at: Vec3, axis: Vec3, pin: Pin) -> tuple[Index, Array]:
        """Nodes that a pin on such an axis takes, and the weights of these."""
        weight = pin.weights(self.mesh.points, at, axis)
        nodes = np.flatnonzero(weight > 0.0)
        return nodes.astype(np.int32), weight[nodes]


@dataclass(frozen=True)
class Ties:
    """Pairs of coincident nodes that move as one, in all directions or in some.

    Attributes:
        first: nodes of the joint's body, in the numbering of its mesh, shape (pair_count,), int32.
        second: nodes of the other body that they are tied to, likewise; None for the ground.
        tied: orthogonal projector on the directions in which they move as one [-], shape (3, 3), float64, in the
            scene's frame; None for all directions. The directions stay fixed in space.
    """

    first: Index
    second: Index | None = None
    tied: Array | None = None


@dataclass(frozen=True)
class Rails:
    """Nodes that slide along lines of nodes of the other body, which may bend and turn.

    Attributes:
        sliders: nodes of the joint's body on each rail, in the numbering of its mesh, int32.
        rails: nodes of the other body that make up each rail, in the order along it, two at least, int32. Beyond its
            ends a rail goes on straight.
    """

    sliders: tuple[Index, ...]
    rails: tuple[Index, ...]


@dataclass(frozen=True)
class Clusters:
    """Nodes near a hinge, of the joint's body and of the other one or the ground, that share a mean motion.

    The means coincide at a point and in the direction of an axis; meshes need not match.

    Attributes:
        first: nodes of the joint's body, in the numbering of its mesh, shape (count,), int32.
        first_weight: of each of these beside its mass [-], shape (count,), float64.
        at: the point in the frame of the joint's body [m].
        axis: direction of the hinge in that frame [-].
        second: nodes of the other body, likewise; None for the ground.
        second_weight: of each of these [-], shape (count,), float64; None for the ground.
        other_at: the point in the frame of the other body [m].
    """

    first: Index
    first_weight: Array
    at: Vec3
    axis: Vec3
    second: Index | None = None
    second_weight: Array | None = None
    other_at: Vec3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Pin:
    """Which nodes around an axis share a mean motion.

    Attributes:
        radius: how far from the axis, or of a hole [m].
        hole: whether it takes the surface of a hole in place of all nodes within the radius.
    """

    radius: float
    hole: bool = False

    def weights(self, points: Array, at: Vec3, axis: Vec3) -> Array:
        """Weights of points at the distance r from an axis through `at`, shape (count,); 0 where they are not taken.

        Within a radius (1 - (r / radius)^2)^2: the weight and its slope are 0 there, so that sums over the nodes, which
        lumped masses make quadratures, change smoothly with the mesh. On the surface of a hole 1: masses are
        proportional to the surface, so that an impulse acts as an even pressure.

        Args:
            points: [m], shape (count, 3), float64.
            at, axis: in the same frame [m].
        """
        offset, direction = points - np.asarray(at), np.asarray(axis) / np.linalg.norm(axis)
        square = (offset**2).sum(axis=1) - (offset @ direction) ** 2
        if self.hole:
            return np.where(np.abs(square - self.radius**2) <= 2.0 * ON_HOLE * self.radius**2, 1.0, 0.0)
        return np.asarray(np.maximum(1.0 - square / self.radius**2, 0.0) ** 2, dtype=np.float64)


def coincident(first: Side, a: Index, second: Side, b: Index) -> tuple[Index, Index]:
    """Nodes among `a` of one body that coincide with nodes among `b` of the other, and the latter."""
    from scipy.spatial import KDTree

    away, place = KDTree(second.X[b]).query(first.X[a])
    met = away <= first.tolerance
    return a[met], b[np.asarray(place)[met]]


def rails_along(first: Side, a: Index, second: Side, b: Index, axis: Array) -> Rails:
    """Lines of the nodes `b` of a body along a unit vector, with the nodes among `a` of the other one on each."""
    from scipy.spatial import KDTree

    def across(X: Array) -> Array:
        return X - np.outer(X @ axis, axis)

    found: dict[tuple[int, ...], list[int]] = {}
    lines = KDTree(across(second.X[b])).query_ball_point(across(first.X[a]), first.tolerance)
    for node, line in zip(a.tolist(), lines, strict=True):
        if len(line) > 1:
            found.setdefault(tuple(sorted(line)), []).append(node)
    rails = [b[list(line)] for line in found]
    return Rails(
        sliders=tuple(np.array(nodes, dtype=np.int32) for nodes in found.values()),
        rails=tuple(rail[np.argsort(second.X[rail] @ axis)].astype(np.int32) for rail in rails),
    )
