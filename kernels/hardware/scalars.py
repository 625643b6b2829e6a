"""Owns the scalar, vector and matrix types of a precision."""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

THIRD = 1.0 / 3.0  # a division of two constants in a kernel is one of float32


@dataclass(frozen=True)
class Scalars:
    """Types of one element precision; nodes are float64 always, because v dt would vanish in float32 positions.

    Attributes:
        real: Warp scalar type of element arithmetic and history.
        vec3, mat33: three-vector and 3 x 3 matrix of it.
        mat43, mat83: one row for each edge of a direction, and one for each node of a hexahedron.
        mat63, mat73: one row for each monomial of a hexahedron that changes its volume, and for each but the constant.
        mat103: one row for each node of a quadratic tetrahedron.
    """

    real: Any
    vec3: Any
    mat33: Any
    mat43: Any
    mat83: Any
    mat63: Any
    mat73: Any
    mat103: Any


@cache
def scalars(precision: str) -> Scalars:
    """The element types of `precision`: "mixed" computes elements in float32, "float64" in float64."""
    if precision == "mixed":
        real, vec3, mat33 = wp.float32, wp.vec3f, wp.mat33f
    else:
        real, vec3, mat33 = wp.float64, wp.vec3d, wp.mat33d
    rows = (wp.types.matrix((count, 3), real) for count in (4, 8, 6, 7, 10))
    return Scalars(real, vec3, mat33, *rows)
