"""Owns the checks that scenes and recipes make on their values."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from numbers import Real

import numpy as np

from warp_mca.errors import bad_value


def positive(owner: str, /, **values: float) -> None:
    """Each value must be a finite number above 0."""
    for name, value in values.items():
        if not (is_number(value) and value > 0.0):
            raise bad_value(f"{owner}.{name}", value, "give a finite number above 0")


def finite(owner: str, /, **values: float) -> None:
    """Each value must be a finite number."""
    for name, value in values.items():
        if not is_number(value):
            raise bad_value(f"{owner}.{name}", value, "give a finite number")


def counts(owner: str, /, **values: int) -> None:
    """Each value must be a whole number above 0."""
    for name, value in values.items():
        if not _is_count(value):
            raise bad_value(f"{owner}.{name}", value, "give a whole number above 0")


def even_counts(owner: str, /, **values: int) -> None:
    """Each value must be an even number above 0, so that the middle is a grid line."""
    for name, value in values.items():
        if not (_is_count(value) and value % 2 == 0):
            raise bad_value(f"{owner}.{name}", value, "give an even number above 0")


def entries(owner: str, count: int, /, **values: tuple) -> None:
    """Each value must be a tuple of `count` entries."""
    for name, value in values.items():
        if not (isinstance(value, (tuple, list)) and len(value) == count):
            raise bad_value(f"{owner}.{name}", value, f"give {count} numbers")


def vectors(owner: str, /, **values: Sequence[float]) -> None:
    """Each value must be three finite numbers."""
    for name, value in values.items():
        if not (is_list(value) and len(value) == 3):
            raise bad_value(f"{owner}.{name}", value, "give three finite numbers")


def is_number(value: object) -> bool:
    """Whether it is a finite real number; text, None, sequences and truth values are none."""
    try:
        return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # a whole number that no float holds
        return False


def is_list(value: object) -> bool:
    """Whether it is a sequence of finite numbers."""
    return isinstance(value, Iterable) and not isinstance(value, str) and all(map(is_number, value))


def _is_count(value: object) -> bool:
    return isinstance(value, (int, np.integer)) and not isinstance(value, bool) and int(value) > 0
