"""Owns the strain of `wedge6` at its points, and the forces that the stress there gives: its transpose.

Two patterns, zeta r and zeta s, have amplitudes q_1 and q_2 beside the mean gradient. Their strains are taken in the
base g_k of the middle with its dual n_k, from the components a_i = g_r . q_i, b_i = g_s . q_i, c_i = g_zeta . q_i:

    Y = ((a_1 - a_2 - b_1) n_r n_zeta + (b_2 - b_1 - a_2) n_s n_zeta) / 6 + zeta (E + d n_zeta)
      + dev(r (kappa c_1 n_zeta n_zeta - tau n_s n_zeta) + s (kappa c_2 n_zeta n_zeta + tau n_r n_zeta)),
    E = a_1 n_r n_r + b_2 n_s n_s + (a_2 + b_1) n_r n_s, tau = (a_2 - b_1) / 2, kappa^2 = 3 (1 + nu) / 2

with symmetric products n n. The transverse shear is that of MITC3 (Lee and Bathe, Comput. Struct. 82 (2004) 945), which
is zero along edges in pure bending. Of the dilatation only what is linear in zeta is left, so that incompressible
bodies do not lock; with kappa the strain along the axis has the energy of a bar that is free beside it all the same.
Y adds to a small mean strain; at finite strain it is that of the stretched element, with the base F_mean g_k, and
F = (I + Y) F_mean, so that forces are the exact slope of the energy.

The internal vector d makes the tractions of layers free of what is linear in zeta, so that the thickness may follow
(Buechter, Ramm and Roehl, Int. J. Numer. Meth. Engng 37 (1994) 2551) and leaning columns do not lock:
d = -A^-1 (C E) n_zeta + h with A as in `internal_modes`. That is exact in an elastic element. After each step h, whose
covariant components are history, takes away what is left of the tractions.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.internal_modes import mode_functions
from warp_mca.kernels.elements.patterns import mean_frame
from warp_mca.kernels.elements.wedge_shape import (
    POINTS,
    SIXTH,
    gradient_functions,
    hooke_function,
    pattern_functions,
    place_function,
    tensor_functions,
)
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.laws import law_functions

wp.set_module_options({"enable_backward": False})


@cache
def shape_functions(precision: str, law_name: str, finite: bool) -> tuple[Any, Any, Any, Any]:
    """(Struct; functions that load it, give it its internal strain, and give Y at one of its points)."""
    t = scalars(precision)
    R, vec3, mat33, mat53 = t.real, t.vec3, t.mat33, wp.types.matrix((5, 3), t.real)
    load_patterns, _ = pattern_functions(precision)
    volume_gradients, mean_gradient = gradient_functions(precision)
    dyad, without_trace = tensor_functions(precision)
    hooke, vector_of, place_of = hooke_function(precision), mode_functions(precision).solve, place_function(precision)
    rotated = mean_frame(precision, finite)
    law = law_functions(law_name, precision)
    keeps, first = law.always or bool(law.history), POINTS * law.size

    @wp.struct
    class Wedge6:
        """Patterns x and gradients b of the volume [m^3]; F_mean = I + H_world = Q (I + H), W = Q - I.

        In the rotated frame: base G and dual base N by rows; amplitudes q1 and q2, and their components a, b, c in c1
        and c2; parts of Y, which are constant in Y0, linear in zeta in Yz, and in r and s, with their dilatation, in Yr
        and Ys; E, kappa, the internal vector d and its part h.
        """

        x: mat53
        b: mat53
        volume: R
        H_world: mat33
        W: mat33
        H: mat33
        G: mat33
        N: mat33
        q1: vec3
        q2: vec3
        c1: vec3
        c2: vec3
        Y0: mat33
        E: mat33
        Yz: mat33
        Yr: mat33
        Ys: mat33
        d: vec3
        h: vec3
        kappa: R

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        shape = Wedge6()
        x = load_patterns(X, conn, e)
        v = load_patterns(u, conn, e)
        b, volume = volume_gradients(x)
        H_world = mean_gradient(v, b, volume)
        W, H = rotated(H_world)
        q1 = v[3] - H_world * x[3]
        q2 = v[4] - H_world * x[4]
        q1 = q1 + wp.transpose(W) * q1
        q2 = q2 + wp.transpose(W) * q2
        G = wp.matrix_from_rows(x[0], x[1], x[2])
        if wp.static(finite):
            G = G + G * H
        N = wp.transpose(wp.inverse(G))
        c1 = G * q1
        c2 = G * q2
        rz = dyad(N[0], N[2])
        sz = dyad(N[1], N[2])
        tau = R(0.5) * (c2[0] - c1[1])
        shape.x = x
        shape.b = b
        shape.volume = volume
        shape.H_world = H_world
        shape.W = W
        shape.H = H
        shape.G = G
        shape.N = N
        shape.q1 = q1
        shape.q2 = q2
        shape.c1 = c1
        shape.c2 = c2
        shape.Y0 = R(SIXTH) * ((c1[0] - c2[0] - c1[1]) * rz + (c2[1] - c1[1] - c2[0]) * sz)
        both = c2[0] + c1[1]
        shape.E = c1[0] * wp.outer(N[0], N[0]) + c2[1] * wp.outer(N[1], N[1]) + both * dyad(N[0], N[1])
        shape.Yr = -tau * sz
        shape.Ys = tau * rz
        return shape

    @wp.func
    def enriched(shape: Wedge6, e: int, m: int, flag: int, law: wp.array2d(dtype=R), history: wp.array2d(dtype=R)):
        K = law[m, 0]
        G = law[m, 1]
        n = shape.N[2]
        d = -vector_of(hooke(shape.E, K, G) * n, n, K, G)
        h = vec3()
        if wp.static(keeps):
            for i in range(3):
                h += history[wp.static(first) + i, e] * shape.N[i]
        shape.h = h
        shape.d = d + h
        shape.Yz = shape.E + dyad(shape.d, n)
        zz = wp.outer(n, n)
        shape.kappa = wp.sqrt(R(13.5) * K / (R(6.0) * K + R(2.0) * G))
        shape.Yr = shape.Yr + (shape.kappa * shape.c1[2]) * zz
        shape.Ys = shape.Ys + (shape.kappa * shape.c2[2]) * zz
        return shape

    @wp.func
    def strain_at(shape: Wedge6, g: int):
        zeta, r, s = place_of(g)
        return shape.Y0 + zeta * shape.Yz + without_trace(r * shape.Yr + s * shape.Ys)

    return Wedge6, load_shape, enriched, strain_at


@cache
def force_function(precision: str, law_name: str, finite: bool) -> Any:
    """The function (shape, K, G, A, M, Mz, Mr, Ms) -> (forces on the corners [N], tractions, A^-1 times these).

    M, Mz, Mr, Ms are the sums over the points of the stress and of zeta, r and s times it; A is that of Y times it
    where strains are finite, all in Pa. The tractions are what is left of those that the internal vector relieves.
    """
    t = scalars(precision)
    R, vec3, mat33, mat53 = t.real, t.vec3, t.mat33, wp.types.matrix((5, 3), t.real)
    Wedge6, _, _, _ = shape_functions(precision, law_name, finite)
    _, to_corners = pattern_functions(precision)
    dyad, without_trace = tensor_functions(precision)
    hooke, vector_of = hooke_function(precision), mode_functions(precision).solve

    @wp.func
    def conjugate(shape: Wedge6, M: mat33):
        """To Y: the symmetric part of M F_mean^T."""
        S = M
        if wp.static(finite):
            S = M + M * shape.H
        return R(0.5) * (S + wp.transpose(S))

    @wp.func
    def turned(shape: Wedge6, K: R, G: R, S: mat33, Sz: mat33, Sr: mat33, Ss: mat33, left: vec3, loose: vec3):
        """Slope of the energy over v in a velocity gradient L, which changes the dual base by -L^T n."""
        n = shape.N[2]
        d = shape.d - shape.h
        w = hooke(shape.E, K, G) * loose - Sz * shape.d + (R(2.0) * G * wp.dot(loose, d)) * n
        w += (K + R(THIRD) * G) * (wp.dot(n, d) * loose + wp.dot(n, loose) * d)
        relaxed = Sz - hooke(dyad(loose, n), K, G)
        turning = shape.Y0 * S + shape.E * relaxed + shape.Yr * Sr + shape.Ys * Ss
        return wp.outer(n, w) - wp.outer(shape.h, left) - R(2.0) * turning

    @wp.func
    def forces(shape: Wedge6, K: R, G: R, A: mat33, M: mat33, Mz: mat33, Mr: mat33, Ms: mat33):
        S = conjugate(shape, M)
        Sz = conjugate(shape, Mz)
        Sr = without_trace(conjugate(shape, Mr))
        Ss = without_trace(conjugate(shape, Ms))
        v = R(SIXTH) * shape.volume
        r = shape.N[0]
        s = shape.N[1]
        z = shape.N[2]
        left = Sz * z
        loose = vector_of(left, z, K, G)
        relaxed = Sz - hooke(dyad(loose, z), K, G)
        shear_r = R(SIXTH) * wp.dot(r, S * z)
        shear_s = R(SIXTH) * wp.dot(s, S * z)
        tau = R(0.5) * (wp.dot(r, Ss * z) - wp.dot(s, Sr * z))
        both = wp.dot(r, relaxed * s) - shear_r - shear_s
        p1 = v * vec3(wp.dot(r, relaxed * r) + shear_r, both - tau, shape.kappa * wp.dot(z, Sr * z))
        p2 = v * vec3(both + tau, wp.dot(s, relaxed * s) + shear_s, shape.kappa * wp.dot(z, Ss * z))
        B = v * M
        if wp.static(finite):  # base and dual base depend on the mean gradient, too
            F = wp.identity(n=3, dtype=R) + shape.H
            base = wp.transpose(wp.matrix_from_rows(shape.x[0], shape.x[1], shape.x[2]))
            B = B + v * (A + turned(shape, K, G, S, Sz, Sr, Ss, left, loose) * wp.inverse(F))
            B = B + wp.outer(shape.q1, base * p1) + wp.outer(shape.q2, base * p2)
        p1 = wp.transpose(shape.G) * p1
        p2 = wp.transpose(shape.G) * p2
        # amplitudes are those beside the mean gradient
        B = (B - wp.outer(p1, shape.x[3]) - wp.outer(p2, shape.x[4])) / shape.volume
        f = mat53()
        for p in range(5):
            f[p] = B * shape.b[p]
        f[3] = f[3] + p1
        f[4] = f[4] + p2
        for p in range(5):
            f[p] = -f[p] - shape.W * f[p]
        return to_corners(f), left, loose

    return forces
