"""Tests the rules that turn force histories into contacts, peaks and phases, whatever the unit of time."""

from __future__ import annotations

import numpy as np
import pytest
from test_results import TIME, facts, history, two_bumps

from warp_mca.results.force_history import contact_intervals, contact_rows, force_peaks, phases, unfinished
from warp_mca.results.result import summarise


def half_sine(rows: int, peak: float = 1e3) -> np.ndarray:
    return peak * np.sin(np.pi * (np.arange(rows) + 0.5) / rows)


def test_a_force_that_still_rises_at_the_end_is_no_peak():
    summary = summarise(history(F_n_N=1e7 * TIME), facts())
    assert summary["F_n_first_peak"] is None
    assert summary["F_n_peaks"] == []
    assert summary["F_n_max"] == pytest.approx(6e3)
    assert summary["touched"] is summary["contact_open_at_end"] is True


def test_a_peak_before_an_unfinished_rise_keeps_its_value():
    force = np.interp(TIME, [0.0, 1e-4, 3e-4, 6e-4], [0.0, 3e3, 1e3, 4e3])
    assert force_peaks(TIME, force) == [pytest.approx((1e-4, 3e3))]
    assert unfinished(force)


def test_a_force_that_ends_abruptly_before_the_history_does_is_a_peak():
    force = np.where(TIME < 3e-4, 1e7 * TIME, 0.0)
    assert force_peaks(TIME, force) == [pytest.approx((3e-4, 3e3), abs=1e-6, rel=0.01)]
    assert not unfinished(force)


def test_a_history_without_contact_says_so():
    summary = summarise(history(), facts())
    assert summary["touched"] is summary["contact_open_at_end"] is False
    assert summary["contacts_by_pair"] == []


@pytest.mark.parametrize("factor", [1e3, 1e-3, 0.37])
def test_the_summary_scales_exactly_with_the_unit_of_time(factor: float):
    """Jitter, separations near the limit, peaks and sticking: nothing changes but the numbers of seconds."""
    rng = np.random.default_rng(5)
    force = two_bumps() * (1.0 + 0.1 * rng.normal(size=len(TIME)))
    force[[20, 21, 22, 60, 61, 62, 63, 64, 65, 66, 67, 250, 251]] = 0.0
    force[500:510], force[520:] = 50.0, 0.0
    columns = {"F_n_N": force, "stick_fraction": rng.uniform(size=len(TIME))}
    known = summarise(history(**columns), facts())
    other = summarise(history(time_s=factor * TIME, **columns), facts())
    assert len(known["contacts"]) > 1 and len(known["F_n_peaks"]) > 1 and len(known["sticks"]) > 1
    for key in ("contacts", "sticks"):
        assert np.array(other[key]) == pytest.approx(factor * np.array(known[key]), rel=1e-12)
    assert other["contact_duration"] == pytest.approx(factor * known["contact_duration"], rel=1e-12)
    assert [F for _, F in other["F_n_peaks"]] == [F for _, F in known["F_n_peaks"]]
    assert [t for t, _ in other["F_n_peaks"]] == pytest.approx([factor * t for t, _ in known["F_n_peaks"]], rel=1e-12)
    assert other["F_n_first_peak"] == known["F_n_first_peak"]


def test_a_contact_that_opens_in_every_other_row_is_one():
    force = np.zeros(600)
    force[100:500:2] = 1e3
    assert contact_rows(force) == [(100, 499)]


def test_each_contact_keeps_its_own_measure():
    """A contact of 400 rows bridges 6 of them; touches of 20 rows, 6 apart, are two."""
    force = np.zeros(1000)
    force[100:500] = half_sine(400)
    force[300:306] = 0.0
    force[700:720] = force[726:746] = half_sine(20)
    assert contact_rows(force) == [(100, 500), (700, 720), (726, 746)]
    assert contact_rows(force[::-1]) == [(254, 274), (280, 300), (500, 900)]


def test_peaks_of_a_short_contact_are_not_smoothed_away_by_a_long_one():
    force = np.zeros(3000)
    force[:2000] = half_sine(2000) * (1.0 + 0.1 * np.sin(np.arange(2000.0)))
    force[2500:2540] = np.tile(half_sine(20), 2)
    assert len(force_peaks(np.arange(3000.0), force)) == 3


@pytest.mark.parametrize("scale", [1.0, 1e-6])
def test_phases_of_an_impact_with_jitter(scale: float):
    rows = np.arange(400)
    speed = scale * (np.cos(np.pi * rows / 400) + 0.5 * np.sin(2.0 * rows))
    compression, restitution = phases(half_sine(400), speed, 0.0)
    assert compression == [(0, pytest.approx(200, abs=4))]
    assert restitution == [(pytest.approx(200, abs=4), 400)]


def test_there_are_no_phases_below_the_least_work():
    speed = np.cos(np.pi * np.arange(400) / 400)
    work = float((half_sine(400) * speed)[:200].sum())
    assert phases(half_sine(400), speed, 1.01 * work) == ([], [])
    assert len(phases(half_sine(400), speed, 0.9 * work)[0]) == 1


def test_contact_in_the_first_row_alone_has_no_length():
    assert contact_intervals(np.arange(5) * 1e-6, np.array([1.0, 0.0, 0.0, 0.0, 0.0])) == []
