"""Owns the fully integrated hexahedron: 2 x 2 x 2 points, mean dilatation, total form in the element's rotated frame.

The element's rotation Q is taken out first; strain is measured in the rotated frame from reference coordinates, so
that nothing drifts however many steps are run.
Mean dilatation: Hughes, Int. J. Numer. Meth. Engng 15 (1980) 1413; at finite strain Simo, Taylor and Pister, Comput.
Meth. Appl. Mech. Engng 51 (1985) 177.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8_finite import finite_force_kernel, pressure_function
from warp_mca.kernels.elements.hex8_small import small_strain_function
from warp_mca.kernels.elements.hexahedron import (
    LINE_SCALE,
    framed_function,
    gauss_line_function,
    gradient_function,
    history_place,
    store_function,
)
from warp_mca.kernels.elements.kinematics import kinematics
from warp_mca.kernels.elements.point_records import history_functions, stress_function
from warp_mca.kernels.hardware.scalars import scalars
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
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    load_in_frame = framed_function(precision)
    element_forces = small_strain_function(precision, law_name)
    store_force = store_function(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    scale = LINE_SCALE**3

    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": True})
    def hex8_force(
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
        m = material[e]
        K = R(scale) * law[m, 0]
        G = R(scale) * law[m, 1]
        f, largest = element_forces(Xl, ul, W, K, G, e, m, law, yielded_out, history_out)
        keep_strain(e, strain_square(largest, G), extreme_out)
        keep_volume(e, R(1.0) - J, extreme_out)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8_force


@cache
def energy_kernel(precision: str, law_name: str, finite: bool = False) -> Any:
    """Kernel: elastic, plastic and hourglass energy [J], greatest strain and smallest Jacobian ratio [-] so far.

    The points' own Jacobians are those of this step; of the steps between, the force kernels keep that of the centre.
    """
    k = kinematics(precision, finite)
    dilatation_of, deviator, volumetric_energy = k.dilatation, k.deviator, k.volumetric_energy
    t = scalars(precision)
    R, mat33 = t.real, t.mat33
    gauss_lines = gauss_line_function(precision, scaled=True)
    load_in_frame = framed_function(precision, finite)
    point_gradient = gradient_function(precision)
    read_plastic_strain, _ = history_functions(precision, points=8)
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
        Xl, ul, W, _J = load_in_frame(X, u, conn, e)
        gx, gy, gz = gauss_lines(Xl)
        lx, ly, lz = gauss_lines(ul)
        m = material[e]
        identity = wp.identity(n=3, dtype=R)
        volume = R(0.0)
        dilatation = R(0.0)
        elastic = R(0.0)
        dissipated = R(0.0)
        largest = extreme[STRAIN_SQUARE, e]
        smallest = R(1.0)
        for g in range(8):
            det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            volume += det
            dilatation += dilatation_of(grad) * det
            strain, _N, _d = deviator(grad)
            largest = wp.max(largest, wp.ddot(strain, strain))
            eps_p = mat33()
            if wp.static(plastic):
                if yielded[e] != 0:
                    eps_p, p = read_plastic_strain(history, history_place(g), e)
                    dissipated += det * plastic_energy(eps_p, p, read_parameters(law, m, R(1.0)))
            elastic += det * law[m, 1] * wp.ddot(strain - eps_p, strain - eps_p)
            smallest = wp.min(smallest, wp.determinant(identity + grad))
        energy_out[0, first + e] = elastic + volume * volumetric_energy(law[m, 0], dilatation / volume)
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
    gauss_lines = gauss_line_function(precision, scaled=True)
    load_in_frame = framed_function(precision, finite)
    point_gradient = gradient_function(precision)
    read_plastic_strain, _ = history_functions(precision, points=8)
    plastic = bool(law_name)
    write_stress = stress_function(precision)
    k = kinematics(precision, finite)
    deviator, cauchy, element_pressure = k.deviator, k.cauchy, pressure_function(precision, finite)

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
        Xl, ul, W, _J = load_in_frame(X, u, conn, e)
        gx, gy, gz = gauss_lines(Xl)
        lx, ly, lz = gauss_lines(ul)
        m = material[e]
        identity = wp.identity(n=3, dtype=R)
        Q = identity + W
        pressure = element_pressure(gx, gy, gz, lx, ly, lz, law[m, 0])
        for g in range(8):
            _det, grad = point_gradient(gx, gy, gz, lx, ly, lz, g)
            eps_p = mat33()
            p = R(0.0)
            if wp.static(plastic):
                if yielded[e] != 0:
                    eps_p, p = read_plastic_strain(history, history_place(g), e)
            strain, N, d = deviator(grad)
            local = cauchy(grad, R(2.0) * law[m, 1] * (strain - eps_p), N, d, pressure)
            corner = g ^ ((g >> 1) & 1)  # corners run around the faces
            write_stress(stress_out, first + 8 * item + corner, Q * local * wp.transpose(Q), p)

    return hex8_stress
