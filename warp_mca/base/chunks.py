"""Owns the cutting of long arrays into parts that fit a core's cache."""

from __future__ import annotations

CHUNK = 2048  # elements computed at a time: their arrays stay in a core's cache


def chunks(count: int, size: int) -> list[slice]:
    """Slices of `size` that cut `count` entries, the last one shorter."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
