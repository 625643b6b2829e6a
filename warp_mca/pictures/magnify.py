"""Owns magnified shapes: deformation without the rigid motion of each body, times a factor."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import mean_pose


def magnified(X: Array, u: Array, factor: float) -> Array:
    """Places of a body's nodes with its deformation magnified [m], shape (node_count, 3), float64.

    Args:
        X: reference positions [m], shape (node_count, 3).
        u: displacements [m], shape (node_count, 3).
        factor: of what the nodes move beside the nearest rigid motion; 1 gives X + u.
    """
    rigid = rigid_motion(X, u) if factor != 1.0 else 0.0
    return X + rigid + factor * (u - rigid)


def rigid_motion(X: Array, u: Array) -> Array:
    """Displacement of the rigid motion nearest to `u` in the least squares [m], shape (node_count, 3), float64."""
    centre, moved, rotation = mean_pose(X, X + u, np.ones(len(X)))
    return (X - centre) @ rotation.T + moved - X
