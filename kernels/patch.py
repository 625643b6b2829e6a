"""Owns what force kernels of a GPU share: a block of threads loads a patch of elements and sums its forces.

A patch is up to PATCH elements, one for each thread. Its nodes are read once, into shared memory; its forces are summed
there in a fixed order, so that what leaves the multiprocessor is one force for each node of a patch in place of eight
for each element, and runs repeat bit for bit. Shared memory, barriers and the exchange between the lanes of a warp are
CUDA's own; of this module only the order of patches can be found on a CPU.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.scalars import scalars
from warp_mca.patches import NOWHERE, PATCH, SLOTS

SCHEDULERS = 256  # threads that put patches in order

wp.set_module_options({"enable_backward": False})


@wp.func_native("__syncthreads();")
def barrier():
    """Wait for all threads of the block."""
    ...


@wp.func_native("__syncwarp();")
def warp_barrier():
    """Wait for all lanes of the warp."""
    ...


@wp.func_native(f"__shared__ double pool[{6 * SLOTS}]; return (unsigned long long)pool;")
def node_pool() -> wp.uint64:
    """Address of shared memory for reference positions, then displacements, of the slots of a patch."""
    ...


@wp.func_native(f"__shared__ int pool[{PATCH + 1}]; return (unsigned long long)pool;")
def list_pool() -> wp.uint64:
    """Address of shared memory for a list of elements of a patch, its length first."""
    ...


@wp.struct
class Patches:
    """Patches of a block of elements.

    Attributes:
        start: first element of each patch, and the end of the last, shape (patch_count + 1,), int32.
        slot_start: the same of its slots, one for each of its nodes, shape (patch_count + 1,), int32.
        node: of each slot, shape (slot_count,), int32.
        corner: slots of the corners of each element, counted from the first of its patch, two in a word, shape
            (4, element_count), uint32.
        places: where the first components of the forces of a slot lie in shared memory, two in a word and eight at
            most, NOWHERE where there are fewer, shape (4, slot_count), uint32.
        order: patch of each block of threads where elements may yield, shape (patch_count,), int32, else empty.
        flowing: elements of each patch that took the return map last, shape (patch_count,), int32, else empty.
    """

    start: wp.array(dtype=wp.int32)
    slot_start: wp.array(dtype=wp.int32)
    node: wp.array(dtype=wp.int32)
    corner: wp.array2d(dtype=wp.uint32)
    places: wp.array2d(dtype=wp.uint32)
    order: wp.array(dtype=wp.int32)
    flowing: wp.array(dtype=wp.int32)


@cache
def shared_functions(precision: str) -> tuple[Any, Any]:
    """Functions (address of shared memory for the forces of a patch; value of the lane that differs in `mask`)."""
    R = scalars(precision).real
    name = "float" if precision == "mixed" else "double"

    @wp.func_native(f"__shared__ {name} pool[{24 * PATCH}]; return (unsigned long long)pool;")
    def force_pool() -> wp.uint64: ...

    @wp.func_native("return __shfl_xor_sync(0xffffffffu, value, mask);")
    def exchange(value: R, mask: int) -> R: ...

    return force_pool, exchange


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
def schedule(flowing: wp.array(dtype=wp.int32), count: wp.array(dtype=wp.int32), order_out: wp.array(dtype=wp.int32)):
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
            order_out[before] = patch
            before += 1
        else:
            order_out[total + patch - before] = patch


@wp.func
def load_patch(
    X: wp.array(dtype=wp.vec3d),
    u: wp.array(dtype=wp.vec3d),
    patches: Patches,
    patch: int,
    lane: int,
    pool_out: wp.array(dtype=wp.vec3d),
):
    """Positions and displacements of a patch into shared memory; wait before they are read."""
    begin = patches.slot_start[patch]
    count = patches.slot_start[patch + 1] - begin
    # two slots for each thread at once, because a thread waits long for each: first for the node, then for its place
    second = lane + wp.static(PATCH)
    i = patches.node[begin + wp.min(lane, count - 1)]
    j = patches.node[begin + wp.min(second, count - 1)]
    X_i = X[i]
    u_i = u[i]
    X_j = X[j]
    u_j = u[j]
    if lane < count:
        pool_out[lane] = X_i
        pool_out[lane + wp.static(SLOTS)] = u_i
    if second < count:
        pool_out[second] = X_j
        pool_out[second + wp.static(SLOTS)] = u_j
    for n in range(lane + wp.static(2 * PATCH), count, wp.static(PATCH)):
        k = patches.node[begin + n]
        pool_out[n] = X[k]
        pool_out[n + wp.static(SLOTS)] = u[k]


@wp.func
def corners_of(patches: Patches, e: int):
    """Slots of an element's corners within its patch, two in a word."""
    return wp.vec4ui(patches.corner[0, e], patches.corner[1, e], patches.corner[2, e], patches.corner[3, e])


@cache
def load_functions(precision: str) -> tuple[Any, Any]:
    """Functions (an element's nodes relative to its first, as `hexahedron.load_function`; one node so)."""
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83
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
    def load_node(pool: wp.array(dtype=wp.vec3d), first: int, patches: Patches, e: int, a: int):
        word = patches.corner[a // 2, e]
        slot = int(wp.where(a % 2 == 0, word & wp.uint32(0xFFFF), word >> wp.uint32(16)))
        return difference(pool, first + slot, pool[first + int(patches.corner[0, e] & wp.uint32(0xFFFF))])

    return load_element, load_node


@wp.func
def places_of(patches: Patches, n: int, end: int):
    """Where the forces of slot n lie, two places in a word."""
    w = wp.vec4ui()
    if n < end:
        for k in range(4):
            w[k] = patches.places[k, n]
    return w


@cache
def sum_functions(precision: str) -> tuple[Any, Any]:
    """Functions that store the forces of a thread's element in shared memory, and that sum those of a patch."""
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83

    @wp.func
    def keep_forces(pool_out: wp.array(dtype=R), lane: int, f: mat83):
        """Component i of the force on corner a lies at (3 a + i) PATCH + lane."""
        for a in range(8):
            for i in range(3):
                pool_out[(3 * a + i) * wp.static(PATCH) + lane] = f[a, i]

    @wp.func
    def add(pool: wp.array(dtype=R), places: wp.uint32, total: vec3):
        """Adds the forces at two places, the low and the high half of a word."""
        low = int(places & wp.uint32(0xFFFF))
        high = int(places >> wp.uint32(16))
        if low != wp.static(NOWHERE):
            total += vec3(pool[low], pool[low + wp.static(PATCH)], pool[low + wp.static(2 * PATCH)])
        if high != wp.static(NOWHERE):
            total += vec3(pool[high], pool[high + wp.static(PATCH)], pool[high + wp.static(2 * PATCH)])
        return total

    @wp.func
    def sum_patch(
        pool: wp.array(dtype=R), patches: Patches, patch: int, lane: int, slot: int, force_out: wp.array(dtype=vec3)
    ):
        """Forces of a patch into its slots, when all threads have kept theirs."""
        n = patches.slot_start[patch] + lane
        end = patches.slot_start[patch + 1]
        w = places_of(patches, n, end)  # on its way while others still compute
        barrier()
        while n < end:
            coming = places_of(patches, n + wp.static(PATCH), end)
            total = vec3()
            for k in range(4):
                total = add(pool, w[k], total)
            force_out[slot + n] = total
            w = coming
            n += wp.static(PATCH)

    return keep_forces, sum_patch
