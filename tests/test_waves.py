"""Stress waves of the two-link impact, read off the paths of Fig. 10 as a run records them."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.results.paths import PathHistory

TIP, HINGE = 0.06, 0.21  # where the wave has become one of the rod, and hinge A [m]


@pytest.fixture(scope="module")
def runs() -> tuple[mca.Result, mca.Result]:
    """The impact, and the same motion without contact; rods with cells of 5 mm."""
    scene = mca.make_scene("two_link", axial_AB=40, axial_OA=20, axial_ratio=1.0, duration=1e-4)
    meshes = mca.mesh(scene)
    free = dataclasses.replace(scene, contacts=())
    return mca.run(scene, meshes=meshes), mca.run(free, meshes=meshes, duration=5.5e-5)


@pytest.fixture(scope="module")
def wave(runs: tuple[mca.Result, mca.Result]) -> tuple[np.ndarray, PathHistory]:
    """Times [s], and on Path 2 what the impact alone causes.

    Links that were rigid and stress-free begin to stretch when the elements take over: rho omega^2 L^2 / 2 of some
    10 kPa, everywhere at once, and more than the first of the wave.
    """
    impact, free = runs
    count = len(free.time)
    np.testing.assert_allclose(impact.time[:count], free.time, rtol=1e-12)
    one, other = impact.paths[1], free.paths[1]
    return free.time, PathHistory(one.name, one.position, one.stress[:count] - other.stress)


def arrival(time: np.ndarray, stress: np.ndarray, threshold: float) -> np.ndarray:
    """When stress first exceeds the threshold, interpolated between rows, at each probe."""
    rows = np.argmax(stress > threshold, axis=0)
    assert (rows > 0).all()
    probes = np.arange(stress.shape[1])
    before, after = stress[rows - 1, probes], stress[rows, probes]
    return time[rows - 1] + (threshold - before) / (after - before) * (time[rows] - time[rows - 1])


@pytest.mark.parametrize("threshold", [1e3, 3e3, 1e4])
def test_the_fastest_front_on_path_2_travels_between_bar_and_dilatational_speed(wave, threshold: float):
    time, path = wave
    rod = (path.position > TIP) & (path.position < HINGE)
    speed = np.polyfit(arrival(time, path.von_mises[:, rod], threshold), path.position[rod], 1)[0]
    assert 5092.0 < speed < 5692.0


def test_part_of_the_wave_has_passed_the_hinge_soon_after_40_microseconds(wave):
    time, path = wave
    beyond = path.von_mises[:, path.position > HINGE].max(axis=1)
    assert beyond[time < 35e-6].max() < 20.0
    assert beyond[np.searchsorted(time, 50e-6)] > 1e3


def test_bending_loads_the_upper_surface_most_and_the_axis_least(runs):
    """Compression adds to bending on Path 1 and takes from it on Path 3; the axis has no bending."""
    impact, _ = runs
    upper, axis, lower = (path.von_mises[:, path.position < HINGE].mean(axis=1) for path in impact.paths)
    for time in (40e-6, 60e-6, 80e-6, 99e-6):
        row = np.searchsorted(impact.time, time)
        assert upper[row] > 1.05 * lower[row]
        assert axis[row] < 0.6 * lower[row]


def test_wave_speeds_are_those_of_the_rods_whatever_the_tip_is_made_of():
    scene = mca.make_scene("two_link", E_tip=35e9, duration=2e-6)
    speeds = mca.run(scene).summary["wave_speeds"]
    assert speeds["bar"] == pytest.approx((70e9 / 2700.0) ** 0.5, rel=1e-12)
