"""Owns the report: runs a level, judges the claims, and writes paper.html, paper.json and paper.md."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.files import write_atomically
from warp_mca.paper.claim_table import CLAIMS
from warp_mca.paper.claims import Verdict, judge
from warp_mca.paper.evidence import Evidence, Runs, carry_out_runs, figures_of
from warp_mca.paper.page import IMAGES, Page, as_html, as_markdown
from warp_mca.paper.pictures import PICTURES, drawn
from warp_mca.paper.studies import LEVELS, Level
from warp_mca.results.storage import folder_path, load
from warp_mca.runs.arguments import Progress
from warp_mca.runs.sweep_job import DONE, Row
from warp_mca.runs.sweep_workers import Prepare

HTML, JSON, MARKDOWN = "paper.html", "paper.json", "paper.md"
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
) -> Report:
    """Run what is missing of a level, and write the report.

    Args:
        level: to be run.
        out: folder of the report. The same call goes on with what it holds.
        device, precision, workers, force, prepare, progress, deadline: as in `carry_out_runs`.

    Raises:
        RequestError, McaError: as in `warp_mca.sweep`; a file cannot be written.
    """
    out = folder_path("out", out)
    options: dict[str, Any] = {"device": device, "precision": precision, "workers": workers, "force": force}
    runs = carry_out_runs(level, out, **options, prepare=prepare, progress=progress, deadline=deadline)
    figures = figure_rows(runs)
    page = Page(level, _made(runs, precision), judge(CLAIMS, runs), figures, drawn(Evidence(runs)))
    entries = {
        "level": level.name,
        "claims": [verdict.as_json() for verdict in page.verdicts],
        "figures": figures,
    }
    texts = {
        HTML: as_html(page),
        MARKDOWN: as_markdown(page),
        JSON: json.dumps(entries, indent=1, allow_nan=False) + "\n",
    }
    files = {name: text.encode() for name, text in texts.items()}
    files |= {f"{IMAGES}/figure-{number}.png": data for number, data in page.pictures.items()}
    return Report(list(page.verdicts), list(runs.rows.values()), _written(out, files))


def figure_rows(runs: Runs) -> dict[str, list[dict[str, Any]]]:
    """By the paper's number of the figure: of each run the command, what was varied, the figures of its summary."""
    by_study: dict[str, list[dict[str, Any]]] = {}
    for (study, value, variant), case in runs.cases.items():
        row = {"command": case.command(runs.device), "variant": variant, "value": value, **figures_of(runs.rows[case])}
        if row["status"] == DONE:
            summary = load(runs.folders[case]).summary
            row |= {key: summary[key] for key in LISTS}
        by_study.setdefault(study, []).append(row)
    found = {picture.number: by_study.get(picture.study, []) for picture in PICTURES}
    return found | {name: by_study.get(name, []) for name in ("limit", "choices")}


def _made(runs: Runs, precision: str) -> str:
    """How the page was made, in a sentence."""
    from warp_mca import __version__

    done = next((row for row in runs.rows.values() if row["status"] == DONE), {})
    command = f"warp-mca paper --level {runs.level.name}" + (f" --device {runs.device}" if runs.device != "cpu" else "")
    device = done.get("device", runs.device)
    return f"Made by {command}: {len(runs.rows)} runs on {device}, {precision}, warp_mca {__version__}."


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
