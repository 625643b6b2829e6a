"""Owns the one-point hexahedron with assumed-strain hourglass stiffness.

Gradients are means over the element, so that it passes the patch test: Flanagan and Belytschko, Int. J. Numer. Meth.
Engng 17 (1981) 679. The hourglass modes carry the elastic energy of a brick of the element's mean edges without its
parasitic shear: Belytschko and Bindeman, Comput. Meth. Appl. Mech. Engng 105 (1993) 225; bending is then right with
one element over the height. Where the element yields, its hourglass strains flow with its plastic multiplier, as the
points of the full element would about their mean.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels import j2
from warp_mca.kernels.hexahedron import (
    edge_functions,
    frame_functions,
    history_functions,
    load_function,
    node_force_function,
    store_function,
    stress_function,
)
from warp_mca.kernels.kinematics import kinematics
from warp_mca.kernels.scalars import scalars

wp.set_module_options({"enable_backward": False})

# Rows of the history beside those of the plastic strain: plastic hourglass amplitudes, and the energy they took [J].
_AMPLITUDES = j2.HISTORY_SIZE
_DISSIPATED = _AMPLITUDES + 12
HISTORY_ROWS = _DISSIPATED + 1


@cache
def mean_functions(precision: str) -> tuple[Any, Any]:
    """Functions (corners -> node gradients times volume, and volume; displacement gradient)."""
    t = scalars(precision)
    R, mat33, mat43, mat83 = t.real, t.mat33, t.mat43, t.mat83
    half_edges, to_gauss = edge_functions(precision)
    edge_to_node = node_force_function(precision)

    @wp.func
    def mean_gradients(x: mat83):
        gx = to_gauss(half_edges(x, 0))
        gy = to_gauss(half_edges(x, 1))
        gz = to_gauss(half_edges(x, 2))
        Bx = mat43()
        By = mat43()
        Bz = mat43()
        volume = R(0.0)
        for g in range(8):
            i = g & 1
            j = (g >> 1) & 1
            k = g >> 2
            jx = j + 2 * k
            jy = i + 2 * k
            jz = i + 2 * j
            b0 = wp.cross(gy[jy], gz[jz])
            volume += wp.dot(gx[jx], b0)
            Bx[jx] = Bx[jx] + b0
            By[jy] = By[jy] + wp.cross(gz[jz], gx[jx])
            Bz[jz] = Bz[jz] + wp.cross(gx[jx], gy[jy])
        half = R(0.5)
        b = edge_to_node(to_gauss(half * Bx), to_gauss(half * By), to_gauss(half * Bz))
        return b, volume  # with the sign of forces: minus the gradients

    @wp.func
    def mean_gradient_of(u: mat83, b: mat83, volume: R):
        H = mat33()
        for a in range(8):
            H = H - wp.outer(u[a], b[a])
        return H / volume

    return mean_gradients, mean_gradient_of


@cache
def hourglass_functions(precision: str) -> tuple[Any, Any, Any]:
    """Functions (pattern sums of a field over the corners, moduli of a brick, generalised forces and energy)."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat83 = t.real, t.vec3, t.mat33, t.mat43, t.mat83
    half_edges, _ = edge_functions(precision)

    @wp.func
    def hourglass_sums(x: mat83):
        h = mat43()  # rows: patterns eta zeta, zeta xi, xi eta, xi eta zeta of the corners
        bottom_even = x[0] + x[2]
        bottom_odd = x[1] + x[3]
        top_even = x[4] + x[6]
        top_odd = x[5] + x[7]
        h[0] = (x[0] + x[1] - x[2] - x[3]) - (x[4] + x[5] - x[6] - x[7])
        h[1] = (x[0] - x[1] - x[2] + x[3]) - (x[4] - x[5] - x[6] + x[7])
        h[2] = (bottom_even - bottom_odd) + (top_even - top_odd)
        h[3] = (top_even - top_odd) - (bottom_even - bottom_odd)
        return h

    @wp.func
    def brick(x: mat83):
        """Unit edge directions as rows, and half edge lengths, at the centre."""
        directions = mat33()
        lengths = vec3()
        for k in range(3):
            e = half_edges(x, k)
            mean = R(0.25) * (e[0] + e[1] + e[2] + e[3])
            size = wp.length(mean)
            lengths[k] = size
            directions[k] = mean / size
        return directions, lengths

    @wp.func
    def hourglass(q: mat43, directions: mat33, a: vec3, volume: R, K: R, G: R):
        """Forces conjugate to the amplitudes q, one row for each pattern, and the energy."""
        one = R(1.0)
        nu = (R(3.0) * K - R(2.0) * G) / (R(6.0) * K + R(2.0) * G)
        E = R(2.0) * G * (one + nu)
        plane = R(2.0) * G / (one - nu)
        third = volume / R(3.0)
        # amplitudes along the brick's edges: rows as patterns, columns as edges
        p = q * wp.transpose(directions)
        F = mat43()
        energy = R(0.0)
        for k in range(3):  # strains that vary along edge k, in the plane of the two others
            i = (k + 1) % 3
            j = (k + 2) % 3
            # pattern number m varies along the two edges other than m
            ei = p[j, i] / a[i]
            ej = p[i, j] / a[j]
            shear = p[j, j] / a[i] + p[i, i] / a[j]
            si = third * plane * (ei + nu * ej)
            sj = third * plane * (ej + nu * ei)
            sij = third * G * shear
            F[j, i] = F[j, i] + si / a[i]
            F[i, j] = F[i, j] + sj / a[j]
            F[j, j] = F[j, j] + sij / a[i]
            F[i, i] = F[i, i] + sij / a[j]
            energy += R(0.5) * (si * ei + sj * ej + sij * shear)
            last = p[3, k] / a[k]
            F[3, k] = volume / R(9.0) * E * last / a[k]
            energy += R(0.5) * F[3, k] * p[3, k]
        return F * directions, energy

    return hourglass_sums, brick, hourglass


@cache
def amplitude_functions(precision: str) -> tuple[Any, Any]:
    """Functions that read and write the plastic hourglass amplitudes of an element."""
    t = scalars(precision)
    R, mat43 = t.real, t.mat43

    @wp.func
    def read_amplitudes(history: wp.array2d(dtype=R), e: int):
        q = mat43()
        for m in range(4):
            for i in range(3):
                q[m, i] = history[wp.static(_AMPLITUDES) + 3 * m + i, e]
        return q

    @wp.func
    def write_amplitudes(history_out: wp.array2d(dtype=R), e: int, q: mat43):
        for m in range(4):
            for i in range(3):
                history_out[wp.static(_AMPLITUDES) + 3 * m + i, e] = q[m, i]

    return read_amplitudes, write_amplitudes


@cache
def force_kernel(precision: str, plastic: bool, finite: bool = False) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where `plastic`."""
    t = scalars(precision)
    R, vec3, mat33, mat43, mat83 = t.real, t.vec3, t.mat33, t.mat43, t.mat83
    element_rotation, local_displacement = frame_functions(precision, finite)
    load_element = load_function(precision)
    store_force = store_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    hourglass_sums, brick, hourglass = hourglass_functions(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    read_amplitudes, write_amplitudes = amplitude_functions(precision)
    j2_return = j2.return_map(precision)
    k = kinematics(precision, finite)
    dilation_of, deviator, nominal, cofactor, pressure_of = k.dilation, k.deviator, k.nominal, k.cofactor, k.pressure

    # ln(1 + x) of small x needs the rounding that fast math gives away
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def hex8r_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        b, volume = mean_gradients(Xl)
        H = mean_gradient_of(ul, b, volume)
        m = material[e]
        K = law[m, 0]
        G = law[m, 1]
        hx = hourglass_sums(Xl)
        directions, lengths = brick(Xl)
        eighth = R(0.125)
        q = eighth * (hourglass_sums(ul) - hx * wp.transpose(H))
        kept = R(1.0)
        strain, N, d = deviator(H)
        S = R(2.0) * G * strain
        if wp.static(plastic):
            eps_p = mat33()
            p = R(0.0)
            q_p = mat43()
            flag = yielded_out[e]
            if flag != 0:
                eps_p, p = read_plastic_strain(history_out, 0, e)
                q_p = read_amplitudes(history_out, e)
                q = q - q_p
            S, eps_new, p_new = j2_return(strain, eps_p, p, G, law[m, 2], law[m, 3], law[m, 4])
            if p_new > p:
                write_plastic_strain(history_out, 0, e, eps_new, p_new)
                # the flow rule at a point is linear in its stress: the part about the mean relaxes by 3 G dp / S_eq
                S_eq = wp.sqrt(R(1.5) * wp.ddot(S, S))
                kept = S_eq / (S_eq + R(3.0) * G * (p_new - p))
                write_amplitudes(history_out, e, q_p + (R(1.0) - kept) * q)
                if flag == 0:
                    yielded_out[e] = int(1)
        P = nominal(H, S, N, d) + pressure_of(K, dilation_of(H)) * cofactor(H)
        Q, stored = hourglass(q, directions, lengths, volume, K, G)
        if wp.static(plastic):
            if kept < R(1.0):
                row = wp.static(_DISSIPATED)
                # relaxed force times plastic amplitude, as for the mean stress: the balance of energy asks for it
                history_out[row, e] = history_out[row, e] + R(2.0) * kept * (R(1.0) - kept) * stored
                Q = kept * Q
        P = P - (eighth / volume) * (wp.transpose(Q) * hx)
        Q = eighth * Q
        f = mat83()
        for a in range(8):
            f[a] = P * b[a]
        # corner a carries the patterns with the signs of (eta zeta, zeta xi, xi eta, xi eta zeta)
        f[0] = f[0] - Q[0] - Q[1] - Q[2] + Q[3]
        f[1] = f[1] - Q[0] + Q[1] + Q[2] - Q[3]
        f[2] = f[2] + Q[0] + Q[1] - Q[2] + Q[3]
        f[3] = f[3] + Q[0] - Q[1] + Q[2] - Q[3]
        f[4] = f[4] + Q[0] + Q[1] - Q[2] - Q[3]
        f[5] = f[5] + Q[0] - Q[1] + Q[2] + Q[3]
        f[6] = f[6] - Q[0] - Q[1] - Q[2] - Q[3]
        f[7] = f[7] - Q[0] + Q[1] + Q[2] + Q[3]
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, W, a)

    return hex8r_force


@cache
def energy_kernel(precision: str, plastic: bool, finite: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], largest strain [-] and smallest Jacobian ratio."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    element_rotation, local_displacement = frame_functions(precision, finite)
    load_element = load_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    hourglass_sums, brick, hourglass = hourglass_functions(precision)
    read_plastic_strain, _ = history_functions(precision)
    read_amplitudes, _ = amplitude_functions(precision)
    plastic_energy = j2.plastic_energy(precision)
    k = kinematics(precision, finite)
    dilation_of, deviator, volumetric_energy = k.dilation, k.deviator, k.volumetric_energy

    @wp.kernel(enable_backward=False, module="unique")
    def hex8r_energy(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        first: int,
        energy_out: wp.array2d(dtype=R),
    ):
        e = wp.tid()
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        b, volume = mean_gradients(Xl)
        H = mean_gradient_of(ul, b, volume)
        m = material[e]
        K = law[m, 0]
        G = law[m, 1]
        strain, _N, _d = deviator(H)
        eps_p = mat33()
        dissipated = R(0.0)
        if wp.static(plastic):
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
                dissipated = volume * plastic_energy(eps_p, p, law[m, 2], law[m, 3], law[m, 4])
                dissipated += history[wp.static(_DISSIPATED), e]
        directions, lengths = brick(Xl)
        q = R(0.125) * (hourglass_sums(ul) - hourglass_sums(Xl) * wp.transpose(H))
        if wp.static(plastic):
            if yielded[e] != 0:
                q = q - read_amplitudes(history, e)
        _Q, stored = hourglass(q, directions, lengths, volume, K, G)
        identity = wp.identity(n=3, dtype=R)
        elastic = G * wp.ddot(strain - eps_p, strain - eps_p) + volumetric_energy(K, dilation_of(H))
        energy_out[0, first + e] = volume * elastic
        energy_out[1, first + e] = dissipated
        energy_out[2, first + e] = wp.sqrt(R(2.0) / R(3.0) * wp.ddot(strain, strain))
        energy_out[3, first + e] = wp.determinant(identity + H) * wp.determinant(identity + W)
        energy_out[4, first + e] = stored

    return hex8r_energy


@cache
def stress_kernel(precision: str, plastic: bool, finite: bool = False) -> Any:
    """Kernel: stress [Pa] and plastic strain [-] of some elements, in the world frame, once for each corner."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    element_rotation, local_displacement = frame_functions(precision, finite)
    load_element = load_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    read_plastic_strain, _ = history_functions(precision)
    write_stress = stress_function(precision)
    k = kinematics(precision, finite)
    dilation_of, deviator, pressure_of, cauchy = k.dilation, k.deviator, k.pressure, k.cauchy

    @wp.kernel(enable_backward=False, module="unique")
    def hex8r_stress(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        element: wp.array(dtype=wp.int32),
        first: int,
        stress_out: wp.array2d(dtype=wp.float32),
    ):
        item = wp.tid()
        e = element[item]
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        b, volume = mean_gradients(Xl)
        H = mean_gradient_of(ul, b, volume)
        m = material[e]
        eps_p = mat33()
        p = R(0.0)
        if wp.static(plastic):
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
        strain, N, d = deviator(H)
        pressure = pressure_of(law[m, 0], dilation_of(H))
        local = cauchy(H, R(2.0) * law[m, 1] * (strain - eps_p), N, d, pressure)
        Q = wp.identity(n=3, dtype=R) + W
        sigma = Q * local * wp.transpose(Q)
        for a in range(8):
            write_stress(stress_out, first + 8 * item + a, sigma, p)

    return hex8r_stress
