"""Owns the trilinear hexahedron in its monomials: xi, eta, zeta, eta zeta, zeta xi, xi eta, xi eta zeta.

A field over the corners turns into sums with the signs of each monomial (rows of a 7 x 3 matrix; a constant is left
out), which is what one-point elements need: the first three give the edges, the others the hourglass modes.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING, fused
from warp_mca.kernels.elements.rotation import nearest_rotation
from warp_mca.kernels.hardware.scalars import scalars

wp.set_module_options({"enable_backward": False})

VOLUME_SCALE = 1.0 / 64.0  # of a volume over what `mean_gradients` gives, and of gradients times volume


@cache
def pattern_sum_function(scalar: Any) -> Any:
    """The function corner values -> pattern sums, of a scalar type, integers too."""
    mat73, mat83 = wp.types.matrix((7, 3), scalar), wp.types.matrix((8, 3), scalar)

    @wp.func
    def to_patterns(x: mat83):
        p = mat73()
        # along xi
        s0 = x[1] + x[0]
        s1 = x[2] + x[3]
        s2 = x[5] + x[4]
        s3 = x[6] + x[7]
        d0 = x[1] - x[0]
        d1 = x[2] - x[3]
        d2 = x[5] - x[4]
        d3 = x[6] - x[7]
        # along eta, then zeta
        ss_low = s0 + s1
        ss_top = s2 + s3
        sd_low = s1 - s0
        sd_top = s3 - s2
        ds_low = d0 + d1
        ds_top = d2 + d3
        dd_low = d1 - d0
        dd_top = d3 - d2
        p[0] = ds_low + ds_top
        p[1] = sd_low + sd_top
        p[2] = ss_top - ss_low
        p[3] = sd_top - sd_low
        p[4] = ds_top - ds_low
        p[5] = dd_low + dd_top
        p[6] = dd_top - dd_low
        return p

    return to_patterns


@cache
def pattern_functions(precision: str) -> tuple[Any, Any]:
    """Functions (corner values -> pattern sums; pattern forces -> corner forces, the transpose)."""
    t = scalars(precision)
    mat73, mat83 = t.mat73, t.mat83

    @wp.func
    def to_corners(p: mat73):
        f = mat83()
        ds_low = p[0] - p[4]
        ds_top = p[0] + p[4]
        sd_low = p[1] - p[3]
        sd_top = p[1] + p[3]
        dd_low = p[5] - p[6]
        dd_top = p[5] + p[6]
        s0 = -p[2] - sd_low
        s1 = sd_low - p[2]
        s2 = p[2] - sd_top
        s3 = p[2] + sd_top
        d0 = ds_low - dd_low
        d1 = ds_low + dd_low
        d2 = ds_top - dd_top
        d3 = ds_top + dd_top
        f[0] = s0 - d0
        f[1] = s0 + d0
        f[2] = s1 + d1
        f[3] = s1 - d1
        f[4] = s2 - d2
        f[5] = s2 + d2
        f[6] = s3 + d3
        f[7] = s3 - d3
        return f

    return pattern_sum_function(t.real), to_corners


@cache
def mean_functions(precision: str) -> tuple[Any, Any]:
    """Functions (patterns -> mean gradients times volume, and volume; mean displacement gradient).

    The volume is cubic in the patterns: with edges a and hourglass vectors h,
    V = 8 ([a1 a2 a3] + ([a1 h3 h2] + [a2 h1 h3] + [a3 h2 h1]) / 3); gradients are its derivatives, none along the last.
    """
    t = scalars(precision)
    R, mat33, mat63, mat73 = t.real, t.mat33, t.mat63, t.mat73
    add_cross = fused(precision).add_cross

    @wp.func
    def mean_gradients(x: mat73):
        third = R(1.0) / R(3.0)
        b = mat63()
        h1 = third * x[3]
        h2 = third * x[4]
        h3 = third * x[5]
        area = wp.cross(x[1], x[2])
        b[0] = add_cross(area, h3, x[4])
        b[1] = add_cross(wp.cross(x[2], x[0]), h1, x[5])
        b[2] = add_cross(wp.cross(x[0], x[1]), h2, x[3])
        b[3] = add_cross(wp.cross(h3, x[1]), x[2], h2)
        b[4] = add_cross(wp.cross(h1, x[2]), x[0], h3)
        b[5] = add_cross(wp.cross(h2, x[0]), x[1], h1)
        bent = wp.dot(x[3], b[3]) + wp.dot(x[4], b[4]) + wp.dot(x[5], b[5])  # Euler's theorem: of second degree in h
        return b, wp.dot(x[0], area) + R(0.5) * bent

    @wp.func
    def mean_gradient_of(u: mat73, b: mat63, volume: R):
        H = mat33(R(NOTHING))
        for p in range(6):
            H = H + wp.outer(u[p], b[p])
        return H / volume

    return mean_gradients, mean_gradient_of


@cache
def mean_frame(precision: str, finite: bool = False) -> Any:
    """The function H -> (rotation of the mean deformation gradient I + H as W = Q - I, H in the rotated frame)."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    polar_rotation = nearest_rotation(precision, finite)
    add_matrices = fused(precision).add_matrices

    @wp.func
    def rotated(H: mat33):
        F = wp.identity(n=3, dtype=R) + H
        W = polar_rotation(F)
        return W, add_matrices(H, wp.transpose(W), F)  # Q^T F - I, without cancellation

    return rotated


@cache
def amplitude_function(precision: str) -> Any:
    """The function (x, u, H, W) -> hourglass amplitudes: sums over the last four patterns less the part of H, in W.

    Eight times the amplitudes of docs/theory.md, one row for each pattern; forces are conjugate to these. x and u are
    patterns of positions and displacements, H the mean displacement gradient.
    """
    t = scalars(precision)
    mat33, mat43, mat73 = t.mat33, t.mat43, t.mat73
    add_product, add_transposed = fused(precision).add_product, fused(precision).add_transposed

    @wp.func
    def amplitudes(x: mat73, u: mat73, H: mat33, W: mat33):
        q = mat43()
        for m in range(4):
            left = add_product(u[3 + m], H, -x[3 + m])
            q[m] = add_transposed(left, W, left)
        return q

    return amplitudes


@cache
def pattern_strain_function(precision: str, finite: bool) -> Any:
    """The function of patterns of positions and displacements -> what forces and strains of an element need.

    (Mean gradients times volume; volume [m^3]; rotation W = Q - I; mean displacement gradient H in the rotated frame;
    volume ratio J; hourglass amplitudes in that frame [m].)
    """
    t = scalars(precision)
    R, mat73 = t.real, t.mat73
    rotated, amplitudes = mean_frame(precision, finite), amplitude_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)

    @wp.func
    def shape_and_strain(x: mat73, du: mat73):
        b, scaled_volume = mean_gradients(x)
        H_world = mean_gradient_of(du, b, scaled_volume)
        W, H = rotated(H_world)
        J = wp.determinant(wp.identity(n=3, dtype=R) + H_world)
        return b, R(VOLUME_SCALE) * scaled_volume, W, H, J, amplitudes(x, du, H_world, W)

    return shape_and_strain


@cache
def balance_function(precision: str) -> Any:
    """The function (P, H, q, Q, volume) -> mean stress with the part that the variation of the frame gives [Pa].

    Small strains are taken in a frame that turns with the mean deformation, so that the energy depends on the positions
    of the nodes by that frame, too. With m = axial(P U) + sum of q x Q / volume, U = I + H, forces are the slope of the
    energy if P has the skew part of axial vector y more, where (tr(U) I - U) y = m; m is zero where stress and stretch
    have the same axes and strain is uniform. The rates of rotation and stretch: Hoger and Carlson (1984), On the
    derivative of the square root of a tensor and Guo's rate theorems, J. Elasticity 14, 329-336.
    """
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    add_cross = fused(precision).add_cross

    @wp.func
    def balanced(P: mat33, H: mat33, q: mat43, Q: mat43, volume: R):
        m = add_cross(add_cross(add_cross(wp.cross(q[0], Q[0]), q[1], Q[1]), q[2], Q[2]), q[3], Q[3])
        m = (R(1.0) / volume) * m
        for k in range(3):
            m = add_cross(m, H[k], P[k])
        s0 = vec3(R(2.0) + (H[1, 1] + H[2, 2]), -H[0, 1], -H[0, 2])
        s1 = vec3(-H[0, 1], R(2.0) + (H[0, 0] + H[2, 2]), -H[1, 2])
        s2 = vec3(-H[0, 2], -H[1, 2], R(2.0) + (H[0, 0] + H[1, 1]))
        k0 = wp.cross(s1, s2)
        k1 = wp.cross(s2, s0)
        k2 = wp.cross(s0, s1)
        m = (R(1.0) / wp.dot(s0, k0)) * m
        y = vec3(wp.dot(k0, m), wp.dot(k1, m), wp.dot(k2, m))
        return mat33(
            P[0, 0], P[0, 1] + y[2], P[0, 2] - y[1],
            P[1, 0] - y[2], P[1, 1], P[1, 2] + y[0],
            P[2, 0] + y[1], P[2, 1] - y[0], P[2, 2],
        )  # fmt: skip

    return balanced


@cache
def corner_force_function(precision: str) -> Any:
    """The function (x, b, volume, W, P, Q) -> forces on the corners [N], out of frame W.

    P is the mean stress [Pa], Q the forces conjugate to the hourglass amplitudes [N], one row for each pattern.
    """
    t = scalars(precision)
    R, mat33, mat43, mat63, mat73 = t.real, t.mat33, t.mat43, t.mat63, t.mat73
    add_product, add_matrices = fused(precision).add_product, fused(precision).add_matrices
    _, to_corners = pattern_functions(precision)

    @wp.func
    def corner_forces(x: mat73, b: mat63, volume: R, W: mat33, P: mat33, Q: mat43):
        share = R(-1.0) / volume
        for n in range(4):  # amplitudes depend on the mean gradient, too
            P = P + wp.outer(Q[n], share * x[3 + n])
        P = -R(VOLUME_SCALE) * add_matrices(P, W, P)
        f = mat73()
        for n in range(3):
            f[n] = P * b[n]
        for n in range(4):
            f[3 + n] = -add_product(Q[n], W, Q[n])
        for n in range(3):
            f[3 + n] = add_product(f[3 + n], P, b[3 + n])
        return to_corners(f)

    return corner_forces
