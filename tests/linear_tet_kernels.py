"""Owns the kernels of an element of the user's own: the tetrahedron of constant strain, without averaged pressure.

Zienkiewicz, Taylor and Zhu, The Finite Element Method, 7th ed. (2013), section 2.3. See `linear_tet` for the host side.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.elements.point_records import history_functions, stress_function
from warp_mca.kernels.elements.tet4 import gradient_function
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import STRAIN_SQUARE, VOLUME_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: forces -V P grad N of each element on its nodes [N], and the plastic history where there is a law."""
    t = scalars(precision)
    R, vec3, mat33 = t.real, t.vec3, t.mat33
    tet_gradient = gradient_function(precision, finite)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    keep_strain, keep_volume, _ = keep_functions(R)
    k = kinematics(precision, finite)
    dilatation, deviator, pressure_of, nominal = k.dilatation, k.deviator, k.pressure, k.nominal

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def linear_tet_force(
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
        W, H, c, _volume, J = tet_gradient(X, conn, u, e)
        m = material[e]
        G = law[m, 1]
        strain, N, d = deviator(H)
        S = R(2.0) * G * strain
        keep_strain(e, wp.ddot(strain, strain), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        if wp.static(plastic):
            eps_p = mat33()
            p = R(0.0)
            if yielded_out[e] != 0:
                eps_p, p = read_plastic_strain(history_out, 0, e)
            S, eps_new, p_new = return_map(S, eps_p, p, G, read_parameters(law, m, R(1.0)))
            if p_new > p:
                write_plastic_strain(history_out, 0, e, eps_new, p_new)
                yielded_out[e] = 1
        P = nominal(H, S, N, d, pressure_of(law[m, 0], dilatation(H)))
        P = R(-0.5) * R(THIRD) * (P + W * P)
        for i in range(3):
            f0 = wp.dot(P[i], c[0])
            f1 = wp.dot(P[i], c[1])
            f2 = wp.dot(P[i], c[2])
            force_out[slot + e][i] = -f0 - f1 - f2
            force_out[slot + count + e][i] = f0
            force_out[slot + 2 * count + e][i] = f1
            force_out[slot + 3 * count + e][i] = f2

    return linear_tet_force


@cache
def energy_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], greatest strain and smallest Jacobian ratio [-] so far."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    tet_gradient = gradient_function(precision, finite)
    read_plastic_strain, _ = history_functions(precision)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, plastic_energy = functions.parameters, functions.plastic_energy
    k = kinematics(precision, finite)
    dilatation, deviator, volumetric_energy = k.dilatation, k.deviator, k.volumetric_energy

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False)
    def linear_tet_energy(
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
        _W, H, _c, volume, J = tet_gradient(X, conn, u, e)
        m = material[e]
        strain, _N, _d = deviator(H)
        eps_p = mat33()
        dissipated = R(0.0)
        if wp.static(plastic):  # noqa: SIM102 (the history of elastic blocks is empty)
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
                dissipated = volume * plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
        elastic = volumetric_energy(law[m, 0], dilatation(H)) + law[m, 1] * wp.ddot(strain - eps_p, strain - eps_p)
        square = wp.max(wp.ddot(strain, strain), extreme[STRAIN_SQUARE, e])
        energy_out[0, first + e] = volume * elastic
        energy_out[1, first + e] = dissipated
        energy_out[2, first + e] = wp.sqrt(R(2.0) / R(3.0) * square)
        energy_out[3, first + e] = wp.min(J, R(1.0) - extreme[VOLUME_LOSS, e])
        energy_out[4, first + e] = R(0.0)

    return linear_tet_energy


@cache
def stress_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: stress [Pa] and plastic strain [-] of some elements, in the world frame, once for each corner."""
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    tet_gradient = gradient_function(precision, finite)
    read_plastic_strain, _ = history_functions(precision)
    plastic, write_stress = bool(law_name), stress_function(precision)
    k = kinematics(precision, finite)
    dilatation, deviator, pressure_of, cauchy = k.dilatation, k.deviator, k.pressure, k.cauchy

    @wp.kernel(enable_backward=False, module="unique")
    def linear_tet_stress(
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
        W, H, _c, _volume, _J = tet_gradient(X, conn, u, e)
        m = material[e]
        eps_p = mat33()
        p = R(0.0)
        if wp.static(plastic):  # noqa: SIM102 (the history of elastic blocks is empty)
            if yielded[e] != 0:
                eps_p, p = read_plastic_strain(history, 0, e)
        strain, N, d = deviator(H)
        pressure = pressure_of(law[m, 0], dilatation(H))
        Q = wp.identity(n=3, dtype=R) + W
        sigma = Q * cauchy(H, R(2.0) * law[m, 1] * (strain - eps_p), N, d, pressure) * wp.transpose(Q)
        for a in range(4):
            write_stress(stress_out, first + 4 * item + a, sigma, p)

    return linear_tet_stress
