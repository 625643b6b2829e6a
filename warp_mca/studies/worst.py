"""Owns the table of the worst runs of a sweep: for each figure the run in which it is greatest."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase
from typing import Any

from warp_mca.studies.sweep_job import Row

# Columns of rows and their units; those of bodies once for each body.
WORST = {
    "F_n_max": "N",
    "bodies.*.max_von_mises.value": "Pa",
    "bodies.*.max_plastic_strain.value": "-",
    "max_penetration": "m",
}


def worst(rows: Sequence[Row]) -> list[dict[str, Any]]:
    """The run of a sweep in which each figure is greatest.

    Args:
        rows: as `warp_mca.sweep` returns them; runs without figures are left out.

    Returns:
        For greatest force, von Mises stress and plastic strain of each body, and depth of contact: figure, value, unit,
        and index and parameters of the run. Figures that are 0 in all runs are left out.
    """
    found = []
    for pattern, unit in WORST.items():
        columns = dict.fromkeys(column for row in rows for column in row if fnmatchcase(column, pattern))
        for column in columns:
            told = [row for row in rows if row.get(column)]
            if told:
                row = max(told, key=lambda row: row[column])
                end = list(row).index("status")
                chosen = {key: value for key, value in list(row.items())[:end] if key != "index"}
                name = column.removeprefix("bodies.").removesuffix(".value")
                entry = {"figure": name, "value": row[column], "unit": unit, "index": row["index"]}
                found.append({**entry, "parameters": chosen})
    return found
