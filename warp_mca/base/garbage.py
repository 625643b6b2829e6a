"""Owns when Python looks for garbage that refers to itself: rarely while a device or a user waits."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

# Allocations between two collections. A full one takes 0.15 s where USD and rerun are loaded; at Python's own threshold
# commands spend 0.2 s on them.
COLLECT = 100_000


@contextmanager
def few_collections() -> Iterator[None]:
    """Let Python collect garbage seldom until the block ends."""
    before = gc.get_threshold()
    gc.set_threshold(COLLECT)
    try:
        yield
    finally:
        gc.set_threshold(*before)
