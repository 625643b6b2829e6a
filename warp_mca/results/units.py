"""Owns the units of the columns of a history."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache

# By the name of a column, the first that matches it whole. A new column needs a unit here.
UNITS = (
    (r"time_s", "s"),
    (r"F_[nt]_N", "N"),
    (r"stick_fraction", "1"),
    (r"(tip|plate)_v[xyz]|closing_speed", "m/s"),
    (r"E_\w+|external_work", "J"),
    (r"theta_.+", "rad"),
    (r"spring_.+_N", "N"),
    (r"spring_.+_m", "m"),
    (r"bolt_.+_N", "N"),
    (r"joint_.+_N", "N"),
    (r"joint_.+_Nm", "N m"),
    (r"joint_.+_rad", "rad"),
    (r"joint_.+_m", "m"),
)


@cache
def unit_of(column: str) -> str:
    """Unit of a column of the history; "1" for pure numbers.

    Raises:
        KeyError: `UNITS` has none for it.
    """
    for pattern, unit in UNITS:
        if re.fullmatch(pattern, column):
            return unit
    raise KeyError(f"{column}: add its unit to results.units.UNITS")


def units_of(columns: Iterable[str]) -> dict[str, str]:
    """Unit of each column of the history, by its name."""
    return {column: unit_of(column) for column in columns}
