"""Owns the force kernel of hexahedra on a GPU, at small strain: one thread for each element, as if elastic.

Elements that have not yielded need neither history nor registers for it: a thread computes one as if it were elastic.
Elements that have, or that begin to yield now, may be listed; then threads compute the listed ones, one or several for
each.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch import (
    POINT,
    RESIDENT,
    Patches,
    copy_functions,
    copy_places,
    corners_of,
    element_count,
    exponent_of,
    step_of,
)
from warp_mca.kernels.elements.patch_element import material_of, sum_functions
from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.elements.viscosity import DILATATION, VISCOUS_READ
from warp_mca.kernels.hardware.block import from_start
from warp_mca.kernels.hardware.early_launch import begins_early
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import (
    FORCES,
    HEADS,
    ahead_functions,
    barrier,
    head_ring,
    list_pool,
    shared_functions,
    slot_pools,
    wait_for_copies,
)

wp.set_module_options({"enable_backward": False})


@dataclass(frozen=True)
class PatchElement:
    """What a thread does with its element of a patch.

    Attributes:
        name: of the element.
        load_points, load_displacements: as those of `patch_element.load_functions`; what they give goes to `compute`.
        compute: (points, displacements, e, m, lane, law, dt, yielded_out, history_out, extreme_out, listed_out,
            force_out); stores the element's forces, or lists it.
        prepare: (points, displacements, e, lane, dt, extreme_out, force_out); stores what lanes need of a thread's
            element.
        flow: computes an element that may yield by several threads, see `hex8_lanes`; None where `compute` does it all.
        lanes: how many threads `flow` takes [-].
    """

    name: str
    load_points: Any
    load_displacements: Any
    compute: Any
    prepare: Any = None
    flow: Any = None
    lanes: int = 1


Maker = Callable[..., PatchElement]  # of a precision, a law, what joins the pressure, and whether that is read ahead


@wp.func
def list_element(thread: int, listed_out: wp.array(dtype=wp.int32)):
    """List the element of a thread. A list of shape (PATCH + 1,) begins with its length."""
    listed_out[1 + wp.atomic_add(listed_out, 0, 1)] = thread


@cache
def listed_function(precision: str, flow: Any, lanes: int) -> Any:
    """The function that computes the listed elements of a patch by so many lanes each, then clears the list."""
    R, point, shift = scalars(precision).real, POINT[precision], lanes.bit_length() - 1

    @wp.func
    def flow_listed(
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        first: int,
        head: wp.vec4i,
        lane: int,
        patches: Patches,
        law: wp.array2d(dtype=R),
        listed_out: wp.array(dtype=wp.int32),
        history_out: wp.array2d(dtype=R),
        extreme_out: wp.array2d(dtype=R),
        force_out: wp.array(dtype=R),
    ):
        listed = listed_out[0]
        for batch in range((wp.static(lanes) * listed + wp.static(PATCH - 1)) // wp.static(PATCH)):
            item = (batch * wp.static(PATCH) + lane) >> wp.static(shift)
            thread = listed_out[from_start(1 + wp.min(item, listed - 1))] & wp.static(PATCH - 1)
            mine = from_start(head[0] + thread)
            valid = item < listed
            grid = exponent_of(head)
            q = lane & wp.static(lanes - 1)
            dt = R(step_of(patches, head))
            flow(
                points, pool, first, grid, patches, mine, law, dt, thread, q, valid, history_out, extreme_out, force_out
            )
        if listed > 0:
            barrier()
            if lane == 0:
                listed_out[0] = 0

    return flow_listed


@cache
def ahead_function(precision: str, viscous: int) -> Any:
    """The function that begins to copy what a viscous element of the patch reads to the place of its forces."""
    R, (copy, _) = scalars(precision).real, ahead_functions(precision, VISCOUS_READ)
    pool, _ = shared_functions(precision)

    @wp.func
    def read_ahead(extreme: wp.array2d(dtype=R), e: int, exists: bool):
        if wp.static(viscous):
            if exists:
                copy(extreme, DILATATION, e, pool())

    return read_ahead


@cache
def patch_force_kernel(maker: Maker, precision: str, law_name: str, viscous: int = 0) -> Any:
    """Kernel: the forces of each patch on its nodes, bulk viscosity and, where there is a law, the plastic history.

    flowing_out has the number of elements of each patch that took the return map, shape (patch_count,), where the
    element has lanes for these.
    """
    own = maker(precision, law_name, viscous, ahead=bool(viscous))
    load_points, load_displacements, compute_element = own.load_points, own.load_displacements, own.compute
    name = f"{own.name}_patch_force"
    t = scalars(precision)
    R, vec3 = t.real, t.vec3
    force_pool, _ = shared_functions(precision)
    point_pool, vector_pool, places_pool = slot_pools(precision)
    point, slots = POINT[precision], SLOTS[precision]
    lanes = bool(law_name) and own.flow is not None
    flow_listed = listed_function(precision, own.flow, own.lanes) if lanes else None
    # otherwise lanes of yielding elements still need the nodes of this patch in the place of the next ones
    early = precision == "mixed" or not lanes
    begin_turns, copy_nodes, copy_ahead, _ = copy_functions(precision)
    clear_nowhere, _, sum_patch, _ = sum_functions(precision)
    read_ahead = ahead_function(precision, viscous)

    # in float32, a few registers spilled cost less than a quarter of the threads
    @wp.kernel(
        enable_backward=False,
        module="unique",
        name=name,
        grid_stride=False,
        launch_bounds=(PATCH, RESIDENT[precision]),
        module_options={"fast_math": True},
    )
    def patch_force(
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
        if wp.static(lanes):
            if lane == 0:
                listed[0] = 0
        head, corners = begin_turns(points, X, u, patches, block, stride, lane, ring, kept_points, pool)
        k = int(0)
        while element_count(head) > 0:
            e, m = from_start(head[0] + lane), material_of(corners[0], corners[1])
            first, dt = (k & 1) * wp.static(slots), R(step_of(patches, head))
            Xl = load_points(kept_points, pool, corners, first, exponent_of(head))
            ul = load_displacements(pool, corners, first)
            next_head = ring[(k + 1) % wp.static(HEADS)]
            wait_for_copies()
            copy_places(patches, head, lane, places)
            barrier()
            read_ahead(extreme_out, e, lane < element_count(head))
            if wp.static(early):
                copy_nodes(X, u, kept_points, next_head, lane, wp.static(slots) - first, pool)
            if lane < element_count(head):
                compute_element(Xl, ul, e, m, lane, law, dt, yielded_out, history_out, extreme_out, listed, forces)
            wait_for_copies()
            barrier()
            if wp.static(lanes):
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

    return begins_early(patch_force)
