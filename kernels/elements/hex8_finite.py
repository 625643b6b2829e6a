"""Owns the forces of `hex8` at finite strain."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hexahedron import (
    edge_functions,
    framed_function,
    gauss_line_function,
    gradient_function,
    history_place,
    lines_of_point,
    node_force_function,
    store_function,
)
from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.elements.point_records import history_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def pressure_function(precision: str, finite: bool) -> Any:
    """The function that gives the one pressure of an element [Pa], from its mean dilatation."""
    t = scalars(precision)
    R, mat43 = t.real, t.mat43
    point_gradient, k = gradient_function(precision), kinematics(precision, finite)
    dilatation_of, pressure_of = k.dilatation, k.pressure

    @wp.func
    def element_pressure(gx: mat43, gy: mat43, gz: mat43, lx: mat43, ly: mat43, lz: mat43, K: R):
        volume = R(0.0)
        dilatation = R(0.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilatation += dilatation_of(grad) * det
        return pressure_of(K, dilatation / volume)

    return element_pressure


@cache
def finite_force_kernel(precision: str, law_name: str) -> Any:
    """The force kernel at finite strain: volumes first, because the pressure's direction varies within an element."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    _, to_gauss = edge_functions(precision)
    gauss_lines = gauss_line_function(precision, scaled=True)
    load_in_frame = framed_function(precision, True)
    edge_to_node = node_force_function(precision)
    store_force = store_function(precision)
    keep_strain, keep_volume, _ = keep_functions(R)
    point_gradient = gradient_function(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision, points=8)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    k = kinematics(precision, True)
    deviator, nominal, element_pressure = k.deviator, k.nominal, pressure_function(precision, True)

    @wp.kernel(enable_backward=False, module="unique")
    def hex8_finite_force(
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
        Xl, ul, W, J = load_in_frame(X, u, conn, e)
        gx, gy, gz = gauss_lines(Xl)
        lx, ly, lz = gauss_lines(ul)
        m = material[e]
        G = law[m, 1]
        pressure = element_pressure(gx, gy, gz, lx, ly, lz, law[m, 0])
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flag_new = flag
        largest = R(0.0)
        Sx = mat43()
        Sy = mat43()
        Sz = mat43()
        for g in range(8):
            jx, jy, jz = lines_of_point(g)
            _det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            strain, N, d = deviator(grad)
            largest = wp.max(largest, wp.ddot(strain, strain))
            S = (R(2.0) * G) * strain
            if wp.static(plastic):
                eps_p = mat33()
                p = R(0.0)
                if flag != 0:
                    eps_p, p = read_plastic_strain(history_out, history_place(g), e)
                S, eps_new, p_new = return_map(S, eps_p, p, G, read_parameters(law, m, R(1.0)))
                if p_new > p:
                    write_plastic_strain(history_out, history_place(g), e, eps_new, p_new)
                    flag_new = int(1)
            P = nominal(grad, S, N, d, pressure)
            Sx[jx] = Sx[jx] + P * wp.cross(gy[jy], gz[jz])
            Sy[jy] = Sy[jy] + P * wp.cross(gz[jz], gx[jx])
            Sz[jz] = Sz[jz] + P * wp.cross(gx[jx], gy[jy])
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        keep_strain(e, largest, extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        half = R(0.5)
        f = edge_to_node(to_gauss(half * Sx), to_gauss(half * Sy), to_gauss(half * Sz), W)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_finite_force
