"""Owns the one-point hexahedron with assumed-strain hourglass stiffness.

Gradients are means over the element, so that it passes the patch test: Flanagan and Belytschko, Int. J. Numer. Meth.
Engng 17 (1981) 679. `hourglass` describes the stiffness of the hourglass modes; with it, bending is right with one
element over the height. Where the element yields, its hourglass strains flow with its plastic multiplier, as the points
of the full element would about their mean.
"""

from functools import cache, partial
from typing import Any

import warp as wp

from warp_mca.base.errors import bad_value
from warp_mca.kernels.elements.failure import failure_kernel as failure_of
from warp_mca.kernels.elements.formulation import OWN, Formulation
from warp_mca.kernels.elements.hexahedron import load_function, store_function
from warp_mca.kernels.elements.hourglass import AMPLITUDE_ROWS, KEPT, amplitude_functions, hourglass_function
from warp_mca.kernels.elements.patterns import (
    VOLUME_SCALE,
    amplitude_function,
    corner_force_function,
    mean_frame,
    mean_functions,
    pattern_functions,
    pattern_strain_function,
)
from warp_mca.kernels.elements.readings import energy_kernel as energy_of
from warp_mca.kernels.elements.readings import stress_kernel as stress_of
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.materials.isochoric import law_kinematics
from warp_mca.kernels.materials.laws import Law, law_functions
from warp_mca.kernels.materials.point import material_point
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})

__all__ = ["energy_kernel", "failure_kernel", "force_kernel", "kept", "stress_function", "stress_kernel"]


def kept(law: Law, finite: bool) -> tuple[str, ...]:
    """What an element keeps behind the history of its point."""
    return KEPT if law.history or law.general else ()


@cache
def stress_function(precision: str, law_name: str, finite: bool, viscous: int = 0, ahead: bool = False) -> Any:
    """The function that gives stress and hourglass forces of an element, with plastic flow; it keeps the strain.

    A larger function, or a matrix that changes within a branch, would prevent vectorisation on a CPU.

    Raises:
        RequestError: the law relaxes, which the hourglass stiffness does not.
    """
    if law_functions(law_name, precision).relaxes:
        remedy = "its hourglass stiffness does not relax as the material does; choose hex8i or hex8"
        raise bad_value("Body.element", "hex8r", remedy)
    t = scalars(precision)
    R, mat33, mat43, mat73 = t.real, t.mat33, t.mat43, t.mat73
    hourglass = hourglass_function(precision)
    point = material_point(precision, law_name, finite, points=1)
    plastic, general, update = bool(law_name), point.general, point.update
    read_amplitudes, write_amplitudes = amplitude_functions(precision, point.size)
    lost = point.size + AMPLITUDE_ROWS
    keep_strain, _, _ = keep_functions(R)
    viscous_pressure = viscosity_function(precision, finite, viscous, ahead)
    k = law_kinematics(precision, law_name, finite)
    dilatation_of, deviator, nominal, pressure_of = k.dilatation, k.deviator, k.nominal, k.pressure

    @wp.func
    def stress_and_flow(
        x: mat73,
        volume: R,
        H: mat33,
        q: mat43,
        e: int,
        m: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
    ):
        K = law[m, 0]
        G = law[m, 1]
        kept = R(1.0)
        strain, N, d = deviator(H)
        keep_strain(e, wp.ddot(strain, strain), extreme_out)
        theta = dilatation_of(H)
        flag = int(0)
        if wp.static(plastic):
            flag = yielded_out[e]
            q_p = mat43()
            if flag != 0:  # read before the point writes
                q_p = read_amplitudes(history_out, e)
                q = q - q_p
        S, pressure, dp = update(strain, theta, G, 0, e, m, flag, law, dt, history_out)
        if wp.static(plastic):
            if dp > R(0.0):
                # the flow rule at a point is linear in its stress: the part about the mean relaxes by 3 G dp / S_eq
                S_eq = wp.sqrt(R(1.5) * wp.ddot(S, S))
                kept = S_eq / (S_eq + R(3.0) * G * dp)
                write_amplitudes(history_out, e, q_p + (R(1.0) - kept) * q)
                if flag == 0:
                    yielded_out[e] = int(1)
        if wp.static(not general):
            pressure = pressure_of(K, theta)
        pressure = pressure + viscous_pressure(e, theta, volume, dt, True, extreme_out)
        P = nominal(H, S, N, d, pressure)
        Q, stored = hourglass(q, x, volume, K, G)
        if wp.static(plastic):
            if kept < R(1.0):
                row = wp.static(lost)
                # the balance of energy asks for relaxed force times plastic amplitude, as for the mean stress
                history_out[row, e] = history_out[row, e] + R(2.0) * kept * (R(1.0) - kept) * stored
            Q = kept * Q
        return P, Q

    return stress_and_flow


@cache
def force_kernel(precision: str, law_name: str, finite: bool = False, viscous: int = 0) -> Any:
    """Kernel: forces of each element on its nodes, and the plastic history where there is a law."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    load_element = load_function(precision)
    to_patterns, _ = pattern_functions(precision)
    shape_and_strain, corner_forces = pattern_strain_function(precision, finite), corner_force_function(precision)
    stress_and_flow = stress_function(precision, law_name, finite, viscous)
    store_force = store_function(precision)
    _, keep_volume, _ = keep_functions(R)

    # fast math would lose the digits of ln(1 + x) of small x
    @wp.kernel(enable_backward=False, module="unique", grid_stride=False, module_options={"fast_math": not finite})
    def hex8r_force(
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
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, volume, W, H, J, q = shape_and_strain(x, du)
        P, Q = stress_and_flow(x, volume, H, q, e, material[e], law, dt, yielded_out, history_out, extreme_out)
        f = corner_forces(x, b, volume, W, P, Q)
        keep_volume(e, R(1.0) - J, extreme_out)
        for a in range(8):
            store_force(force_out, slot + a * count + e, f, a)

    return hex8r_force


@cache
def formulation(precision: str, law_name: str, finite: bool) -> Formulation:
    """Its one point, whose stress all corners show, and its hourglass modes."""
    t = scalars(precision)
    R, mat33, mat43, mat73 = t.real, t.mat33, t.mat43, t.mat73
    to_patterns, _ = pattern_functions(precision)
    rotated = mean_frame(precision, finite)
    load_element = load_function(precision)
    mean_gradients, mean_gradient_of = mean_functions(precision)
    amplitudes, hourglass = amplitude_function(precision), hourglass_function(precision)
    first = law_functions(law_name, precision).size
    read_amplitudes, _ = amplitude_functions(precision, first)
    plastic, lost = bool(law_name), first + AMPLITUDE_ROWS

    @wp.struct
    class Hex8r:
        """Patterns x and du, mean gradient H_world, rotation W = Q - I, H in the rotated frame, volume [m^3]."""

        x: mat73
        du: mat73
        H_world: mat33
        H: mat33
        W: mat33
        volume: R

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        shape = Hex8r()
        x = to_patterns(load_element(X, conn, e))
        du = to_patterns(load_element(u, conn, e))
        b, scaled_volume = mean_gradients(x)
        H_world = mean_gradient_of(du, b, scaled_volume)
        W, H = rotated(H_world)
        shape.x = x
        shape.du = du
        shape.H_world = H_world
        shape.W = W
        shape.H = H
        shape.volume = R(VOLUME_SCALE) * scaled_volume
        return shape

    @wp.func
    def gradient(shape: Hex8r, g: int):
        return shape.volume, shape.H

    @wp.func
    def rotation(shape: Hex8r):
        return shape.W

    @wp.func
    def corner_of(g: int, j: int):
        return j

    @wp.func
    def modes(shape: Hex8r, K: R, G: R, flag: int, history: wp.array2d(dtype=R), e: int):
        q = amplitudes(shape.x, shape.du, shape.H_world, shape.W)
        dissipated = R(0.0)
        if wp.static(plastic):
            q_p = mat43()
            if flag != 0:
                q_p = read_amplitudes(history, e)
                dissipated = history[wp.static(lost), e]
            q = q - q_p
        _Q, stored = hourglass(q, shape.x, shape.volume, K, G)
        return stored, dissipated

    return Formulation("hex8r", 8, 1, OWN, Hex8r, load_shape, gradient, rotation, 8, corner_of, modes=modes)


energy_kernel, stress_kernel = partial(energy_of, formulation), partial(stress_of, formulation)
failure_kernel = partial(failure_of, formulation)
