"""Channel filters of SAE J211: the difference equation of the standard, its corner, its roll-off, no phase."""

from __future__ import annotations

import math
from typing import Any, cast

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.results.cfc import cfc_filter

CLASSES = [60, 180, 600, 1000]


def standard(values: np.ndarray, T: float, cfc: float) -> np.ndarray:
    """SAE J211-1, Appendix C: Y_t = a0 X_t + a1 X_t-1 + a2 X_t-2 + b1 Y_t-1 + b2 Y_t-2, forwards then backwards."""
    w_a = math.tan(0.5 * T * 2.0 * math.pi * cfc * 2.0775)
    root = math.sqrt(2.0) * w_a
    a0 = w_a**2 / (1.0 + root + w_a**2)
    a1, a2 = 2.0 * a0, a0
    b1 = -2.0 * (w_a**2 - 1.0) / (1.0 + root + w_a**2)
    b2 = (-1.0 + root - w_a**2) / (1.0 + root + w_a**2)
    for _ in range(2):
        out = np.zeros_like(values)
        for t in range(2, len(values)):
            out[t] = a0 * values[t] + a1 * values[t - 1] + a2 * values[t - 2] + b1 * out[t - 1] + b2 * out[t - 2]
        values = out[::-1]
    return values


def gain(cfc: float, frequency: float) -> float:
    """Amplitude of a filtered sine over its own [dB], in the middle of a long record."""
    T = 0.01 / max(cfc, frequency)
    t = T * np.arange(6000)
    sine = np.sin(2.0 * math.pi * frequency * t)
    middle = slice(2000, 4000)
    found = cfc_filter(sine, T, cfc)[middle]
    assert (
        np.abs(found - (found @ sine[middle]) / (sine[middle] @ sine[middle]) * sine[middle]).max() < 1e-3
    )  # no phase
    return 20.0 * math.log10(math.sqrt(2.0 * (found**2).mean()))


@pytest.mark.parametrize("cfc", CLASSES)
def test_the_filter_is_the_difference_equation_of_the_standard(cfc):
    T, values = 0.02 / cfc, np.zeros(900)
    values[400:500] = np.hanning(100) + 0.1 * np.random.default_rng(0).normal(size=100)
    assert cfc_filter(values, T, cfc) == pytest.approx(standard(values, T, cfc), abs=1e-6)


@pytest.mark.parametrize("cfc", CLASSES)
def test_corner_and_roll_off_are_those_of_the_standard(cfc):
    """Within 0.5 dB up to the class, 3 dB at 5/3 of it, then 24 dB in an octave."""
    assert gain(cfc, 0.1 * cfc) == pytest.approx(0.0, abs=0.01)
    assert -0.5 < gain(cfc, cfc) < 0.0
    assert gain(cfc, cfc / 0.6) == pytest.approx(-3.0, abs=0.05)
    assert gain(cfc, 16.0 * cfc) - gain(cfc, 8.0 * cfc) == pytest.approx(-24.0, abs=0.3)


def test_a_constant_and_three_components_stay_what_they_are():
    steady = np.tile([1.0, -2.0, 3.0], (50, 1))
    assert cfc_filter(steady, 1e-5, 1000) == pytest.approx(steady, rel=1e-9)
    assert cfc_filter(np.array([4.0]), 1e-5, 1000) == pytest.approx([4.0])


REFUSED = ((0, "cfc = 0"), ("60", "cfc = '60'"), (1000, "interval of 0.0001 s"), (1e-3, "would be 5e.06 rows"))


@pytest.mark.parametrize(("cfc", "words"), REFUSED)
def test_what_it_cannot_filter_is_refused(cfc, words):
    with pytest.raises(mca.RequestError, match=words):
        cfc_filter(np.zeros(10), 2e-4, cfc)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("shape", [(1,), (50,), (50, 3)])
def test_a_value_that_is_no_number_is_refused(value: float, shape: tuple[int, ...]):
    """One made all rows nan, without a word."""
    values = np.zeros(shape)
    values.ravel()[-1] = value
    with pytest.raises(mca.RequestError, match=rf"^values = {value}: "):
        cfc_filter(values, 1e-5, 60.0)


@pytest.mark.parametrize("interval", [0.0, -1e-5, math.nan, math.inf, None, "1e-5"])
def test_an_interval_that_is_no_time_is_refused(interval: Any):
    with pytest.raises(mca.RequestError, match=r"^interval = "):
        cfc_filter(np.zeros(50), interval, 60.0)
    with pytest.raises(mca.RequestError, match=r"^values = 'text': give an array"):
        cfc_filter(cast(Any, "text"), 1e-5, 60.0)
