"""Owns the page of the report: the same text as HTML with its pictures inside, and as Markdown with files beside it."""

from __future__ import annotations

import base64
import html
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from warp_mca.paper import choices
from warp_mca.paper.claims import Verdict
from warp_mca.paper.pictures import PICTURES
from warp_mca.paper.studies import Level
from warp_mca.paper.table_2 import HEAD, table_rows

IMAGES = "images/paper"  # folder of the pictures of the Markdown page, beside it
TITLE = "The published study, run again"
STYLE = """body{font:16px/1.5 system-ui,sans-serif;max-width:76rem;margin:2rem auto;padding:0 1rem;color:#222}
table{border-collapse:collapse;font-size:.85rem;margin:1rem 0;display:block;overflow-x:auto}
td,th{border-bottom:1px solid #ccc;padding:.25rem .5rem;text-align:left;vertical-align:top}
img{max-width:100%}code{font-size:.8rem}.yes{color:#00704f}.no{color:#b34700}.open{color:#666}"""
CLAIM_HEAD = ("claim", "where", "paper", "ours", "agrees", "why", "mesh", "penalty")
RUN_HEAD = ("command", "elements", "F_n peaks [kN]", "F_t [kN]", "contact [ms]", "energy error")
SECTIONS = (  # number of each figure, its heading and caption
    *((picture.number, f"Figure {picture.number}", picture.caption) for picture in PICTURES),
    ("limit", "Limit of fine meshes", "Runs of our own: penalty 1, hinges of fork and eye, two meshes."),
    ("choices", "Choices that the paper leaves open", choices.CAPTION),
)


@dataclass(frozen=True)
class Page:
    """All that the page shows.

    Attributes:
        level: that was run.
        made: command that makes the page, and what it ran on.
        verdicts: of the claims.
        figures: rows by the paper's number of the figure, as paper.json has them.
        pictures: PNG files by number.
        comparison: with finite elements alone, if they were run.
        compared: the commands of both.
        tried: rows of the table of choices.
        durations: rows of that of springs.
    """

    level: Level
    made: str
    verdicts: Sequence[Verdict]
    figures: Mapping[str, Sequence[Mapping[str, Any]]]
    pictures: Mapping[str, bytes]
    comparison: Mapping[str, Any] | None = None
    compared: Sequence[str] = ()
    tried: Sequence[tuple[str, ...]] = ()
    durations: Sequence[tuple[str, ...]] = ()

    def introduction(self) -> list[str]:
        """Paragraphs before the tables."""
        count = {state: sum(v.agrees is state for v in self.verdicts) for state in (True, False, None)}
        return [
            "The scene is the falling two-link manipulator of “Frictional impact analysis of an elastoplastic "
            "multi-link robotic system using a multi-timescale modelling approach” (“the paper”), Table 1. Each claim "
            "of the paper stands beside our number, each figure is drawn from our runs, and each run has the command "
            "that repeats it.",
            f"Level {self.level.name}: {self.level.note}",
            f"Main mesh: {self.level.main}. Other mesh: {self.level.other}. {self.made}",
            f"Of {len(self.verdicts)} claims, our own counted, {count[True]} agree, {count[False]} differ, and "
            f"{count[None]} have no run.",
            "“mesh” is the change of our number from the main mesh to the other one; “penalty” its change, on the "
            "other mesh, from the factor 0.1 to 0.3 (Figs. 16 to 18: from 1 to 0.5). “Unsure” is what one of them "
            "changes by more than the tolerance.",
        ]

    def table_2(self) -> list[str]:
        """Paragraphs before Table 2."""
        if self.comparison is None:
            return ["Pure finite elements are run with --pure-fem only."]
        return [
            "Finite elements from the release on, beside rigid links until the touch: all nodes of a hinge's axis "
            f"tied, penalty 1, rigid links with the mass of the mesh, {self.level.pure}. An impact that ends when its "
            "contact has been open for a while is computed until then; the way back to rigid bodies is not counted. "
            f"Before contact the links are within {self.comparison['configuration_error']:.1e} of their length of "
            "where rigid links are."
        ]

    def claim_rows(self) -> list[tuple[str, ...]]:
        """Cells of the table of claims."""
        return [
            (
                verdict.claim.what,
                verdict.claim.source,
                value_text(verdict.claim.paper, verdict.claim.unit),
                value_text(verdict.ours, verdict.claim.unit),
                {True: "agrees", False: "differs", None: "–"}[verdict.agrees],
                verdict.why,
                _change(verdict.mesh_change),
                _change(verdict.penalty_change),
            )
            for verdict in self.verdicts
        ]


def as_html(page: Page) -> str:
    """The page in one file, without anything from elsewhere."""
    parts = [f"<!doctype html><html lang=en><meta charset=utf-8><title>{TITLE}</title><style>{STYLE}</style>"]
    parts += [f"<h1>{TITLE}</h1>", *(f"<p>{html.escape(text)}</p>" for text in page.introduction())]
    parts += ["<h2>Claims</h2>", _html_table(CLAIM_HEAD, page.claim_rows())]
    parts += ["<h2>Table 2</h2>", *(f"<p>{html.escape(text)}</p>" for text in page.table_2())]
    if page.comparison is not None:
        parts += [_html_table(HEAD, table_rows(page.comparison))]
        parts += [f"<p><code>{html.escape(command)}</code></p>" for command in page.compared]
    parts += ["<h2>Figures</h2>"]
    for number, heading, caption in SECTIONS:
        parts.append(f"<h3>{heading}</h3><p>{html.escape(caption)}</p>")
        if number == "choices" and page.tried:
            parts.append(_html_table(choices.HEAD, page.tried))
        if number == "choices" and page.durations:
            parts.append(f"<p>{html.escape(choices.DURATIONS_CAPTION)}</p>")
            parts.append(_html_table(choices.DURATIONS_HEAD, page.durations))
        if number in page.pictures:
            data = base64.b64encode(page.pictures[number]).decode()
            parts.append(f'<p><img alt="{heading}" src="data:image/png;base64,{data}">')
        parts.append(_html_table(RUN_HEAD, _run_rows(page.figures.get(number, ()))))
    return "\n".join(parts) + "\n"


def as_markdown(page: Page) -> str:
    """The page with its pictures in the folder IMAGES beside it."""
    parts = [
        f"# {TITLE}",
        *page.introduction(),
        "## Claims",
        _markdown_table(CLAIM_HEAD, page.claim_rows()),
        "## Table 2",
        *page.table_2(),
    ]
    if page.comparison is not None:
        parts += [_markdown_table(HEAD, table_rows(page.comparison))]
        parts += [f"`{command}`" for command in page.compared]
    parts += ["## Figures"]
    for number, heading, caption in SECTIONS:
        parts += [f"### {heading}", caption]
        if number == "choices" and page.tried:
            parts.append(_markdown_table(choices.HEAD, page.tried))
        if number == "choices" and page.durations:
            parts += [choices.DURATIONS_CAPTION, _markdown_table(choices.DURATIONS_HEAD, page.durations)]
        if number in page.pictures:
            parts.append(f"![{heading}]({IMAGES}/figure-{number}.png)")
        parts.append(_markdown_table(RUN_HEAD, _run_rows(page.figures.get(number, ()), mark="`")))
    return "\n\n".join(parts) + "\n"


def _run_rows(rows: Sequence[Mapping[str, Any]], mark: str = "") -> list[tuple[str, ...]]:
    """Cells of the table of a figure's runs."""
    found = []
    for row in rows:
        command = f"{mark}{row['command']}{mark}"
        if row["status"] != "done":
            found.append((command, f"{row['status']}: {row['reason']}", "", "", "", ""))
            continue
        peaks = ", ".join(f"{1e-3 * value:.3f}" for _, value in row["F_n_peaks"])
        count = len(row["contacts"])
        contact = f"{1e3 * row['contact_duration']:.3f}" + (f" in {count}" if count > 1 else "")
        contact += ", still open" if row["contact_open_at_end"] else ""
        F_t = f"{1e-3 * row['F_t_min']:.3f} … {1e-3 * row['F_t_max']:.3f}"
        found.append((command, f"{row['n_elements']:,}", peaks, F_t, contact, f"{100 * row['energy_error']:.3f} %"))
    return found


def value_text(value: float | str | None, unit: str) -> str:
    """A number with its unit, words, or a dash."""
    if value is None:
        return "–"
    return value if isinstance(value, str) else f"{value:.4g} {unit}".strip()


def _change(change: float | str | None) -> str:
    if change is None:
        return "–"
    return change if isinstance(change, str) else f"{round(100 * change, 1) + 0.0:+.1f} %"


def _html_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    colours = {"agrees": "yes", "differs": "no", "–": "open"}
    lines = ["<table><tr>" + "".join(f"<th>{html.escape(name)}" for name in head)]
    for row in rows:
        cells = [
            f"<td><code>{html.escape(cell)}</code>"
            if cell.startswith("warp-mca ")
            else f'<td class="{colours.get(cell, "")}">{html.escape(cell)}'
            for cell in row
        ]
        lines.append("<tr>" + "".join(cells))
    return "\n".join(lines) + "</table>"


def _markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *([cell.replace("|", "\\|") for cell in row] for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
