"""Owns rotations of bodies: from a rotation vector to a matrix."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def turn(vector: Sequence[float] | Array) -> Array:
    """Matrix of the rotation about `vector` by its length [rad], shape (3, 3), float64."""
    if not np.any(vector):
        return np.eye(3)
    from scipy.spatial.transform import Rotation  # whose import takes a fifth of a second

    return Rotation.from_rotvec(vector).as_matrix()
