"""Owns the figures of stress along paths: paths.png, curves at chosen instants, and waves.png, position over time."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.results.figure_style import engineering, new_figure, place, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_mca.results.paths import PathHistory
    from warp_mca.results.result import Result

Array = NDArray[np.float64]

INSTANTS = 6  # number of curves in paths.png by default
PASSAGES = 2.5  # of the slowest wave along a path, that waves.png shows
NEAR = 0.05  # share of a path that does not set the height of paths.png
DECADES = 3.0  # of stress in waves.png: the first wave is weak
FIRST = 0.3  # share of the time that they span: while the first wave travels and reflects
GAP = 2.5  # times the usual distance between probes is a gap between the lines of a path
WAVES = {"bar": "bar wave", "dilatational": "dilatational wave", "shear": "shear wave"}
STYLES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 2)))


def plot_paths(
    time: Array,
    paths: Sequence[PathHistory],
    instants: Sequence[float] | None = None,
    headings: Mapping[str, str] | None = None,
) -> Figure:
    """Stress [MPa] over position [mm], one panel with a scale of its own for each path, one curve for each instant.

    Args:
        time: of the samples [s], shape (time_count,).
        paths: at least one.
        instants: when to draw [s]; the nearest samples are taken.
        headings: of the panels, by the path's name; the names by default.
    """
    from matplotlib import colormaps

    if instants is None:
        instants = tuple(np.linspace(0.0, FIRST * time[-1], INSTANTS + 1)[1:])
    rows = np.array([np.argmin(np.abs(time - instant)) for instant in instants])
    paths = [path.at(rows) for path in paths]
    figure = new_figure(7.0, 1.0 + 1.9 * len(paths), "none")
    panels = np.atleast_1d(figure.subplots(len(paths), 1, sharex=True))
    for axes, path in zip(panels, paths, strict=True):
        # Right at the contact stress is many times that of the waves; curves may leave the panel there.
        beyond = path.von_mises[:, path.position >= path.position[0] + NEAR * np.ptp(path.position)]
        greatest = float(np.nanmax(beyond, initial=0.0))
        scale, unit = engineering(greatest, "Pa")
        position, stress = _with_gaps(path)
        for k, row in enumerate(rows):
            colour = colormaps["viridis"](0.9 * k / max(1, len(rows) - 1))
            label = f"{1e6 * time[row]:.0f} µs"
            style = STYLES[k % len(STYLES)]
            axes.plot(1e3 * position, scale * stress[k], color=colour, linestyle=style, label=label)
        axes.set_title((headings or {}).get(path.name, path.name), loc="left", fontsize=10)
        axes.set_ylabel(f"von Mises [{unit}]")
        axes.set_xlim(1e3 * path.position[0], 1e3 * path.position[-1])
        axes.set_ylim(0.0, 1.05 * scale * greatest or 1.0)
        tidy(axes)
    place(figure, panels, right=1.25, gap=0.4)
    panels[-1].set_xlabel("position along the path, from the struck end [mm]")
    panels[0].legend(title="after contact", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def plot_waves(
    time: Array, paths: Sequence[PathHistory], speeds: Mapping[str, float], headings: Mapping[str, str] | None = None
) -> Figure:
    """Position [mm] over time [µs], stress as colour, on a log scale for each path; wave speeds from the struck end.

    Args:
        time: of the samples [s], shape (time_count,).
        paths: at least one.
        speeds: by label [m/s].
        headings: of the panels, by the path's name; the names by default.
    """
    from matplotlib.colors import LogNorm

    figure = new_figure(7.0, 1.0 + 2.1 * len(paths), "none")
    panels = np.atleast_1d(figure.subplots(len(paths), 1, sharex=True, sharey=True))
    place(figure, panels, top=0.6, gap=0.4)
    far = max(float(path.position[-1]) for path in paths)
    shown = time <= PASSAGES * far / min(speeds.values()) if speeds else np.ones(len(time), dtype=bool)
    time, paths = time[shown], [path.at(shown) for path in paths]
    for axes, path in zip(panels, paths, strict=True):
        position, stress = _with_gaps(path)
        # A few probes near the contact are far above the waves: the top hundredth may share one colour.
        limit = float(np.nanpercentile(stress, 99.0)) if stress.size else 0.0
        scale, unit = engineering(limit, "Pa")
        top = scale * limit or 1.0
        value = scale * stress.T
        norm = LogNorm(top / 10.0**DECADES, top, clip=True)
        image = axes.pcolorfast(_edges(1e6 * time), _edges(1e3 * position), value, norm=norm, cmap="viridis")
        bar = figure.colorbar(image, ax=axes, extend="both", format="%g")  # powers of ten take 0.15 s to be parsed
        bar.minorticks_off()
        bar.set_label(f"von Mises [{unit}]")
        _draw_speeds(axes, path, speeds)
        axes.set_xlim(0.0, 1e6 * float(time[-1]))
        axes.set_ylim(1e3 * float(path.position[0]), 1e3 * float(path.position[-1]))
        axes.set_title((headings or {}).get(path.name, path.name), loc="left", fontsize=10)
        axes.set_ylabel("position [mm]")
    panels[-1].set_xlabel("time after first contact [µs]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="upper center", ncols=3, frameon=False)
    return figure


def _edges(centres: Array) -> Array:
    """Between cells around increasing centres, shape (count + 1,); the outer cells are symmetric."""
    if len(centres) < 2:
        return centres[:1] + np.array([-0.5, 0.5])
    inner = 0.5 * (centres[1:] + centres[:-1])
    return np.concatenate([2.0 * centres[:1] - inner[:1], inner, 2.0 * centres[-1:] - inner[-1:]])


def _with_gaps(path: PathHistory) -> tuple[Array, NDArray[np.floating]]:
    """Positions [m] and stresses [Pa] of a path with no number where it jumps from one line to the next."""
    distance = np.diff(path.position)
    usual = float(np.median(distance)) if len(distance) else 0.0
    ends = np.flatnonzero(distance > GAP * usual) + 1
    beside = np.stack([path.position[ends - 1] + 0.5 * usual, path.position[ends] - 0.5 * usual], axis=1).ravel()
    at = np.repeat(ends, 2)
    return np.insert(path.position, at, beside), np.insert(path.von_mises, at, np.nan, axis=1)


def _draw_speeds(axes: Axes, path: PathHistory, speeds: Mapping[str, float]) -> None:
    from matplotlib.patheffects import Normal, Stroke

    far = float(path.position[-1])
    for (label, speed), style in zip(speeds.items(), ("-", "--", ":"), strict=False):
        name = f"{label} {speed:.0f} m/s"
        ends = [0.0, 1e6 * far / speed], [0.0, 1e3 * far]
        line = axes.plot(*ends, color="white", linestyle=style, label=name, linewidth=1.2)[0]
        # White on a black rim: seen on every colour of the palette.
        line.set_path_effects([Stroke(linewidth=2.4, foreground="black"), Normal()])


def save_path_curves(path: str | os.PathLike[str], result: Result) -> Path:
    """Write paths.png to `path` as PNG at 200 dots per inch."""
    headings = result.summary.get("path_headings", {})
    return save_png(plot_paths(result.time, result.paths, headings=headings), path)


def save_waves(path: str | os.PathLike[str], result: Result) -> Path:
    """Write waves.png to `path` as PNG at 200 dots per inch."""
    headings = result.summary.get("path_headings", {})
    speeds = {WAVES[key]: float(value) for key, value in result.summary.get("wave_speeds", {}).items()}
    return save_png(plot_waves(result.time, result.paths, speeds, headings), path)
