"""Owns magnified shapes: deformation without the rigid motion of each body, times a factor."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array


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
    """Displacement of the rigid motion nearest to `u` in the least squares [m], shape (node_count, 3), float64.

    The rotation is that of W. Kabsch, Acta Cryst. A 32 (1976) 922, from the singular value decomposition of the
    covariance of places before and after.
    """
    centre, moved = X.mean(axis=0), (X + u).mean(axis=0)
    left, _, right = np.linalg.svd((X - centre).T @ (X + u - moved))
    sign = np.sign(np.linalg.det(left @ right))
    return (X - centre) @ (left * [1.0, 1.0, sign]) @ right + moved - X
