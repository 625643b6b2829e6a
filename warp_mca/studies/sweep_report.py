"""Owns report.html of a sweep: the worst of each criterion, and a row for each run with a link to its own report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import Any

from warp_mca.base.errors import McaError
from warp_mca.base.files import write_atomically
from warp_mca.results.html_page import Figures, page, section, table
from warp_mca.results.report import REPORT
from warp_mca.scene.criteria import read_criterion
from warp_mca.studies.sweep_columns import parameter_column
from warp_mca.studies.sweep_job import BETWEEN, COMPLETE, CRITERION, Row
from warp_mca.studies.sweep_plan import Plan

HEADINGS = ("greatest force", "duration of contact", "greatest plastic strain", "energy error")
COLUMNS = (("F_n_max", "N"), ("contact_duration", "s"), ("max_plastic_strain", ""), ("energy_error", "share"))


def write_report(plan: Plan, rows: Sequence[Row]) -> None:
    """Write the page of a sweep's rows to its folder, if it has one.

    Raises:
        McaError: it cannot be written.
    """
    if plan.out is None:
        return
    text = sweep_html(plan, rows).encode()
    try:
        write_atomically(plan.out / REPORT, lambda file: file.write(text))
    except OSError as error:
        raise McaError(f"the report could not be written to {plan.out}: {error.strerror or error}") from error


def sweep_html(plan: Plan, rows: Sequence[Row]) -> str:
    """The page; figures have their number in `rows` and their column as key."""
    found = Figures({"rows": rows})
    count = Counter(row["status"] for row in rows)
    kind = "met" if count.keys() <= {"done"} else "unmet"
    told = ", ".join(f"{number} {status}" for status, number in count.items())
    said = Counter(text for row in rows for text in (row.get("warnings") or "").split(BETWEEN) if text)
    warnings = (
        f'<p class="warning">{escape(text)} ({number} of {len(rows)} runs)</p>' for text, number in said.items()
    )
    name = f"Sweep of {plan.scenes[0].name}"
    return page(
        name,
        [
            f"<h1>{escape(name)}</h1>",
            f'<p class="verdict {kind}">{len(rows)} runs: {told}.</p>',
            section("Worst of each criterion", _worst(plan, rows, found)),
            section("Runs", _runs(plan, rows, found)),
            section("Warnings", *warnings),
        ],
    )


def _texts(plan: Plan) -> list[str]:
    """The criteria of all scenes, each once."""
    return list(dict.fromkeys(text for scene in plan.scenes for text in scene.criteria))


def _place(plan: Plan, k: int, text: str) -> str | None:
    """Prefix of the columns of a criterion in row `k`."""
    criteria = plan.scenes[k].criteria
    return f"criteria.{criteria.index(text)}" if text in criteria else None


def _worst(plan: Plan, rows: Sequence[Row], found: Figures) -> str:
    cells = []
    for text in _texts(plan):
        at = {k: place for k in range(len(rows)) if (place := _place(plan, k, text))}
        margins = {k: m for k, place in at.items() if (m := rows[k].get(f"{place}.margin")) is not None}
        met = sum(rows[k].get(f"{place}.met") is True for k, place in at.items())
        kind = "met" if met == len(at) else "unmet"
        row = [escape(text), f'<span class="{kind}">{met} of {len(at)} runs</span>', "", "", "", ""]
        if margins:
            worst = min(margins, key=lambda k: margins[k])
            own = "rows", worst
            unit = read_criterion(text).unit
            row[2:] = [
                found.cell(*own, f"{at[worst]}.value", unit=unit),
                found.cell(*own, f"{at[worst]}.margin", unit="share"),
                found.cell(*own, f"{at[worst]}.of"),
                _link(plan, rows[worst]),
            ]
        cells.append(row)
    return table(("criterion", "met in", "worst value", "margin", "decided by", "run"), cells)


def _runs(plan: Plan, rows: Sequence[Row], found: Figures) -> str:
    parameters, texts = list(plan.parameters[0]), _texts(plan)
    cells = []
    for k, row in enumerate(rows):
        own: tuple[Any, ...] = ("rows", k)
        kind = "met" if row["status"] == "done" else "unmet"
        line = [_link(plan, row), *(found.cell(*own, parameter_column(name)) for name in parameters)]
        line += [f'<span class="{kind}">{row["status"]}</span>']
        for text in texts:
            place = _place(plan, k, text)
            value = found.cell(*own, f"{place}.value", unit=read_criterion(text).unit)
            met = "met" if row.get(f"{place}.met") else "unmet"
            line.append(f'<span class="{met}">{value}</span>' if value else "")
        line += [found.cell(*own, column, unit=unit) for column, unit in COLUMNS]
        reason = "" if row["status"] == CRITERION else row.get("reason") or ""  # its criteria say so
        cells.append([*line, escape(reason)])
    return table(("run", *parameters, "status", *texts, *HEADINGS, "reason"), cells)


def _link(plan: Plan, row: Row) -> str:
    """The number of a run, which leads to its report where the files of runs are kept."""
    folder, number = plan.run_folder(row["index"]), str(row["index"])
    kept = folder is not None and row["status"] in COMPLETE
    return f'<a href="{folder.name}/{REPORT}">{number}</a>' if kept and folder else number
