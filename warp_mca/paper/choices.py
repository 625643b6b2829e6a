"""Owns the table of choices that the paper leaves open: what each gives of the published figures, side by side."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from warp_mca.paper import readings as read
from warp_mca.paper.evidence import Evidence, MissingRunError, Runs
from warp_mca.paper.studies import CELLS, CELLS_LUG, ENDS, LUG, MAIN, MESH, PENALTY, SPRINGS
from warp_mca.results.result import Result

HEAD = (
    "hinges, cells at the tip",
    "first peak [kN]",
    "second peak [kN]",
    "F_n at μ = 0.1, 1.5 [kN]",
    "F_t there [kN]",
    "contact at μ = 0.1, 0.47, 1.5 [ms]",
    "F_t turns at 0.4, 0.8 m/s",
)
PUBLISHED = ("published", "3.235", "a second compression", "4.10, 2.44", "-0.42, -2.31", "0.42, –, 0.39", "no, yes")
TRIED = {
    MAIN: "two pairs of nodes, main mesh",
    LUG: "fork and eye, main mesh",
    CELLS: "two pairs of nodes, 0.45 mm",
    CELLS_LUG: "fork and eye, 0.45 mm",
}
CAPTION = (
    "What the paper leaves open and what decides the rest: its hinges and its cells at the tip, all with its penalty "
    "0.1. Its words name two pairs of nodes in each hinge of fork and eye. On fine cells two pairs yield as under a "
    "point load, and F_t no longer turns at 0.8 m/s; with the surfaces of the holes coupled it turns there on every "
    "mesh. The coarser the cells, the more of the first peak the penalty takes: with 0.45 mm it is the published one."
)


DURATIONS_HEAD = ("penalty, mesh", *(f"{name} of {value:g} GPa [ms]" for name, value in ENDS))
DURATIONS = ("published", "1", "0.33", "1.39", "0.22", "1.57", "0.14")
SPRINGS_TRIED = {
    MAIN: "1, main mesh",
    MESH: "1, other mesh",
    PENALTY: "0.5, other mesh",
    SPRINGS: "0.3, cells of 1.2 mm at the tip",
}
DURATIONS_CAPTION = (
    "Durations of Figs. 16 to 18, succession collisions included, by the contact's springs. Those of the last row are "
    "as soft, by area, as the published first peak asks for: 4 mm of cell over penalty factor."
)


def duration_rows(runs: Runs) -> list[tuple[str, ...]]:
    """Cells under DURATIONS_HEAD, where the level has the moduli with published durations."""
    if not runs.cases.keys() >= {(name, value, MAIN) for name, value in ENDS}:
        return []
    found: list[tuple[str, ...]] = [DURATIONS]
    for variant, title in SPRINGS_TRIED.items():
        values = [_text(Evidence(runs, variant), read.event_duration, point, 3) for point in ENDS]
        found.append((title, *values))
    return found


def choice_rows(runs: Runs) -> list[tuple[str, ...]]:
    """Cells under HEAD: the published figures, then those of each choice that has runs."""
    tried = {variant for _, _, variant in runs.cases}
    return [PUBLISHED, *(_row(Evidence(runs, variant), title) for variant, title in TRIED.items() if variant in tried)]


def _row(evidence: Evidence, title: str) -> tuple[str, ...]:
    def listed(reading: Callable[[Result], float], *points: tuple[str, float], digits: int = 3) -> str:
        return ", ".join(_text(evidence, reading, point, digits) for point in points)

    ends: Sequence[tuple[str, float]] = (("mu", 0.1), ("mu", 1.5))
    return (
        title,
        listed(read.first_peak, ("base", 0.0)),
        listed(read.second_peak, ("base", 0.0)),
        listed(read.first_peak, *ends),
        listed(read.greatest_F_t, *ends),
        listed(read.duration, ends[0], ("base", 0.0), ends[1]),
        ", ".join(_turns(evidence, value) for value in (0.4, 0.8)),
    )


def _text(evidence: Evidence, reading: Callable[[Result], float], point: tuple[str, float], digits: int) -> str:
    try:
        return f"{reading(evidence.run(*point)):.{digits}f}"
    except MissingRunError:
        return "–"


def _turns(evidence: Evidence, value: float) -> str:
    """Whether F_t changes its sign, and how far it gets."""
    try:
        summary = evidence.run("v_plate", value).summary
    except MissingRunError:
        return "–"
    return f"{'yes' if summary['F_t_reverses'] else 'no'} ({summary['F_t_max']:.0f} N)"
