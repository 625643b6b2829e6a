"""Owns what force kernels of a GPU share: a block of threads computes one patch of elements after another.

A patch is up to PATCH elements, one for each thread. Its nodes are read once, into shared memory; its forces are summed
there in a fixed order, so that what leaves the multiprocessor is one force for each node of a patch in place of eight
for each element, and runs repeat bit for bit. While a patch is computed, data of the following ones are being copied:
displacements of nodes of the next patch, points of the one after it, which name the nodes, and heads of later ones.
Only the order of patches can be computed on a CPU.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.hardware.block import from_start
from warp_mca.kernels.hardware.early_launch import let_next_begin, wait_for_previous
from warp_mca.kernels.hardware.shared_memory import (
    HEADS,
    barrier,
    copy_index,
    copy_pair,
    copy_vector,
    copy_words,
    wait_for_copies,
)

SCHEDULERS = 256  # threads that put patches in order
RESIDENT = {"mixed": 4, "float64": 2}  # blocks of threads that a multiprocessor holds, by the registers they need
# Most blocks for a chain of slower elements, so that the fastest elements find room beside it.
BESIDE = {"mixed": 2, "float64": 1}
HALVED = 2.5  # patches of half the size on a multiprocessor up to which those of the fastest elements are halved
# A slot holds the place of its node on the patch's grid and the node's number. In float64, where positions are not
# rounded, it holds the number alone, and shared memory has no room for displacements of the next patch.
POINT = {"mixed": wp.vec4i, "float64": wp.int32}
SLOTS_OF_THREAD = (max(SLOTS.values()) + PATCH - 1) // PATCH

wp.set_module_options({"enable_backward": False})


@wp.struct
class Patches:
    """Patches of a block of elements.

    A head of a patch is its first element, its first slot, (level << 25) + (slots << 16) + (exponent << 8) + elements,
    and its number; see `warp_mca.physics.elements.patches`.

    Attributes:
        head: of each patch, shape (patch_count,), vec4i.
        turn: the same in the order in which they are computed, shape (patch_count,), vec4i.
        corner: slots of the corners of each element, counted from the first of its patch, and its material, shape
            (4, element_count), uint32.
        places: element of the patch whose corner of each number lies in a slot, a byte each, NOWHERE where none does,
            shape (slot_count,), vec2i.
        dt: time step of level 0, which viscous elements read [s].
    """

    head: wp.array(dtype=wp.vec4i)
    turn: wp.array(dtype=wp.vec4i)
    corner: wp.array2d(dtype=wp.uint32)
    places: wp.array(dtype=wp.vec2i)
    dt: wp.float64


@wp.kernel(enable_backward=False)
def count_flowing(flowing: wp.array(dtype=wp.int32), count_out: wp.array(dtype=wp.int32)):
    """Count the patches with yielding elements in each of SCHEDULERS equal runs of patches."""
    run = wp.tid()
    size = (flowing.shape[0] + wp.static(SCHEDULERS - 1)) // wp.static(SCHEDULERS)
    count = int(0)
    for patch in range(run * size, wp.min((run + 1) * size, flowing.shape[0])):
        count += wp.min(flowing[patch], 1)
    count_out[run] = count


@wp.kernel(enable_backward=False)
def schedule(
    flowing: wp.array(dtype=wp.int32),
    count: wp.array(dtype=wp.int32),
    head: wp.array(dtype=wp.vec4i),
    turn_out: wp.array(dtype=wp.vec4i),
):
    """Order patches: those with yielding elements first, then the others, each in their own order."""
    run = wp.tid()
    size = (flowing.shape[0] + wp.static(SCHEDULERS - 1)) // wp.static(SCHEDULERS)
    before = int(0)
    total = int(0)
    for k in range(wp.static(SCHEDULERS)):
        if k < run:
            before += count[k]
        total += count[k]
    for patch in range(run * size, wp.min((run + 1) * size, flowing.shape[0])):
        if flowing[patch] > 0:
            turn_out[before] = head[patch]
            before += 1
        else:
            turn_out[total + patch - before] = head[patch]


@wp.func
def element_count(head: wp.vec4i):
    """Elements of a patch."""
    return head[2] & 0xFF


@wp.func
def slot_count(head: wp.vec4i):
    """Slots of a patch."""
    return (head[2] >> 16) & 0x1FF


@wp.func
def step_of(patches: Patches, head: wp.vec4i):
    """Time step of the elements of a patch [s]."""
    return wp.float64(1 << (head[2] >> 25)) * patches.dt


@wp.func
def exponent_of(head: wp.vec4i):
    """Exponent of the grid that a patch's points lie on."""
    return (head[2] >> 8) & 0xFF


@wp.func
def copy_head(patches: Patches, block: int, stride: int, k: int, ring_out: wp.array(dtype=wp.vec4i)):
    """Begin to copy the head of the k-th patch of a block of threads, an empty head beyond the last patch.

    Blocks that had the first patches, which take longest, come last afterwards, and some of them get one patch fewer.
    """
    turn = (k + 1) * stride - 1 - block
    if turn < patches.turn.shape[0]:
        copy_words(patches.turn, turn, k % wp.static(HEADS), ring_out)
    else:
        ring_out[k % wp.static(HEADS)] = wp.vec4i()


@wp.func
def copy_places(patches: Patches, head: wp.vec4i, lane: int, places_out: wp.array(dtype=wp.vec2i)):
    """Begin to copy where the forces of slots lie into shared memory, where each thread reads its own."""
    for k in range(wp.static(SLOTS_OF_THREAD)):
        n = lane + k * wp.static(PATCH)
        if n < slot_count(head):
            copy_pair(patches.places, head[1] + n, n, places_out)


@wp.func
def corners_of(patches: Patches, head: wp.vec4i, lane: int):
    """Words of a thread's element within its patch, or of any element if it has none."""
    e = from_start(head[0] + wp.min(lane, wp.max(element_count(head) - 1, 0)))
    return wp.vec4ui(patches.corner[0, e], patches.corner[1, e], patches.corner[2, e], patches.corner[3, e])


@cache
def copy_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Functions that begin to copy (begin a block of threads; nodes of a patch; what comes after the next; its points).

    In shared memory, points of successive patches lie in turn from 0 and from SLOTS on. So do displacements of nodes in
    `mixed`; otherwise positions lie from 0 on, displacements from SLOTS on.
    """
    point, slots = POINT[precision], SLOTS[precision]

    @wp.func
    def copy_points(
        points: wp.array(dtype=point), head: wp.vec4i, lane: int, first: int, pool_out: wp.array(dtype=point)
    ):
        for k in range(wp.static(SLOTS_OF_THREAD)):
            n = lane + k * wp.static(PATCH)
            if n < slot_count(head):
                if wp.static(precision == "mixed"):
                    copy_words(points, head[1] + n, first + n, pool_out)
                else:
                    copy_index(points, head[1] + n, first + n, pool_out)

    @wp.func
    def copy_nodes(
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        points: wp.array(dtype=point),
        head: wp.vec4i,
        lane: int,
        first: int,
        pool_out: wp.array(dtype=wp.vec3d),
    ):
        """Begin to copy displacements of a patch's nodes, for the points that this thread copied."""
        for k in range(wp.static(SLOTS_OF_THREAD)):
            n = lane + k * wp.static(PATCH)
            if n < slot_count(head):
                if wp.static(precision == "mixed"):
                    copy_vector(u, points[first + n][3], first + n, pool_out)
                else:
                    copy_vector(X, points[first + n], n, pool_out)
                    copy_vector(u, points[first + n], wp.static(slots) + n, pool_out)

    @wp.func
    def begin_turns(
        points: wp.array(dtype=point),
        X: wp.array(dtype=wp.vec3d),
        u: wp.array(dtype=wp.vec3d),
        patches: Patches,
        block: int,
        stride: int,
        lane: int,
        ring_out: wp.array(dtype=wp.vec4i),
        point_out: wp.array(dtype=point),
        vector_out: wp.array(dtype=wp.vec3d),
    ):
        """The first patch, but for its places, points of the second, and two more heads; head and corners."""
        head = patches.turn[block]
        if lane == 1 or lane == 2:
            copy_head(patches, block, stride, lane, ring_out)
        corners = corners_of(patches, head, lane)
        copy_points(points, head, lane, 0, point_out)
        wait_for_copies()
        barrier()
        copy_points(points, ring_out[1], lane, wp.static(slots), point_out)
        wait_for_previous()
        let_next_begin()
        copy_nodes(X, u, point_out, head, lane, 0, vector_out)
        wait_for_copies()
        barrier()
        return head, corners

    @wp.func
    def copy_ahead(
        points: wp.array(dtype=point),
        patches: Patches,
        block: int,
        stride: int,
        k: int,
        lane: int,
        first: int,
        ring_out: wp.array(dtype=wp.vec4i),
        point_out: wp.array(dtype=point),
    ):
        """At the k-th patch of a block: begin to copy the points of the patch after the next, and a later head."""
        if lane == wp.static(PATCH - 1):
            copy_head(patches, block, stride, k + wp.static(HEADS - 1), ring_out)
        copy_points(points, ring_out[(k + 2) % wp.static(HEADS)], lane, first, point_out)

    return begin_turns, copy_nodes, copy_ahead, copy_points
