"""Tests the picture of a run: what it shows and with which units."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from warp_mca.results.figure_style import STICK
from warp_mca.results.force_figure import compression_phases, plot_forces, save_forces
from warp_mca.results.result import HISTORY_COLUMNS, Result

TIME = np.arange(1, 501) * 1e-6


def result(peak: float) -> Result:
    """A half-sine contact of 0.4 ms with `peak` [N], sticking from 0.1 to 0.2 ms."""
    force = peak * np.sin(np.pi * np.clip(TIME / 4e-4, 0.0, 1.0))
    history = {name: np.zeros(len(TIME)) for name in HISTORY_COLUMNS} | {"time_s": TIME, "F_n_N": force}
    history["stick_fraction"] = np.where((TIME > 100.5e-6) & (TIME < 200.5e-6), 1.0, 0.0)
    history["F_t_N"] = -0.3 * force
    history["tip_vy"] = np.full(len(TIME), -1.0)
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


def test_without_velocities_there_is_no_empty_panel():
    """As in scenes without a tip, a target and a closing speed."""
    run = result(900.0)
    bare = replace(run, history={**run.history, "tip_vy": np.full(len(TIME), np.nan)})
    (forces,) = plot_forces(bare).axes
    assert forces.get_xlabel() == "time after first contact [ms]" and forces.get_ylabel() == "contact force [N]"


def test_sticking_is_shaded_in_both_panels():
    for axes in plot_forces(result(3000.0)).axes:
        (shade,) = (patch for patch in axes.patches if patch.get_facecolor()[:3] == to_rgb(STICK))
        assert shade.get_x() == pytest.approx(0.1)
        assert shade.get_width() == pytest.approx(0.1)


def test_compression_and_restitution_follow_the_closing_speed():
    run = result(3000.0)
    run.history["closing_speed"] = np.cos(np.pi * TIME / 2e-4)  # towards the plate before 0.1 and after 0.3 ms
    run.history["closing_speed"][450:] = np.nan
    compression, restitution = compression_phases(run)
    assert compression == [pytest.approx((0.0, 1e-4), abs=2e-6), pytest.approx((3e-4, 4e-4), abs=2e-6)]
    assert restitution == [pytest.approx((1e-4, 3e-4), abs=2e-6)]


def test_bodies_at_rest_have_no_phases():
    """Rounded motion of a body that weighs on another, and of one that glides along it."""
    run = result(3000.0)
    run.history["closing_speed"] = 1e-9 * np.random.default_rng(0).normal(size=len(TIME))
    run.history["E_kinetic"] = np.full(len(TIME), 1.0)
    assert compression_phases(run) == ([], [])


def test_results_without_closing_speeds_have_no_phases():
    assert compression_phases(result(3000.0)) == ([], [])


def test_velocities_are_those_along_the_axes_in_which_the_tip_moves():
    run = result(3000.0)
    run.history.update({f"{point}_v{axis}": np.zeros(len(TIME)) for point in ("tip", "plate") for axis in "xyz"})
    run.history["plate_vx"] = run.history["plate_vz"] = np.ones(len(TIME))
    run.history["tip_vz"] = np.linspace(-1.0, 1.0, len(TIME))
    run.history["closing_speed"] = np.cos(np.pi * TIME / 4e-4)
    labels = [line.get_label() for line in plot_forces(run).axes[1].lines[1:]]
    assert labels == ["plate $v_z$", "tip $v_z$", "closing speed"]


def test_equal_runs_give_equal_files(tmp_path: Path):
    one, other = (save_forces(tmp_path / name, result(3000.0)).read_bytes() for name in ("a.png", "b.png"))
    assert one == other


def test_a_run_without_contact_can_be_drawn(tmp_path: Path):
    assert save_forces(tmp_path / "none.png", result(0.0)).stat().st_size > 0
