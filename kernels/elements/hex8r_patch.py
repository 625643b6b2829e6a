"""Owns what a thread of a GPU does with its `hex8r` element of a patch, at small strain."""

from functools import cache, partial

import warp as wp

from warp_mca.kernels.elements.hex8r import stress_function
from warp_mca.kernels.elements.patch_element import pattern_load_functions, sum_functions
from warp_mca.kernels.elements.patch_kernel import PatchElement, patch_force_kernel
from warp_mca.kernels.elements.patterns import corner_force_function, pattern_strain_function
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def element(precision: str, law_name: str, viscous: int = 0, ahead: bool = False) -> PatchElement:
    """Stress, bulk viscosity, plastic flow and forces."""
    t = scalars(precision)
    R, mat73 = t.real, t.mat73
    load_patterns, load_displacement_patterns = pattern_load_functions(precision)
    _, keep_forces, *_ = sum_functions(precision)
    _, keep_volume, _ = keep_functions(R)
    shape_and_strain, corner_forces = pattern_strain_function(precision, False), corner_force_function(precision)
    stress_and_flow = stress_function(precision, law_name, False, viscous, ahead)

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
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        _listed: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=R),
    ):
        b, volume, W, H, J, q = shape_and_strain(x, du)
        P, Q = stress_and_flow(x, volume, H, q, e, m, law, dt, yielded_out, history_out, extreme_out)
        keep_forces(force_out, lane, corner_forces(x, b, volume, W, P, Q))
        keep_volume(e, R(1.0) - J, extreme_out)

    return PatchElement("hex8r", load_patterns, load_displacement_patterns, compute_element)


force_kernel = partial(patch_force_kernel, element)
