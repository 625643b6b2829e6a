"""Owns the one-point hexahedron with assumed-strain hourglass stiffness.

Gradients are means over the element, so that it passes the patch test: Flanagan and Belytschko, Int. J. Numer. Meth.
Engng 17 (1981) 679. `hourglass` describes the stiffness of the hourglass modes; with it, bending is right with one
element over the height. Where the element yields, its hourglass strains flow with its plastic multiplier, as the points
of the full element would about their mean.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.hexahedron import load_function, store_function
from warp_mca.kernels.elements.hourglass import DISSIPATED, amplitude_functions, hourglass_functions
from warp_mca.kernels.elements.hourglass import VECTORS as HOURGLASS_VECTORS
from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.elements.patterns import VOLUME_SCALE, mean_frame, mean_functions, pattern_functions
from warp_mca.kernels.elements.point_records import history_functions, stress_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import STRAIN_SQUARE, VOLUME_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})

VECTORS = HOURGLASS_VECTORS  # plastic hourglass amplitudes, which turn with the element


@cache
def element_functions(precision: str, law_name: str, finite: bool) -> tuple[Any, Any, Any]:
    """Functions (shape and strain of an element; its stress and hourglass forces, with plastic flow; corner forces).

    The first also gives the ratio of volumes J, the second keeps the greatest strain.

    A larger one, or a matrix that changes within a branch, keeps a CPU from computing elements side by side.
    """
    t = scalars(precision)
    R, mat33, mat43, mat63, mat73 = t.real, t.mat33, t.mat43, t.mat63, t.mat73
    add_product, add_matrices = fused(precision).add_product, fused(precision).add_matrices
    _, to_corners = pattern_functions(precision)
    rotated = mean_frame(precision, finite)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    amplitudes, hourglass = hourglass_functions(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision, points=1)
    read_amplitudes, write_amplitudes = amplitude_functions(precision)
    keep_strain, _, _ = keep_functions(R)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    k = kinematics(precision, finite)
    dilatation_of, deviator, nominal, pressure_of = k.dilatation, k.deviator, k.nominal, k.pressure

    @wp.func
    def shape_and_strain(x: mat73, du: mat73):
        b, scaled_volume = mean_gradients(x)
        H_world = mean_gradient_of(du, b, scaled_volume)
        W, H = rotated(H_world)
        J = wp.determinant(wp.identity(n=3, dtype=R) + H_world)
        return b, R(VOLUME_SCALE) * scaled_volume, W, H, J, amplitudes(x, du, H_world, W)

    @wp.func
    def stress_and_flow(
        x: mat73,
        volume: R,
        H: mat33,
        q: mat43,
        e: int,
        m: int,
        law: wp.array2d(dtype=R),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
    ):
        K = law[m, 0]
        G = law[m, 1]
        kept = R(1.0)
        strain, N, d = deviator(H)
        keep_strain(e, wp.ddot(strain, strain), extreme_out)
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
            S, eps_new, p_new = return_map(S, eps_p, p, G, read_parameters(law, m, R(1.0)))
            if p_new > p:
                write_plastic_strain(history_out, 0, e, eps_new, p_new)
                # the flow rule at a point is linear in its stress: the part about the mean relaxes by 3 G dp / S_eq
                S_eq = wp.sqrt(R(1.5) * wp.ddot(S, S))
                kept = S_eq / (S_eq + R(3.0) * G * (p_new - p))
                write_amplitudes(history_out, e, q_p + (R(1.0) - kept) * q)
                if flag == 0:
                    yielded_out[e] = int(1)
        P = nominal(H, S, N, d, pressure_of(K, dilatation_of(H)))
        Q, stored = hourglass(q, x, volume, K, G)
        if wp.static(plastic):
            if kept < R(1.0):
                row = wp.static(DISSIPATED)
                # relaxed force times plastic amplitude, as for the mean stress: the balance of energy asks for it
                history_out[row, e] = history_out[row, e] + R(2.0) * kept * (R(1.0) - kept) * stored
            Q = kept * Q
        return P, Q

    @wp.func
    def corner_forces(x: mat73, b: mat63, volume: R, W: mat33, P: mat33, Q: mat43):
        share = R(-1.0) / volume
        for n in range(4):  # amplitudes feel the mean gradient too
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

    return shape_and_strain, stress_and_flow, corner_forces


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    load_element = load_function(precision)
    to_patterns, _ = pattern_functions(precision)
    shape_and_strain, stress_and_flow, corner_forces = element_functions(precision, law_name, finite)
    store_force = store_function(precision)
    _, keep_volume, _ = keep_functions(R)

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
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, volume, W, H, J, q = shape_and_strain(x, du)
        P, Q = stress_and_flow(x, volume, H, q, e, material[e], law, yielded_out, history_out, extreme_out)
        f = corner_forces(x, b, volume, W, P, Q)
        keep_volume(e, R(1.0) - J, extreme_out)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8r_force


@cache
def energy_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], greatest strain and smallest Jacobian ratio [-] so far."""
    t = scalars(precision)
    R, mat33, mat43 = t.real, t.mat33, t.mat43
    to_patterns, _ = pattern_functions(precision)
    rotated = mean_frame(precision, finite)
    load_element = load_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    amplitudes, hourglass = hourglass_functions(precision)
    read_plastic_strain, _ = history_functions(precision, points=1)
    read_amplitudes, _ = amplitude_functions(precision)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, plastic_energy = functions.parameters, functions.plastic_energy
    k = kinematics(precision, finite)
    dilatation_of, deviator, volumetric_energy = k.dilatation, k.deviator, k.volumetric_energy

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def hex8r_energy(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        extreme: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        first: int,
        energy_out: wp.array2d(dtype=R),
    ):
        e = wp.tid()
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, scaled_volume = mean_gradients(x)
        H_world = mean_gradient_of(du, b, scaled_volume)
        W, H = rotated(H_world)
        volume = R(VOLUME_SCALE) * scaled_volume
        m = material[e]
        K = law[m, 0]
        G = law[m, 1]
        strain, _N, _d = deviator(H)
        eps_p = mat33()
        dissipated = R(0.0)
        if wp.static(plastic):
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
                dissipated = volume * plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
                dissipated += history[wp.static(DISSIPATED), e]
        q = amplitudes(x, du, H_world, W)
        if wp.static(plastic):
            q_p = mat43()
            if yielded[e] != 0:
                q_p = read_amplitudes(history, e)
            q = q - q_p
        _Q, stored = hourglass(q, x, volume, K, G)
        elastic = G * wp.ddot(strain - eps_p, strain - eps_p) + volumetric_energy(K, dilatation_of(H))
        energy_out[0, first + e] = volume * elastic
        energy_out[1, first + e] = dissipated
        identity = wp.identity(n=3, dtype=R)
        square = wp.max(wp.ddot(strain, strain), extreme[STRAIN_SQUARE, e])
        J = wp.determinant(identity + H) * wp.determinant(identity + W)
        energy_out[2, first + e] = wp.sqrt(R(2.0) / R(3.0) * square)
        energy_out[3, first + e] = wp.min(J, R(1.0) - extreme[VOLUME_LOSS, e])
        energy_out[4, first + e] = stored

    return hex8r_energy


@cache
def stress_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: stress [Pa] and plastic strain [-] of some elements, in the world frame, once for each corner."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    to_patterns, _ = pattern_functions(precision)
    rotated = mean_frame(precision, finite)
    load_element = load_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    read_plastic_strain, _ = history_functions(precision, points=1)
    plastic = bool(law_name)
    write_stress = stress_function(precision)
    k = kinematics(precision, finite)
    dilatation_of, deviator, pressure_of, cauchy = k.dilatation, k.deviator, k.pressure, k.cauchy

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
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, scaled_volume = mean_gradients(x)
        H_world = mean_gradient_of(du, b, scaled_volume)
        W, H = rotated(H_world)
        m = material[e]
        eps_p = mat33()
        p = R(0.0)
        if wp.static(plastic):
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
        strain, N, d = deviator(H)
        pressure = pressure_of(law[m, 0], dilatation_of(H))
        local = cauchy(H, R(2.0) * law[m, 1] * (strain - eps_p), N, d, pressure)
        Q = wp.identity(n=3, dtype=R) + W
        sigma = Q * local * wp.transpose(Q)
        for a in range(8):
            write_stress(stress_out, first + 8 * item + a, sigma, p)

    return hex8r_stress
