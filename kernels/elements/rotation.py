"""Owns the rotation of an element: the orthogonal factor of its centroid deformation gradient."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.hardware.scalars import scalars, width_functions

wp.set_module_options({"enable_backward": False})


@cache
def nearest_rotation(precision: str, finite: bool = False) -> Any:
    """The function F -> W = Q - I, float64 in both precisions, with F = Q U; with `finite`, for stretches of up to ten.

    Higham's iteration Q <- (Q + Q^-T) / 2 (SIAM J. Sci. Stat. Comput. 7 (1986) 1160) acts on the singular values only
    and squares their distance from one. A last step by Newton and Schulz, Q <- Q (I - (Q^T Q - I) / 2), works on W, in
    float64: what Q lacks to a rotation counts as strain, and float32 would leave 6e-8 of W, anew in each step, whose
    forces heat a stiff body. A stretch of 10 % ends at 1e-10 in mixed and below rounding in float64.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    add_matrices = fused(precision).add_matrices
    D, vec3d, mat33d = wp.float64, wp.vec3d, wp.mat33d
    _, widened, _ = width_functions(precision)
    iterations = 7 if finite else 2 if precision == "mixed" else 3
    last = 0.5**iterations

    @wp.func
    def half_excess(a: vec3d, b: vec3d, sum: D):
        """- (a . b + sum) / 2, rounded after what cancels has cancelled."""
        return R(D(-0.5) * (a[0] * b[0] + (a[1] * b[1] + (a[2] * b[2] + sum))))

    @wp.func
    def from_float32(W: mat33):
        """W - Q (Q^T Q - I) / 2, of a Q that is orthogonal nearly; with Q^T Q - I = W + W^T + W^T W."""
        a = widened(vec3(W[0, 0], W[1, 0], W[2, 0]))
        b = widened(vec3(W[0, 1], W[1, 1], W[2, 1]))
        c = widened(vec3(W[0, 2], W[1, 2], W[2, 2]))
        xx = half_excess(a, a, a[0] + a[0])
        yy = half_excess(b, b, b[1] + b[1])
        zz = half_excess(c, c, c[2] + c[2])
        xy = half_excess(a, b, a[1] + b[0])
        yz = half_excess(b, c, b[2] + c[1])
        xz = half_excess(a, c, a[2] + c[0])
        E = mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
        E = add_matrices(E, W, E)
        a += widened(vec3(E[0, 0], E[1, 0], E[2, 0]))
        b += widened(vec3(E[0, 1], E[1, 1], E[2, 1]))
        c += widened(vec3(E[0, 2], E[1, 2], E[2, 2]))
        return mat33d(a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2])

    @wp.func
    def in_float64(W: mat33):
        excess = R(0.5) * add_matrices(W + wp.transpose(W), wp.transpose(W), W)
        return add_matrices(W - excess, W, -excess)

    last_step = from_float32 if precision == "mixed" else in_float64

    @wp.func
    def polar_rotation(F: mat33):
        A = F  # 2^n Q, which saves the halves
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
        return last_step(W)

    return polar_rotation


@cache
def local_function(precision: str) -> Any:
    """The function (x, d, W) -> Q^T (x + d) - x: an edge's displacement d in the frame of a rotation Q = I + W.

    Where a body has turned, d is as large as x and what remains small: they cancel in float64, in both precisions.
    """
    vec3 = scalars(precision).vec3
    rounded, widened, _ = width_functions(precision)
    add_transposed = fused("float64").add_transposed

    @wp.func
    def local_of(x: vec3, d: wp.vec3d, W: wp.mat33d):
        return rounded(add_transposed(d, W, widened(x) + d))

    return local_of
