"""Owns which bodies a general contact keeps apart, and the springs of a slave node that each body near it gets.

In a pass of a listed contact the tables are empty: all of its faces may meet all of its slaves.
"""

import warp as wp


@wp.struct
class Pairs:
    """Bodies of a general contact, numbered within their scene.

    Attributes:
        row: first entry of the body of each slave node in `factor`, shape (slave_count,), int32.
        own: body of each slave node, shape (slave_count,), int32.
        body: of each face, shape (face_count,), int32.
        factor: of the stiffness of springs between two bodies, 0 where they do not meet [-], those of the first body of
            the first scene with all others first, float64.
        barred_offset, barred: faces of its own body that a slave node never meets, compressed rows in
            ascending order, int32.
        slot: body that each row of springs of a slave node belongs to, or -1; shape (slave_count, slot_count), int32.
            Empty where a node has springs for one body alone.
    """

    row: wp.array(dtype=wp.int32)
    own: wp.array(dtype=wp.int32)
    body: wp.array(dtype=wp.int32)
    factor: wp.array(dtype=wp.float64)
    barred_offset: wp.array(dtype=wp.int32)
    barred: wp.array(dtype=wp.int32)
    slot: wp.array2d(dtype=wp.int32)


@wp.func
def pair_factor(pairs: Pairs, s: int, f: int) -> wp.float64:
    """Factor of the stiffness between slave node s and face f [-]; 0 where their bodies do not meet."""
    if pairs.factor.shape[0] == 0:
        return wp.float64(1.0)
    return pairs.factor[pairs.row[s] + pairs.body[f]]


@wp.func
def same_solid(pairs: Pairs, f: int, g: int) -> bool:
    """Whether faces f and g belong to one body."""
    if pairs.factor.shape[0] == 0:
        return True
    return pairs.body[f] == pairs.body[g]


@wp.func
def may_meet(pairs: Pairs, s: int, f: int) -> bool:
    """Whether slave node s may touch face f: of another body, or of its own beyond its neighbourhood."""
    if pairs.factor.shape[0] == 0:
        return True
    if pair_factor(pairs, s, f) == wp.float64(0.0):
        return False
    if pairs.own[s] == pairs.body[f]:
        low, end = int(pairs.barred_offset[s]), pairs.barred_offset[s + 1]
        high = int(end)
        while low < high:
            middle = (low + high) // 2
            if pairs.barred[middle] < f:
                low = middle + 1
            else:
                high = middle
        return low == end or pairs.barred[wp.min(low, end - 1)] != f
    return True


@wp.func
def slot_of(pairs: Pairs, s: int, body: int) -> int:
    """Row of springs that slave node s has for a body; the last one if it has none."""
    found = pairs.slot.shape[1] - 1
    for q in range(pairs.slot.shape[1] - 1):
        if pairs.slot[s, q] == body:
            found = q
    return found


@wp.func
def spring_of(pairs: Pairs, s: int, f: int, side: int, sides: int) -> int:
    """Spring of slave node s, which has one for each of `sides`, for face f on this `side` of its body."""
    if pairs.slot.shape[0] == 0:
        return sides * s + side
    return sides * s + sides // pairs.slot.shape[1] * slot_of(pairs, s, pairs.body[f]) + side


@wp.func
def neighbours_spring(pairs: Pairs, s: int, e: int, other: int, sides: int) -> int:
    """Spring of slave node `other` for the side of a body to which spring e of node s belongs; a body has `sides`."""
    if pairs.slot.shape[0] == 0:
        return sides * other + e - sides * s
    slots = pairs.slot.shape[1]
    slot = slot_of(pairs, other, pairs.slot[s, e // sides - slots * s])
    return sides * (slots * other + slot) + e % sides
