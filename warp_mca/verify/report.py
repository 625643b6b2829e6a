"""Owns the report of a verification: the table on the console, verification.md and its figure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from warp_mca.verify.case import Case, Row, Setup


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """A case that was run.

    Attributes:
        case: that was run.
        setup: how.
        rows: what it gave; empty when it failed.
        failure: why it gave nothing, or None.
        wall: seconds it took.
        skipped: why it was not run after all, or None.
    """

    case: Case
    setup: Setup
    rows: tuple[Row, ...]
    failure: str | None
    wall: float
    skipped: str | None = None

    @property
    def element(self) -> str:
        """Formulation that was run, or "none" where none takes part."""
        return self.setup.element if self.case.elements else "none"

    @property
    def met(self) -> bool:
        """Whether every row is, or is known to be open."""
        return self.failure is None and bool(self.rows) and all(row.met or row.open for row in self.rows)


def _number(value: float) -> str:
    return f"{value:.4g}"


def cells(row: Row) -> list[str]:
    """Quantity, exact, measured, error, order, tolerance and verdict, as text."""
    order = row.order
    return [
        row.quantity,
        f"{_number(row.exact)} {row.unit}".removesuffix(" -"),
        ", ".join(_number(value) for value in row.measured),
        f"{row.errors[-1]:.2g}",
        "" if order is None else f"{order:.1f}",
        f"{row.tolerance:.2g}",
        row.verdict,
    ]


HEAD = ["quantity", "exact", "measured, coarse to fine", "error", "order", "tolerance", ""]


def lines(outcome: Outcome) -> list[str]:
    """What the console shows of one case."""
    case, how = outcome.case, f"{outcome.element}, {outcome.setup.precision}"
    if outcome.skipped:
        return [f"{case.group}/{case.name}: {case.title}: {outcome.skipped}"]
    verdict = "met" if outcome.met else "NOT MET"
    shown = [f"{case.group}/{case.name} ({how}): {case.title}: {verdict}, {outcome.wall:.1f} s"]
    if outcome.failure:
        shown.append(f"  {outcome.failure}")
    for row in outcome.rows:
        quantity, exact, measured, error, order, tolerance, met = cells(row)
        rate = f", order {order}" if order else ""
        shown.append(f"  {quantity}: {measured} for {exact}, error {error}{rate}, tolerance {tolerance}: {met}")
        if row.verdict == "OPEN" and row.open:
            shown.append(f"    {row.open}")
    return shown


def write(folder: Path, outcomes: Sequence[Outcome], header: str, notes: Mapping[str, str] | None = None) -> list[Path]:
    """Write verification.md and images/verification.png into `folder`; returns the files.

    Args:
        folder: is made if need be.
        outcomes: of cases, in the order of the page.
        header: text below the title.
        notes: a sentence to add to the section of a case, by its name.
    """
    folder.mkdir(parents=True, exist_ok=True)
    image = _figure(folder / "images" / "verification.png", outcomes)
    text = ["# Verification", "", header, ""]
    if image:
        text += ["![Error over element size of every row with an order](images/verification.png)", ""]
    for group in dict.fromkeys(outcome.case.group for outcome in outcomes):
        text += [f"## {group}", ""]
        mine = [outcome for outcome in outcomes if outcome.case.group == group]
        for name in dict.fromkeys(outcome.case.name for outcome in mine):
            text += _section([outcome for outcome in mine if outcome.case.name == name])
            if notes and name in notes:
                text += [notes[name], ""]
    page = folder / "verification.md"
    page.write_text("\n".join(text).rstrip() + "\n", encoding="utf-8")
    return [page, *([image] if image else [])]


def _section(outcomes: Sequence[Outcome]) -> list[str]:
    case = outcomes[0].case
    text = [f"### {case.name}", "", f"{case.title}. {case.reference}", ""]
    if all(outcome.skipped for outcome in outcomes):
        return [*text, f"{outcomes[0].skipped}.".capitalize(), ""]
    text += ["| element | precision | " + " | ".join(HEAD) + " |", "|---" * (len(HEAD) + 2) + "|"]
    reasons: dict[str, str] = {}
    found: dict[tuple[str, str], list[str]] = {}  # precisions that gave the same row of an element
    for outcome in outcomes:
        shown = [" | ".join(cells(row)) for row in outcome.rows]
        shown += [f"{outcome.failure} | | | | | | NOT MET"] if outcome.failure else []
        for row in shown:
            found.setdefault((outcome.element, row), []).append(outcome.setup.precision)
        for row in outcome.rows:
            reasons.setdefault(row.quantity, row.why + (f"; open: {row.open}" if row.verdict == "OPEN" else ""))
    text += [f"| {element} | {', '.join(precisions)} | {row} |" for (element, row), precisions in found.items()]
    text += ["", "Tolerances: " + "; ".join(f"{key}: {why}" for key, why in reasons.items()) + "."]
    return [*text, ""]


def _figure(path: Path, outcomes: Sequence[Outcome]) -> Path | None:
    """Error over element size, for every row that demands or shows an order; None when there is none."""
    from warp_mca.results import figure_style as style
    from warp_mca.results.figure_style import new_figure, save_png, tidy

    looks = {
        "hex8i": (style.BLACK, "D", "-"),
        "hex8": (style.BLUE, "o", "-"),
        "hex8r": (style.VERMILION, "s", "--"),
        "hex8w": (style.ORANGE, "P", "-."),
        "tet4": (style.GREEN, "^", ":"),
        "tet10": (style.PURPLE, "v", "-."),
        "tet10_mean": (style.SKY, "<", "-."),
        "wedge6": (style.SKY, "h", "--"),
    }
    curves = [(o, row) for o in outcomes for row in o.rows if row.order is not None and row.order > 0.3]
    if not curves:
        return None
    groups = list(dict.fromkeys(outcome.case.group for outcome, _ in curves))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure = new_figure(7.0, 2.6 * ((len(groups) + 1) // 2))
    all_axes = figure.subplots(-(-len(groups) // 2), 2, squeeze=False).ravel()
    for axes in all_axes[len(groups) :]:
        axes.set_visible(False)
    for axes, group in zip(all_axes, groups, strict=False):
        for outcome, row in curves:
            if outcome.case.group == group:
                color, marker, line = looks.get(outcome.setup.element, ("0.5", "x", "-"))
                sizes = [size / max(row.sizes) for size in row.sizes]
                axes.loglog(sizes, row.errors, color=color, marker=marker, linestyle=line, linewidth=0.8, markersize=3)
        axes.xaxis.set_minor_formatter("")
        axes.set_title(group, loc="left", fontsize=9)
        axes.set_xlabel("element size over the coarsest [-]", fontsize=8)
        axes.set_ylabel("relative error [-]", fontsize=8)
        tidy(axes)
    for name in dict.fromkeys(outcome.setup.element for outcome, _ in curves):
        color, marker, line = looks.get(name, ("0.5", "x", "-"))
        all_axes[0].plot([], [], color=color, marker=marker, linestyle=line, markersize=3, label=name)
    figure.legend(loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return save_png(figure, path)
