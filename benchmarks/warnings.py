"""Writes docs/warnings.md, the table of guards, warnings and advice: `python -m benchmarks.warnings`."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from warp_mca.watch.row import Row, When
from warp_mca.watch.table import TABLE

PAGE = Path(__file__).resolve().parent.parent / "docs" / "warnings.md"
HEAD = """# Guards, warnings and advice

What a run may say of itself; [When a run stops, or warns](how-to/stopped.md) has an example. **Guards** stop the run,
**warnings** doubt some of its figures, **advice** doubts the scene. Values that a run fills in stand in *italics*.
`python -m benchmarks.warnings` writes this page from `warp_mca/watch/table.py`; a new row is a condition with `@row` in
a file of `warp_mca/watch/` and a pair in `tests/warning_pairs.py`.
"""
TITLES = {
    When.FLAGS: "While it runs: what kernels see",
    When.RECORDS: "While it runs: records",
    When.BEFORE: "Before the run",
    When.LOOKS: "Looks at the shape of bodies",
    When.END: "At the end",
}


def page() -> str:
    """The text of the page."""
    parts = [HEAD]
    for when, title in TITLES.items():
        parts.append(f"\n## {title}\n\n| name | looks at | limit | says | remedy |\n|---|---|---|---|---|\n")
        parts += [line(row) for row in TABLE if row.when is when]
    return "".join(parts)


def line(row: Row) -> str:
    """A row of a table."""
    doc = inspect.getdoc(row.found) or ""
    looks_at = doc.split("\n\n")[0].replace("\n", " ")
    limit = "" if not row.unit else row.unit if row.limit == 0.0 else f"{row.limit:.4g} {row.unit}"
    cells = (f"{row.name} ({row.kind})", looks_at, limit, text(row.sentence).rstrip(":;,"), text(row.remedy))
    return f"| {' | '.join(cells)} |\n"


def text(template: str) -> str:
    """A sentence as the page shows it: names of values for the values."""
    return re.sub(r"\{(\w+)[^}]*\}", r"*\1*", template.replace("*", "\\*"))


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
