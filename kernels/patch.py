"""Owns what force kernels of a GPU share: a block of threads computes one patch of elements after another.

A patch is up to PATCH elements, one for each thread. Its nodes are read once, into shared memory; its forces are summed
there in a fixed order, so that what leaves the multiprocessor is one force for each node of a patch in place of eight
for each element, and runs repeat bit for bit. What the next patch needs is on its way while one is computed: its nodes,
and before these the list of them, and before that its head. Of this module only the order of patches can be found on a
CPU.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.scalars import scalars
from warp_mca.kernels.shared_memory import (
    HEADS,
    barrier,
    close_group,
    copy_index,
    copy_vector,
    copy_words,
    wait_for_copies,
)
from warp_mca.patches import NOWHERE, PATCH, SLOTS

SCHEDULERS = 256  # threads that put patches in order
RESIDENT = {"mixed": 4, "float64": 2}  # blocks of threads that a multiprocessor holds, by the registers they need
SLOTS_OF_THREAD = (max(SLOTS.values()) + PATCH - 1) // PATCH

wp.set_module_options({"enable_backward": False})


@wp.struct
class Patches:
    """Patches of a block of elements.

    A head of a patch is its first element, its first slot, how many it has of both, (slots << 16) + elements, and its
    number.

    Attributes:
        head: of each patch, shape (patch_count,), vec4i.
        turn: the same in the order in which they are computed, shape (patch_count,), vec4i.
        node: of each slot, one for each node of a patch, shape (slot_count,), int32.
        corner: slots of the corners of each element, counted from the first of its patch, two in a word, shape
            (4, element_count), uint32.
        places: where the first components of the forces of a slot lie in shared memory, two in a word and eight at
            most, NOWHERE where there are fewer, shape (slot_count,), vec4i.
        flowing: elements of each patch that took the return map last, shape (patch_count,), int32; empty where elastic.
    """

    head: wp.array(dtype=wp.vec4i)
    turn: wp.array(dtype=wp.vec4i)
    node: wp.array(dtype=wp.int32)
    corner: wp.array2d(dtype=wp.uint32)
    places: wp.array(dtype=wp.vec4i)
    flowing: wp.array(dtype=wp.int32)


@wp.kernel(enable_backward=False)
def count_flowing(flowing: wp.array(dtype=wp.int32), count_out: wp.array(dtype=wp.int32)):
    """Patches in which elements yield, of each of SCHEDULERS equal runs of patches."""
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
    """Patches in which elements yield first, then the others, both in the order they lie in."""
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
def from_start(i: int):
    """The same index, plainly not negative: Warp asks of each that may be whether it counts from the end."""
    return i & 0x7FFFFFFF


@wp.func
def element_count(head: wp.vec4i):
    """Elements of a patch."""
    return head[2] & 0xFFFF


@wp.func
def slot_count(head: wp.vec4i):
    """Slots of a patch."""
    return (head[2] >> 16) & 0xFFFF


@wp.func
def copy_head(patches: Patches, block: int, stride: int, k: int, ring_out: wp.array(dtype=wp.vec4i)):
    """Begin to copy the head of the k-th patch of a block of threads; beyond the last, that of an empty one.

    Blocks that had the first patches, which take longest, come last from then on: some have one fewer.
    """
    turn = block
    if k > 0:
        turn = (k + 1) * stride - 1 - block
    if turn < patches.turn.shape[0]:
        copy_words(patches.turn, turn, k % wp.static(HEADS), ring_out)
    else:
        ring_out[k % wp.static(HEADS)] = wp.vec4i()


@wp.func
def copy_list(patches: Patches, head: wp.vec4i, lane: int, node_out: wp.array(dtype=wp.int32)):
    """Begin to copy the nodes of a patch into shared memory, where each thread reads its own."""
    for k in range(wp.static(SLOTS_OF_THREAD)):
        n = lane + k * wp.static(PATCH)
        if n < slot_count(head):
            copy_index(patches.node, head[1] + n, n, node_out)
    close_group()


@wp.func
def copy_places(patches: Patches, head: wp.vec4i, lane: int, places_out: wp.array(dtype=wp.vec4i)):
    """Begin to copy where the forces of slots lie into shared memory, where each thread reads its own."""
    for k in range(wp.static(SLOTS_OF_THREAD)):
        n = lane + k * wp.static(PATCH)
        if n < slot_count(head):
            copy_words(patches.places, head[1] + n, n, places_out)
    close_group()


@wp.func
def copy_nodes(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    head: wp.vec4i,
    lane: int,
    node: wp.array(dtype=wp.int32),
    slots: int,
    pool_out: wp.array(dtype=wp.vec3d),
):
    """Begin to copy positions and displacements of a patch into shared memory; its own list of nodes has arrived.

    Displacements stand `slots` behind positions.
    """
    for k in range(wp.static(SLOTS_OF_THREAD)):
        n = lane + k * wp.static(PATCH)
        if n < slot_count(head):
            i = node[n]
            copy_vector(X, i, n, pool_out)
            copy_vector(u, i, n + slots, pool_out)


@wp.func
def begin_turns(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    patches: Patches,
    block: int,
    stride: int,
    lane: int,
    slots: int,
    ring_out: wp.array(dtype=wp.vec4i),
    node_out: wp.array(dtype=wp.int32),
    pool_out: wp.array(dtype=wp.vec3d),
):
    """Heads of the first patches, nodes of the first of them, and the list of those of the second."""
    if lane < wp.static(HEADS - 1):
        copy_head(patches, block, stride, lane, ring_out)
    wait_for_copies()
    barrier()
    copy_list(patches, ring_out[0], lane, node_out)
    wait_for_copies()
    copy_nodes(X, u, ring_out[0], lane, node_out, slots, pool_out)
    wait_for_copies()
    copy_list(patches, ring_out[1], lane, node_out)
    barrier()


@wp.func
def copy_ahead(
    patches: Patches,
    block: int,
    stride: int,
    k: int,
    lane: int,
    ring_out: wp.array(dtype=wp.vec4i),
    node_out: wp.array(dtype=wp.int32),
):
    """At the k-th patch of a block of threads: begin to copy the list of the second after it, the head of the third."""
    if lane == wp.static(PATCH - 1):
        copy_head(patches, block, stride, k + wp.static(HEADS - 1), ring_out)
    copy_list(patches, ring_out[(k + 2) % wp.static(HEADS)], lane, node_out)


@wp.func
def corners_of(patches: Patches, head: wp.vec4i, lane: int):
    """Slots of the corners of a thread's element within its patch, two in a word; of any where it has none."""
    e = from_start(head[0] + wp.min(lane, wp.max(element_count(head) - 1, 0)))
    return wp.vec4ui(patches.corner[0, e], patches.corner[1, e], patches.corner[2, e], patches.corner[3, e])


@cache
def load_functions(precision: str) -> tuple[Any, Any]:
    """Functions: an element's nodes relative to its first, as `hexahedron.load_function`; two of its corners so."""
    t = scalars(precision)
    R, vec3, mat83, slots = t.real, t.vec3, t.mat83, SLOTS[precision]
    # Fast math would also flush what is too small, in three instructions for each number.
    convert = 'float f; asm("cvt.rn.f32.f64 %0, %1;" : "=f"(f) : "d"(value)); return f;'

    @wp.func_native(convert if precision == "mixed" else "return value;")
    def rounded(value: wp.float64) -> R: ...

    @wp.func
    def difference(pool: wp.array(dtype=wp.vec3d), slot: int, origin: wp.vec3d):
        d = pool[slot] - origin
        return vec3(rounded(d[0]), rounded(d[1]), rounded(d[2]))

    @wp.func
    def load_element(pool: wp.array(dtype=wp.vec3d), first: int, corners: wp.vec4ui):
        local = mat83()
        origin = pool[first + int(corners[0] & wp.uint32(0xFFFF))]
        for k in range(4):
            if k > 0:
                local[2 * k] = difference(pool, first + int(corners[k] & wp.uint32(0xFFFF)), origin)
            local[2 * k + 1] = difference(pool, first + int(corners[k] >> wp.uint32(16)), origin)
        return local

    @wp.func
    def load_corners(pool: wp.array(dtype=wp.vec3d), patches: Patches, e: int, a: int):
        """Position and displacement of corner a, then of a + 4."""
        origin = int(patches.corner[0, e] & wp.uint32(0xFFFF))
        shift = wp.uint32(16 * (a & 1))
        lower = int((patches.corner[a >> 1, e] >> shift) & wp.uint32(0xFFFF))
        upper = int((patches.corner[(a >> 1) + 2, e] >> shift) & wp.uint32(0xFFFF))
        X = pool[origin]
        u = pool[origin + wp.static(slots)]
        return (
            difference(pool, lower, X),
            difference(pool, lower + wp.static(slots), u),
            difference(pool, upper, X),
            difference(pool, upper + wp.static(slots), u),
        )

    return load_element, load_corners


@cache
def sum_functions(precision: str) -> tuple[Any, Any, Any]:
    """Functions that prepare shared memory, store the forces of a thread's element there, and sum those of a patch."""
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83

    @wp.func
    def keep_forces(pool_out: wp.array(dtype=R), lane: int, f: mat83):
        """Component i of the force on corner a lies at (3 a + i) PATCH + lane."""
        for a in range(8):
            for i in range(3):
                pool_out[(3 * a + i) * wp.static(PATCH) + lane] = f[a, i]

    @wp.func
    def clear_nowhere(pool_out: wp.array(dtype=R), lane: int):
        """Zeros for the places of slots where fewer forces meet."""
        if lane < 3:
            pool_out[wp.static(NOWHERE) + lane * wp.static(PATCH)] = R(0.0)

    @wp.func
    def kept(pool: wp.array(dtype=R), place: int):
        """The force at a place, the low half of a word."""
        first = place & 0xFFFF
        return vec3(pool[first], pool[first + wp.static(PATCH)], pool[first + wp.static(2 * PATCH)])

    @wp.func
    def sum_patch(
        pool: wp.array(dtype=R),
        places: wp.array(dtype=wp.vec4i),
        head: wp.vec4i,
        lane: int,
        slot: int,
        force_out: wp.array(dtype=vec3),
    ):
        """Forces of a patch into its slots, when all threads have kept theirs."""
        for k in range(wp.static(SLOTS_OF_THREAD)):
            n = lane + k * wp.static(PATCH)
            if n < slot_count(head):
                w = places[n]
                total = kept(pool, w[0]) + kept(pool, w[0] >> 16)
                for i in range(1, 4):
                    total = total + kept(pool, w[i]) + kept(pool, w[i] >> 16)
                force_out[from_start(slot + head[1] + n)] = total

    return clear_nowhere, keep_forces, sum_patch
