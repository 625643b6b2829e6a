"""Owns the forces of `hex8i` at finite strain, and of general laws at any: point by point, with kept internal vectors.

With the mean deformation gradient F and the tensors A_k of `internal_modes`, vectors are

    a_k = F^T L(G_k F^-1) + c_k,   c_k <- c_k - 3 F^T A_k^-1 F r_k,   r_k = sum_g w_g xi_k P^T n_k,

where L gives them in closed form for isotropic elasticity, so that only what plastic flow and large strain add lags by
a step. They add n_k a_k to the displacement gradient, in place of a_k n_k, which is the same at small strain: in a
compressed element the latter would soften hourglass modes below those of an element without internal vectors (Wriggers
and Reese, Comput. Meth. Appl. Mech. Engng 135 (1996) 201; Glaser and Armero, Engng Comput. 14 (1997) 759).
Logarithmic elasticity is elliptic up to stretches of about 0.21 to 1.39 only (Bruhns, Xiao and Meyers, Proc. R. Soc. A
457 (2001) 2207), beyond which a vector would grow at will: vectors fade out before, as elastic strains grow. Plastic
strains do not count.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8i_small import internal_function
from warp_mca.kernels.elements.internal_modes import mode_functions, place_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.materials.point import material_point

wp.set_module_options({"enable_backward": False})

FADING, FADED = 0.2, 0.35  # |e| of the elastic deviatoric strain e from which vectors fade, and at which they are gone

KEPT = ("vector", "vector", "vector", "scalar")  # c_k, and how far vectors have faded, behind the history of the points


@cache
def vector_functions(precision: str, law_name: str, points: int) -> tuple[Any, Any, Any]:
    """Functions that read and write c_k, one in each row, and the share [-] that is left of vectors; and give a_k.

    The last one is (G_k, F^-1, F, y_k, c_k, share, K, G) -> a_k.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    first = points * law_functions(law_name, precision).size
    internal_vector, doubled_gradient = internal_function(precision), mode_functions(precision).doubled_gradient

    @wp.func
    def read_vectors(history: wp.array2d(dtype=R), e: int):
        c = mat33()
        for i in range(9):
            c[i // 3, i % 3] = history[wp.static(first) + i, e]
        return c, R(1.0) - history[wp.static(first + 9), e]

    @wp.func
    def write_vectors(history_out: wp.array2d(dtype=R), e: int, c: mat33, share: R):
        for i in range(9):
            history_out[wp.static(first) + i, e] = c[i // 3, i % 3]
        history_out[wp.static(first + 9), e] = R(1.0) - share

    @wp.func
    def vector_of(G_k: mat33, inverse: mat33, F: mat33, y: vec3, c: vec3, share: R, K: R, G: R):
        return c + share * (wp.transpose(F) * internal_vector(doubled_gradient(G_k * inverse), y, vec3(), K, G))

    return read_vectors, write_vectors, vector_of


@cache
def gradient_function(precision: str) -> Any:
    """The function (H, G0, G1, G2, y, z, xi) -> displacement gradient at natural coordinates xi.

    G_k are the parts that are linear in a coordinate, with the internal vectors; z_k n_k n_k normal strains.
    """
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33

    @wp.func
    def normal(amount: R, y: vec3):
        """amount times the deviator of y y."""
        N = wp.outer(amount * y, y)
        mean = R(THIRD) * wp.trace(N)
        for i in range(3):
            N[i, i] = N[i, i] - mean
        return N

    @wp.func
    def gradient_at(H: mat33, G0: mat33, G1: mat33, G2: mat33, y: mat33, z: vec3, xi: vec3):
        found = H + xi[0] * G0 + xi[1] * G1 + xi[2] * G2
        found = found + normal(xi[1] * xi[2] * z[0], y[0])
        found = found + normal(xi[2] * xi[0] * z[1], y[1])
        return found + normal(xi[0] * xi[1] * z[2], y[2])

    return gradient_at


@cache
def stress_function(precision: str, law_name: str, finite: bool, points: int) -> Any:
    """The function that gives mean nominal stress P, hourglass forces Q and greatest e : e of an element."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    modes = mode_functions(precision)
    gradients, normals, solve, twice, whole = modes.gradients, modes.normals, modes.solve, modes.twice, modes.whole
    gradient_at, place = gradient_function(precision), place_function(precision, points)
    read_vectors, write_vectors, vector_of = vector_functions(precision, law_name, points)
    point = material_point(precision, law_name, finite, points)
    plastic, general, update = bool(law_name), point.general, point.update
    k = kinematics(precision, finite)
    dilatation_of, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal

    @wp.func
    def deviatoric_normal(P: mat33, y: vec3):
        return wp.dot(y, P * y) - R(THIRD) * wp.trace(P) * wp.dot(y, y)

    @wp.func
    def relaxing(s: vec3, y: vec3, inverse: mat33, K: R, G: R):
        """The part of a stress moment, elastic in s y, whose traction is what the moment has left; conjugate to L."""
        D = twice(s, y)
        return whole(G * D, (R(0.5) * K - R(THIRD) * G) * (D[0] + D[1] + D[2])) * wp.transpose(inverse)

    @wp.func
    def points_stress(
        x: mat73,
        volume: R,
        H: mat33,
        q: mat43,
        y: mat33,
        e: int,
        m: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
    ):
        K = law[m, 0]
        G = law[m, 1]
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flag_new = flag
        F = wp.identity(n=3, dtype=R)
        if wp.static(finite):
            F = F + H
        inverse = wp.inverse(F)
        c, share = read_vectors(history_out, e)
        G0, G1, G2 = gradients(q, y)
        a0 = vector_of(G0, inverse, F, y[0], c[0], share, K, G)
        a1 = vector_of(G1, inverse, F, y[1], c[1], share, K, G)
        a2 = vector_of(G2, inverse, F, y[2], c[2], share, K, G)
        G0 = G0 + wp.outer(y[0], a0)
        G1 = G1 + wp.outer(y[1], a1)
        G2 = G2 + wp.outer(y[2], a2)
        z = normals(q, x)
        mean = mat33()
        R0 = mat33()
        R1 = mat33()
        R2 = mat33()
        w = vec3()
        largest = R(0.0)
        stress2 = R(0.0)
        for g in range(wp.static(points)):
            xi, weight = place(g)
            Hg = gradient_at(H, G0, G1, G2, y, z, xi)
            strain, N, d = deviator(Hg)
            theta = dilatation_of(Hg)
            largest = wp.max(largest, wp.ddot(strain, strain))
            S, pressure, dp = update(strain, theta, G, g, e, m, flag, law, dt, history_out)
            if dp > R(0.0):
                flag_new = int(1)
            if wp.static(not general):
                pressure = pressure_of(K, theta)
                stress2 = wp.max(stress2, wp.ddot(S, S))
            P = weight * nominal(Hg, S, N, d, pressure)
            mean = mean + P
            R0 = R0 + xi[0] * P
            R1 = R1 + xi[1] * P
            R2 = R2 + xi[2] * P
            w = w + vec3(
                xi[1] * xi[2] * deviatoric_normal(P, y[0]),
                xi[2] * xi[0] * deviatoric_normal(P, y[1]),
                xi[0] * xi[1] * deviatoric_normal(P, y[2]),
            )
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        s0 = solve(F * (wp.transpose(R0) * y[0]), y[0], K, G)
        s1 = solve(F * (wp.transpose(R1) * y[1]), y[1], K, G)
        s2 = solve(F * (wp.transpose(R2) * y[2]), y[2], K, G)
        kept = R(1.0)
        if wp.static(finite and not general):
            kept = (R(FADED) - R(0.5) * wp.sqrt(stress2) / G) * R(wp.static(1.0 / (FADED - FADING)))
            kept = wp.clamp(kept, R(0.0), R(1.0))
        three = R(3.0) * wp.transpose(F)
        c[0] = c[0] - three * s0
        c[1] = c[1] - three * s1
        c[2] = c[2] - three * s2
        write_vectors(history_out, e, kept * c, kept)
        R0 = R0 - share * relaxing(s0, y[0], inverse, K, G)
        R1 = R1 - share * relaxing(s1, y[1], inverse, K, G)
        R2 = R2 - share * relaxing(s2, y[2], inverse, K, G)
        Q = mat43()
        Q[0] = volume * (R1 * y[2] + R2 * y[1])
        Q[1] = volume * (R0 * y[2] + R2 * y[0])
        Q[2] = volume * (R0 * y[1] + R1 * y[0])
        Q[3] = volume * (w[0] * x[0] + w[1] * x[1] + w[2] * x[2])
        return mean, Q, largest

    return points_stress
