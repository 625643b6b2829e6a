"""Owns the force kernel of `hex8` on a GPU, at small strain: one thread for each element, four where it yields.

Elements that have not yielded need neither history nor registers for it: a thread computes one as if it were elastic.
Elements that have, or that begin to yield now, are listed; then `hex8_lanes` computes them, four lanes for each.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8_lanes import flow_functions
from warp_mca.kernels.elements.hex8_small import small_strain_function
from warp_mca.kernels.elements.hexahedron import LINE_SCALE, frame_functions
from warp_mca.kernels.elements.patch import (
    POINT,
    RESIDENT,
    Patches,
    copy_functions,
    copy_places,
    corners_of,
    element_count,
    exponent_of,
    from_start,
)
from warp_mca.kernels.elements.patch_element import load_functions, material_of, sum_functions
from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.hardware.early_launch import begins_early
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import (
    FORCES,
    HEADS,
    barrier,
    head_ring,
    list_pool,
    shared_functions,
    slot_pools,
    wait_for_copies,
)
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def element_functions(precision: str, law_name: str) -> tuple[Any, Any]:
    """Two functions: compute a thread's element as if elastic, and list it if it yields; the first part alone."""
    t = scalars(precision)
    R, mat33, mat83 = t.real, t.mat33, t.mat83
    plastic, (list_element, *_) = bool(law_name), flow_functions(precision, law_name)
    element_rotation, local_displacement = frame_functions(precision)
    element_forces = small_strain_function(precision, "")
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
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Whether the element begins to yield; if so, its forces are not valid."""
        G = R(scale) * law[m, 1]
        local = local_displacement(Xl, ul, W)
        f, largest = element_forces(Xl, local, W, R(scale) * law[m, 0], G, e, m, law, yielded_out, history_out)
        keep_forces(force_out, lane, f)
        keep_strain(e, strain_square(largest, G), extreme_out)
        yields = bool(False)
        if wp.static(plastic):
            if R(3.0) * largest > R(scale) * R(scale) * law[m, 2] * law[m, 2]:
                yields = bool(True)
                yielded_out[e] = 1
        return yields

    @wp.func
    def compute_element(
        Xl: mat83,
        ul: mat83,
        e: int,
        m: int,
        lane: int,
        law: wp.array2d(dtype=R),
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
            flows = elastic_element(Xl, ul, W, e, m, lane, law, yielded_out, history_out, extreme_out, force_out)
        if wp.static(plastic):
            if flows:
                list_element(W, lane, listed_out, force_out)

    return compute_element, elastic_element


@cache
def force_kernel(precision: str, law_name: str) -> Any:
    """Kernel: the forces of each patch on its nodes and, where there is a law, the plastic history.

    flowing_out has the number of elements of each patch that took the return map, shape (patch_count,).
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, places_pool = slot_pools(precision)
    point, slots = POINT[precision], SLOTS[precision]
    plastic = bool(law_name)
    # otherwise lanes of yielding elements still need the nodes of this patch in the place of the next ones
    early = precision == "mixed" or not plastic
    begin_turns, copy_nodes, copy_ahead, _ = copy_functions(precision)
    load_points, load_displacements, _ = load_functions(precision)
    clear_nowhere, _, sum_patch, _ = sum_functions(precision)
    compute_element, _ = element_functions(precision, law_name)
    _, flow_listed, _ = flow_functions(precision, law_name)

    # in float32, a few registers spilled cost less than a quarter of the threads
    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=(PATCH, RESIDENT[precision]),
        module_options={"fast_math": True},
    )
    def hex8_patch_force(
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        patches: Patches,
        law: wp.array2d(dtype=R),
        u: wp.array(dtype=wp.vec3d),
        slot: int,
        stride: int,
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        flowing_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=vec3),
    ):
        lane = wp.tid() & wp.static(PATCH - 1)
        block = wp.tid() // wp.static(PATCH)
        forces = wp.array(ptr=force_pool(), shape=(FORCES,), dtype=R)
        listed = wp.array(ptr=list_pool(), shape=(PATCH + 1,), dtype=wp.int32)
        kept_points = wp.array(ptr=point_pool(), shape=(2 * slots,), dtype=point)
        pool = wp.array(ptr=vector_pool(), shape=(2 * slots,), dtype=wp.vec3d)
        places = wp.array(ptr=places_pool(), shape=(slots,), dtype=wp.vec2i)
        ring = wp.array(ptr=head_ring(), shape=(HEADS,), dtype=wp.vec4i)
        clear_nowhere(forces, lane)
        if wp.static(plastic):
            if lane == 0:
                listed[0] = 0
        head, corners = begin_turns(points, X, u, patches, block, stride, lane, ring, kept_points, pool)
        k = int(0)
        while element_count(head) > 0:
            e = from_start(head[0] + lane)
            m = material_of(corners[0], corners[1])
            first = (k & 1) * wp.static(slots)
            Xl = load_points(kept_points, pool, corners, first, exponent_of(head))
            ul = load_displacements(pool, corners, first)
            next_head = ring[(k + 1) % wp.static(HEADS)]
            wait_for_copies()
            copy_places(patches, head, lane, places)
            barrier()
            if wp.static(early):
                copy_nodes(X, u, kept_points, next_head, lane, wp.static(slots) - first, pool)
            if lane < element_count(head):
                compute_element(Xl, ul, e, m, lane, law, yielded_out, history_out, extreme_out, listed, forces)
            wait_for_copies()
            barrier()
            if wp.static(plastic):
                if lane == 0:
                    flowing_out[head[3]] = listed[0]
                flow_listed(
                    kept_points, pool, first, head, lane, patches, law, listed, history_out, extreme_out, forces
                )
            if wp.static(not early):
                copy_nodes(X, u, kept_points, next_head, lane, wp.static(slots) - first, pool)
            corners = corners_of(patches, next_head, lane)
            copy_ahead(points, patches, block, stride, k, lane, first, ring, kept_points)
            sum_patch(forces, places, head, lane, slot, force_out)
            if wp.static(not early):
                wait_for_copies()
                barrier()
            head = next_head
            k += 1

    return begins_early(hex8_patch_force)
