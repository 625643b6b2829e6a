"""Owns the pictures of the page: the paper's figures, drawn from our runs."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.paper.evidence import Evidence, MissingRunError
from warp_mca.paper.readings import path, row_at
from warp_mca.paper.studies import MESHES, STUDIES
from warp_mca.paper.table_2 import MCA, PURE
from warp_mca.results.figure_style import BLACK, BLUE, DOTS_PER_INCH, VERMILION, legend_beside, new_figure, tidy
from warp_mca.results.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INSTANTS = (20, 40, 60, 80, 100, 200)  # of Fig. 11 [us]
STYLES = ("-", "--", "-.", ":")
Panel = tuple[str, str, float]  # column of the history, label of the axis, factor of its values
FORCES: tuple[Panel, ...] = (("F_n_N", "$F_n$ [kN]", 1e-3), ("F_t_N", "$F_t$ [kN]", 1e-3))
VELOCITIES: tuple[Panel, ...] = (
    ("tip_vx", "tip $v_t$ [m/s]", 1.0),
    ("tip_vy", "tip $v_n$ [m/s]", 1.0),
    ("plate_vx", "plate $v_x$ [m/s]", 1.0),
)

FLUTTER = (
    "Where v_x of the plate swings from row to row, friction makes its outermost cells vibrate: flutter, which depends "
    "on mesh and penalty and not on the time step. The forces hardly show it."
)


@dataclass(frozen=True)
class Picture:
    """A figure of the paper.

    Attributes:
        number: the paper's.
        study: whose runs it shows.
        caption: what it shows.
        draw: draws it; raises MissingRunError where runs are missing.
    """

    number: str
    study: str
    caption: str
    draw: Callable[[Evidence], Figure]


def png(figure: Figure) -> bytes:
    """The figure as a PNG file; equal runs give equal bytes."""
    stream = io.BytesIO()
    figure.savefig(stream, format="png", dpi=DOTS_PER_INCH // 2, metadata={"Software": None})
    return stream.getvalue()


def _curves(evidence: Evidence, study: str, panels: Sequence[Panel]) -> Figure:
    """A panel for each column, a line for each value of the study, over time."""
    values = evidence.values(study)
    named = [(f"{value:g}", evidence.run(study, value)) for value in values]
    figure = _panels(named, panels)
    _legend_outside(figure, STUDIES[study].quantity)
    return figure


def _legend_outside(figure: Figure, title: str) -> None:
    """One legend beside all panels, which does not push them apart."""
    lines, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(lines, labels, title=title, loc="outside right upper", frameon=False, fontsize=9)


def _panels(named: Sequence[tuple[str, Result]], panels: Sequence[Panel]) -> Figure:
    import matplotlib

    figure = new_figure(7.5, 0.6 + 2.1 * len(panels))
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(named)))
    rows: list[Axes] = list(np.atleast_1d(figure.subplots(len(panels), 1, sharex=True)))
    for axes, (column, label, factor) in zip(rows, panels, strict=True):
        axes.axhline(0.0, color="0.5", linewidth=0.8)
        for k, (name, result) in enumerate(named):
            style = {"color": colours[k], "linestyle": STYLES[k % len(STYLES)], "linewidth": 1.3}
            axes.plot(1e3 * result.time, factor * result[column], label=name, **style)
        axes.set_ylabel(label)
        tidy(axes)
    rows[-1].set_xlabel("time after first contact [ms]")
    return figure


def _meshes(evidence: Evidence) -> Figure:
    named = [(f"{r.summary['n_elements']:,}", r) for r in evidence.results(MESHES)]
    figure = _panels(named, FORCES[:1])
    _legend_outside(figure, "elements")
    return figure


def _force_both_ways(evidence: Evidence) -> Figure:
    """F_n of Table 1; where they were run, also of finite elements alone and of rigid links first in their scene."""
    named = [("rigid links first", evidence.run("base", 0.0))]
    if evidence.runs.comparison:
        both = (("rigid links first, as Table 2", MCA), ("finite elements alone, as Table 2", PURE))
        named += [(name, evidence.compared(folder)) for name, folder in both]
    figure = _panels(named, FORCES[:1])
    figure.axes[0].set_xlim(0.0, 1e3 * named[0][1].time[-1])
    figure.axes[0].legend(loc="upper right", frameon=False, fontsize=9)
    return figure


def _swing(evidence: Evidence) -> Figure:
    """Velocity of the tip's centre before and in the impact, from 0.15 s on."""
    result = evidence.run("swing", 0.0)
    time = result.time + result.summary["t_contact"]
    shown = time >= 0.15
    figure = new_figure(7.5, 3.2)
    axes = figure.subplots()
    for column, label, colour, style in (("tip_vx", "$v_t$", VERMILION, "--"), ("tip_vy", "$v_n$", BLUE, "-")):
        sign = -1.0 if column == "tip_vy" else 1.0
        axes.plot(time[shown], sign * result[column][shown], color=colour, linestyle=style, label=label, linewidth=1.3)
    axes.axvline(result.summary["t_contact"], color=BLACK, linewidth=0.8)
    axes.set_xlabel("time after release [s]")
    axes.set_ylabel("velocity [m/s]")
    tidy(axes)
    legend_beside(axes)
    return figure


def _waves(evidence: Evidence) -> Figure:
    """Von Mises stress along Paths 1, 2 and 3 at some instants."""
    import matplotlib

    result = evidence.run("base", 0.0)
    figure = new_figure(7.5, 7.0)
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.9, len(INSTANTS)))
    rows = figure.subplots(3, 1, sharex=True, sharey=True)
    for number, axes in enumerate(rows, start=1):
        history = path(result, number)
        gap = int(np.argmax(np.diff(history.position))) + 1  # the hinge is left out
        for colour, instant in zip(colours, INSTANTS, strict=True):
            stress = 1e-6 * history.von_mises[row_at(result, 1e-6 * instant)]
            position, values = (np.insert(item.astype(float), gap, np.nan) for item in (history.position, stress))
            axes.plot(position, values, color=colour, label=f"{instant} µs", linewidth=1.2)
        axes.set_title(history.name, loc="left", fontsize=10)
        axes.set_ylabel("von Mises [MPa]")
        tidy(axes)
    rows[0].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    rows[-1].set_xlabel("position from the tip's end: AB, then OA [m]")
    return figure


def _pictures(study: str) -> tuple[Callable[[Evidence], Figure], Callable[[Evidence], Figure]]:
    return partial(_curves, study=study, panels=FORCES), partial(_curves, study=study, panels=VELOCITIES)


PICTURES: tuple[Picture, ...] = (
    Picture("7", MESHES, "Normal contact force with different meshes.", _meshes),
    Picture("8", "swing", "Velocity of the tip's centre: downwards and along +x. The line marks contact.", _swing),
    Picture("9", "base", "Normal contact force. Table 2 has finite elements alone.", _force_both_ways),
    Picture("11", "base", "Stress waves along the manipulator.", _waves),
    Picture("12", "v_plate", "Contact forces, by initial velocity of the plate.", _pictures("v_plate")[0]),
    Picture(
        "13",
        "v_plate",
        f"Velocities of tip and plate, by initial velocity of the plate. {FLUTTER}",
        _pictures("v_plate")[1],
    ),
    Picture("14", "mu", "Contact forces, by coefficient of friction.", _pictures("mu")[0]),
    Picture("15", "mu", f"Velocities of tip and plate, by coefficient of friction. {FLUTTER}", _pictures("mu")[1]),
    Picture("16", "tip", "Modulus of the tip.", partial(_curves, study="tip", panels=FORCES + VELOCITIES[:2])),
    Picture(
        "17", "body", "Modulus of the rods' bodies.", partial(_curves, study="body", panels=FORCES + VELOCITIES[:2])
    ),
    Picture("18", "rod", "Modulus of the whole rods.", partial(_curves, study="rod", panels=FORCES + VELOCITIES[:2])),
)


def drawn(evidence: Evidence) -> dict[str, bytes]:
    """PNG files by number of figure; those whose runs are missing are left out."""
    found = {}
    for picture in PICTURES:
        try:
            found[picture.number] = png(picture.draw(evidence))
        except MissingRunError:
            continue
    return found
