"""Owns patches: the elements of a block in compact groups, each of which a GPU computes in one block of threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.chunks import chunks
from warp_mca.geometry.boxes import cell_boxes
from warp_mca.kernels.elements.patch_layout import MATERIAL_BITS, NOWHERE, PATCH, SECOND_SLOT, SLOT_BITS, SLOTS

GRID = 28  # bits of a position within its patch: with a sign, and so that sums of eight corners just fit 32
LARGEST = 128.0  # extent of a patch over that of its smallest element, where the grid rounds 4 times as much as float32
SORT_CHUNK = 1 << 13  # elements sorted in one batch, where parts are smaller than this

Array = NDArray[np.float64]
Index = NDArray[np.int32]


def compact_order(X: Array, conn: Index, size: int) -> Index:
    """An order in which every `size` successive elements lie close together, by recursive bisection.

    All parts of a level are cut before those of the next, and small parts of one length together: there are thousands.

    Args:
        X: positions of the nodes [m], shape (node_count, 3), float64.
        conn: nodes of each element, shape (element_count, corners), int32.
        size: elements of a group; all groups are full but the last.

    Returns:
        Elements in their new order, shape (element_count,), int32.
    """
    count = len(conn)
    lower, upper = cell_boxes(X, conn)
    box, order = np.concatenate([lower, upper]), np.arange(count, dtype=np.int32)
    box[:3] += upper
    box[:3] *= 0.5
    box[3:] -= lower
    del lower, upper
    begin, end = np.array([0]), np.array([count])
    while len(begin):
        large = end - begin > size
        begin, end = begin[large], end[large]
        half = size * np.rint((end - begin) / size / 2).astype(np.int64)
        for length in np.unique(end - begin):
            alike = np.flatnonzero(end - begin == length)
            for lot in chunks(len(alike), max(1, SORT_CHUNK // int(length))):
                _cut(box, order, begin[alike[lot]], int(length), int(half[alike[0]]))
        begin, end = np.stack([begin, begin + half]).ravel(), np.stack([begin + half, end]).ravel()
    full = count // size * size
    order[:full].reshape(-1, size).sort(axis=1)  # adjacent elements stay adjacent: contiguous memory
    order[full:].sort()
    return order


def _cut(box: Array, order: Index, begin: NDArray[np.int64], length: int, half: int) -> None:
    """Sort parts of `length` elements so that the first `half` of each lie on one side of the others."""
    if len(begin) == 1:  # a view will do
        part = slice(begin[0], begin[0] + length)
        rank = np.argpartition(_layers(box[:, None, part])[0], half)
        for row in (*box, order):
            row[part] = row[part][rank]
        return
    place = begin[:, None] + np.arange(length)
    rank = np.argpartition(_layers(np.take(box, place, axis=1)), half, axis=1)
    ranked = np.take_along_axis(place, rank, axis=1)
    box[:, place], order[place] = np.take(box, ranked, axis=1), order[ranked]


def _layers(box: Array) -> Array:
    """Keys that cut across the longest direction, in elements, and a layer of that across the next.

    Args:
        box: centres and extents of the boxes around the elements of each part [m], shape (6, part_count,
            element_count).
    """
    centre, size, part = box[:3], box[3:].mean(axis=2), np.arange(box.shape[1])
    low = centre.min(axis=2)
    span = (centre.max(axis=2) - low) / size
    # directions that differ by rounding count as equal, so that cubes are cut alike on every machine
    third, second, first = np.argsort(np.round(span, 6), axis=0, kind="stable")

    def place(axis: NDArray[np.int64]) -> Array:
        return (centre[axis, part] - low[axis, part][:, None]) / size[axis, part][:, None]

    layer = np.rint(place(first)) * (span[second, part] + 2.0)[:, None] + np.rint(place(second))
    return layer * (span[third, part] + 2.0)[:, None] + place(third)


@dataclass(frozen=True)
class Patches:
    """Patches of a block of elements, as `warp_mca.kernels.elements.patch.Patches` has them on the device.

    Attributes:
        start: first element of each patch, and the end of the last, shape (patch_count + 1,), int32.
        slot_start: the same of its slots, one for each of its nodes, shape (patch_count + 1,), int32.
        node: of each slot, shape (slot_count,), int32.
        corner: slots of the corners of each element, counted from the first of its patch, shape (corners,
            element_count), uint16.
        places: element of the patch whose corner of each number lies in a slot, NOWHERE where none does, shape
            (slot_count, corners), uint8.
    """

    start: Index
    slot_start: Index
    node: Index
    corner: NDArray[np.uint16]
    places: NDArray[np.uint8]

    def heads(self, exponent: Index, level_ends: Sequence[int] = ()) -> Index:
        """Header of each patch for its block of threads, shape (patch_count, 4), int32.

        First element, first slot, (level << 25) + (slots << 16) + (exponent << 8) + elements, and number.

        Args:
            exponent: of each patch's grid, as `grid_points` has it, shape (patch_count,), int32.
            level_ends: of the elements, as in `Block`.
        """
        level = np.searchsorted(np.asarray(level_ends[:-1], dtype=np.int64), self.start[:-1], side="right")
        counts = (level << 25) + (np.diff(self.slot_start) << 16) + (exponent << 8) + np.diff(self.start)
        return np.column_stack([self.start[:-1], self.slot_start[:-1], counts, np.arange(len(counts))]).astype(np.int32)

    def words(self, material: Index) -> NDArray[np.uint32]:
        """Corners two in a word, with the material's number; see SLOT_BITS.

        Args:
            material: of each element, shape (element_count,), int32.

        Returns:
            Words, shape (corners / 2, element_count), uint32.
        """
        words = self.corner[0::2].astype(np.uint32)
        words |= self.corner[1::2].astype(np.uint32) << np.uint32(SECOND_SLOT)
        for k in range(2):
            part = (material >> k * MATERIAL_BITS) & ((1 << MATERIAL_BITS) - 1)
            words[k] |= part.astype(np.uint32) << np.uint32(SLOT_BITS)
        return words


def grid_points(X: Array, patches: Patches) -> tuple[Index, Index]:
    """Positions of nodes on a grid of each patch, which rounds about as float32 does beside an element.

    Returns:
        (Places from the middle of the patch and node of each slot, shape (slot_count, 4), int32; exponents of the
        patches, shape (patch_count,), int32: a grid's spacing is 2^(exponent - 127) [m], whose float32 has these bits.)
    """
    first, count = patches.slot_start[:-1], np.diff(patches.slot_start)
    points = np.empty((len(patches.node), 4), dtype=np.int32)
    points[:, 3] = patches.node
    lower, upper = np.empty((2, 3, len(first)))
    for axis in range(3):
        x = X[patches.node, axis]
        lower[axis], upper[axis] = np.minimum.reduceat(x, first), np.maximum.reduceat(x, first)
    half = np.maximum(0.5 * (1.0 + 1e-8) * (upper - lower).max(axis=0), 2.0**-60)  # without its last lines sums fit
    exponent = np.frexp(half)[1] - GRID
    middle, unit = 0.5 * (lower + upper), np.repeat(np.ldexp(1.0, -exponent), count)
    for axis in range(3):
        points[:, axis] = np.rint((X[patches.node, axis] - np.repeat(middle[axis], count)) * unit)
    return points, (exponent + 127).astype(np.int32)


def make_patches(
    conn: Index,
    ends: Sequence[int] = (),
    slots: int = SLOTS["mixed"],
    X: Array | None = None,
    size: int = PATCH,
    halved: int = 0,
) -> Patches:
    """Patches of elements that stand in a compact order; those with too many nodes are halved.

    So are those that are too large for one of their elements, where there will be grids.

    A node has a slot in each patch around it: as many as corners of one number meet there, one in regular meshes.

    Args:
        conn: nodes of each element, shape (corners, element_count), int32.
        ends: where the elements of each scene of a batch end; each has patches of its own, as if it were alone.
        slots: that a patch may have.
        X: positions of the nodes [m], shape (node_count, 3), float64, where `grid_points` will be called.
        size: elements of a patch at most.
        halved: first elements, of which patches hold half as many.
    """
    count = conn.shape[1]
    ends = sorted({0, *ends, count})
    sizes = [size // 2 if end <= halved else size for end in ends[1:]]
    start = np.concatenate([*(np.arange(a, b, s) for (a, b), s in zip(pairwise(ends), sizes, strict=True)), [count]])
    lots = chunks(len(start) - 1, SORT_CHUNK // PATCH)
    made = []
    for lot in lots:
        part = slice(start[lot.start], start[lot.stop])
        made.append(_patches(conn[:, part], start[lot.start : lot.stop + 1], slots, X))
    starts, slot_starts = [part.start[:-1] for part in made], [np.diff(part.slot_start) for part in made]
    return Patches(
        start=np.append(np.concatenate(starts), count).astype(np.int32),
        slot_start=np.cumsum(np.concatenate([[0], *slot_starts])).astype(np.int32),
        node=np.concatenate([part.node for part in made]),
        corner=np.concatenate([part.corner for part in made], axis=1),
        places=np.concatenate([part.places for part in made]),
    )


def _patches(conn: Index, start: NDArray[np.int64], slots: int, X: Array | None) -> Patches:
    """Patches of one range of elements; `start` counts from the first element of all."""
    corners, count = conn.shape
    boxes = cell_boxes(X, conn.T) if X is not None else None
    bits = conn.size.bit_length()
    while True:
        patch = np.repeat(np.arange(len(start) - 1), np.diff(start))
        # one number for each corner, by patch, then node, then where the corner stands: quicker sorted than ranked
        key = ((patch << 32) + conn).ravel() << bits
        key += np.arange(conn.size)
        key.sort()
        corner = key & ((1 << bits) - 1)
        key >>= bits
        opened, slot = _slots(key, corner // count)
        slot_start = np.searchsorted(opened, np.arange(len(start)) << 32)
        too_large = np.diff(slot_start) > slots
        if boxes:
            too_large |= _uneven(*boxes, start[:-1] - start[0])
        large = np.flatnonzero(too_large)
        if not len(large):
            break
        start = np.sort(np.append(start, (start[large] + start[large + 1]) // 2))
    number, element = np.divmod(corner, count)
    places = np.full((len(opened), corners), NOWHERE, dtype=np.uint8)
    places[slot, number] = element + start[0] - start[patch[element]]
    local = np.empty(conn.shape, dtype=np.uint16)
    local[number, element] = slot - slot_start[patch[element]]
    return Patches(
        start=start.astype(np.int32),
        slot_start=slot_start.astype(np.int32),
        node=(opened & 0xFFFFFFFF).astype(np.int32),
        corner=local,
        places=places,
    )


def _uneven(lower: Array, upper: Array, start: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether an element of a patch is so small beside it that the patch's grid would show in its forces.

    Args:
        lower, upper: boxes around the elements [m], shape (3, element_count).
        start: first element of each patch, shape (patch_count,).
    """
    smallest = np.minimum.reduceat((upper - lower).max(axis=0), start)
    extent = np.maximum.reduceat(upper, start, axis=1) - np.minimum.reduceat(lower, start, axis=1)
    return extent.max(axis=0) > LARGEST * smallest


def _slots(key: NDArray[np.int64], number: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Of sorted keys with the numbers of their corners, sorted too: key of each slot, and slot of each corner."""
    opened = np.append(True, key[1:] != key[:-1])
    again = np.append(False, ~opened[1:] & (number[1:] == number[:-1]))
    if not again.any():
        return key[opened], np.cumsum(opened) - 1
    group = np.cumsum(opened) - 1
    several = np.zeros(group[-1] + 1, dtype=bool)
    several[group[again]] = True
    where = np.flatnonzero(several[group])  # few: of nodes at which corners of one number meet
    begin = np.flatnonzero(~again[where])
    rank = np.arange(len(where)) - np.repeat(begin, np.diff(np.append(begin, len(where))))
    order = np.lexsort([rank, key[where]])
    opened[where[1:]] |= rank[order][1:] != rank[order][:-1]
    slot = np.cumsum(opened) - 1
    slot[where[order]] = slot[where]
    return key[opened], slot
