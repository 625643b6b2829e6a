"""Owns `Kept`: what was computed last, for the next run of the same process that depends on equal values."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Generic, TypeVar

T = TypeVar("T")
_RUN: ContextVar[object | None] = ContextVar("run", default=None)


@contextmanager
def unchanged() -> Iterator[None]:
    """While this thread is in it, arrays stay as they are: whether they changed is looked at once."""
    token = _RUN.set(this_run() or object())
    try:
        yield
    finally:
        _RUN.reset(token)


def this_run() -> object | None:
    """What tells one time in `unchanged` from another; None outside."""
    return _RUN.get()


class Kept(Generic[T]):
    """The values used last by what they depend on, up to a total size."""

    def __init__(self, most: int) -> None:
        """Begin empty; the sizes of what is kept add up to `most` at most."""
        self._most, self._total = most, 0
        self._values: OrderedDict[Hashable, tuple[T, int]] = OrderedDict()

    def get(self, key: Hashable) -> T | None:
        """The value of a key, or None."""
        if key not in self._values:
            return None
        self._values.move_to_end(key)
        return self._values[key][0]

    def put(self, key: Hashable, value: T, size: int = 1) -> None:
        """Keep a value that has this size, and leave out those used longest ago; one that is too large is not kept."""
        if size > self._most or key in self._values:
            return
        self._values[key] = value, size
        self._total += size
        while self._total > self._most:
            _, (_, gone) = self._values.popitem(last=False)
            self._total -= gone
