"""Owns the blocks of threads that compute one patch of elements in every step.

The places of its points stay in shared memory from step to step.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch import (
    POINT,
    Patches,
    copy_functions,
    copy_places,
    corners_of,
    element_count,
    exponent_of,
    slot_count,
)
from warp_mca.kernels.elements.patch_element import material_of, sum_functions
from warp_mca.kernels.elements.patch_kernel import Maker
from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.hardware.block import from_start
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import FORCES as POOL
from warp_mca.kernels.hardware.shared_memory import (
    barrier,
    copy_vector,
    shared_functions,
    slot_pools,
    wait_for_copies,
)
from warp_mca.kernels.nodes.floating import seen
from warp_mca.kernels.resident.meeting import FORCES, NODES, arrive, wait_for
from warp_mca.kernels.resident.node_role import Nodes

THREADS = 2 * PATCH  # of a block
RESIDENT = 2  # blocks of threads that a multiprocessor holds, by the registers they need
ROUNDS = (max(SLOTS.values()) + THREADS - 1) // THREADS  # slots of a thread


@cache
def element_role(maker: Maker, precision: str, law_name: str, viscous: int) -> Any:
    """The function that computes the elements of a patch by all threads of a block.

    Elements with a plastic law are computed as those that yield, whether they do or not.
    """
    t = scalars(precision)
    R, point = t.real, POINT[precision]
    plastic, own = bool(law_name), maker(precision, law_name, viscous)
    lanes, shift = own.lanes, own.lanes.bit_length() - 1
    load_points, load_displacements, compute, prepare, flow = (
        own.load_points,
        own.load_displacements,
        own.compute,
        own.prepare,
        own.flow,
    )

    @wp.func
    def compute_elements(
        lane: int,
        head: wp.vec4i,
        corners: wp.vec4ui,
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        patches: Patches,
        law: wp.array2d(dtype=R),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        """Compute the forces, and store them as `patch_kernel` does."""
        count = element_count(head)
        if lane < count:
            e = from_start(head[0] + lane)
            Xl = load_points(points, pool, corners, 0, exponent_of(head))
            ul = load_displacements(pool, corners, 0)
            if wp.static(plastic):
                prepare(Xl, ul, e, lane, R(patches.dt), extreme_out, force_out)
            else:
                m = material_of(corners[0], corners[1])
                none = wp.array(ptr=wp.uint64(0), shape=(0,), dtype=wp.int32)  # of elements that yield
                dt = R(patches.dt)
                compute(Xl, ul, e, m, lane, law, dt, yielded_out, history_out, extreme_out, none, force_out)
        if wp.static(plastic):
            barrier()
            for batch in range((wp.static(lanes) * count + wp.static(THREADS - 1)) // wp.static(THREADS)):
                item = (batch * wp.static(THREADS) + lane) >> wp.static(shift)
                thread = wp.min(item, count - 1)
                e = from_start(head[0] + thread)
                q, valid = lane & wp.static(lanes - 1), item < count
                if flow(
                    points, pool, 0, exponent_of(head), patches, e, law, R(patches.dt), thread, q, valid,
                    history_out, extreme_out, force_out,
                ):  # fmt: skip
                    yielded_out[e] = 1
        barrier()

    return compute_elements


@cache
def see_function(precision: str, turned: bool) -> Any:
    """The function that turns displacements copied by a thread to floating frames; without `turned` it does nothing."""
    point = POINT[precision]

    @wp.func
    def see_slots(
        lane: int,
        count: int,
        X: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        nodes: Nodes,
        pool_out: wp.array(dtype=wp.vec3d),
    ):
        if wp.static(turned):
            for k in range(wp.static(ROUNDS)):
                a = lane + k * wp.static(THREADS)
                if a < count:
                    i = points[a][3]
                    pool_out[a] = seen(X[i], pool_out[a], nodes.data.frames.rotation[nodes.data.frames.of_node[i]])

    return see_slots


@cache
def patch_role(maker: Maker, precision: str, law_name: str, viscous: int, turned: bool) -> Any:
    """The function that computes the forces of a patch in each of the kernel's steps.

    `turned`, in `mixed`: elements compute in floating frames.
    """
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, places_pool = slot_pools(precision)
    point, slots, mixed = POINT[precision], SLOTS[precision], precision == "mixed"
    copy_points = copy_functions(precision)[3]
    clear_nowhere, _, _, sum_slot = sum_functions(precision)
    compute_elements, see_slots = element_role(maker, precision, law_name, viscous), see_function(precision, turned)

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
        nodes: Nodes,
        u: wp.array(dtype=wp.vec3d),
        count_out: wp.array(dtype=wp.int32),
        yielded_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=vec3),
    ):
        """Compute one patch. `movers` is the number of blocks that move nodes."""
        forces = wp.array(ptr=force_pool(), shape=(POOL,), dtype=R)
        kept_points = wp.array(ptr=point_pool(), shape=(2 * slots,), dtype=point)
        pool = wp.array(ptr=vector_pool(), shape=(2 * slots,), dtype=wp.vec3d)
        places = wp.array(ptr=places_pool(), shape=(slots,), dtype=wp.vec2i)
        clear_nowhere(forces, lane)
        head = patches.turn[block]
        corners = corners_of(patches, head, lane)
        if lane < wp.static(PATCH):
            copy_points(points, head, lane, 0, kept_points)
            copy_places(patches, head, lane, places)
        wait_for_copies()
        barrier()
        for n in range(steps):
            if n > 0:
                wait_for(wp.static(NODES), n * movers, count_out)
            for k in range(wp.static(ROUNDS)):
                a = lane + k * wp.static(THREADS)
                if a < slot_count(head):
                    if wp.static(mixed):
                        copy_vector(u, kept_points[a][3], a, pool)
                    else:
                        copy_vector(X, kept_points[a], a, pool)
                        copy_vector(u, kept_points[a], wp.static(slots) + a, pool)
            wait_for_copies()
            see_slots(lane, slot_count(head), X, kept_points, nodes, pool)
            barrier()
            compute_elements(
                lane, head, corners, kept_points, pool, patches, law, yielded_out, history_out, extreme_out, forces
            )
            for k in range(wp.static(ROUNDS)):
                a = lane + k * wp.static(THREADS)
                if a < slot_count(head):
                    force_out[from_start(slot + head[1] + a)] = sum_slot(forces, places[a])
            arrive(wp.static(FORCES), count_out)

    return compute_patch
