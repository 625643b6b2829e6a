"""Owns tradeoff.png: time against error, a panel for each figure, points by knob, and the frontier."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.worth import HEADINGS, present
from warp_mca.results.figure_style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 1e-4  # error that smaller ones are drawn at [-]
COLOURS = {
    "as written": (BLACK, "*"),
    "mesh": (BLUE, "o"),
    "springs": (VERMILION, "s"),
    "mass scaling": (GREEN, "^"),
    "multi-rate": (ORANGE, "D"),
    "time step": (PURPLE, "v"),
    "element": (SKY, "P"),
    "precision": ("#B8860B", "X"),
    "combined": (BLACK, "o"),
    "reference": ("0.5", "d"),
}
BROWN, MARKERS = "#8C564B", ("h", "p", "<", ">", "8", "H")  # of parameters of the scene's model
CLOCKS = {"cpu": "processor time of the steps, one thread [s]", "fe": "wall time of the steps [s]"}


def plot_tradeoff(contents: Mapping[str, Any]) -> Figure:
    """The figure of a trade-off, from the contents of tradeoff.json."""
    names = present(contents)
    across = 2 if len(names) < 4 else 3
    down = len(names) // across + 1  # one panel is for the names of the knobs
    figure = new_figure(4.4 * across, 4.0 * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    rows = [row for row in contents["variants"] if not row["stopped"]]
    looks = _looks(rows)
    for axes, name in zip(panels, names, strict=False):
        axes.set_title(HEADINGS[name], loc="left", fontsize=10, fontweight="bold")
        if contents["reference"]["figures"][name] is None:
            _say_why(axes, contents["reference"]["why"][name])
            continue
        axes.set_xlabel(CLOCKS[contents["time"]], fontsize=8)
        axes.set_ylabel("error [%]", fontsize=8)
        tidy(axes)
        _draw(axes, [row for row in rows if row["errors"][name] is not None], name, contents, looks)
    _legend(panels[len(names)], looks)
    for axes in panels[len(names) + 1 :]:
        axes.axis("off")
    figure.suptitle(f"{contents['scene']} on {contents['device']}: what a choice costs in error", fontsize=11)
    return figure


def _looks(rows: list[dict[str, Any]]) -> dict[str, tuple[str, str]]:
    """Colour and marker of each knob."""
    knobs = dict.fromkeys(row["knob"] for row in rows)
    others = [knob for knob in knobs if knob not in COLOURS]
    return {
        knob: COLOURS.get(knob) or (BROWN, MARKERS[others.index(knob) % len(MARKERS)])
        for knob in sorted(
            knobs, key=lambda knob: (knob in others, list(COLOURS).index(knob) if knob in COLOURS else 0)
        )
    }


def _draw(
    axes: Axes, rows: list[dict[str, Any]], name: str, contents: Mapping[str, Any], looks: dict[str, tuple[str, str]]
) -> None:
    import matplotlib.ticker as ticker

    points = [(row["wall"][contents["time"]], 100.0 * max(abs(row["errors"][name]), LEAST)) for row in rows]
    for row, (x, y) in zip(rows, points, strict=True):
        colour, marker = looks[row["knob"]]
        size = 110 if row["knob"] == "as written" else 30
        face = "none" if row["knob"] == "combined" else colour
        axes.scatter(x, y, s=size, marker=marker, facecolors=face, edgecolors=colour, linewidths=0.9, zorder=3)
    front = sorted(point for row, point in zip(rows, points, strict=True) if name in row["frontier"])
    if front:
        axes.step(*zip(*front, strict=True), where="post", color="0.35", linewidth=1.0, zorder=2)
    bottom = 0.7 * min((y for _, y in points), default=1.0)
    left = 100.0 * (contents["reference"]["left"][name] or 0.0)
    if left > bottom:
        axes.axhspan(bottom, left, color="0.93", zorder=0)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_ylim(bottom=bottom)
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(ticker.LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axis.set_minor_formatter(ticker.NullFormatter())
    axes.tick_params(labelsize=8)


def _say_why(axes: Axes, why: str) -> None:
    """A panel with a sentence in place of points."""
    text = "no limit:\n" + textwrap.fill(why, 40)
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="0.3")
    axes.set_xticks([])
    axes.set_yticks([])
    axes.spines[:].set_color("0.85")


def _legend(axes: Axes, looks: dict[str, tuple[str, str]]) -> None:
    """Names of the knobs, in a panel of their own."""
    axes.axis("off")
    for knob, (colour, marker) in looks.items():
        face = "none" if knob == "combined" else colour
        axes.scatter([], [], marker=marker, facecolors=face, edgecolors=colour, label=knob)
    axes.plot([], [], color="0.35", linewidth=1.0, label="frontier")
    axes.fill_between([], [], color="0.9", label="below the reference's own error")
    axes.legend(loc="center left", frameon=False, fontsize=9)
