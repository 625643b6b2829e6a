"""Owns products that are added to something, nested so that each fuses with one addition.

Vector and matrix operators form the product first and then add it: three more instructions for each vector.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

NOTHING = -0.0  # a sum that begins with it costs no addition: x + 0.0 is not x where x is -0.0


@dataclass(frozen=True)
class Fused:
    """Functions of one precision.

    Attributes:
        add_product: (c, A, b) -> c + A b.
        add_transposed: (c, A, b) -> c + A^T b.
        add_matrices: (C, A, B) -> C + A B.
        add_cross: (c, a, b) -> c + a x b.
    """

    add_product: Any
    add_transposed: Any
    add_matrices: Any
    add_cross: Any


@cache
def fused(precision: str) -> Fused:
    """The functions in the scalars of `precision`."""
    t = scalars(precision)
    vec3, mat33 = t.vec3, t.mat33

    @wp.func
    def add_product(c: vec3, A: mat33, b: vec3):
        return vec3(
            A[0, 0] * b[0] + (A[0, 1] * b[1] + (A[0, 2] * b[2] + c[0])),
            A[1, 0] * b[0] + (A[1, 1] * b[1] + (A[1, 2] * b[2] + c[1])),
            A[2, 0] * b[0] + (A[2, 1] * b[1] + (A[2, 2] * b[2] + c[2])),
        )

    @wp.func
    def add_transposed(c: vec3, A: mat33, b: vec3):
        return vec3(
            A[0, 0] * b[0] + (A[1, 0] * b[1] + (A[2, 0] * b[2] + c[0])),
            A[0, 1] * b[0] + (A[1, 1] * b[1] + (A[2, 1] * b[2] + c[1])),
            A[0, 2] * b[0] + (A[1, 2] * b[1] + (A[2, 2] * b[2] + c[2])),
        )

    @wp.func
    def add_matrices(C: mat33, A: mat33, B: mat33):
        S = mat33()
        for i in range(3):
            for j in range(3):
                S[i, j] = A[i, 0] * B[0, j] + (A[i, 1] * B[1, j] + (A[i, 2] * B[2, j] + C[i, j]))
        return S

    @wp.func
    def add_cross(c: vec3, a: vec3, b: vec3):
        return vec3(
            a[1] * b[2] + (c[0] - a[2] * b[1]),
            a[2] * b[0] + (c[1] - a[0] * b[2]),
            a[0] * b[1] + (c[2] - a[1] * b[0]),
        )

    return Fused(add_product, add_transposed, add_matrices, add_cross)
