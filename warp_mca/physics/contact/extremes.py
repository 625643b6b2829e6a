"""Owns the greatest normal force of any step: sums of whole numbers, which do not depend on the order of nodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import warp as wp

from warp_mca.physics.contact.per_scene import numbers
from warp_mca.system.contact import ContactPass
from warp_mca.system.reading import on_host
from warp_mca.system.threads import RANGES

_BITS = 60  # of the whole numbers, below their sign, that springs as deep as their faces are long would fill
_DASHPOTS = 12  # of these bits that are left to forces of dashpots
_LARGEST = 1000  # exponent of a scale that a float64 holds, whatever the springs
_LINE = 8  # numbers in a line of a CPU's cache: two threads that write to one wait for each other


class NormalForce:
    """How normal forces of all springs of a step are summed for each scene: `State.normal_force` holds the sums."""

    def __init__(self, scenes: Sequence[Sequence[ContactPass]], threads: int) -> None:
        """For the passes of each scene, none where no scene has contact, and for as many threads of a CPU."""
        ranges = RANGES * threads if threads > 1 else 1
        self._shape = (1 + ranges if scenes else 0, -(-len(scenes) // _LINE) * _LINE)
        self._scales = [_scale(passes) for passes in scenes]

    def per_newton(self, items: Sequence[ContactPass]) -> Any:
        """What the sums count for a newton in a pass of each scene [1/N]: a power of two, or 0 of internal contacts.

        See `kernels.hardware.per_scene`.
        """
        return numbers([0.0 if item.internal else scale for item, scale in zip(items, self._scales, strict=True)])

    def new_state(self) -> wp.array:
        """The greatest sum of any step, then a row of sums of the present step for each range of slaves.

        Shape (1 + range_count, column_count), int64; a column for each scene, and some that stay 0.
        """
        return wp.zeros(self._shape, dtype=wp.int64)

    def greatest(self, sums: wp.array, scene: int) -> float:
        """Greatest normal force of a scene in any step [N]; 0 without contact."""
        return float(on_host(sums)[0, scene]) / self._scales[scene] if self._scales else 0.0


def _scale(passes: Sequence[ContactPass]) -> float:
    """What sums count for a newton [1/N]: guards stop a run before forces come near the largest whole number."""
    stiffness = [item.stiffening * item.sides * float(item.stiffness.sum()) for item in passes]
    reach = [k * max(item.longest, item.deepest) for k, item in zip(stiffness, passes, strict=True)]
    _, exponent = math.frexp(sum(reach))
    bits = _BITS - (_DASHPOTS if any(item.damping for item in passes) else 0)
    return 2.0 ** min(max(bits - exponent, -_LARGEST), _LARGEST)
