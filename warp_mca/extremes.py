"""Owns the greatest normal force of any step: sums of whole numbers, which do not depend on the order of nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import warp as wp

from warp_mca.surfaces import ContactPass
from warp_mca.threads import RANGES

_BITS = 60  # of the whole numbers, below their sign, that springs as deep as their faces are long would fill
_LINE = 8  # numbers in a line of a CPU's cache: two threads that write to one wait for each other


class NormalForce:
    """Normal forces of all springs of a step, summed for each scene, and the greatest sum so far.

    Attributes:
        sums: of the present step, a row for each range of slaves, shape (range_count, column_count), int64.
        rows: views of these rows.
        peak: greatest sum of any step, shape (scene_count,), int64.
        per_newton: what the sums count for a newton [1/N], a power of two; as kernels take it, see `kernels.each`.
    """

    def __init__(self, scenes: Sequence[Sequence[ContactPass]], threads: int) -> None:
        """Allocate for the passes of each scene, none where no scene has contact, and for as many threads of a CPU."""
        ranges = RANGES * threads if threads > 1 else 1
        self.sums = wp.zeros((ranges, -(-len(scenes) // _LINE) * _LINE), dtype=wp.int64)
        self.rows = [self.sums[k] for k in range(ranges)] if scenes else []
        self.peak = wp.zeros(len(scenes), dtype=wp.int64)
        self._scales = [_scale(passes) for passes in scenes]
        self.per_newton: Any = self._scales[0] if len(scenes) == 1 else wp.array(self._scales, dtype=wp.float64)

    def greatest(self, scene: int) -> float:
        """Greatest normal force of any step [N]."""
        return float(self.peak.numpy()[scene]) / self._scales[scene]


def _scale(passes: Sequence[ContactPass]) -> float:
    """Parts of a newton that sums are counted in [1/N]: guards stop a run before forces come near the largest number."""
    reach = [item.sides * float(item.stiffness.sum()) * max(item.longest, item.deepest) for item in passes]
    return 2.0 ** (_BITS - math.ceil(math.log2(sum(reach))))
