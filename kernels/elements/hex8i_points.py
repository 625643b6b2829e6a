"""Owns the forces of `hex8i` at finite strain, and of general laws at any: point by point, with kept internal vectors.

With the mean deformation gradient F and the tensors A_k of `internal_modes`, vectors are

    a_k = F^T L(G_k F^-1) + c_k,   c_k <- c_k - 3 F^T A_k^-1 F r_k,   r_k = sum_g w_g xi_k P^T F n_k,

where L gives them in closed form for isotropic elasticity, so that only what plastic flow and large strain add lags by
a step; the energy that this takes is the work of what r_k has left in the change of a_k. They add F n_k a_k to the
displacement gradient, in place of a_k n_k, which is the same at small strain: in a compressed element the latter would
soften hourglass modes below those of an element without internal vectors (Wriggers and Reese, Comput. Meth. Appl. Mech.
Engng 135 (1996) 201; Glaser and Armero, Engng Comput. 14 (1997) 759). All parts turn with F, so that the energy is
objective, and angular momentum is kept.

Vectors do not take what J varies by in second order. Near incompressibility K would hold this: cells lock as they
stretch, and vectors that lag make them unstable. At finite strain points have a K of `OWN_SHARE` G at most to
themselves, as vectors do; the rest goes with the mean of J - 1, as in `hex8`. Bending is 1 % too soft by this at
nu = 0.5. Where vectors fade, it falls to `OWN_ALONE` G; what this frees counts as taken by the lag.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.formulation import OWN_ALONE, own_modulus_function
from warp_mca.kernels.elements.hex8i_small import internal_function
from warp_mca.kernels.elements.hex8i_vectors import closed_form_function, corrected_function, vector_functions
from warp_mca.kernels.elements.internal_modes import mode_functions, place_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.point import material_point

wp.set_module_options({"enable_backward": False})


def splits(precision: str, law_name: str, finite: bool) -> bool:
    """Whether points have a part of K to themselves: at finite strain, where the law leaves the pressure to K."""
    return finite and not material_point(precision, law_name, finite, 8).general


@cache
def varying_function(precision: str, finite: bool) -> Any:
    """The function (x, H, q, y, c, share, K, G) -> how the displacement gradient varies over an element.

    (F; F^-1; F y_k in rows; a_k in rows; parts that are linear in a natural coordinate, and in the product of the two
    others; F^-1 times the last amplitude; amounts z of normal strain along the natural axes.)
    """
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    modes, internal_vector = mode_functions(precision), internal_function(precision)
    gradients, doubled_gradient, normal = modes.gradients, modes.doubled_gradient, modes.normal

    @wp.func
    def varying(x: mat73, H: mat33, q: mat43, y: mat33, c: mat33, share: R, K: R, G: R):
        F = wp.identity(n=3, dtype=R)
        inverse = wp.identity(n=3, dtype=R)
        if wp.static(finite):
            F = F + H
            inverse = wp.inverse(F)
        Y = y * wp.transpose(F)
        G0, G1, G2 = gradients(q, y)
        none = vec3()
        a = mat33()
        a[0] = internal_vector(doubled_gradient(G0 * inverse), Y[0], none, K, G)
        a[1] = internal_vector(doubled_gradient(G1 * inverse), Y[1], none, K, G)
        a[2] = internal_vector(doubled_gradient(G2 * inverse), Y[2], none, K, G)
        a = share * (a * F) + c
        last = inverse * q[3]
        z = vec3(wp.dot(x[0], last), wp.dot(x[1], last), wp.dot(x[2], last))
        return (
            F,
            inverse,
            Y,
            a,
            G0 + wp.outer(Y[0], a[0]),
            G1 + wp.outer(Y[1], a[1]),
            G2 + wp.outer(Y[2], a[2]),
            z[0] * (F * normal(y[0])),
            z[1] * (F * normal(y[1])),
            z[2] * (F * normal(y[2])),
            last,
            z,
        )

    return varying


@cache
def sums_function(precision: str, law_name: str, finite: bool, points: int) -> Any:
    """The function that goes through the points of an element.

    It gives sums of w_g P: by themselves; times each natural coordinate; times the product of the two others. Then the
    greatest e : e and S : S, the new flag, and the mean of ln(J)^2 / 2 beyond that of the mean J, where K is split.
    """
    R, mat33 = scalars(precision).real, scalars(precision).mat33
    column_place, layer_place, layer_count = *place_functions(precision, points), points // 4
    point = material_point(precision, law_name, finite, points)
    general, update, has_mean = point.general, point.update, splits(precision, law_name, finite)
    k = law_kinematics(precision, law_name, finite)
    dilatation_of, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal

    @wp.func
    def mean_dilatation(H: mat33, L0: mat33, L1: mat33, L2: mat33, N0: mat33, N1: mat33, N2: mat33):
        growth = R(0.0)
        for column in range(4):
            xi, eta = column_place(column)
            middle = (H + xi * L0) + eta * (L1 + xi * N2)
            slope = (L2 + xi * N1) + eta * N0
            for k in range(wp.static(layer_count)):
                zeta, weight = layer_place(k)
                growth += weight * dilatation_of(middle + zeta * slope)
        return growth

    @wp.func
    def beyond_mean(variance: R, theta: R):
        """Of ln(J)^2 / 2, of points beyond that of their mean J = 1 + theta."""
        return R(0.5) * variance * (R(1.0) - theta) / ((R(1.0) + theta) * (R(1.0) + theta))

    @wp.func
    def point_sums(
        H: mat33,
        L0: mat33,
        L1: mat33,
        L2: mat33,
        N0: mat33,
        N1: mat33,
        N2: mat33,
        K: R,
        e: int,
        m: int,
        flag: int,
        law: wp.array2d(dtype=R),
        dt: R,
        history_out: wp.array2d(dtype=R),
    ):
        G = law[m, 1]
        shared, mean_theta, variance = R(0.0), R(0.0), R(0.0)
        if wp.static(has_mean):
            if law[m, 0] > R(OWN_ALONE) * G:
                mean_theta = mean_dilatation(H, L0, L1, L2, N0, N1, N2)
                shared = pressure_of(law[m, 0] - K, mean_theta)
        flag_new = flag
        mean = mat33()
        R0, R1, R2 = mat33(), mat33(), mat33()
        M0, M1, M2 = mat33(), mat33(), mat33()
        largest, stress2 = R(0.0), R(0.0)
        for column in range(4):
            xi, eta = column_place(column)
            middle = (H + xi * L0) + eta * (L1 + xi * N2)
            slope = (L2 + xi * N1) + eta * N0
            total = mat33()
            moment = mat33()
            for k in range(wp.static(layer_count)):
                zeta, weight = layer_place(k)
                Hg = middle + zeta * slope
                strain, N, d = deviator(Hg)
                theta = dilatation_of(Hg)
                largest = wp.max(largest, wp.ddot(strain, strain))
                g = wp.static(layer_count) * column + k
                S, pressure, dp = update(strain, theta, G, g, e, m, flag, law, dt, history_out)
                if dp > R(0.0):
                    flag_new = int(1)
                if wp.static(has_mean):
                    variance += weight * (theta - mean_theta) * (theta - mean_theta)
                if wp.static(not general):
                    pressure = shared + pressure_of(K, theta)
                    stress2 = wp.max(stress2, wp.ddot(S, S))
                P = nominal(Hg, S, N, d, pressure)
                total = total + weight * P
                moment = moment + (weight * zeta) * P
            mean = mean + total
            R0 = R0 + xi * total
            R1 = R1 + eta * total
            R2 = R2 + moment
            M0 = M0 + eta * moment
            M1 = M1 + xi * moment
            M2 = M2 + (xi * eta) * total
        return mean, R0, R1, R2, M0, M1, M2, largest, stress2, flag_new, beyond_mean(variance, mean_theta)

    return point_sums


@cache
def stress_function(precision: str, law_name: str, finite: bool, points: int) -> Any:
    """The function that gives mean nominal stress P, hourglass forces Q and greatest e : e of an element.

    The last value is the energy that the lag of the internal vectors takes [J].
    """
    t = scalars(precision)
    R, vec3, mat33, mat43, mat73 = t.real, t.vec3, t.mat33, t.mat43, t.mat73
    modes, varying = mode_functions(precision), varying_function(precision, finite)
    gradients, solve, normal = modes.gradients, modes.solve, modes.normal
    closed_form, corrected = closed_form_function(precision), corrected_function(precision, law_name, finite)
    read_vectors, write_vectors = vector_functions(precision, law_name, points)
    point_sums, plastic = sums_function(precision, law_name, finite, points), bool(law_name)
    own_modulus, has_mean = own_modulus_function(precision), splits(precision, law_name, finite)

    @wp.func
    def conjugate(R0: mat33, R1: mat33, R2: mat33, y: mat33, last: vec3):
        Q = mat43()
        Q[0] = R1 * y[2] + R2 * y[1]
        Q[1] = R0 * y[2] + R2 * y[0]
        Q[2] = R0 * y[1] + R1 * y[0]
        Q[3] = last
        return Q

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
        G = law[m, 1]
        K = R(law[m, 0])
        own = R(law[m, 0])
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        c, share = read_vectors(history_out, e)
        if wp.static(has_mean):
            K = own_modulus(law[m, 0], G, R(1.0))
            own = own_modulus(law[m, 0], G, share)
        F, inverse, Y, a, L0, L1, L2, N0, N1, N2, last, z = varying(x, H, q, y, c, share, K, G)
        mean, R0, R1, R2, M0, M1, M2, largest, stress2, flag_new, excess = point_sums(
            H, L0, L1, L2, N0, N1, N2, own, e, m, flag, law, dt, history_out
        )
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        r0 = wp.transpose(R0) * Y[0]
        r1 = wp.transpose(R1) * Y[1]
        r2 = wp.transpose(R2) * Y[2]
        s0 = solve(F * r0, Y[0], K, G)
        s1 = solve(F * r1, Y[1], K, G)
        s2 = solve(F * r2, Y[2], K, G)
        S = wp.matrix_from_rows(s0, s1, s2)
        change, c, kept = corrected(F, c, a, S, share, stress2, G)
        write_vectors(history_out, e, c, kept)
        lost = -volume * (wp.dot(r0, change[0]) + wp.dot(r1, change[1]) + wp.dot(r2, change[2]))
        if wp.static(has_mean):
            lost += volume * (own - own_modulus(law[m, 0], G, kept)) * excess
        D0 = normal(y[0])
        D1 = normal(y[1])
        D2 = normal(y[2])
        w = vec3(wp.ddot(M0, F * D0), wp.ddot(M1, F * D1), wp.ddot(M2, F * D2))
        along = w[0] * x[0] + w[1] * x[1] + w[2] * x[2]
        along = wp.transpose(inverse) * along
        if wp.static(finite):  # all parts depend on F, too
            mean = mean + wp.outer(R0 * a[0], y[0]) + wp.outer(R1 * a[1], y[1]) + wp.outer(R2 * a[2], y[2])
            mean = mean + z[0] * (M0 * D0) + z[1] * (M1 * D1) + z[2] * (M2 * D2) - wp.outer(along, last)
        G0, G1, G2 = gradients(q, y)
        B0, C0 = closed_form(s0, r0, G0, Y[0], y[0], inverse, K, G)
        B1, C1 = closed_form(s1, r1, G1, Y[1], y[1], inverse, K, G)
        B2, C2 = closed_form(s2, r2, G2, Y[2], y[2], inverse, K, G)
        if wp.static(finite):
            mean = mean - share * (C0 + C1 + C2)
        return mean, volume * conjugate(R0 - share * B0, R1 - share * B1, R2 - share * B2, y, along), largest, lost

    return points_stress
