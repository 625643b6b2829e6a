"""Owns energies.png: where the energy of a run goes, and the imbalance of the ledger below."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.results.figure_style import (
    BLACK,
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    VERMILION,
    engineering,
    legend_beside,
    new_figure,
    place,
    save_png,
    tidy,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from warp_mca.results.result import Result

# Change of kinetic energy, so that the small shares are not lost beside its size.
CURVES = (
    ("E_kinetic", "kinetic, change", BLACK, "-"),
    ("E_elastic", "elastic", BLUE, "--"),
    ("E_plastic", "plastic work", VERMILION, "-."),
    ("E_friction", "friction", GREEN, ":"),
    ("E_contact", "contact springs", ORANGE, (0, (5, 1, 1, 1, 1, 1))),
    ("E_absorbed", "absorbed by sides", PURPLE, (0, (1, 2))),
)


def plot_energies(result: Result) -> Figure:
    """The figure: energies [J] above, error of their balance [J] below, over time [ms]."""
    figure = new_figure(7.0, 5.0, "none")
    energies, balance = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    names = ("E_kinetic", "E_plastic", "E_friction", "E_contact", "E_absorbed")
    values = {name: result[name] for name in names if name in result.history}
    values["E_elastic"] = result["E_internal"] - result["E_plastic"]
    values["E_kinetic"] = values["E_kinetic"] - values["E_kinetic"][:1]
    scale, unit = engineering(max(float(np.max(np.abs(v), initial=0.0)) for v in values.values()), "J")
    time = 1e3 * result.time
    energies.axhline(0.0, color="0.5", linewidth=0.8)
    for name, label, color, style in (curve for curve in CURVES if curve[0] in values):
        energies.plot(time, scale * values[name], color=color, linestyle=style, label=label, linewidth=1.4)
    energies.set_ylabel(f"energy [{unit}]")
    error = result["E_total_error"]
    scale, unit = engineering(float(np.max(np.abs(error), initial=0.0)), "J")
    balance.axhline(0.0, color="0.5", linewidth=0.8)
    balance.plot(time, scale * error, color=PURPLE, label="sum less\nwork done", linewidth=1.2)
    balance.set_ylabel(f"error [{unit}]")
    balance.set_xlabel("time after first contact [ms]")
    balance.set_xlim(*(1e3 * result.time[[0, -1]] if len(result.time) else (0.0, 1.0)))
    place(figure, (energies, balance), right=1.9)
    for axes in (energies, balance):
        tidy(axes)
        legend_beside(axes)
    energies.set_title(_title(result), loc="left", fontsize=10)
    return figure


def save_energies(path: str | os.PathLike[str], result: Result) -> Path:
    """Write the figure to `path` as PNG at 200 dots per inch."""
    return save_png(plot_energies(result), path)


def _title(result: Result) -> str:
    name = str(result.summary.get("scene") or "")
    after = np.flatnonzero(result.time >= 0.0)  # rows before it are those of a swing
    initial = float(result["E_kinetic"][after[0]]) if len(after) else 0.0
    return f"{name}: kinetic energy at first contact {initial:.4g} J".removeprefix(": ")
