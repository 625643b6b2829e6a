"""Owns how a thread of a patch reads its element, and how the forces of all elements are summed.

None of it runs on a CPU.
"""

from functools import cache
from typing import Any

import warp as wp

from warp_mca.kernels.elements.patch import POINT, SLOTS_OF_THREAD, Patches, slot_count
from warp_mca.kernels.elements.patch_layout import MATERIAL_BITS, NOWHERE, PATCH, SECOND_SLOT, SLOT_BITS, SLOTS
from warp_mca.kernels.elements.patterns import pattern_functions, pattern_sum_function
from warp_mca.kernels.hardware.block import from_start
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.kernels.hardware.shared_memory import ROW, place_of, power_of_two

wp.set_module_options({"enable_backward": False})


@wp.func
def lower(word: wp.uint32):
    """Slot of the first corner of a word."""
    return int(word & wp.uint32((1 << SLOT_BITS) - 1))


@wp.func
def upper(word: wp.uint32):
    """Slot of the second corner of a word."""
    return int(word >> wp.uint32(SECOND_SLOT))


@wp.func
def material_of(first: wp.uint32, second: wp.uint32):
    """Material of an element, by its first words."""
    mask = wp.uint32((1 << MATERIAL_BITS) - 1)
    low = (first >> wp.uint32(SLOT_BITS)) & mask
    return int(low + (((second >> wp.uint32(SLOT_BITS)) & mask) << wp.uint32(MATERIAL_BITS)))


@cache
def load_functions(precision: str) -> tuple[Any, Any, Any]:
    """Three functions: corners relative to corner 0 [m]; displacements likewise; both for two corners."""
    t = scalars(precision)
    R, vec3, mat83, slots = t.real, t.vec3, t.mat83, SLOTS[precision]
    point, mixed = POINT[precision], precision == "mixed"
    # Fast math would also flush subnormal numbers, in three instructions for each number.
    convert = 'float f; asm("cvt.rn.f32.f64 %0, %1;" : "=f"(f) : "d"(value)); return f;'

    @wp.func_native(convert if precision == "mixed" else "return value;")
    def rounded(value: wp.float64) -> R: ...

    @wp.func
    def difference(pool: wp.array(dtype=wp.vec3d), slot: int, origin: wp.vec3d):
        d = pool[slot] - origin
        return vec3(rounded(d[0]), rounded(d[1]), rounded(d[2]))

    @wp.func
    def point_difference(
        points: wp.array(dtype=point), pool: wp.array(dtype=wp.vec3d), slot: int, origin: int, first: int, exponent: int
    ):
        if wp.static(mixed):
            d = place_of(points, first + slot) - place_of(points, first + origin)  # exact: the next operation rounds
            return power_of_two(exponent) * vec3(R(d[0]), R(d[1]), R(d[2]))
        return difference(pool, slot, pool[origin])

    @wp.func
    def load_points(
        points: wp.array(dtype=point), pool: wp.array(dtype=wp.vec3d), corners: wp.vec4ui, first: int, exponent: int
    ):
        local = mat83()
        origin = lower(corners[0])
        for k in range(4):
            if k > 0:
                local[2 * k] = point_difference(points, pool, lower(corners[k]), origin, first, exponent)
            local[2 * k + 1] = point_difference(points, pool, upper(corners[k]), origin, first, exponent)
        return local

    @wp.func
    def displacements_of(first: int):
        """Where displacements of the patch begin whose points begin at `first`."""
        if wp.static(mixed):
            return first
        return wp.static(slots)

    @wp.func
    def load_displacements(pool: wp.array(dtype=wp.vec3d), corners: wp.vec4ui, first: int):
        local = mat83()
        begin = displacements_of(first)
        origin = pool[begin + lower(corners[0])]
        for k in range(4):
            if k > 0:
                local[2 * k] = difference(pool, begin + lower(corners[k]), origin)
            local[2 * k + 1] = difference(pool, begin + upper(corners[k]), origin)
        return local

    @wp.func
    def load_corners(
        points: wp.array(dtype=point),
        pool: wp.array(dtype=wp.vec3d),
        patches: Patches,
        e: int,
        a: int,
        first: int,
        exponent: int,
    ):
        """Point and displacement of corner a, then of a + 4."""
        begin = displacements_of(first)
        origin = lower(patches.corner[0, e])
        shift = wp.uint32(wp.static(SECOND_SLOT) * (a & 1))
        low = lower(patches.corner[a >> 1, e] >> shift)
        top = lower(patches.corner[(a >> 1) + 2, e] >> shift)
        u = pool[begin + origin]
        return (
            point_difference(points, pool, low, origin, first, exponent),
            difference(pool, begin + low, u),
            point_difference(points, pool, top, origin, first, exponent),
            difference(pool, begin + top, u),
        )

    return load_points, load_displacements, load_corners


@cache
def pattern_load_functions(precision: str) -> tuple[Any, Any]:
    """Functions that load pattern sums of an element's points and displacements [m], see `patterns`."""
    t = scalars(precision)
    R, mat73, point = t.real, t.mat73, POINT[precision]
    to_patterns, _ = pattern_functions(precision)
    sums_of_places = pattern_sum_function(wp.int32)
    places8 = wp.types.matrix((8, 3), wp.int32)
    load_points, load_displacements, _ = load_functions(precision)

    @wp.func
    def load_displacement_patterns(pool: wp.array(dtype=wp.vec3d), corners: wp.vec4ui, first: int):
        return to_patterns(load_displacements(pool, corners, first))

    @wp.func
    def load_patterns(
        points: wp.array(dtype=point), pool: wp.array(dtype=wp.vec3d), corners: wp.vec4ui, first: int, exponent: int
    ):
        if wp.static(precision == "mixed"):
            x = places8()
            for k in range(4):
                x[2 * k] = place_of(points, first + lower(corners[k]))
                x[2 * k + 1] = place_of(points, first + upper(corners[k]))
            sums = sums_of_places(x)  # exact, because these are sums of integers
            p = mat73()
            for k in range(7):
                for i in range(3):
                    p[k, i] = power_of_two(exponent) * R(sums[k, i])
            return p
        return to_patterns(load_points(points, pool, corners, first, exponent))

    return load_patterns, load_displacement_patterns


@cache
def sum_functions(precision: str) -> tuple[Any, Any, Any, Any]:
    """Four functions, which sum the forces of a patch.

    They prepare shared memory; store the forces of a thread's element there; sum those of a patch; sum those of a slot.

    Component i of the force on corner a of a thread's element lies in row 3 a + i, in the thread's column.
    """
    t = scalars(precision)
    R, vec3, mat83 = t.real, t.vec3, t.mat83

    @wp.func
    def keep_forces(pool_out: wp.array(dtype=R), lane: int, f: mat83):
        for a in range(8):
            for i in range(3):
                pool_out[(3 * a + i) * wp.static(ROW) + lane] = f[a, i]

    @wp.func
    def clear_nowhere(pool_out: wp.array(dtype=R), lane: int):
        if lane < 24:
            pool_out[lane * wp.static(ROW) + wp.static(NOWHERE)] = R(0.0)

    @wp.func
    def kept(pool: wp.array(dtype=R), a: int, place: int):
        """The force on corner a of the element that the low byte of a word of places names."""
        first = 3 * a * wp.static(ROW) + (place & 0xFF)
        return vec3(pool[first], pool[first + wp.static(ROW)], pool[first + wp.static(2 * ROW)])

    @wp.func
    def sum_slot(pool: wp.array(dtype=R), w: wp.vec2i):
        total = kept(pool, 0, w[0])
        for a in range(1, 8):
            total = total + kept(pool, a, w[a // 4] >> (8 * (a % 4)))
        return total

    @wp.func
    def sum_patch(
        pool: wp.array(dtype=R),
        places: wp.array(dtype=wp.vec2i),
        head: wp.vec4i,
        lane: int,
        slot: int,
        force_out: wp.array(dtype=vec3),
    ):
        """Sum the forces of a patch into its slots, after all threads stored theirs."""
        for k in range(wp.static(SLOTS_OF_THREAD)):
            n = lane + k * wp.static(PATCH)
            if n < slot_count(head):
                force_out[from_start(slot + head[1] + n)] = sum_slot(pool, places[n])

    return clear_nowhere, keep_forces, sum_patch, sum_slot
