"""Owns the blocks of threads that compute one patch of elements in every step.

What says where its points lie stays in shared memory from step to step.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8_lanes import flow_functions
from warp_mca.kernels.elements.hex8_patch import element_function
from warp_mca.kernels.elements.patch import (
    POINT,
    Patches,
    copy_functions,
    copy_places,
    corners_of,
    element_count,
    exponent_of,
    from_start,
)
from warp_mca.kernels.elements.patch_element import load_functions, material_of, sum_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import (
    FORCES as POOL,
)
from warp_mca.kernels.hardware.shared_memory import (
    barrier,
    list_pool,
    shared_functions,
    slot_pools,
    wait_for_copies,
)
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.model.patches import PATCH, SLOTS

wp.set_module_options({"enable_backward": False})


@cache
def patch_role(precision: str, law_name: str) -> Any:
    """The function that computes the forces of a patch of `hex8` in each of some steps."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, places_pool = slot_pools(precision)
    point, slots, plastic = POINT[precision], SLOTS[precision], bool(law_name)
    copy_points, copy_nodes = copy_functions(precision)[3], copy_functions(precision)[1]
    load_points, load_displacements, _ = load_functions(precision)
    clear_nowhere, _, sum_patch = sum_functions(precision)
    compute_element, (_, flow_listed) = element_function(precision, law_name), flow_functions(precision, law_name)

    @wp.func
    def compute_patch(
        block: int,
        lane: int,
        steps: int,
        movers: int,
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        patches: Patches,
        law: wp.array2d(dtype=R),
        slot: int,
        u: wp.array(dtype=wp.vec3d),
        count_out: wp.array(dtype=wp.int32),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        flowing_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=vec3),
    ):
        """`movers`: blocks of threads that move nodes."""
        forces = wp.array(ptr=force_pool(), shape=(POOL,), dtype=R)
        listed = wp.array(ptr=list_pool(), shape=(PATCH + 1,), dtype=wp.int32)
        kept_points = wp.array(ptr=point_pool(), shape=(2 * slots,), dtype=point)
        pool = wp.array(ptr=vector_pool(), shape=(2 * slots,), dtype=wp.vec3d)
        places = wp.array(ptr=places_pool(), shape=(slots,), dtype=wp.vec2i)
        clear_nowhere(forces, lane)
        if lane == 0:
            listed[0] = 0
        head = patches.turn[block]
        corners = corners_of(patches, head, lane)
        copy_points(points, head, lane, 0, kept_points)
        copy_places(patches, head, lane, places)
        wait_for_copies()
        barrier()
        e = from_start(head[0] + lane)
        m = material_of(corners[0], corners[1])
        for n in range(steps):
            if n > 0:
                wait_for(wp.static(NODES), n * movers, count_out)
            copy_nodes(X, u, kept_points, head, lane, 0, pool)
            wait_for_copies()
            barrier()
            if lane < element_count(head):
                Xl = load_points(kept_points, pool, corners, 0, exponent_of(head))
                ul = load_displacements(pool, corners, 0)
                compute_element(Xl, ul, e, m, lane, law, yielded_out, history_out, extreme_out, listed, forces)
            barrier()
            if wp.static(plastic):
                if lane == 0:
                    flowing_out[head[3]] = listed[0]
                flow_listed(kept_points, pool, 0, head, lane, patches, law, listed, history_out, extreme_out, forces)
            sum_patch(forces, places, head, lane, slot, force_out)
            arrive(wp.static(FORCES), count_out)

    return compute_patch
