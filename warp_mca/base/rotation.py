"""Owns rotations of bodies: from a rotation vector to a matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def rotation_matrix(rotation_vector: Sequence[float] | Array) -> Array:
    """Matrix of the rotation about `rotation_vector` by its length [rad], shape (3, 3), float64."""
    if not np.any(rotation_vector):
        return np.eye(3)
    from scipy.spatial.transform import Rotation  # whose import takes a fifth of a second

    return Rotation.from_rotvec(rotation_vector).as_matrix()
