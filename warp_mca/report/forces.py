"""Owns forces.png: contact forces over time with the sticking shaded, and the velocities of tip and plate below."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.history import contact_intervals, stick_intervals

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_mca.results import Result

# Okabe and Ito's colours, told apart by colour-blind readers; line styles tell them apart in grey print.
BLUE, VERMILION, BLACK = "#0072B2", "#D55E00", "#222222"
STICK = "#F0E442"


def plot_forces(result: Result) -> Figure:
    """The figure: F_n and F_t [N or kN] above, tip and plate velocities [m/s] below, over time [ms]."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 5.6), layout="constrained")
    FigureCanvasAgg(figure)
    forces, velocities = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _shade_sticking(forces, result, label="sticking")
    _shade_sticking(velocities, result)
    _draw_forces(forces, result)
    _draw_velocities(velocities, result)
    figure.align_ylabels()
    for axes in (forces, velocities):
        axes.grid(color="0.88", linewidth=0.6)
        axes.set_axisbelow(True)
        axes.spines[["top", "right"]].set_visible(False)
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
    velocities.set_xlabel("time after first contact [ms]")
    velocities.set_xlim(0.0, 1e3 * float(result.time[-1]) if len(result.time) else 1.0)
    forces.set_title(_title(result), loc="left", fontsize=10)
    return figure


def save_forces(path: str | os.PathLike[str], result: Result) -> Path:
    """Write the figure to `path` as PNG at 200 dots per inch."""
    # Without the date and version that matplotlib adds, equal runs give equal files.
    plot_forces(result).savefig(path, dpi=200, metadata={"Software": None})
    return Path(path)


def _shade_sticking(axes: Axes, result: Result, label: str | None = None) -> None:
    for start, end in stick_intervals(result.time, result.F_n, result["stick_fraction"]):
        axes.axvspan(1e3 * start, 1e3 * end, color=STICK, alpha=0.45, linewidth=0, label=label)
        label = None


def _draw_forces(axes: Axes, result: Result) -> None:
    greatest = max(float(np.max(np.abs(force), initial=0.0)) for force in (result.F_n, result.F_t))
    scale, unit = (1e-3, "kN") if greatest >= 1e3 else (1.0, "N")
    time = 1e3 * result.time
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    axes.plot(time, scale * result.F_n, color=BLUE, label=r"$F_n$", linewidth=1.4)
    axes.plot(time, scale * result.F_t, color=VERMILION, linestyle="--", label=r"$F_t$", linewidth=1.4)
    axes.set_ylabel(f"contact force [{unit}]")


def _draw_velocities(axes: Axes, result: Result) -> None:
    time = 1e3 * result.time
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    # A node of the plate's surface rings with every wave that passes: thin, so that it stays in the background.
    axes.plot(time, result["plate_vx"], color=BLACK, label=r"plate $v_x$", linewidth=0.7)
    axes.plot(time, result["tip_vx"], color=VERMILION, linestyle="--", label=r"tip $v_x$", linewidth=1.4)
    axes.plot(time, result["tip_vy"], color=BLUE, label=r"tip $v_y$", linewidth=1.4)
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
