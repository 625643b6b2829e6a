"""Owns the way of arrays from the device to the host, which the device never waits for.

Copies go to pinned memory behind the work queued before them, so that the host reads one set while the device goes on.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Generic, TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

Key = TypeVar("Key")
ALIGN = 64  # of arrays in a block [byte]
SLOTS = 2  # sets under way at least: one that is copied, one that the host reads


@dataclass
class _Slot(Generic[Key]):
    """Host arrays of one set, and when they are complete."""

    arrays: dict[Key, wp.array]
    event: wp.Event | None
    tag: int = 0
    sent: tuple[Key, ...] = ()


class Transfer(Generic[Key]):
    """Sets of device arrays on their way to the host, received in the order in which they were sent."""

    def __init__(self, arrays: Mapping[Key, wp.array], device: str, most: int = SLOTS) -> None:
        """Allocate the host's copies of `arrays`, pinned where `device` is a GPU, for as many sets as `most`."""
        where = wp.get_device(device)
        self.source = dict(arrays)
        self.pending: deque[_Slot[Key]] = deque()
        copies = _copies(self.source, most, where.is_cuda)
        self.free = [_Slot(copy, wp.Event(where) if where.is_cuda else None) for copy in copies]

    @property
    def full(self) -> bool:
        """Whether one must be received before the next can be sent."""
        return not self.free

    @property
    def arrived(self) -> bool:
        """Whether one can be received without waiting."""
        return bool(self.pending) and (self.pending[0].event is None or bool(self.pending[0].event.is_complete))

    def carries(self, arrays: Mapping[Key, wp.array]) -> bool:
        """Whether it can bring these arrays, and nothing is under way: pinned memory takes long to allocate."""
        alike = self.source.keys() == arrays.keys() and all(self.source[key] is arrays[key] for key in arrays)
        return alike and not self.pending

    def send(self, tag: int, keys: Iterable[Key] | None = None, rows: Mapping[Key, int] = MappingProxyType({})) -> None:
        """Queue copies of the arrays `keys`, all by default, as they are once the work queued so far is done.

        Of arrays in `rows` only their first entries are copied, so many and one at least.
        """
        slot = self.free.pop()
        slot.tag, slot.sent = tag, tuple(self.source if keys is None else keys)
        for key in slot.sent:
            source = self.source[key]
            count = rows[key] * math.prod(source.shape[1:]) if key in rows else source.size
            if count:
                wp.copy(slot.arrays[key], source, count=count)
        if slot.event:
            wp.get_stream(slot.event.device).record_event(slot.event)
        self.pending.append(slot)

    def receive(self) -> tuple[int, dict[Key, NDArray]]:
        """Wait for the oldest set: its tag, and its arrays, which hold until the next `send`."""
        slot = self.pending.popleft()
        if slot.event:
            wp.synchronize_event(slot.event)
        self.free.insert(0, slot)
        return slot.tag, {key: np.asarray(slot.arrays[key].numpy()) for key in slot.sent}


def _copies(arrays: Mapping[Key, wp.array], count: int, pinned: bool) -> list[dict[Key, wp.array]]:
    """Host arrays like `arrays`, so many sets: parts of one block, because each allocation of pinned memory is slow."""
    sizes = {key: -(-array.capacity // ALIGN) * ALIGN for key, array in arrays.items()}
    block = wp.empty(count * sum(sizes.values()) // 4, dtype=float, device="cpu", pinned=pinned)
    at, sets = block.ptr or 0, []
    for _ in range(count):
        found = {}
        for key, array in arrays.items():
            found[key] = wp.array(ptr=at, dtype=array.dtype, shape=array.shape, device="cpu", pinned=pinned)
            found[key].block = block  # lives as long
            at += sizes[key]
        sets.append(found)
    return sets
