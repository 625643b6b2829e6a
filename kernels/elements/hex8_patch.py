"""Owns the force kernel of `hex8` on a GPU, at small strain: one thread for each element, four where it yields.

Elements that have not yielded need neither history nor registers for it: a thread computes one as if it were elastic.
Elements that have, or that begin to yield now, are listed; then `hex8_lanes` computes them, four lanes for each.
"""

from functools import cache, partial

import warp as wp

from warp_mca.kernels.elements.hex8_lanes import flow_function
from warp_mca.kernels.elements.hex8_small import elastic_function, small_strain_function
from warp_mca.kernels.elements.hexahedron import LINE_SCALE, frame_functions
from warp_mca.kernels.elements.patch_element import load_functions, sum_functions
from warp_mca.kernels.elements.patch_kernel import PatchElement, list_element, patch_force_kernel
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import ROW, wait_for_copies
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def element(precision: str, law_name: str, viscous: int = 0, ahead: bool = False) -> PatchElement:
    """A thread's element as if elastic, and listed if it yields: lanes then compute its bulk viscosity, too."""
    t = scalars(precision)
    R, mat33, mat83 = t.real, t.mat33, t.mat83
    plastic, flow = bool(law_name), flow_function(precision, law_name, viscous)
    load_points, load_displacements, _ = load_functions(precision)
    element_rotation, local_displacement = frame_functions(precision)
    element_forces = small_strain_function(precision, "", viscous, ahead, listed=plastic)
    is_elastic = elastic_function(precision, plastic)
    _, keep_forces, *_ = sum_functions(precision)
    keep_strain, keep_volume, strain_square = keep_functions(R)
    scale = LINE_SCALE**3

    @wp.func
    def elastic_element(
        Xl: mat83,
        ul: mat83,
        W: mat33,
        e: int,
        m: int,
        lane: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Whether the element begins to yield; if so, its forces are not valid."""
        G = R(scale) * law[m, 1]
        local = local_displacement(Xl, ul, W)
        K = R(scale) * law[m, 0]
        f, largest = element_forces(Xl, local, W, K, G, e, m, law, dt, yielded_out, history_out, extreme_out)
        keep_forces(force_out, lane, f)
        keep_strain(e, strain_square(largest, G), extreme_out)
        yields = bool(False)
        if wp.static(plastic):
            yields = not is_elastic(largest, m, law)
            if yields:
                yielded_out[e] = 1
        return yields

    @wp.func
    def keep_rotation(W: mat33, lane: int, force_out: wp.array(dtype=R)):
        """In the place of the element's forces."""
        for i in range(9):
            force_out[i * wp.static(ROW) + lane] = W[i // 3, i % 3]

    @wp.func
    def prepare(
        Xl: mat83, ul: mat83, e: int, lane: int, _dt: R, extreme_out: wp.array2d(dtype=R), force_out: wp.array(dtype=R)
    ):
        W, J = element_rotation(Xl, ul)
        keep_volume(e, R(1.0) - J, extreme_out)
        keep_rotation(W, lane, force_out)

    @wp.func
    def compute_element(
        Xl: mat83,
        ul: mat83,
        e: int,
        m: int,
        lane: int,
        law: wp.array2d(dtype=R),
        dt: R,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        listed_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=R),
    ):
        W, J = element_rotation(Xl, ul)
        keep_volume(e, R(1.0) - J, extreme_out)
        flows = bool(False)
        if wp.static(plastic):
            flows = yielded_out[e] != 0
        if not flows:
            flows = elastic_element(Xl, ul, W, e, m, lane, law, dt, yielded_out, history_out, extreme_out, force_out)
        if wp.static(plastic):
            if flows:
                list_element(lane, listed_out)
                if wp.static(ahead):
                    wait_for_copies()  # which go to the place of the rotation
                keep_rotation(W, lane, force_out)

    return PatchElement("hex8", load_points, load_displacements, compute_element, prepare, flow, lanes=4)


force_kernel = partial(patch_force_kernel, element)
