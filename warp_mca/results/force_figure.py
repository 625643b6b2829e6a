"""Owns forces.png: contact forces over time with the phases of contact, and the velocities of tip and plate below.

Phases are shown as in Fig. 12 of the paper: times of sticking are shaded over the full height; a strip at the bottom
tells compression from restitution.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.results.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    SKY,
    STICK,
    VERMILION,
    legend_beside,
    new_figure,
    place,
    save_png,
    tidy,
)
from warp_mca.results.force_history import Interval, contact_intervals, intervals, phases, stick_intervals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_mca.results.result import Result

COMPRESSION, RESTITUTION = "#5A5A5A", "#BDBDBD"
REST = 1e-9  # share of the greatest energy of a run; contact forces that do less work belong to bodies at rest
STILL = 0.01  # share of the greatest component of velocity below which another one is not drawn
# Column, label, colour, line style and width. A node of the surface of the plate rings with every wave: its lines are
# thin and come first, so that they stay in the background.
VELOCITIES = (
    ("plate_vx", r"plate $v_x$", BLACK, "-", 0.7),
    ("plate_vy", r"plate $v_y$", SKY, "-", 0.7),
    ("plate_vz", r"plate $v_z$", PURPLE, "-", 0.7),
    ("tip_vx", r"tip $v_x$", VERMILION, "--", 1.4),
    ("tip_vy", r"tip $v_y$", BLUE, "-", 1.4),
    ("tip_vz", r"tip $v_z$", ORANGE, "-.", 1.4),
    ("closing_speed", "closing speed", GREEN, ":", 1.2),
)
Velocity = tuple[str, str, str, str, float]
STRIP = 0.035  # height of the strip of phases, as a share of the axes


def compression_phases(result: Result) -> tuple[list[Interval], list[Interval]]:
    """Times of compression and of restitution [s], see `history.phases`.

    Both lists are empty where contact forces do no more work than REST of the energy of the run, and for results that
    were saved without closing speeds.
    """
    time, energy = result.time, sum(result[name] for name in ("E_kinetic", "E_internal", "E_contact"))
    if len(time) < 2 or "closing_speed" not in result.history:
        return [], []
    least = REST * float(np.max(energy)) / float(time[-1] - time[-2])
    compression, restitution = phases(result.F_n, result["closing_speed"], least)
    return intervals(time, compression), intervals(time, restitution)


def plot_forces(result: Result) -> Figure:
    """The figure: F_n and F_t [N or kN], below them velocities of tip and plate [m/s] if any, over time [ms]."""
    moving = _shown_velocities(result)
    figure = new_figure(7.0, 5.6 if moving else 3.6, "none")
    heights = (3, 2) if moving else (1,)
    panels = list(figure.subplots(len(heights), 1, sharex=True, squeeze=False, height_ratios=heights)[:, 0])
    forces = panels[0]
    for axes in panels:
        _shade_phases(axes, result, labelled=axes is forces)
    _draw_forces(forces, result)
    if moving:
        _draw_velocities(panels[1], result, moving)
    place(figure, panels, right=1.65)
    for axes in panels:
        tidy(axes)
        legend_beside(axes)
    panels[-1].set_xlabel("time after first contact [ms]")
    panels[-1].set_xlim(0.0, 1e3 * float(result.time[-1]) if len(result.time) else 1.0)
    forces.set_title(_title(result), loc="left", fontsize=10)
    return figure


def save_forces(path: str | os.PathLike[str], result: Result) -> Path:
    """Write the figure to `path` as PNG at 200 dots per inch."""
    return save_png(plot_forces(result), path)


def _shade_phases(axes: Axes, result: Result, labelled: bool = False) -> None:
    compression, restitution = compression_phases(result)
    sticking = stick_intervals(result.time, result.F_n, result["stick_fraction"])
    for spans, label, style in (
        (sticking, "sticking", dict(color=STICK, alpha=0.45)),
        (compression, "compression", dict(color=COMPRESSION, ymax=STRIP)),
        (restitution, "restitution", dict(color=RESTITUTION, ymax=STRIP)),
    ):
        for k, (start, end) in enumerate(spans):
            name = label if labelled and k == 0 else None
            axes.axvspan(1e3 * start, 1e3 * end, linewidth=0, label=name, **style)  # pyright: ignore[reportArgumentType]


def _draw_forces(axes: Axes, result: Result) -> None:
    greatest = max(float(np.max(np.abs(force), initial=0.0)) for force in (result.F_n, result.F_t))
    scale, unit = (1e-3, "kN") if greatest >= 1e3 else (1.0, "N")
    time = 1e3 * result.time
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    axes.plot(time, scale * result.F_n, color=BLUE, label=r"$F_n$", linewidth=1.4)
    axes.plot(time, scale * result.F_t, color=VERMILION, linestyle="--", label=r"$F_t$", linewidth=1.4)
    axes.margins(y=0.08)
    axes.set_ylabel(f"contact force [{unit}]")


def _shown_velocities(result: Result) -> list[Velocity]:
    """Those of tip and plate along the axes in which the tip moves, and the closing speed of the contact."""
    axes = _moving_axes(result)
    return [
        item
        for item in VELOCITIES
        if (item[0][-1] in axes or item[0] == "closing_speed")
        and np.nan_to_num(result.history.get(item[0], np.zeros(1))).any()
    ]


def _draw_velocities(axes: Axes, result: Result, shown: Sequence[Velocity]) -> None:
    time = 1e3 * result.time
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    for column, label, colour, style, width in shown:
        axes.plot(time, result[column], color=colour, linestyle=style, label=label, linewidth=width)
    axes.margins(y=0.08)
    axes.set_ylabel("velocity [m/s]")


def _moving_axes(result: Result) -> str:
    """Letters of the axes in which the tip moves, or the plate in scenes without a tip; all where neither moves."""
    for point in ("tip", "plate"):
        speed = {axis: np.abs(result.history.get(f"{point}_v{axis}", np.zeros(1))) for axis in "xyz"}
        greatest = {axis: float(np.max(v, initial=0.0, where=np.isfinite(v))) for axis, v in speed.items()}
        if any(greatest.values()):
            return "".join(axis for axis in "xyz" if greatest[axis] > STILL * max(greatest.values()))
    return "xyz"


def _title(result: Result) -> str:
    """The scene and how long the contacts last, so that the picture explains itself away from its folder."""
    contacts = contact_intervals(result.time, result.F_n)
    name = str(result.summary.get("scene") or "")
    if not contacts:
        return f"{name}: no contact".removeprefix(": ")
    lengths = " + ".join(f"{1e3 * (end - start):.3f}" for start, end in contacts[:4])
    more = " + …" if len(contacts) > 4 else ""
    return f"{name}: contact for {lengths}{more} ms".removeprefix(": ")
