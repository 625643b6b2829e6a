"""Owns patches: the elements of a block in compact groups, each of which a GPU computes in one block of threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from warp_mca.elements.hexahedron import chunks
from warp_mca.geometry.boxes import cell_boxes

PATCH = 128  # elements of a patch, and threads of its block
SLOTS = {"mixed": 384, "float64": 304}  # that a patch may have, as far as shared memory holds them
SUMMED = 8  # forces that a slot sums at most
NOWHERE = 24 * PATCH  # behind the forces of all corners, where shared memory holds nothing but zeros
LOT = 1 << 13  # elements that are sorted at a time, where parts are smaller

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
            for lot in chunks(len(alike), max(1, LOT // int(length))):
                _cut(box, order, begin[alike[lot]], int(length), int(half[alike[0]]))
        begin, end = np.stack([begin, begin + half]).ravel(), np.stack([begin + half, end]).ravel()
    full = count // size * size
    order[:full].reshape(-1, size).sort(axis=1)  # neighbours stay neighbours: threads read what lies side by side
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
    """Patches of a block of elements, as `warp_mca.kernels.patch.Patches` has them on the device.

    Attributes:
        start: first element of each patch, and the end of the last, shape (patch_count + 1,), int32.
        slot_start: the same of its slots, one for each of its nodes, shape (patch_count + 1,), int32.
        node: of each slot, shape (slot_count,), int32.
        corner: slots of the corners of each element, counted from the first of its patch, two in a word, shape
            (corners / 2, element_count), uint32.
        places: where the first components of the forces of a slot lie in shared memory, two in a word and SUMMED at
            most, NOWHERE where there are fewer, shape (SUMMED / 2, slot_count), uint32.
    """

    start: Index
    slot_start: Index
    node: Index
    corner: NDArray[np.uint32]
    places: NDArray[np.uint32]

    def heads(self) -> Index:
        """First element, first slot, counts of both, (slots << 16) + elements, and number: shape (patch_count, 4)."""
        counts = (np.diff(self.slot_start) << 16) + np.diff(self.start)
        return np.column_stack([self.start[:-1], self.slot_start[:-1], counts, np.arange(len(counts))]).astype(np.int32)


def make_patches(conn: Index, ends: Sequence[int] = (), slots: int = SLOTS["mixed"]) -> Patches:
    """Patches of elements that stand in a compact order; those with too many nodes are halved.

    A node has a slot in each patch around it, and one more for every SUMMED corners that meet there.

    Args:
        conn: nodes of each element, shape (corners, element_count), int32.
        ends: where the elements of each scene of a batch end; each has patches of its own, as if it were alone.
        slots: that a patch may have.
    """
    count = conn.shape[1]
    ends = sorted({0, *ends, count})
    start = np.concatenate([*(np.arange(a, b, PATCH) for a, b in pairwise(ends)), [count]])
    lots = chunks(len(start) - 1, LOT // PATCH)
    made = [_patches(conn[:, start[a.start] : start[a.stop]], start[a.start : a.stop + 1], slots) for a in lots]
    starts, slot_starts = [part.start[:-1] for part in made], [np.diff(part.slot_start) for part in made]
    return Patches(
        start=np.append(np.concatenate(starts), count).astype(np.int32),
        slot_start=np.cumsum(np.concatenate([[0], *slot_starts])).astype(np.int32),
        node=np.concatenate([part.node for part in made]),
        corner=np.concatenate([part.corner for part in made], axis=1),
        places=np.concatenate([part.places for part in made], axis=1),
    )


def _patches(conn: Index, start: NDArray[np.int64], slots: int) -> Patches:
    """Patches of one range of elements; `start` counts from the first element of all."""
    corners, count = conn.shape
    bits = conn.size.bit_length()
    while True:
        patch = np.repeat(np.arange(len(start) - 1), np.diff(start))
        # one number for each corner, by patch, then node, then where the corner stands: quicker sorted than ranked
        key = ((patch << 32) + conn).ravel() << bits
        key += np.arange(conn.size)
        key.sort()
        corner = key & ((1 << bits) - 1)
        key >>= bits
        rank, head, slot = _slots(key)
        opened = key[head]
        slot_start = np.searchsorted(opened, np.arange(len(start)) << 32)
        large = np.flatnonzero(np.diff(slot_start) > slots)
        if not len(large):
            break
        start = np.sort(np.append(start, (start[large] + start[large + 1]) // 2))
    place = (3 * np.arange(corners)[:, None] * PATCH + (np.arange(count) + start[0] - start[patch])).ravel()
    places = np.full((len(opened), SUMMED), NOWHERE, dtype="<u2")
    places[slot, rank] = place[corner]
    local = np.empty(conn.size, dtype=np.int64)
    local[corner] = slot
    local = (local.reshape(conn.shape) - slot_start[patch]).astype("<u2")
    return Patches(
        start=start.astype(np.int32),
        slot_start=slot_start.astype(np.int32),
        node=(opened & 0xFFFFFFFF).astype(np.int32),
        corner=np.ascontiguousarray(local.T).view("<u4").T.copy(),
        places=places.view("<u4").T.copy(),
    )


def _slots(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Of sorted keys: the place of each among its equals, whether it opens a slot of SUMMED of them, and its slot."""
    begin = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    rank = np.arange(len(key)) - np.repeat(begin, np.diff(np.append(begin, len(key))))
    head = rank % SUMMED == 0
    return rank % SUMMED, head, np.cumsum(head) - 1
