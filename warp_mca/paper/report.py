"""Owns the report: runs a level, judges the claims, and writes paper.html, paper.json and paper.md."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.files import write_atomically
from warp_mca.base.version import __version__
from warp_mca.paper.choices import choice_rows, duration_rows
from warp_mca.paper.claim_table import CLAIMS
from warp_mca.paper.claims import Verdict, judge
from warp_mca.paper.evidence import Evidence, Runs, carry_out_runs, figures_of
from warp_mca.paper.page import IMAGES, Page, as_html, as_markdown
from warp_mca.paper.pictures import PICTURES, drawn
from warp_mca.paper.studies import LEVELS, Level, pure_case
from warp_mca.paper.table_2 import compare, stored
from warp_mca.phases.arguments import Progress
from warp_mca.phases.every import METHOD
from warp_mca.results.storage import folder_path, load
from warp_mca.step.device import check_device
from warp_mca.studies.sweep_job import DONE, Row
from warp_mca.studies.worker_process import Prepare

HTML, JSON, MARKDOWN = "paper.html", "paper.json", "paper.md"
PURE = "pure"  # folder of the comparison with finite elements alone
LISTS = ("F_n_peaks", "contacts", "sticks")  # of a summary, which rows of a sweep leave out


@dataclass(frozen=True)
class Report:
    """A report that was written.

    Attributes:
        verdicts: of the claims.
        rows: of all runs.
        files: that were written.
    """

    verdicts: list[Verdict]
    rows: list[Row]
    files: list[Path]


def level_named(name: str) -> Level:
    """The level of that name.

    Raises:
        RequestError: there is none.
    """
    if name not in LEVELS:
        raise bad_value("level", name, f"give {' or '.join(LEVELS)}")
    return LEVELS[name]


def make_report(
    level: Level,
    out: Path,
    *,
    device: str = "cpu",
    precision: str = "mixed",
    workers: int | None = None,
    force: bool = False,
    prepare: Prepare | None = None,
    progress: Progress | None = None,
    deadline: float = math.inf,
    pure_fem: bool = False,
) -> Report:
    """Run what is missing of a level, and write the report.

    Args:
        level: to be run.
        out: folder of the report. The same call goes on with what it holds.
        device, precision, workers, force, prepare, progress, deadline: as in `carry_out_runs`.
        pure_fem: run finite elements alone too, after all others; they store their state on the way.

    Raises:
        RequestError, McaError: as in `warp_mca.sweep`; a file cannot be written.
        GuardError: a run of the comparison with finite elements alone lost its footing.
    """
    out, end = folder_path("out", out), time.monotonic() + deadline
    options: dict[str, Any] = {"device": device, "precision": precision, "force": force, "progress": progress}
    runs = carry_out_runs(level, out, **options, workers=workers, prepare=prepare, deadline=deadline)
    runs = replace(runs, comparison=None if force else stored(out / PURE), pure=out / PURE)
    if pure_fem and runs.comparison is None and time.monotonic() < end:
        if not runs.pure.exists():
            _report(runs, precision)  # the run of finite elements alone may be interrupted, again and again
        options["device"] = check_device(device)
        runs = replace(runs, comparison=compare(pure_case(level).scene(), runs.pure, **options))
    return _report(runs, precision)


def _report(runs: Runs, precision: str) -> Report:
    """Judge, draw and write."""
    level, figures = runs.level, figure_rows(runs)
    commands = [pure_case(level).command(runs.device) + more for more in (f" --method {METHOD}", "")]
    verdicts, pictures = judge(CLAIMS, runs), drawn(Evidence(runs))
    made, tried = _made(runs, precision), choice_rows(runs)
    tables = runs.comparison, commands, tried, duration_rows(runs)
    page = Page(level, made, verdicts, figures, pictures, *tables)
    entries = {
        "level": level.name,
        "claims": [verdict.as_json() for verdict in page.verdicts],
        "table_2": runs.comparison,
        "figures": figures,
    }
    texts = {
        HTML: as_html(page),
        MARKDOWN: as_markdown(page),
        JSON: json.dumps(entries, indent=1, allow_nan=False) + "\n",
    }
    files = {name: text.encode() for name, text in texts.items()}
    files |= {f"{IMAGES}/figure-{number}.png": data for number, data in page.pictures.items()}
    return Report(list(page.verdicts), list(runs.rows.values()), _written(runs.out, files))


def figure_rows(runs: Runs) -> dict[str, list[dict[str, Any]]]:
    """By the paper's number of the figure: of each run the command, what was varied, the figures of its summary."""
    by_study: dict[str, list[dict[str, Any]]] = {}
    for (study, value, variant), case in runs.cases.items():
        group = "choices" if variant in runs.level.tried else study
        row = {"command": case.command(runs.device), "variant": variant, "value": value, **figures_of(runs.rows[case])}
        if row["status"] == DONE:
            summary = load(runs.folders[case]).summary
            row |= {key: summary[key] for key in LISTS}
        by_study.setdefault(group, []).append(row)
    found = {picture.number: by_study.get(picture.study, []) for picture in PICTURES}
    return found | {name: by_study.get(name, []) for name in ("limit", "choices")}


def _made(runs: Runs, precision: str) -> str:
    """How the page was made, in a sentence."""
    done = next((row for row in runs.rows.values() if row["status"] == DONE), {})
    command = f"warp-mca paper --level {runs.level.name}" + (f" --device {runs.device}" if runs.device != "cpu" else "")
    device = done.get("device", runs.device)
    made = f"{precision}, warp_mca {__version__}, {datetime.now(UTC).date().isoformat()}"
    return f"Made by {command}: {len(runs.rows)} runs on {device}, {made}."


def _written(out: Path, files: Mapping[str, bytes]) -> list[Path]:
    """The paths of the files, written.

    Raises:
        McaError: one cannot be written.
    """
    found = []
    for name, data in files.items():
        target = out / name
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            write_atomically(target, lambda file, data=data: file.write(data))
        except OSError as error:
            raise McaError(f"{target} cannot be written: {error.strerror or error}") from error
        found.append(target)
    return found
