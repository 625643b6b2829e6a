"""Owns values of the scenes of a batch as the kernels of contact take them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.joining import offsets
from warp_mca.kernels.contact import pairs
from warp_mca.system.contact import Pairs


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


def device_pairs(items: Sequence[Pairs | None]) -> Any:
    """Tables of the passes of all scenes as `kernels.contact.pairs.Pairs`, without slots; empty for listed contacts."""
    found, own = pairs.Pairs(), [item for item in items if item is not None]
    if not own:
        return found
    tables, faces, entries = (
        offsets([count(item) for item in own])
        for count in (lambda i: i.factor.size, lambda i: len(i.face), lambda i: len(i.barred))
    )
    together = list(zip(own, tables, faces, entries, strict=False))

    def device(parts: Sequence[Any], dtype: type = wp.int32) -> wp.array:
        return wp.array(np.concatenate(parts), dtype=dtype)

    found.row = device([first + len(item.factor) * item.body for item, first, _, _ in together])
    found.own = device([item.body for item in own])
    found.body = device([item.face for item in own])
    found.factor = device([item.factor.ravel() for item in own], wp.float64)
    found.barred_offset = device([item.barred_offset[:-1] + at for item, _, _, at in together] + [entries[-1:]])
    found.barred = device([item.barred + first for item, _, first, _ in together])
    return found
