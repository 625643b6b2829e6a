"""Owns forces.png: contact forces over time with the phases of contact, and the velocities of tip and plate below.

Phases are shown as in Fig. 12 of the paper: times of sticking are shaded over the full height; a strip at the bottom
tells compression from restitution.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.history import Interval, contact_intervals, intervals, smoothed, stick_intervals
from warp_mca.report.style import BLACK, BLUE, STICK, VERMILION, legend_beside, new_figure, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_mca.results import Result

COMPRESSION, RESTITUTION = "#5A5A5A", "#BDBDBD"
STRIP = 0.035  # height of the strip of phases, as a share of the axes


def compression_phases(result: Result) -> tuple[list[Interval], list[Interval]]:
    """Times of compression and of restitution [s].

    In contact, the bodies are compressed while the tip moves towards the plate, tip_vy < 0; otherwise they restitute.
    Both lists are empty when the scene has no tip.
    """
    time, velocity = result.time, result["tip_vy"]
    if len(time) < 2 or not np.isfinite(velocity).all():
        return [], []
    touching = np.zeros(len(time), dtype=bool)
    for start, end in contact_intervals(time, result.F_n):
        touching |= (time > start) & (time <= end)
    closing = smoothed(time, velocity) < 0.0
    return intervals(time, touching & closing, 0.0), intervals(time, touching & ~closing, 0.0)


def plot_forces(result: Result) -> Figure:
    """The figure: F_n and F_t [N or kN] above, tip and plate velocities [m/s] below, over time [ms]."""
    figure = new_figure(7.0, 5.6)
    forces, velocities = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _shade_phases(forces, result, labelled=True)
    _shade_phases(velocities, result)
    _draw_forces(forces, result)
    _draw_velocities(velocities, result)
    figure.align_ylabels()
    for axes in (forces, velocities):
        tidy(axes)
        legend_beside(axes)
    velocities.set_xlabel("time after first contact [ms]")
    velocities.set_xlim(0.0, 1e3 * float(result.time[-1]) if len(result.time) else 1.0)
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


def _draw_velocities(axes: Axes, result: Result) -> None:
    time = 1e3 * result.time
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    # A node of the plate's surface rings with every wave that passes: thin, so that it stays in the background.
    axes.plot(time, result["plate_vx"], color=BLACK, label=r"plate $v_x$", linewidth=0.7)
    axes.plot(time, result["tip_vx"], color=VERMILION, linestyle="--", label=r"tip $v_x$", linewidth=1.4)
    axes.plot(time, result["tip_vy"], color=BLUE, label=r"tip $v_y$", linewidth=1.4)
    axes.margins(y=0.08)
    axes.set_ylabel("velocity [m/s]")


def _title(result: Result) -> str:
    """The scene and how long the contacts last, so that the picture explains itself away from its folder."""
    contacts = contact_intervals(result.time, result.F_n)
    name = str(result.summary.get("scene") or "")
    if not contacts:
        return f"{name}: no contact".removeprefix(": ")
    lengths = " + ".join(f"{1e3 * (end - start):.3f}" for start, end in contacts[:4])
    more = " + …" if len(contacts) > 4 else ""
    return f"{name}: contact for {lengths}{more} ms".removeprefix(": ")
