"""Owns tables of numbers as CSV, with the digits that give each float64 back."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def write_table(path: Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write columns of equal length, in their order; names that hold a comma or a quote are quoted."""
    rows = np.column_stack([np.asarray(column, dtype=np.float64) for column in columns.values()])
    # repr gives the shortest text that reads back as the same float64.
    lines = [",".join(map(_quoted, columns)), *(",".join(map(repr, row)) for row in rows.tolist())]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _quoted(name: str) -> str:
    if any(mark in name for mark in ',"\n'):
        return '"' + name.replace('"', '""') + '"'
    return name
