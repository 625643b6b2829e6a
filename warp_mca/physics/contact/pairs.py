"""Owns the tables of a general contact: which bodies it keeps apart, and the faces that a node never meets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import offsets
from warp_mca.kernels.contact import pairs

SLOTS = 2  # bodies for which a node at a sharp edge has springs of their own


@dataclass(frozen=True, kw_only=True)
class Pairs:
    """Bodies of a general contact, numbered within their scene.

    Attributes:
        body: of each slave node, shape (slave_count,), int32.
        face: body of each face, shape (face_count,), int32.
        factor: of the stiffness of springs between two bodies [-], 0 where they do not meet, shape (body_count,
            body_count), float64.
        barred_offset, barred: faces of its own body that each slave node never meets, compressed rows, int32.
    """

    body: Index
    face: Index
    factor: Array
    barred_offset: Index
    barred: Index


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
