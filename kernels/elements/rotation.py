"""Owns the rotation of an element: the orthogonal factor of its centroid deformation gradient."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})


@cache
def nearest_rotation(precision: str, finite: bool = False) -> Any:
    """The function F -> W = Q - I with F = Q U; with `finite`, for stretches of up to ten.

    Higham's iteration Q <- (Q + Q^-T) / 2 (SIAM J. Sci. Stat. Comput. 7 (1986) 1160) acts on the singular values only
    and squares their distance from one. A last step by Newton and Schulz, Q <- Q (I - (Q^T Q - I) / 2), works on W, so
    that its rounding is as small as W: rods that turned by 0.01 rad would otherwise carry strains of float32's 6e-8,
    whose forces heat a stiff body. A stretch of 10 % ends at 1e-10 in mixed and below rounding in float64.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    add_matrices = fused(precision).add_matrices
    iterations = 7 if finite else 2 if precision == "mixed" else 3
    last = 0.5**iterations

    @wp.func
    def polar_rotation(F: mat33):
        A = F  # 2^n Q, which saves the multiplications by 1/2
        factor = R(1.0)
        for _ in range(wp.static(iterations)):
            r0 = vec3(A[0, 0], A[0, 1], A[0, 2])
            r1 = vec3(A[1, 0], A[1, 1], A[1, 2])
            r2 = vec3(A[2, 0], A[2, 1], A[2, 2])
            k0 = wp.cross(r1, r2)
            k1 = wp.cross(r2, r0)
            k2 = wp.cross(r0, r1)
            weight = factor / wp.dot(r0, k0)
            cofactor = mat33(k0[0], k0[1], k0[2], k1[0], k1[1], k1[2], k2[0], k2[1], k2[2])
            A = A + weight * cofactor
            factor = R(4.0) * factor
        W = R(last) * A - wp.identity(n=3, dtype=R)
        excess = R(0.5) * add_matrices(W + wp.transpose(W), wp.transpose(W), W)
        return add_matrices(W - excess, W, -excess)

    return polar_rotation
