"""Owns patches: the elements of a block in compact groups, each of which a GPU computes in one block of threads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

PATCH = 128  # elements of a patch, and threads of its block
SLOTS = 304  # that a patch may have: as many as shared memory holds in float64
SUMMED = 8  # forces that a slot sums at most
NOWHERE = 24 * PATCH  # behind the forces of all corners, where shared memory holds nothing but zeros

Array = NDArray[np.float64]
Index = NDArray[np.int32]


def compact_order(x: Array, size: int) -> NDArray[np.int64]:
    """An order in which every `size` successive elements lie close together, by recursive bisection.

    Args:
        x: corners [m], shape (element_count, corners, 3), float64.
        size: elements of a group; all groups are full but the last.

    Returns:
        Elements in their new order, shape (element_count,).
    """
    lower, upper = x.min(axis=1), x.max(axis=1)
    centre, extent = 0.5 * (lower + upper), upper - lower
    order = np.arange(len(x))
    stack = [(0, len(x))]
    while stack:
        begin, end = stack.pop()
        if end - begin <= size:
            order[begin:end].sort()  # neighbours stay neighbours: threads read what lies side by side
            continue
        part = order[begin:end]
        key, middle = _layers(centre[part], extent[part].mean(axis=0)), size * round((end - begin) / size / 2)
        order[begin:end] = part[np.argpartition(key, middle)]
        stack += [(begin, begin + middle), (begin + middle, end)]
    return order


def _layers(centre: Array, size: Array) -> Array:
    """Keys that cut across the longest direction, in elements, and a layer of that across the next."""
    place = (centre - centre.min(axis=0)) / size
    first, second, third = np.argsort(place.max(axis=0))[::-1]
    count = place.max(axis=0) + 2.0
    layer = np.rint(place[:, first]) * count[second] + np.rint(place[:, second])
    return layer * count[third] + place[:, third]


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


def _slots(key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.int64]]:
    """Of sorted keys: the place of each among its equals, whether it opens a slot of SUMMED of them, and its slot."""
    begin = np.flatnonzero(np.append(True, key[1:] != key[:-1]))
    rank = np.arange(len(key)) - np.repeat(begin, np.diff(np.append(begin, len(key))))
    head = rank % SUMMED == 0
    return rank % SUMMED, head, np.cumsum(head) - 1


def make_patches(conn: Index, ends: Sequence[int] = ()) -> Patches:
    """Patches of elements that stand in a compact order; those with too many nodes are halved.

    A node has a slot in each patch around it, and one more for every SUMMED corners that meet there.

    Args:
        conn: nodes of each element, shape (corners, element_count), int32.
        ends: where the elements of each scene of a batch end; each has patches of its own, as if it were alone.
    """
    corners, count = conn.shape
    ends = sorted({0, *ends, count})
    span = int(conn.max()) + 1
    start = np.concatenate([*(np.arange(a, b, PATCH) for a, b in pairwise(ends)), [count]])
    while True:
        patch = np.repeat(np.arange(len(start) - 1), np.diff(start))
        key = (patch * span + conn).ravel()
        order = np.argsort(key, kind="stable")
        rank, head, slot = _slots(key[order])
        opened = key[order][head]
        slot_start = np.searchsorted(opened, np.arange(len(start)) * span)
        large = np.flatnonzero(np.diff(slot_start) > SLOTS)
        if not len(large):
            break
        start = np.sort(np.append(start, (start[large] + start[large + 1]) // 2))
    place = (3 * np.arange(corners)[:, None] * PATCH + (np.arange(count) - start[patch])).ravel()
    places = np.full((len(opened), SUMMED), NOWHERE, dtype="<u2")
    places[slot, rank] = place[order]
    corner = np.empty(conn.size, dtype=np.int64)
    corner[order] = slot
    corner = (corner.reshape(conn.shape) - slot_start[patch]).astype("<u2")
    return Patches(
        start=start.astype(np.int32),
        slot_start=slot_start.astype(np.int32),
        node=(opened % span).astype(np.int32),
        corner=np.ascontiguousarray(corner.T).view("<u4").T.copy(),
        places=places.view("<u4").T.copy(),
    )
