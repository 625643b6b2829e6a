"""Tests what measured errors tell of those of another scene, and the estimates that follow."""

from __future__ import annotations

import math

import numpy as np
import pytest

from warp_mca.accuracy.prediction import CORES, HIGH, LOW, MANY, NOISE, Expected, fitted, gaussian_process


def test_a_process_keeps_to_what_was_measured_and_knows_nothing_far_away():
    points = np.linspace(-2.0, 2.0, 9)[:, None]
    errors = 0.03 * np.sin(points[:, 0])
    noise = np.full(len(points), NOISE)
    process = fitted(points, errors, noise)
    between = gaussian_process(points, errors, np.array([0.25]), noise, process)
    assert between.mean == pytest.approx(0.03 * math.sin(0.25), abs=2.0 * NOISE)
    assert between.spread < 2.0 * NOISE
    far = gaussian_process(points, errors, np.array([100.0]), noise, process)
    assert far.mean == pytest.approx(errors.mean(), abs=1e-6)
    assert far.spread == pytest.approx(math.hypot(errors.std(), math.sqrt(2.0) * NOISE), rel=1e-3)


def test_a_scene_whose_limits_are_not_sure_tells_less():
    points = np.linspace(-2.0, 2.0, 9)[:, None]
    errors, noise = np.where(points[:, 0] == 0.0, 0.05, 0.0), np.full(len(points), NOISE)
    sure = gaussian_process(points, errors, np.zeros(1), noise, fitted(points, errors, noise))
    noise[4] = 0.1
    unsure = gaussian_process(points, errors, np.zeros(1), noise, fitted(points, errors, noise))
    assert abs(unsure.mean) < 0.5 * sure.mean


def test_a_few_large_errors_do_not_widen_estimates():
    """Of scenes far apart, e_i / s are the errors as they are left out, with s^2 = mean(e^2) and twice the noise."""
    rng = np.random.default_rng(2)
    points, errors = 1e3 * rng.normal(size=(200, 3)), 0.01 * rng.normal(size=200)
    errors[::10] = 0.04 * np.sign(errors[::10])
    process = fitted(points, errors, np.full(200, NOISE))
    about = errors - errors.mean()
    spread = math.sqrt(np.mean(about**2) + 2.0 * NOISE**2)
    assert process.core == pytest.approx(1.4826 * np.median(np.abs(about)) / spread, rel=1e-6)
    assert CORES[0] < process.core < 0.8
    wide = Expected(0.0, spread, process.core)
    assert wide.estimate(0.0) == Expected(0.0, process.core * spread).estimate(0.0)
    assert wide.within(0.02) == Expected(0.0, spread).within(0.02)  # the choice counts the large ones
    assert fitted(points[: MANY - 1], errors[: MANY - 1], np.full(MANY - 1, NOISE)).core == 1.0


def test_estimates_are_those_most_probably_right():
    """About no mean, d/de [Phi(e / LOW s) - Phi(e / HIGH s)] = 0 has a closed form."""
    c = math.sqrt(2.0 * math.log(HIGH / LOW) / (LOW**-2 - HIGH**-2))
    assert Expected(0.0, 0.01).estimate(0.0) == pytest.approx(0.01 * c, rel=0.02)
    mean = Expected(0.04, 0.001).estimate(0.0)
    assert LOW * 0.043 < mean < HIGH * 0.037  # sure to be right
    assert mean == pytest.approx(0.04, rel=0.02)
    assert Expected(0.0, 0.006).estimate(0.01) < 0.01 < Expected(0.03, 0.006).estimate(0.01)
