"""Owns rotations of bodies: from a rotation vector to a matrix and back, and those of clusters."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_mca.base.arrays import Array


def rotation_matrix(rotation_vector: Sequence[float] | Array) -> Array:
    """Matrix of the rotation about `rotation_vector` by its length [rad], shape (3, 3), float64."""
    if not np.any(rotation_vector):
        return np.eye(3)
    from scipy.spatial.transform import Rotation  # whose import takes a fifth of a second

    return Rotation.from_rotvec(rotation_vector).as_matrix()


def rotation_vector(matrix: Array) -> Array:
    """Rotation vector [rad], shape (3,), float64, of a rotation matrix, shape (3, 3)."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(matrix).as_rotvec()


def best_rotation(a: Array, b: Array, weights: Array) -> Array:
    """Rotation R, shape (3, 3), float64, with the least sum w |b - R a|^2 (Kabsch, Acta Cryst. A 32 (1976) 922).

    Args:
        a, b: vectors, shape (count, 3), float64, that span a plane at least.
        weights: shape (count,), float64.
    """
    U, _, W = np.linalg.svd((weights[:, None] * b).T @ a)
    U[:, 2] *= np.linalg.det(U) * np.linalg.det(W)
    return np.asarray(U @ W, dtype=np.float64)


def mean_pose(points: Array, X: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Mean positions of a cluster at `points` and at `X`, and the rotation from the one to the other.

    Args:
        points, X: of its nodes [m], shape (count, 3), float64.
        weights: s m of each [kg], shape (count,), float64.

    Returns:
        Shapes (3,), (3,) and (3, 3), float64.
    """
    a, b = weights @ points / weights.sum(), weights @ X / weights.sum()
    return a, b, best_rotation(points - a, X - b, weights)


def point_velocity(x: Array, v: Array, weights: Array, point: Array) -> Array:
    """Velocity of a point that moves with the mean motion of a cluster [m/s], shape (3,), float64.

    Args:
        x, v: positions [m] and velocities [m/s] of the nodes, shape (count, 3), float64.
        weights: shape (count,), float64.
        point: [m], shape (3,), float64.
    """
    centre = weights @ x / weights.sum()
    return weights @ v / weights.sum() + np.cross(mean_spin(x, v, weights), point - centre)


def mean_spin(x: Array, v: Array, weights: Array) -> Array:
    """Angular velocity that fits the motion of a cluster best [rad/s], shape (3,), float64; arguments as above.

    omega = (tr(M) I - M)^-1 sum w r x v with M = sum w r r^T, r from the mean position.
    """
    r = x - weights @ x / weights.sum()
    moment = (weights[:, None] * r).T @ r
    spin = np.linalg.solve(np.trace(moment) * np.eye(3) - moment, weights @ np.cross(r, v))
    return np.asarray(spin, dtype=np.float64)
