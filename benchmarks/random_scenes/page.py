"""Owns how rows are shown: a line on the terminal, and the tables of random_scenes.md."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from benchmarks.measurements import FOLDER, measured
from benchmarks.random_scenes.crossing import FAMILIES
from benchmarks.random_scenes.judge import silent, told
from benchmarks.random_scenes.measure import Row
from benchmarks.stability.page import percent
from benchmarks.stability.page import word as known_word

TEMPLATE = FOLDER / "random_scenes.template.md"
ENERGY = 0.003  # of all energy, that a plain scene may be off
IMPULSE = 0.05  # of the first contact, that finer cells may change
WORDS = {
    "distance between nodes": "nodes of the slave farther apart than the other body is wide",
    "initial_overlap": "bodies said to overlap at the start, which they do not",
    "in touches of their own": "faint touches",
}
LISTED = 40  # seeds that a cell of a table names at most
QUANTILES = (0.5, 0.9, 1.0)


def word(sentence: str) -> str:
    """What stands for a sentence in the tables, as on the page of stability."""
    return next((short for part, short in WORDS.items() if part in sentence), known_word(sentence))


def line(row: Row) -> str:
    """A row on the terminal."""
    parts = [row["family"], str(row["seed"]), " on ".join(row["kinds"]), f"{row['cells']} cells", row["status"]]
    if "seen" in row:
        parts.append(f"{row['seen']} ({percent(row['depth'])} deep)" + (" SILENT" if silent(row) else ""))
    if "energy_error" in row:
        parts.append(f"energy {percent(row['energy_error'])}")
    if row.get("impulse_off") is not None:
        parts.append(f"impulse {100.0 * row['impulse_off']:+.1f} %")
    said = ", ".join(dict.fromkeys(map(word, row["said"])))
    return ", ".join(parts) + (f": {said}" if said else "") + f"; {row['wall']} s"


def seeds(rows: Iterable[Row]) -> str:
    """How many rows there are, and their seeds."""
    found = sorted(row["seed"] for row in rows)
    more = ", …" if len(found) > LISTED else ""
    return f"{len(found)}" + (f" ({', '.join(map(str, found[:LISTED]))}{more})" if found else "")


def facts(rows: Sequence[Row]) -> list[tuple[str, str]]:
    """What a family's table says, name and value."""
    meeting = [row for row in rows if "seen" in row]
    ended = Counter(row["status"] for row in rows)
    found = [("scenes", f"{len(rows)}"), ("ran to their end", f"{ended['finished']}")]
    for status in ("refused", "stopped", "failed"):
        causes = Counter(word(row["said"][0]) for row in rows if row["status"] == status)
        for cause, _ in causes.most_common():
            own = (row for row in rows if row["status"] == status and word(row["said"][0]) == cause)
            found.append((f"{status}: {cause}", seeds(own)))
    energy = [row["energy_error"] for row in rows if "energy_error" in row]
    if energy:
        values = ", ".join(percent(float(q)) for q in np.quantile(energy, QUANTILES))
        found.append(("energy error: median, 90 % of scenes, greatest", values))
    if rows[0]["family"] in FAMILIES:
        found += _meeting(rows, meeting)
    else:
        off = [row for row in rows if row.get("energy_error", 0.0) > ENERGY]
        found.append((f"energy off by more than {percent(ENERGY)}", seeds(off)))
        found.append(("figures that are no numbers", seeds(row for row in rows if row.get("finite") is False)))
        found.append(("never touched", seeds(row for row in rows if row.get("touched") is False)))
    return found


def _meeting(rows: Sequence[Row], meeting: Sequence[Row]) -> list[tuple[str, str]]:
    found = []
    for verdict, name in (("through", "went through each other"), ("overlap", "lay too deep in each other")):
        own = [row for row in meeting if row["seen"] == verdict]
        found.append((name, seeds(own)))
        found.append((f"{name}, and the run was stopped or said so", seeds(row for row in own if told(row))))
    found.append(("silent", seeds(filter(silent, rows))))
    shy = (row for row in meeting if row["seen"] == "apart" and row["status"] == "finished" and told(row))
    found.append(("apart, but warned of going into each other", seeds(shy)))
    off = [row["impulse_off"] for row in rows if row.get("impulse_off") is not None]
    if off:
        wrong = [row for row in rows if abs(row.get("impulse_off") or 0.0) > IMPULSE]
        values = ", ".join(percent(float(q)) for q in np.quantile(np.abs(off), QUANTILES))
        found.append(("run with finer cells too", f"{len(off)}"))
        found.append(("impulse of the first contact off: median, 90 %, greatest", values))
        found.append((f"impulse off by more than {percent(IMPULSE)}", seeds(wrong)))
        found.append(("and nothing was said", seeds(row for row in wrong if not row["said"])))
    lost = (row for row in rows if row.get("momentum_off", 0.0) > 1e-3)
    found.append(("impulse recorded is not the change of momentum", seeds(lost)))
    return found


def tables(rows: Sequence[Row]) -> str:
    """A table for each family, of the rows that there are."""
    lines = []
    for family in dict.fromkeys(row["family"] for row in rows):
        own = [row for row in rows if row["family"] == family]
        lines += [f"## {family[0].upper()}{family[1:]}", "", "| | number, seeds |", "|---|---|"]
        lines += [f"| {name} | {value} |" for name, value in facts(own)]
        lines.append("")
    return "\n".join(lines).rstrip()


def write_page(rows: Sequence[Row], path: Path) -> None:
    """Write the page of the rows."""
    text = TEMPLATE.read_text(encoding="utf-8").replace("MEASURED", measured("random_scenes"))
    path.write_text(text.replace("TABLES", tables(rows)), encoding="utf-8")
