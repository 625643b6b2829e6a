"""Tests the warning about surfaces that friction on contact springs makes vibrate."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from watched import told

import warp_mca as mca
from warp_mca.scenes import two_link
from warp_mca.watch.vibration import MEAN, SPAN, flutter, vibration, vibration_aside

ROWS = 400


def sampled(amplitude: float, frequency: float) -> np.ndarray:
    """A motion over all rows with a vibration of so many periods a row in rows 200 to 299, shape (ROWS, 1)."""
    row = np.arange(ROWS)
    slow = np.sin(np.pi * row / ROWS)
    fast = np.where((row >= 200) & (row < 300), amplitude * np.sin(2.0 * np.pi * frequency * row), 0.0)
    return (slow + fast)[:, None]


@pytest.mark.parametrize("frequency", [0.13, 0.233, 0.41])
def test_vibration_is_the_amplitude_that_a_mean_of_rows_leaves_of_a_sine(frequency: float) -> None:
    """The mean of n rows keeps sin(n pi f) / (n sin(pi f)) of it."""
    left = 1.0 - np.sin(MEAN * np.pi * frequency) / (MEAN * np.sin(np.pi * frequency))
    found = vibration(sampled(0.5, frequency), np.ones(ROWS, dtype=bool))
    # over SPAN rows, the mean square of a sine is off by 1 / (2 SPAN sin(2 pi f)) of itself at most
    assert found == pytest.approx(0.5 * left, rel=0.5 / (SPAN * np.sin(2.0 * np.pi * frequency)))


def test_slow_motion_and_rows_without_contact_do_not_vibrate() -> None:
    whole = np.ones(ROWS, dtype=bool)
    assert vibration(sampled(0.0, 0.2), whole) < 1e-3
    touching = np.arange(ROWS) < 200 + SPAN // 2  # vibrates in contact for half of the span
    assert vibration(sampled(0.5, 0.233), touching) < 0.8 * vibration(sampled(0.5, 0.233), whole)
    assert vibration(sampled(0.5, 0.233), np.arange(ROWS) < 200 - MEAN) < 1e-3


def flutters(*, mu: float, penalty: float) -> bool:
    """Whether an elastic arm on a mesh of 1,408 elements is said to flutter."""
    scene = two_link.build(plastic=False, duration=0.12e-3, mu=mu, penalty=penalty)
    return any("flutter" in text for text in mca.run(scene, refine=0.5, device="cpu", threads=1).warnings)


def test_a_run_tells_of_flutter_which_soft_springs_avoid() -> None:
    assert flutters(mu=1.5, penalty=1.0)
    assert not flutters(mu=1.5, penalty=0.1)


@pytest.mark.parametrize(("amplitude", "mu", "says"), [(0.9, 0.0, 1), (0.9, 0.4, 1), (0.6, 0.0, 0)])
def test_a_run_tells_of_vibration_across_normal_and_tangent(amplitude: float, mu: float, says: int) -> None:
    """From 0.2 of the 4 m/s on at which tip and target met; less the mean of rows, which may add to it."""
    none = np.zeros(ROWS)
    history = {f"{point}_v{axis}": none for point in ("tip", "plate") for axis in "xyz"}
    history |= {"time_s": 1e-6 * np.arange(ROWS), "F_n_N": np.ones(ROWS), "tip_vy": np.full(ROWS, -4.0)}
    history["plate_vz"] = sampled(amplitude, 0.233)[:, 0]
    axes = np.array([[[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]])
    model = SimpleNamespace(passes=[SimpleNamespace(contact=0, mu=mu)], contact_axes=axes)
    found = [text for row in (flutter, vibration_aside) for text in told(row, history=history, model=model)]
    assert [text.partition(" with up to")[0] for text in found] == says * [
        "the surface under the tip vibrates across normal and tangent"
    ]
