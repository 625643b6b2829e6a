"""Owns the blocks of threads that compute one patch of elements in every step.

What says where its points lie stays in shared memory from step to step. Elements that yielded before are computed by
threads of their own, beside the others.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.hex8_lanes import flow_functions
from warp_mca.kernels.elements.hex8_patch import element_functions
from warp_mca.kernels.elements.hexahedron import frame_functions
from warp_mca.kernels.elements.patch import (
    POINT,
    Patches,
    copy_functions,
    corners_of,
    element_count,
    exponent_of,
    from_start,
    slot_count,
)
from warp_mca.kernels.elements.patch_element import load_functions, material_of, sum_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import FORCES as POOL
from warp_mca.kernels.hardware.shared_memory import (
    barrier,
    copy_vector,
    list_pool,
    shared_functions,
    slot_pools,
    wait_for_copies,
)
from warp_mca.kernels.records.extremes import keep_functions
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.model.patches import PATCH, SLOTS

wp.set_module_options({"enable_backward": False})

THREADS = 4 * PATCH  # of a block: one for each slot of a patch; one for each element, the others for those that yield


@cache
def element_role(precision: str, law_name: str) -> Any:
    """The function that computes the elements of a patch by all threads of a block."""
    t = scalars(precision)
    R, mat33, point = t.real, t.mat33, POINT[precision]
    plastic = bool(law_name)
    load_points, load_displacements, _ = load_functions(precision)
    element_rotation, _ = frame_functions(precision)
    _, keep_volume, _ = keep_functions(R)
    _, elastic_element = element_functions(precision, law_name)
    list_element, _, flow_range = flow_functions(precision, law_name)

    @wp.func
    def compute_elements(
        lane: int,
        exists: bool,
        m: int,
        head: wp.vec4i,
        corners: wp.vec4ui,
        kept_points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        patches: Patches,
        law: wp.array2d(dtype=R),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        listed_out: wp.array(dtype=wp.int32),
        force_out: wp.array(dtype=R),
    ):
        """Number of elements that took the return map; forces as `hex8_patch` has them."""
        e = from_start(head[0] + lane)
        flows = bool(False)
        W = mat33()
        if exists:
            W, J = element_rotation(
                load_points(kept_points, pool, corners, 0, exponent_of(head)), load_displacements(pool, corners, 0)
            )
            keep_volume(e, R(1.0) - J, extreme_out)
            if wp.static(plastic):
                flows = yielded_out[e] != 0
                if flows:
                    list_element(W, lane, listed_out, force_out)
        known = int(0)
        if wp.static(plastic):
            barrier()
            known = listed_out[0]
            barrier()
        if exists and not flows:
            Xl = load_points(kept_points, pool, corners, 0, exponent_of(head))  # again: they take registers
            ul = load_displacements(pool, corners, 0)
            if elastic_element(Xl, ul, W, e, m, lane, law, yielded_out, history_out, extreme_out, force_out):
                if wp.static(plastic):
                    list_element(W, lane, listed_out, force_out)
        total = int(0)
        if wp.static(plastic):
            if lane >= wp.static(PATCH):
                flow_range(
                    kept_points, pool, 0, head, 0, known, lane - wp.static(PATCH), wp.static(THREADS - PATCH),
                    patches, law, listed_out, history_out, extreme_out, force_out,
                )  # fmt: skip
            barrier()
            total = listed_out[0]
            if total > known:
                flow_range(
                    kept_points, pool, 0, head, known, total, lane, wp.static(THREADS),
                    patches, law, listed_out, history_out, extreme_out, force_out,
                )  # fmt: skip
        barrier()
        return total

    return compute_elements


@cache
def patch_role(precision: str, law_name: str) -> Any:
    """The function that computes the forces of a patch of `hex8` in each of some steps."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, _ = slot_pools(precision)
    point, slots, plastic, mixed = POINT[precision], SLOTS[precision], bool(law_name), precision == "mixed"
    copy_points = copy_functions(precision)[3]
    clear_nowhere, _, _, sum_slot = sum_functions(precision)
    compute_elements = element_role(precision, law_name)

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
        clear_nowhere(forces, lane)
        if lane == 0:
            listed[0] = 0
        head = patches.turn[block]
        corners = corners_of(patches, head, lane)
        m = material_of(corners[0], corners[1])
        if lane < wp.static(PATCH):
            copy_points(points, head, lane, 0, kept_points)
        in_use = lane < slot_count(head)
        mine = head[1] + wp.min(lane, slot_count(head) - 1)  # slot of this thread
        places = patches.places[mine]
        node = int(0)
        if wp.static(mixed):
            node = points[mine][3]
        else:
            node = points[mine]
            if in_use:
                copy_vector(X, node, lane, pool)
        wait_for_copies()
        barrier()
        for n in range(steps):
            if n > 0:
                wait_for(wp.static(NODES), n * movers, count_out)
            if in_use:
                copy_vector(u, node, wp.static(0 if mixed else slots) + lane, pool)
            wait_for_copies()
            barrier()
            flowing = compute_elements(
                lane, lane < element_count(head), m, head, corners, kept_points, pool, patches, law,
                yielded_out, history_out, extreme_out, listed, forces,
            )  # fmt: skip
            if wp.static(plastic):
                if lane == 0:
                    flowing_out[head[3]] = flowing
                    listed[0] = 0
            if in_use:
                force_out[from_start(slot + mine)] = sum_slot(forces, places)
            arrive(wp.static(FORCES), count_out)

    return compute_patch
