"""Owns the fully integrated hexahedron: 2 x 2 x 2 points, mean dilatation, total form in the element's rotated frame.

The element's rotation Q is taken out first; strain is measured in the rotated frame from reference coordinates, so
that nothing drifts however many steps are run.
Mean dilatation: Hughes, Int. J. Numer. Meth. Engng 15 (1980) 1413; at finite strain Simo, Taylor and Pister, Comput.
Meth. Appl. Mech. Engng 51 (1985) 177.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.fused import NOTHING
from warp_mca.kernels.elements.hex8_elastic import elastic_function, stress_functions
from warp_mca.kernels.elements.hex8_finite import finite_force_kernel
from warp_mca.kernels.elements.hexahedron import (
    LINE_SCALE,
    edge_functions,
    frame_functions,
    gradient_function,
    history_functions,
    line_functions,
    load_function,
    node_force_function,
    store_function,
    stress_function,
)
from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.hardware.scalars import THIRD, scalars
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.kernels.records.extremes import STRAIN_SQUARE, VOLUME_LOSS, keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law.

    Every plastic element takes the return map, which suits a CPU that computes several elements side by side; a GPU
    runs `kernels.elements.hex8_patch`.
    """
    if finite:
        return finite_force_kernel(precision, law_name)
    if law_name:
        return _plastic_force_kernel(precision, law_name)
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    element_rotation, local_displacement = frame_functions(precision)
    load_element = load_function(precision)
    elastic_forces = elastic_function(precision)
    store_force = store_function(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    scale = LINE_SCALE**3

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": True})
    def hex8_elastic_force(
        X: wp.array(dtype=wp.vec3d),
        conn: wp.array2d(dtype=wp.int32),
        material: wp.array(dtype=wp.int32),
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        count: int,
        yielded: wp.array(dtype=wp.int32),
        history: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        e = wp.tid()
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W, J = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        m = material[e]
        G = R(scale) * law[m, 1]
        f, largest = elastic_forces(Xl, ul, W, R(scale) * law[m, 0], G)
        keep_strain(e, strain_square(largest, G), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_elastic_force


@cache
def _plastic_force_kernel(precision: str, law_name: str) -> Any:
    """The force kernel with a return map at each point."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    edges, to_lines = line_functions(precision)
    element_rotation, local_displacement = frame_functions(precision)
    edge_to_node = node_force_function(precision)
    load_element = load_function(precision)
    add_traction, symmetric_gradient, invariant = stress_functions(precision)
    store_force = store_function(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    read_plastic_strain, write_plastic_strain = history_functions(precision)
    functions = law_functions(law_name, precision)
    read_parameters, return_map = functions.parameters, functions.return_map
    scale = LINE_SCALE**3

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": True})
    def hex8_plastic_force(
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
        gx = to_lines(edges(Xl, 0))
        gy = to_lines(edges(Xl, 1))
        gz = to_lines(edges(Xl, 2))
        lx = to_lines(edges(ul, 0))
        ly = to_lines(edges(ul, 1))
        lz = to_lines(edges(ul, 2))
        m = material[e]
        # as in `elastic_function`
        K = R(scale) * law[m, 0]
        G = R(scale) * law[m, 1]
        parameters = read_parameters(law, m, R(scale))
        Sx = mat43()
        Sy = mat43()
        Sz = mat43()
        Bx = mat43(R(NOTHING))
        By = mat43(R(NOTHING))
        Bz = mat43(R(NOTHING))
        volume = R(NOTHING)
        dilation = R(NOTHING)
        largest = R(0.0)
        flag = yielded_out[e]
        flag_new = flag
        for g in range(8):
            i = g & 1
            j = (g >> 1) & 1
            k = g >> 2
            jx = j + 2 * k
            jy = i + 2 * k
            jz = i + 2 * j
            eps_p = mat33()
            p = R(0.0)
            if flag != 0:
                eps_p, p = read_plastic_strain(history_out, g, e)
            b0 = wp.cross(gy[jy], gz[jz])
            b1 = wp.cross(gz[jz], gx[jx])
            b2 = wp.cross(gx[jx], gy[jy])
            det = wp.dot(gx[jx], b0)
            xx, yy, zz, xy, yz, xz = symmetric_gradient(lx[jx], ly[jy], lz[jz], b0, b1, b2)
            trace = xx + yy + zz
            volume += det
            dilation += trace
            shear = G / det
            direct = shear + shear
            mean = R(THIRD) * trace
            xx = direct * (xx - mean)
            yy = direct * (yy - mean)
            zz = direct * (zz - mean)
            xy = shear * xy
            yz = shear * yz
            xz = shear * xz
            largest = wp.max(largest, invariant(xx, yy, xy, yz, xz))
            S = mat33(xx, xy, xz, xy, yy, yz, xz, yz, zz)
            S, eps_new, p_new = return_map(S, eps_p, p, G, parameters)
            if p_new > p:
                write_plastic_strain(history_out, g, e, eps_new, p_new)
                flag_new = int(1)
            Sx[jx] = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b0, Sx[jx])
            Sy[jy] = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b1, Sy[jy])
            Sz[jz] = add_traction(S[0, 0], S[1, 1], S[2, 2], S[0, 1], S[1, 2], S[0, 2], b2, Sz[jz])
            Bx[jx] = Bx[jx] + b0
            By[jy] = By[jy] + b1
            Bz[jz] = Bz[jz] + b2
        if flag_new != flag:
            yielded_out[e] = flag_new
        keep_strain(e, strain_square(largest, G), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        pressure = K * dilation / volume
        Fx = to_lines(Sx + pressure * Bx)
        Fy = to_lines(Sy + pressure * By)
        Fz = to_lines(Sz + pressure * Bz)
        f = edge_to_node(Fx, Fy, Fz, W)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_plastic_force


@cache
def energy_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], greatest strain and smallest Jacobian ratio [-] so far.

    The points' own Jacobians are those of this step; of the steps between, the force kernels keep that of the centre.
    """
    k = kinematics(precision, finite)
    dilation_of, deviator, volumetric_energy = k.dilation, k.deviator, k.volumetric_energy
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    half_edges, to_gauss = edge_functions(precision)
    element_rotation, local_displacement = frame_functions(precision, finite)
    load_element = load_function(precision)
    point_gradient = gradient_function(precision)
    read_plastic_strain, _ = history_functions(precision)
    plastic, functions = bool(law_name), law_functions(law_name, precision)
    read_parameters, plastic_energy = functions.parameters, functions.plastic_energy

    # logarithms need all their digits
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def hex8_energy(
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
        Xl = load_element(X, conn, e)
        ul = load_element(u, conn, e)
        W, _J = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        gx = to_gauss(half_edges(Xl, 0))
        gy = to_gauss(half_edges(Xl, 1))
        gz = to_gauss(half_edges(Xl, 2))
        lx = to_gauss(half_edges(ul, 0))
        ly = to_gauss(half_edges(ul, 1))
        lz = to_gauss(half_edges(ul, 2))
        m = material[e]
        identity = wp.identity(n=3, dtype=R)
        volume = R(0.0)
        dilation = R(0.0)
        elastic = R(0.0)
        dissipated = R(0.0)
        largest = extreme[STRAIN_SQUARE, e]
        smallest = R(1.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilation += dilation_of(grad) * det
            strain, _N, _d = deviator(grad)
            largest = wp.max(largest, wp.ddot(strain, strain))
            eps_p = mat33()
            if wp.static(plastic):
                if yielded[e] != 0:
                    eps_p, p = read_plastic_strain(history, g, e)
                    dissipated += det * plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
            elastic += det * law[m, 1] * wp.ddot(strain - eps_p, strain - eps_p)
            smallest = wp.min(smallest, wp.determinant(identity + grad))
        energy_out[0, first + e] = elastic + volume * volumetric_energy(law[m, 0], dilation / volume)
        energy_out[1, first + e] = dissipated
        energy_out[2, first + e] = wp.sqrt(R(2.0) / R(3.0) * largest)
        energy_out[4, first + e] = R(0.0)
        # an inverted element's Q is a reflection, which would hide the inversion in its own frame
        smallest = smallest * wp.determinant(identity + W)
        energy_out[3, first + e] = wp.min(smallest, R(1.0) - extreme[VOLUME_LOSS, e])

    return hex8_energy


@cache
def stress_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: stress [Pa] and plastic strain [-] at the integration points of some elements, in the world frame.

    A point's values go to the slot of the element's corner that lies nearest: rows xx, yy, zz, xy, yz, xz, p.
    """
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    half_edges, to_gauss = edge_functions(precision)
    element_rotation, local_displacement = frame_functions(precision, finite)
    load_element = load_function(precision)
    point_gradient = gradient_function(precision)
    read_plastic_strain, _ = history_functions(precision)
    plastic = bool(law_name)
    write_stress = stress_function(precision)
    k = kinematics(precision, finite)
    dilation_of, deviator, pressure_of, cauchy = k.dilation, k.deviator, k.pressure, k.cauchy

    @wp.kernel(enable_backward=False, module="unique")
    def hex8_stress(
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
        W, _J = element_rotation(Xl, ul)
        ul = local_displacement(Xl, ul, W)
        gx = to_gauss(half_edges(Xl, 0))
        gy = to_gauss(half_edges(Xl, 1))
        gz = to_gauss(half_edges(Xl, 2))
        lx = to_gauss(half_edges(ul, 0))
        ly = to_gauss(half_edges(ul, 1))
        lz = to_gauss(half_edges(ul, 2))
        m = material[e]
        identity = wp.identity(n=3, dtype=R)
        Q = identity + W
        volume = R(0.0)
        dilation = R(0.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilation += dilation_of(grad) * det
        pressure = pressure_of(law[m, 0], dilation / volume)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            eps_p = mat33()
            p = R(0.0)
            if wp.static(plastic):
                if yielded[e] != 0:
                    eps_p, p = read_plastic_strain(history, g, e)
            strain, N, d = deviator(grad)
            local = cauchy(grad, R(2.0) * law[m, 1] * (strain - eps_p), N, d, pressure)
            corner = g ^ ((g >> 1) & 1)  # corners run around the faces
            write_stress(stress_out, first + 8 * item + corner, Q * local * wp.transpose(Q), p)

    return hex8_stress
