"""Tests the picture of a run: what it shows and with which units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warp_mca.report.forces import plot_forces, save_forces
from warp_mca.results import HISTORY_COLUMNS, Result

TIME = np.arange(1, 501) * 1e-6


def result(peak: float) -> Result:
    """A half-sine contact of 0.4 ms with `peak` [N], sticking from 0.1 to 0.2 ms."""
    force = peak * np.sin(np.pi * np.clip(TIME / 4e-4, 0.0, 1.0))
    history = {name: np.zeros(len(TIME)) for name in HISTORY_COLUMNS} | {"time_s": TIME, "F_n_N": force}
    history["stick_fraction"] = np.where((TIME > 100.5e-6) & (TIME < 200.5e-6), 1.0, 0.0)
    history["F_t_N"] = -0.3 * force
    return Result({"scene": "toy"}, history)


@pytest.mark.parametrize(("peak", "unit", "shown"), [(3000.0, "kN", 3.0), (900.0, "N", 900.0)])
def test_forces_are_drawn_over_time_in_a_fitting_unit(peak: float, unit: str, shown: float):
    forces, velocities = plot_forces(result(peak)).axes
    assert forces.get_ylabel() == f"contact force [{unit}]"
    assert velocities.get_ylabel() == "velocity [m/s]"
    assert velocities.get_xlabel() == "time after first contact [ms]"
    line = next(line for line in forces.lines if line.get_label() == "$F_n$")
    assert np.max(line.get_ydata()) == pytest.approx(shown)
    assert line.get_xdata()[-1] == pytest.approx(0.5)
    assert forces.get_title(loc="left").startswith("toy: contact for 0.")


def test_sticking_is_shaded_in_both_panels():
    for axes in plot_forces(result(3000.0)).axes:
        (shade,) = axes.patches
        assert shade.get_x() == pytest.approx(0.1)
        assert shade.get_width() == pytest.approx(0.1)


def test_equal_runs_give_equal_files(tmp_path: Path):
    one, other = (save_forces(tmp_path / name, result(3000.0)).read_bytes() for name in ("a.png", "b.png"))
    assert one == other


def test_a_run_without_contact_can_be_drawn(tmp_path: Path):
    assert save_forces(tmp_path / "none.png", result(0.0)).stat().st_size > 0
