"""Owns the stress along the paths of a scene, row by row, as its records arrive."""

from __future__ import annotations

from contextlib import suppress
from threading import Thread

import numpy as np
from numpy.typing import NDArray

from warp_mca.system.records import SceneRecords

BLOCK = 1024  # rows for which memory is reserved at a time, so that those of most runs need not be joined


class Room:
    """Memory for the rows of scenes, touched by a thread beside other work: to touch it first takes longest."""

    def __init__(self, scenes: int, rows: int, probes: int) -> None:
        """Begin with that of so many scenes, each of so many rows and probes."""
        self._found: list[NDArray[np.float32]] = []
        self._left = scenes
        self._thread = Thread(target=self._touch, args=((min(rows, BLOCK), probes, 6),), daemon=True)
        self._thread.start()

    def _touch(self, shape: tuple[int, ...]) -> None:
        with suppress(MemoryError):  # that of the run itself says so
            while len(self._found) < self._left:
                self._found.append(np.empty(shape, dtype=np.float32))
                self._found[-1].fill(0.0)  # which lets other threads go on

    def take(self, probes: int) -> NDArray[np.float32] | None:
        """That of one more scene; None if it has other probes, or no more was touched before the first one took its."""
        self._left = 0
        self._thread.join()
        return self._found.pop() if self._found and self._found[-1].shape[1] == probes else None


class StressRows:
    """Copies rows once, to where they stay, before it is known which of them a guard leaves."""

    def __init__(self, kept: SceneRecords, checks: int, probes: slice, room: NDArray[np.float32] | None = None) -> None:
        """Go on from what is `kept`; each of `checks` records gives a row, of these `probes` of the solver's.

        room: for the first rows [Pa], shape (row_count, probe_count, 6), float32.
        """
        self._blocks = [] if room is None else [room]
        self._size = BLOCK if room is None else len(room)
        self._checks, self._probes = checks, probes
        self._before, self._records = list(kept.path_stress), kept.records
        self._count = 0

    def take(self, written: int, stress: NDArray[np.float32]) -> None:
        """Copy what the next records have [Pa], the first `written` of shape (ROWS, all probes, 6), float32."""
        found = stress[-self._records % self._checks : written : self._checks, self._probes]
        self._records += written
        while len(found):
            block, place = divmod(self._count, self._size)
            if block == len(self._blocks):
                self._blocks.append(np.empty((self._size, *found.shape[1:]), dtype=np.float32))
            own = self._blocks[block][place : place + len(found)]
            own[:] = found[: len(own)]
            self._count += len(own)
            found = found[len(own) :]

    def first(self, count: int) -> list[NDArray[np.float32]]:
        """The first `count` rows, as `SceneRecords.path_stress`: no copies."""
        left = count - sum(map(len, self._before))
        return [*self._before, *(block[: max(left - self._size * k, 0)] for k, block in enumerate(self._blocks))]
