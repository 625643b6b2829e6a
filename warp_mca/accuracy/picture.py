"""Owns tradeoff.png: time against error, a panel for each figure, points by knob, and the frontier."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warp_mca.accuracy.figures import NAMES
from warp_mca.accuracy.worth import HEADINGS
from warp_mca.report.style import BLACK, BLUE, GREEN, ORANGE, PURPLE, SKY, VERMILION, new_figure, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEAST = 1e-5  # error that smaller ones are drawn at [-]
COLOURS = {
    "as written": (BLACK, "*"),
    "mesh": (BLUE, "o"),
    "springs": (VERMILION, "s"),
    "mass scaling": (GREEN, "^"),
    "multi-rate": (ORANGE, "D"),
    "time step": (PURPLE, "v"),
    "element": (SKY, "P"),
    "precision": ("0.5", "X"),
    "combined": (BLACK, "o"),
    "reference": ("0.5", "d"),
}
OTHER = ("#8C564B", "h")  # parameters of the scene's model
CLOCKS = {"cpu": "processor time of the steps, one thread [s]", "fe": "wall time of the steps [s]"}


def plot_tradeoff(contents: Mapping[str, Any]) -> Figure:
    """The figure of a trade-off, from the contents of tradeoff.json."""
    import matplotlib.ticker as ticker

    figure = new_figure(13.0, 8.0)
    panels = figure.subplots(2, 3).ravel()
    clock = contents["time"]
    rows = [row for row in contents["variants"] if not row["stopped"]]
    for axes, name in zip(panels, NAMES, strict=False):
        axes.set_title(HEADINGS[name], loc="left", fontsize=10, fontweight="bold")
        axes.set_xscale("log")
        axes.set_xlabel(CLOCKS[clock], fontsize=8)
        axes.set_ylabel("error [%]", fontsize=8)
        axes.tick_params(labelsize=8)
        tidy(axes)
        if contents["reference"]["figures"][name] is None:
            _say_why(axes, contents["reference"]["why"][name])
            continue
        _draw(axes, rows, name, clock, contents["reference"]["left"][name])
        axes.set_yscale("log")
        axes.yaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axes.xaxis.set_major_formatter(ticker.FormatStrFormatter("%g"))
        axes.xaxis.set_minor_formatter(ticker.NullFormatter())
    _legend(panels[-1], rows)
    figure.suptitle(f"{contents['scene']} on {contents['device']}: what a choice costs in error", fontsize=11)
    return figure


def _draw(axes: Axes, rows: list[dict[str, Any]], name: str, clock: str, left: float | None) -> None:
    points = []
    for row in rows:
        error = row["errors"][name]
        if error is None:
            continue
        x, y = row["wall"][clock], 100.0 * max(abs(error), LEAST)
        colour, marker = COLOURS.get(row["knob"], OTHER)
        hollow = row["knob"] == "combined"
        size = 110 if row["knob"] == "as written" else 30
        face = "none" if hollow else colour
        axes.scatter(x, y, s=size, marker=marker, facecolors=face, edgecolors=colour, linewidths=0.9, zorder=3)
        points.append((x, y, name in row["frontier"]))
    front = sorted(point[:2] for point in points if point[2])
    if front:
        axes.step(*zip(*front, strict=True), where="post", color="0.35", linewidth=1.0, zorder=2)
    if left:
        axes.axhspan(
            axes.get_ylim()[0] if not points else min(y for _, y, _ in points) * 0.5, 100.0 * left, color="0.93"
        )


def _say_why(axes: Axes, why: str) -> None:
    import textwrap

    text = "no limit:\n" + textwrap.fill(why, 40)
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", fontsize=9, color="0.3")
    axes.set_xticks([])
    axes.set_yticks([])


def _legend(axes: Axes, rows: list[dict[str, Any]]) -> None:
    """Names of the knobs in a panel of their own."""
    axes.axis("off")
    for knob in dict.fromkeys(row["knob"] for row in rows):
        colour, marker = COLOURS.get(knob, OTHER)
        face = "none" if knob == "combined" else colour
        axes.scatter([], [], marker=marker, facecolors=face, edgecolors=colour, label=knob)
    axes.plot([], [], color="0.35", linewidth=1.0, label="frontier")
    axes.fill_between([], [], color="0.9", label="within the reference's own error")
    axes.legend(loc="center left", frameon=False, fontsize=9)
