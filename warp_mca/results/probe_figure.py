"""Owns probes.png: the acceleration of each probe, raw and filtered, and the force through each section."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.results.figure_style import (
    BLUE,
    GREEN,
    VERMILION,
    engineering,
    legend_beside,
    new_figure,
    place,
    save_png,
    tidy,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from warp_mca.results.result import Result

COLOURS = (BLUE, VERMILION, GREEN)  # of x, y and z
STILL = 0.01  # share of the greatest component below which another one is not drawn
MOST = 8  # panels


def plot_probes(result: Result) -> Figure:
    """The figure: a panel for each of the first probes and sections, components [m/s^2 or N] over time [ms]."""
    panels: list[tuple[str, str, str, NDArray, NDArray | None, str]] = []
    for probe in result.probes:
        smooth, label = probe.own_filtered, "" if probe.cfc is None else f"CFC {probe.cfc:g}"
        panels.append((probe.name, "acceleration", "m/s²", probe.acceleration, smooth, label))
    panels += [(section.name, "force", "N", section.force, None, "") for section in result.sections]
    panels = panels[:MOST]
    figure = new_figure(7.0, 0.6 + 2.0 * len(panels), "none")
    columns = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (name, what, unit, raw, smooth, label) in zip(columns, panels, strict=True):
        _draw(axes, 1e3 * result.time, what, unit, raw, smooth, label)
        axes.set_title(name, loc="left", fontsize=10)
    columns[-1].set_xlabel("time after first contact [ms]")
    columns[-1].set_xlim(*(1e3 * result.time[[0, -1]] if len(result.time) > 1 else (0.0, 1.0)))
    place(figure, columns, right=1.5, gap=0.4)
    return figure


def _draw(axes: Axes, time: NDArray, what: str, unit: str, raw: NDArray, smooth: NDArray | None, label: str) -> None:
    """Components that matter, the raw ones thin where there are filtered ones too."""
    size = np.nan_to_num(np.abs(raw)).max(axis=0, initial=0.0)
    scale, unit = engineering(float(size.max()), unit)
    axes.axhline(0.0, color="0.5", linewidth=0.8)
    for k in np.flatnonzero(size >= STILL * size.max()) if size.any() else ():
        colour = COLOURS[k]
        if smooth is not None:
            axes.plot(time, scale * raw[:, k], color=colour, linewidth=0.6, alpha=0.5)
        shown = raw if smooth is None else smooth
        axes.plot(time, scale * shown[:, k], color=colour, linewidth=1.4, label=f"{'xyz'[k]} {label}".strip())
    axes.set_ylabel(f"{what} [{unit}]")
    tidy(axes)
    legend_beside(axes)


def save_probes(path: str | os.PathLike[str], result: Result) -> Path:
    """Write the figure to `path` as PNG at 200 dots per inch."""
    return save_png(plot_probes(result), path)
