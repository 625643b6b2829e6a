"""Owns values of the scenes of a batch as the kernels of contact take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray


def per_scene(first: NDArray[np.int32]) -> Any:
    """Scene of each entry for kernels: 0 where there is one scene, else an array; see `kernels.hardware.per_scene`."""
    if len(first) == 2:
        return 0
    return wp.array(np.repeat(np.arange(len(first) - 1), np.diff(first)), dtype=wp.int32)


def numbers(values: Sequence[float]) -> Any:
    """A number of each scene, as kernels take it."""
    return values[0] if len(values) == 1 else wp.array(list(values), dtype=wp.float64)


def vectors(values: Sequence[Any]) -> Any:
    """A vector of each scene, as kernels take it."""
    return wp.vec3d(*values[0]) if len(values) == 1 else wp.array(np.asarray(values), dtype=wp.vec3d)
