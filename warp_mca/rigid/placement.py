"""Owns where a rigid body is and how it moves, and the same of every link of a chain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from warp_mca.base.rotation import rotation_matrix
from warp_mca.rigid.chain import Array, Chain, link_axes


@dataclass(frozen=True, kw_only=True)
class Placement:
    """A body's rigid pose and motion in the world at one time.

    Attributes:
        pivot: a point in the body's frame [m], shape (3,), float64.
        origin: where the pivot lies in the world [m], shape (3,), float64.
        rotation: from the body's frame to the world [-], shape (3, 3), float64.
        velocity: of the pivot [m/s], shape (3,), float64.
        angular_velocity: [rad/s], shape (3,), float64.
    """

    pivot: Array
    origin: Array
    rotation: Array
    velocity: Array
    angular_velocity: Array

    def place(self, points: Array) -> tuple[Array, Array]:
        """World positions X = origin + R (x - pivot) [m] and velocities V = velocity + omega x R (x - pivot) [m/s].

        The products are written out so that every point sees the same operations in the same order as the chain's
        hinges do: coincident nodes of two links on their hinge coincide afterwards too, and z of a link is copied.

        Args:
            points: in the body's frame [m], shape (count, 3), float64.

        Returns:
            X and V, each shape (count, 3), float64.
        """
        u = points - self.pivot
        r = np.stack([u[:, 0] * row[0] + u[:, 1] * row[1] + u[:, 2] * row[2] for row in self.rotation], axis=1)
        return self.origin + r, self.velocity + np.cross(self.angular_velocity, r)

    def after(self, span: float) -> Placement:
        """The placement after a time [s] at the same velocity of the pivot and the same angular velocity."""
        rotation = rotation_matrix(self.angular_velocity * span) @ self.rotation
        return replace(self, origin=self.origin + self.velocity * span, rotation=rotation)

    def to_body(self, positions: Array) -> Array:
        """Points in the body's frame x = pivot + R^T (X - origin) [m], shape (count, 3), float64, of X in the world."""
        return self.pivot + (positions - self.origin) @ self.rotation


def link_placements(chain: Chain, theta: Array, theta_dot: Array) -> dict[str, Placement]:
    """Pose and motion of each link by body name: R = [d f z], omega = (0, 0, -theta_dot), about its inbound hinge."""
    hinges, speeds = chain.hinges(theta, theta_dot)
    theta, theta_dot = chain.angles(theta), chain.angles(theta_dot)
    d, f = link_axes(theta)
    return {
        link.body: Placement(
            pivot=np.array([*link.hinge_in, 0.0]),
            origin=np.array([*hinges[i], 0.0]),
            rotation=np.array([[d[i, 0], f[i, 0], 0.0], [d[i, 1], f[i, 1], 0.0], [0.0, 0.0, 1.0]]),
            velocity=np.array([*speeds[i], 0.0]),
            angular_velocity=np.array([0.0, 0.0, -theta_dot[i]]),
        )
        for i, link in enumerate(chain.links)
    }
