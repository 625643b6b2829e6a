"""Owns the forces of `hex8` at finite strain, and of general laws at any: point by point, after the mean dilatation."""

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
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.kinematics import kinematics
from warp_mca.kernels.materials.point import material_point
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def shared_functions(precision: str, finite: bool) -> tuple[Any, Any]:
    """Functions of the Gauss lines of an element: its volume and mean dilatation; lines of forces of a pressure."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    point_gradient, k = gradient_function(precision), kinematics(precision, finite)
    dilatation_of, nominal = k.dilatation, k.nominal

    @wp.func
    def mean_dilatation(gx: mat43, gy: mat43, gz: mat43, lx: mat43, ly: mat43, lz: mat43):
        volume = R(0.0)
        dilatation = R(0.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilatation += dilatation_of(grad) * det
        return volume, dilatation / volume

    @wp.func
    def pressure_lines(gx: mat43, gy: mat43, gz: mat43, lx: mat43, ly: mat43, lz: mat43, pressure: R):
        Sx = mat43()
        Sy = mat43()
        Sz = mat43()
        for g in range(8):
            jx, jy, jz = lines_of_point(g)
            _det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            P = nominal(grad, mat33(), mat33(), vec3(), pressure)
            Sx[jx] = Sx[jx] + P * wp.cross(gy[jy], gz[jz])
            Sy[jy] = Sy[jy] + P * wp.cross(gz[jz], gx[jx])
            Sz[jz] = Sz[jz] + P * wp.cross(gx[jx], gy[jy])
        return Sx, Sy, Sz

    return mean_dilatation, pressure_lines


@cache
def points_force_kernel(precision: str, law_name: str, finite: bool, viscous: int) -> Any:
    """The force kernel: volumes first, because the pressure's direction varies within an element at finite strain.

    All points share the mean dilatation. The pressure of a law of flow follows from it; that of a general law is the
    mean over the points, which is conjugate to it, and known only behind them.
    """
    t = scalars(precision)
    R, vec3, mat43 = t.real, t.vec3, t.mat43
    _, to_gauss = edge_functions(precision)
    gauss_lines = gauss_line_function(precision, scaled=True)
    load_in_frame = framed_function(precision, finite)
    edge_to_node = node_force_function(precision)
    store_force = store_function(precision)
    keep_strain, keep_volume, _ = keep_functions(R)
    point_gradient = gradient_function(precision)
    point = material_point(precision, law_name, finite, points=8)
    plastic, general, update = bool(law_name), point.general, point.update
    k = law_kinematics(precision, law_name, finite)
    deviator, nominal, pressure_of = k.deviator, k.nominal, k.pressure
    mean_dilatation, pressure_lines = shared_functions(precision, finite)
    viscous_pressure = viscosity_function(precision, finite, viscous)

    @wp.kernel(enable_backward=False, module="unique")
    def hex8_points_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        dt: R,
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
        volume, theta = mean_dilatation(gx, gy, gz, lx, ly, lz)
        pressure = pressure_of(law[m, 0], theta)
        mean = R(0.0)
        if wp.static(general):
            pressure = R(0.0)
        pressure = pressure + viscous_pressure(e, theta, volume, dt, True, extreme_out)
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
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            strain, N, d = deviator(grad)
            largest = wp.max(largest, wp.ddot(strain, strain))
            S, own, dp = update(strain, theta, law[m, 1], history_place(g), e, m, flag, law, dt, history_out)
            if dp > R(0.0):
                flag_new = int(1)
            if wp.static(general):
                mean += own * det / volume
            P = nominal(grad, S, N, d, pressure)
            Sx[jx] = Sx[jx] + P * wp.cross(gy[jy], gz[jz])
            Sy[jy] = Sy[jy] + P * wp.cross(gz[jz], gx[jx])
            Sz[jz] = Sz[jz] + P * wp.cross(gx[jx], gy[jy])
        if wp.static(general):
            Bx, By, Bz = pressure_lines(gx, gy, gz, lx, ly, lz, mean)
            Sx = Sx + Bx
            Sy = Sy + By
            Sz = Sz + Bz
        if wp.static(plastic):
            if flag_new != flag:
                yielded_out[e] = flag_new
        keep_strain(e, largest, extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        f = edge_to_node(to_gauss(R(0.5) * Sx), to_gauss(R(0.5) * Sy), to_gauss(R(0.5) * Sz), W)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_points_force
