"""Owns the stress along the paths of a scene, row by row, as its records arrive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.system.records import SceneRecords

BLOCK = 1024  # rows for which memory is reserved at a time, so that those of most runs need not be joined


class StressRows:
    """Copies rows once, to where they stay, before it is known which of them a guard leaves."""

    def __init__(self, kept: SceneRecords, checks: int, probes: slice) -> None:
        """Go on from what is `kept`; each of `checks` records gives a row, of these `probes` of the solver's."""
        self._checks, self._probes = checks, probes
        self._before, self._records = list(kept.path_stress), kept.records
        self._blocks: list[NDArray[np.float32]] = []
        self._count = 0

    def take(self, written: int, stress: NDArray[np.float32]) -> None:
        """Copy what the next records have [Pa], the first `written` of shape (ROWS, all probes, 6), float32."""
        found = stress[-self._records % self._checks : written : self._checks, self._probes]
        self._records += written
        while len(found):
            place = self._count % BLOCK
            if place == 0:
                self._blocks.append(np.empty((BLOCK, *found.shape[1:]), dtype=np.float32))
            own = self._blocks[-1][place : place + len(found)]
            own[:] = found[: len(own)]
            self._count += len(own)
            found = found[len(own) :]

    def first(self, count: int) -> list[NDArray[np.float32]]:
        """The first `count` rows, as `SceneRecords.path_stress`: no copies."""
        left = count - sum(map(len, self._before))
        return [*self._before, *(block[: max(left - BLOCK * k, 0)] for k, block in enumerate(self._blocks))]
