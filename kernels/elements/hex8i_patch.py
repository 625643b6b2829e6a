"""Owns what a thread of a GPU does with its `hex8i` element of a patch, at small strain."""

from functools import cache, partial
from types import SimpleNamespace
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8i_lanes import flow_function
from warp_mca.kernels.elements.hex8i_small import elastic_function
from warp_mca.kernels.elements.internal_modes import mode_functions
from warp_mca.kernels.elements.patch_element import pattern_load_functions, sum_functions
from warp_mca.kernels.elements.patch_kernel import PatchElement, list_element, patch_force_kernel
from warp_mca.kernels.elements.patterns import balance_function, corner_force_function, pattern_strain_function
from warp_mca.kernels.elements.viscosity import viscosity_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import ROW
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def keep_function(precision: str) -> Any:
    """The function (H, q, W, lane, force_out) that keeps what lanes need of an element in the place of its forces.

    Twelve rows of amplitudes, six of H + H^T, and two rows of W = Q - I, of which the third follows.
    """
    t = scalars(precision)
    R, mat33, mat43 = t.real, t.mat33, t.mat43
    doubled_gradient = mode_functions(precision).doubled_gradient

    @wp.func
    def keep(H: mat33, q: mat43, W: mat33, lane: int, force_out: wp.array(dtype=R)):
        D = doubled_gradient(H)
        for i in range(12):
            force_out[i * wp.static(ROW) + lane] = q[i // 3, i % 3]
        for i in range(6):
            force_out[(12 + i) * wp.static(ROW) + lane] = D[i]
            force_out[(18 + i) * wp.static(ROW) + lane] = W[i // 3, i % 3]

    return keep


@cache
def element(points: int, precision: str, law_name: str, viscous: int = 0, ahead: bool = False) -> PatchElement:
    """A thread's element as if elastic, and listed if it yields: lanes then add the viscous pressure that is kept."""
    t = scalars(precision)
    R, mat73 = t.real, t.mat73
    plastic, flow = bool(law_name), flow_function(points, precision, law_name, viscous)
    load_patterns, load_displacement_patterns = pattern_load_functions(precision)
    shape_and_strain, corner_forces = pattern_strain_function(precision, False), corner_force_function(precision)
    balanced = balance_function(precision)
    frame, elastic_stress = mode_functions(precision).frame, elastic_function(precision, points)
    keep, viscous_pressure = keep_function(precision), viscosity_function(precision, False, viscous or 1, ahead)
    _, keep_forces, *_ = sum_functions(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)

    @wp.func
    def prepare(
        x: mat73, du: mat73, e: int, lane: int, dt: R, extreme_out: wp.array2d(dtype=R), force_out: wp.array(dtype=R)
    ):
        _b, volume, W, H, J, q = shape_and_strain(x, du)
        keep_volume(e, R(1.0) - J, extreme_out)
        if wp.static(viscous):
            viscous_pressure(e, wp.trace(H), volume, dt, True, extreme_out)
        keep(H, q, W, lane, force_out)

    @wp.func
    def compute_element(
        x: mat73,
        du: mat73,
        e: int,
        m: int,
        lane: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        _history: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        listed_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=R),
    ):
        b, volume, W, H, J, q = shape_and_strain(x, du)
        keep_volume(e, R(1.0) - J, extreme_out)
        if wp.static(viscous):
            pressure = viscous_pressure(e, wp.trace(H), volume, dt, True, extreme_out)
        flows = bool(False)
        if wp.static(plastic):
            flows = yielded_out[e] != 0
        if not flows:
            G = law[m, 1]
            P, Q, largest = elastic_stress(x, volume, H, q, frame(x), law[m, 0], G)
            if wp.static(viscous):
                for i in range(3):
                    P[i, i] += pressure
            keep_forces(force_out, lane, corner_forces(x, b, volume, W, balanced(P, H, q, Q, volume), Q))
            keep_strain(e, strain_square(largest, G), extreme_out)
            if wp.static(plastic):
                if R(3.0) * largest > law[m, 2] * law[m, 2]:
                    flows = bool(True)
                    yielded_out[e] = 1
        if wp.static(plastic):
            if flows:
                list_element(lane, listed_out)
                keep(H, q, W, lane, force_out)

    return PatchElement("hex8i", load_patterns, load_displacement_patterns, compute_element, prepare, flow, lanes=2)


@cache  # makers keep kernels by what they are called with: these parts of them are the same each time
def kernels(points: int) -> SimpleNamespace:
    """What `PatchStage` asks of a module of kernels, for elements of so many points."""
    maker = partial(element, points)
    return SimpleNamespace(element=maker, force_kernel=partial(patch_force_kernel, maker))
