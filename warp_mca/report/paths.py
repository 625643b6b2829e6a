"""Owns the figures of stress along paths: paths.png, curves at chosen instants, and waves.png, position over time."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.report.style import engineering, new_figure, save_png, tidy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from warp_mca.scene import Elastic

Array = NDArray[np.float64]

INSTANTS = 6  # curves in paths.png when none are named
PASSAGES = 2.5  # of the slowest wave along a path, that waves.png shows
NEAR = 0.05  # share of a path that does not set the height of paths.png
DECADES = 3.0  # of stress in waves.png: the first wave is weak
FIRST = 0.3  # share of the time that they span: while the first wave travels and reflects
STYLES = ("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)), (0, (1, 2)))


@dataclass(frozen=True)
class PathStress:
    """Von Mises stress along one path.

    Attributes:
        name: of the path.
        position: of the probes along the path, from the end that is struck [m], shape (probe_count,), float64.
        stress: [Pa], shape (time_count, probe_count), float32 or float64.
    """

    name: str
    position: Array
    stress: NDArray[np.floating]


def wave_speeds(material: Elastic) -> dict[str, float]:
    """Speeds of elastic waves [m/s]: of the bar, sqrt(E/rho); of dilatation, c_d; of shear, c_s."""
    K, G, rho = material.bulk_modulus, material.shear_modulus, material.rho
    return {
        r"$\sqrt{E/\rho}$": float(np.sqrt(material.E / rho)),
        r"$c_d$": float(np.sqrt((K + 4.0 * G / 3.0) / rho)),
        r"$c_s$": float(np.sqrt(G / rho)),
    }


def plot_paths(time: Array, paths: Sequence[PathStress], instants: Sequence[float] | None = None) -> Figure:
    """Stress [MPa] over position [mm], one panel for each path, one curve for each instant.

    Args:
        time: of the samples [s], shape (time_count,).
        paths: at least one.
        instants: when to draw [s]; the nearest samples are taken.
    """
    from matplotlib import colormaps

    if instants is None:
        instants = tuple(np.linspace(0.0, FIRST * time[-1], INSTANTS + 1)[1:])
    rows = [int(np.argmin(np.abs(time - instant))) for instant in instants]
    figure = new_figure(7.0, 1.0 + 1.9 * len(paths))
    panels = np.atleast_1d(figure.subplots(len(paths), 1, sharex=True, sharey=True))
    # Right at the contact stress is many times that of the waves; curves may leave the panel there.
    beyond = [path.stress[rows][:, path.position >= path.position[0] + NEAR * np.ptp(path.position)] for path in paths]
    greatest = max(float(np.nanmax(stress, initial=0.0)) for stress in beyond)
    scale, unit = engineering(greatest, "Pa")
    for axes, path in zip(panels, paths, strict=True):
        for k, row in enumerate(rows):
            colour = colormaps["viridis"](0.9 * k / max(1, len(rows) - 1))
            label = f"{1e6 * time[row]:.0f} µs"
            style = STYLES[k % len(STYLES)]
            axes.plot(1e3 * path.position, scale * path.stress[row], color=colour, linestyle=style, label=label)
        axes.set_title(path.name, loc="left", fontsize=10)
        axes.set_ylabel(f"von Mises [{unit}]")
        axes.set_xlim(1e3 * path.position[0], 1e3 * path.position[-1])
        tidy(axes)
    panels[0].set_ylim(0.0, 1.05 * scale * greatest or 1.0)
    panels[-1].set_xlabel("position along the path, from the struck end [mm]")
    panels[0].legend(title="after contact", loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)
    return figure


def plot_waves(time: Array, paths: Sequence[PathStress], speeds: Mapping[str, float]) -> Figure:
    """Position [mm] over time [µs] with stress as colour, on a log scale, and wave speeds as lines from the struck end.

    Args:
        time: of the samples [s], shape (time_count,).
        paths: at least one.
        speeds: by label [m/s], see `wave_speeds`.
    """
    from matplotlib.colors import LogNorm

    figure = new_figure(7.0, 1.0 + 2.1 * len(paths))
    panels = np.atleast_1d(figure.subplots(len(paths), 1, sharex=True, sharey=True))
    far = max(float(path.position[-1]) for path in paths)
    shown = time <= PASSAGES * far / min(speeds.values()) if speeds else np.ones(len(time), dtype=bool)
    stress = np.concatenate([np.asarray(path.stress[shown]).ravel() for path in paths])
    # A few probes near the contact are far above the waves: the top hundredth may share one colour.
    limit = float(np.nanpercentile(stress, 99.0)) if stress.size else 0.0
    scale, unit = engineering(limit, "Pa")
    image, top = None, scale * limit or 1.0
    for axes, path in zip(panels, paths, strict=True):
        value = scale * np.asarray(path.stress[shown]).T
        norm = LogNorm(top / 10.0**DECADES, top, clip=True)
        image = axes.pcolormesh(
            1e6 * time[shown], 1e3 * path.position, value, norm=norm, cmap="viridis", rasterized=True
        )
        _draw_speeds(axes, path, speeds)
        axes.set_xlim(0.0, 1e6 * float(time[shown][-1]))
        axes.set_ylim(1e3 * float(path.position[0]), 1e3 * float(path.position[-1]))
        axes.set_title(path.name, loc="left", fontsize=10)
        axes.set_ylabel("position [mm]")
    panels[-1].set_xlabel("time after first contact [µs]")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=3, frameon=False)
    assert image is not None
    bar = figure.colorbar(image, ax=list(panels), extend="both")
    bar.set_label(f"von Mises stress [{unit}]")
    return figure


def _draw_speeds(axes: Axes, path: PathStress, speeds: Mapping[str, float]) -> None:
    from matplotlib.patheffects import Normal, Stroke

    far = float(path.position[-1])
    for (label, speed), style in zip(speeds.items(), ("-", "--", ":"), strict=False):
        name = f"{label} = {speed:.0f} m/s"
        ends = [0.0, 1e6 * far / speed], [0.0, 1e3 * far]
        line = axes.plot(*ends, color="white", linestyle=style, label=name, linewidth=1.2)[0]
        # White on a black rim: seen on every colour of the palette.
        line.set_path_effects([Stroke(linewidth=2.4, foreground="black"), Normal()])


def save_paths(
    directory: str | os.PathLike[str], time: Array, paths: Sequence[PathStress], speeds: Mapping[str, float]
) -> list[Path]:
    """Write paths.png and waves.png into `directory` as PNG at 200 dots per inch."""
    folder = Path(directory)
    return [
        save_png(plot_paths(time, paths), folder / "paths.png"),
        save_png(plot_waves(time, paths, speeds), folder / "waves.png"),
    ]
