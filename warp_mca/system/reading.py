"""Owns arrays of a state that are read for each scene of a batch, and come from the device once for all of them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any

import warp as wp
from numpy.typing import NDArray

_READ: ContextVar[dict[tuple[int, object], tuple[wp.array, NDArray[Any]]] | None] = ContextVar("read", default=None)


@contextmanager
def read_once() -> Iterator[None]:
    """While this thread is in it no array that `on_host` gives changes."""
    token = _READ.set({})
    try:
        yield
    finally:
        _READ.reset(token)


def on_host(array: wp.array, rows: slice | None = None) -> NDArray[Any]:
    """The entries of an array, or some rows, not to be written to; in `read_once` as they were when first asked for."""
    read, key = _READ.get(), (id(array), rows and (rows.start, rows.stop, rows.step))
    if read is None or key not in read:
        found = (array if rows is None else array[rows]).numpy()
        if read is None:
            return found
        read[key] = array, found  # kept too: the id of one that is gone may be that of the next
    return read[key][1]
