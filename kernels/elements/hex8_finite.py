"""Owns the forces of `hex8` at finite strain."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hexahedron import (
    edge_functions,
    frame_functions,
    gradient_function,
    history_functions,
    load_function,
    node_force_function,
    store_function,
)
from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def finite_force_kernel(precision: str, law_name: str) -> Any:
    """The force kernel at finite strain: volumes first, because the pressure's direction varies within an element."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    half_edges, to_gauss = edge_functions(precision)
    element_rotation, local_displacement = frame_functions(precision, True)
    edge_to_node = node_force_function(precision)
    load_element = load_function(precision)
    store_force = store_function(precision)
    keep_strain, keep_volume, _ = keep_functions(R)
    point_gradient = gradient_function(precision)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    k = kinematics(precision, True)
    dilation_of, deviator, nominal, pressure_of = k.dilation, k.deviator, k.nominal, k.pressure

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
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W, J = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        gx = to_gauss(half_edges(Xl, 0))
        gy = to_gauss(half_edges(Xl, 1))
        gz = to_gauss(half_edges(Xl, 2))
        lx = to_gauss(half_edges(ul, 0))
        ly = to_gauss(half_edges(ul, 1))
        lz = to_gauss(half_edges(ul, 2))
        m = material[e]
        G = law[m, 1]
        volume = R(0.0)
        dilation = R(0.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilation += dilation_of(grad) * det
        pressure = pressure_of(law[m, 0], dilation / volume)
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
        flag_new = flag
        largest = R(0.0)
        Sx = mat43()
        Sy = mat43()
        Sz = mat43()
        for g in range(8):
            i = g & 1
            j = (g >> 1) & 1
            k = g >> 2
            jx = j + 2 * k
            jy = i + 2 * k
            jz = i + 2 * j
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            strain, N, d = deviator(grad)
            largest = wp.max(largest, wp.ddot(strain, strain))
            S = (R(2.0) * G) * strain
            if wp.static(plastic):
                eps_p = mat33()
                p = R(0.0)
                if flag != 0:
                    eps_p, p = read_plastic_strain(history_out, g, e)
                S, eps_new, p_new = return_map(S, eps_p, p, G, read_parameters(law, m, R(1.0)))
                if p_new > p:
                    write_plastic_strain(history_out, g, e, eps_new, p_new)
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
