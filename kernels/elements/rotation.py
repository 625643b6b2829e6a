"""Owns the rotation of an element: the orthogonal factor of its centroid deformation gradient."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.hardware.scalars import scalars, width_functions

wp.set_module_options({"enable_backward": False})


@cache
def last_step_function(precision: str, exact: bool) -> Any:
    """The function that makes a nearly orthogonal Q = I + W0 orthogonal, by a step of Newton and Schulz.

    Q <- Q (I - S) with S = (Q^T Q - I) / 2 = (W0 + W0^T + W0^T W0) / 2 (Higham, SIAM J. Sci. Stat. Comput. 7 (1986)
    1160). Returns (W, the rotation in float64 that takes displacements back, S that strains owe to it). In mixed, what
    cancels in S cancels in float64. `exact`: the second is W unrounded, so that strains owe nothing; otherwise it is
    W0, and they owe S, which takes fewer operations where an element has one gradient.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    add_matrices = fused(precision).add_matrices
    rounded, widened = width_functions(precision)

    @wp.func
    def add_dot(c: wp.float64, a: wp.vec3d, b: wp.vec3d):
        return a[0] * b[0] + (a[1] * b[1] + (a[2] * b[2] + c))

    @wp.func
    def excess(a: wp.vec3d, b: wp.vec3d, c: wp.vec3d):
        """S of the columns of W0."""
        twice_direct = wp.vec3d(add_dot(a[0] + a[0], a, a), add_dot(b[1] + b[1], b, b), add_dot(c[2] + c[2], c, c))
        twice_shear = wp.vec3d(add_dot(a[1] + b[0], a, b), add_dot(b[2] + c[1], b, c), add_dot(a[2] + c[0], a, c))
        direct = R(0.5) * rounded(twice_direct)
        shear = R(0.5) * rounded(twice_shear)
        return mat33(direct[0], shear[0], shear[2], shear[0], direct[1], shear[1], shear[2], shear[1], direct[2])

    @wp.func
    def last_step_mixed(W0: mat33):
        a = widened(vec3(W0[0, 0], W0[1, 0], W0[2, 0]))
        b = widened(vec3(W0[0, 1], W0[1, 1], W0[2, 1]))
        c = widened(vec3(W0[0, 2], W0[1, 2], W0[2, 2]))
        S = excess(a, b, c)
        change = add_matrices(-S, W0, -S)
        if wp.static(exact):
            a += widened(vec3(change[0, 0], change[1, 0], change[2, 0]))
            b += widened(vec3(change[0, 1], change[1, 1], change[2, 1]))
            c += widened(vec3(change[0, 2], change[1, 2], change[2, 2]))
        return W0 + change, wp.mat33d(a[0], b[0], c[0], a[1], b[1], c[1], a[2], b[2], c[2]), S

    @wp.func
    def last_step_float64(W0: mat33):
        S = R(0.5) * add_matrices(W0 + wp.transpose(W0), wp.transpose(W0), W0)
        W = add_matrices(W0 - S, W0, -S)
        return W, W, mat33()

    return last_step_mixed if precision == "mixed" else last_step_float64


@cache
def nearest_rotation(precision: str, finite: bool = False, exact: bool = False) -> Any:
    """The function F -> what `last_step_function` gives, of Q in F = Q U; with `finite`, for stretches of up to ten.

    Higham's iteration Q <- (Q + Q^-T) / 2 acts on the singular values only and squares their distance from one. A last
    step works on W = Q - I: what Q lacks to a rotation counts as strain, and in float32 it would be 6e-8 of W, anew in
    each step, whose forces heat a stiff body. A stretch of 10 % ends at 1e-10 in mixed and below rounding in float64.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    last_step = last_step_function(precision, exact)
    iterations = 7 if finite else 2 if precision == "mixed" else 3
    last = 0.5**iterations

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
        W, wide, S = last_step(R(last) * A - wp.identity(n=3, dtype=R))
        return W, wide, S

    return polar_rotation


@cache
def local_function(precision: str) -> Any:
    """The function (x, d, W) -> Q^T (x + d) - x: an edge's displacement d in the frame of a rotation Q = I + W.

    Where a body has turned, d is as large as x and what remains small: they cancel in float64, in both precisions.
    """
    rounded, _ = width_functions(precision)
    add_transposed = fused("float64").add_transposed

    @wp.func
    def local_of(x: wp.vec3d, d: wp.vec3d, W: wp.mat33d):
        return rounded(add_transposed(d, W, x + d))

    return local_of
