"""Owns the geometry of the linear tetrahedron: volumes and gradients."""

from __future__ import annotations

import numpy as np

from warp_mca.base.arrays import Array


def determinants(x: Array) -> Array:
    """Volumes [m^3] as weights of one integration point, shape (element_count, 1); corners x [m] as in `volumes`."""
    return volumes(x)[:, None]


def volumes(x: Array) -> Array:
    """Volumes [m^3], shape (element_count,), negative where inverted.

    Args:
        x: corners [m], shape (element_count, 4, 3), float64.
    """
    return (np.linalg.det(x[:, 1:] - x[:, :1]) / 6.0).astype(np.float64)


def gradients(x: Array) -> Array:
    """Gradients of the shape functions [1/m], shape (element_count, 4, 3); corners x [m] as in `volumes`."""
    last = np.linalg.inv(x[:, 1:] - x[:, :1]).transpose(0, 2, 1)
    return np.concatenate([-last.sum(axis=1, keepdims=True), last], axis=1).astype(np.float64)
