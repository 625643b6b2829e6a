"""Owns the force kernel of `hex8r` on a GPU, at small strain: one thread for each element of a patch."""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8r import stress_function
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
from warp_mca.kernels.elements.patch_element import load_functions, load_pattern_function, material_of, sum_functions
from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.elements.patterns import corner_force_function, pattern_functions, pattern_strain_function
from warp_mca.kernels.hardware.early_launch import begins_early
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import (
    FORCES,
    HEADS,
    barrier,
    head_ring,
    shared_functions,
    slot_pools,
    wait_for_copies,
)
from warp_mca.kernels.records.extremes import keep_functions

wp.set_module_options({"enable_backward": False})


@cache
def force_kernel(precision: str, law_name: str) -> Any:
    """Kernel: the forces of each patch on its nodes and, where there is a law, the plastic history."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, places_pool = slot_pools(precision)
    point, slots = POINT[precision], SLOTS[precision]
    begin_turns, copy_nodes, copy_ahead, _ = copy_functions(precision)
    load_patterns = load_pattern_function(precision)
    _, load_displacements, _ = load_functions(precision)
    clear_nowhere, keep_forces, sum_patch, _ = sum_functions(precision)
    to_patterns, _ = pattern_functions(precision)
    _, keep_volume, _ = keep_functions(R)
    shape_and_strain, corner_forces = pattern_strain_function(precision, False), corner_force_function(precision)
    stress_and_flow = stress_function(precision, law_name, False)

    @wp.kernel(
        enable_backward=False,
        module="unique",
        grid_stride=False,
        launch_bounds=(PATCH, RESIDENT[precision]),
        module_options={"fast_math": True},
    )
    def hex8r_patch_force(
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
        force_out: wp.array(dtype=vec3),
    ):
        lane = wp.tid() & wp.static(PATCH - 1)
        block = wp.tid() // wp.static(PATCH)
        forces = wp.array(ptr=force_pool(), shape=(FORCES,), dtype=R)
        kept_points = wp.array(ptr=point_pool(), shape=(2 * slots,), dtype=point)
        pool = wp.array(ptr=vector_pool(), shape=(2 * slots,), dtype=wp.vec3d)
        places = wp.array(ptr=places_pool(), shape=(slots,), dtype=wp.vec2i)
        ring = wp.array(ptr=head_ring(), shape=(HEADS,), dtype=wp.vec4i)
        clear_nowhere(forces, lane)
        head, corners = begin_turns(points, X, u, patches, block, stride, lane, ring, kept_points, pool)
        k = int(0)
        while element_count(head) > 0:
            e = from_start(head[0] + lane)
            m = material_of(corners[0], corners[1])
            first = (k & 1) * wp.static(slots)
            x = load_patterns(kept_points, pool, corners, first, exponent_of(head))
            du = to_patterns(load_displacements(pool, corners, first))
            next_head = ring[(k + 1) % wp.static(HEADS)]
            wait_for_copies()
            copy_places(patches, head, lane, places)
            barrier()
            copy_nodes(X, u, kept_points, next_head, lane, wp.static(slots) - first, pool)
            if lane < element_count(head):
                b, volume, W, H, J, q = shape_and_strain(x, du)
                P, Q = stress_and_flow(x, volume, H, q, e, m, law, R(0.0), yielded_out, history_out, extreme_out)
                keep_forces(forces, lane, corner_forces(x, b, volume, W, P, Q))
                keep_volume(e, R(1.0) - J, extreme_out)
            corners = corners_of(patches, next_head, lane)
            wait_for_copies()
            barrier()
            copy_ahead(points, patches, block, stride, k, lane, first, ring, kept_points)
            sum_patch(forces, places, head, lane, slot, force_out)
            head = next_head
            k += 1

    return begins_early(hex8r_patch_force)
