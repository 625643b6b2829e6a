"""Owns what Warp leaves to CUDA: shared memory of a block, barriers, asynchronous copies, lanes.

None of it runs on a CPU.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch_layout import PATCH, SLOTS
from warp_mca.kernels.hardware.scalars import scalars

ROW = PATCH + 1  # one force component of all elements at one corner, and a zero behind them
FORCES = 24 * ROW
HEADS = 4  # patches whose heads are in shared memory: the present one, the next two, and one that is being copied


@wp.func_native("__syncthreads();")
def barrier():
    """Wait for all threads of the block."""
    ...


@wp.func_native("__syncwarp();")
def warp_barrier():
    """Wait for all lanes of the warp."""
    ...


@wp.func_native(f"__shared__ int pool[{PATCH + 1}]; return (unsigned long long)pool;")
def list_pool() -> wp.uint64:
    """Address of shared memory for a list of elements of a patch, which begins with its length."""
    ...


@wp.func_native(f"__shared__ int4 pool[{HEADS}]; return (unsigned long long)pool;")
def head_ring() -> wp.uint64:
    """Address of shared memory for the heads of the next patches of a block of threads."""
    ...


@cache
def slot_pools(precision: str) -> tuple[Any, Any, Any]:
    """Functions: addresses of shared memory for what each slot of a patch has.

    (Points of two patches, or their nodes; displacements of two, or positions and displacements of one; where the
    forces lie.)
    """
    slots = SLOTS[precision]
    point = "int4" if precision == "mixed" else "int"

    @wp.func_native(f"__shared__ {point} pool[{2 * slots}]; return (unsigned long long)pool;")
    def point_pool() -> wp.uint64: ...

    @wp.func_native(f"__shared__ double pool[{6 * slots}]; return (unsigned long long)pool;")
    def vector_pool() -> wp.uint64: ...

    @wp.func_native(f"__shared__ int2 pool[{slots}]; return (unsigned long long)pool;")
    def places_pool() -> wp.uint64: ...

    return point_pool, vector_pool, places_pool


@cache
def shared_functions(precision: str) -> tuple[Any, Any]:
    """Functions (address of shared memory for the forces of a patch; value of the lane that differs in `mask`)."""
    R = scalars(precision).real
    name = "float" if precision == "mixed" else "double"

    @wp.func_native(f"__shared__ {name} pool[{FORCES}]; return (unsigned long long)pool;")
    def force_pool() -> wp.uint64: ...

    @wp.func_native("return __shfl_xor_sync(0xffffffffu, value, mask);")
    def exchange(value: R, mask: int) -> R: ...

    return force_pool, exchange


@cache
def group_exchange(lanes: int) -> Any:
    """The function that gives the value of the lane that differs in `mask`, among `lanes` that go the same way.

    Other lanes of the warp may go another one.
    """
    group = f"{(1 << lanes) - 1}u << (threadIdx.x & {32 - lanes}u)"

    @wp.func_native(f"return __shfl_xor_sync({group}, value, mask);")
    def exchange(value: wp.float64, mask: int) -> wp.float64: ...

    return exchange


def _begin_copy(size: int, to: str, of: str) -> str:
    target = f'"r"((unsigned)__cvta_generic_to_shared({to}))'
    return f'asm volatile("cp.async.ca.shared.global [%0], [%1], {size};" :: {target}, "l"({of}) : "memory");'


@wp.func_native("\n".join(_begin_copy(8, f"&pool_out.data[slot].c[{i}]", f"&value.data[k].c[{i}]") for i in range(3)))
def copy_vector(value: wp.array(dtype=wp.vec3d), k: int, slot: int, pool_out: wp.array(dtype=wp.vec3d)):
    """Begin to copy an entry into shared memory, past the registers."""
    ...


@wp.func_native(_begin_copy(8, "&pool_out.data[slot]", "&value.data[k]"))
def copy_pair(value: wp.array(dtype=wp.vec2i), k: int, slot: int, pool_out: wp.array(dtype=wp.vec2i)):
    """Begin to copy an entry into shared memory, past the registers."""
    ...


@cache
def ahead_functions(precision: str, size: int) -> tuple[Any, Any]:
    """Functions of what an element reads ahead, `size` rows, in the place of its forces.

    (Begin to copy rows of entry e from `first` on; read row k once the copies have arrived.) Thread and element of the
    patch have the same number, and every thread copies and reads its own.
    """
    R = scalars(precision).real
    name, width = ("float", 4) if precision == "mixed" else ("double", 8)
    to, of = f"({name}*)pool + {{0}} * {ROW} + threadIdx.x", "wp::address(value, first + {0}, e)"

    @wp.func_native("\n".join(_begin_copy(width, to.format(k), of.format(k)) for k in range(size)))
    def copy_ahead(value: wp.array2d(dtype=R), first: int, e: int, pool: wp.uint64): ...

    @wp.func_native(f"return (({name}*)pool)[k * {ROW} + threadIdx.x];")
    def read_ahead(pool: wp.uint64, k: int) -> R: ...

    return copy_ahead, read_ahead


@wp.func_native(_begin_copy(16, "&pool_out.data[slot]", "&value.data[k]"))
def copy_words(value: wp.array(dtype=wp.vec4i), k: int, slot: int, pool_out: wp.array(dtype=wp.vec4i)):
    """Begin to copy an entry into shared memory, past the registers."""
    ...


@wp.func_native(_begin_copy(4, "&pool_out.data[slot]", "&value.data[k]"))
def copy_index(value: wp.array(dtype=wp.int32), k: int, slot: int, pool_out: wp.array(dtype=wp.int32)):
    """Begin to copy an entry into shared memory, past the registers."""
    ...


@wp.func_native("int4 a = ((const int4*)pool.data)[slot]; return wp::vec_t<3, int>(a.x, a.y, a.z);")
def place_of(pool: wp.array(dtype=wp.vec4i), slot: int) -> wp.vec3i:
    """Read a point's place on its grid in one instruction."""
    ...


@wp.func_native("return __int_as_float(exponent << 23);")
def power_of_two(exponent: int) -> wp.float32:
    """2^(exponent - 127)."""
    ...


@wp.func_native('asm volatile("cp.async.wait_all;" ::: "memory");')
def wait_for_copies():
    """Wait until the copies that this thread began have arrived."""
    ...


@cache
def row_functions(precision: str, size: int) -> tuple[Any, Any]:
    """Functions that read and write `size` entries of a column, which lie side by side, 16 bytes at a time.

    Written values are the first to leave the cache, because this step does not read them again.
    """
    R = scalars(precision).real
    name, width = ("float", 4) if precision == "mixed" else ("double", 2)
    row = wp.types.vector(size, R)
    begin = f"{name}{width}* part = ({name}{width}*)wp::address({{}}, first, column);"
    parts = [range(k, k + width) for k in range(0, size, width)]
    read = "".join(
        f"{{ {name}{width} w = part[{k}]; "
        + "".join(f"row[{n}] = w.{c}; " for n, c in zip(part, "xyzw", strict=False))
        + "} "
        for k, part in enumerate(parts)
    )
    write = "".join(
        f"__stcs(&part[{k}], make_{name}{width}({', '.join(f'row[{n}]' for n in part)})); "
        for k, part in enumerate(parts)
    )

    @wp.func_native(f"wp::vec_t<{size}, {name}> row; {begin.format('value')} {read} return row;")
    def read_row(value: wp.array2d(dtype=R), first: int, column: int) -> row: ...

    @wp.func_native(f"{begin.format('value_out')} {write}")
    def write_row(row: row, first: int, column: int, value_out: wp.array2d(dtype=R)): ...

    return read_row, write_row
