"""Limits of series: orders and limits of made-up functions, and series that have none."""

import math

import pytest

from warp_mca.accuracy.convergence import limit_of, limits, observed_order

SIZES = (1.0, 0.7, 0.45)


@pytest.mark.parametrize("p", [0.5, 1.0, 1.7, 2.0])
def test_order_and_limit_of_a_power(p):
    values = [3.0 - 0.8 * h**p for h in SIZES]
    found = limit_of(SIZES, values)
    assert found.order == pytest.approx(p, abs=1e-6)
    assert found.value == pytest.approx(3.0, rel=1e-6)
    assert found.left == pytest.approx((3.0 - values[-1]) / 3.0, rel=1e-4)


def test_two_values_are_extrapolated_with_order_one():
    assert limit_of((1.0, 0.5), (2.2, 2.1)).value == pytest.approx(2.0)


def test_a_steep_series_is_extrapolated_with_order_two_at_most():
    found = limit_of(SIZES, [1.0 + 0.5 * h**5 for h in SIZES])
    assert found.order == pytest.approx(5.0, abs=1e-6)
    assert (found.left or 0.0) > 0.5 * 0.45**5  # further than the true limit


@pytest.mark.parametrize("singular", [lambda h: h**-0.5, lambda h: 2.0 - math.log(h), lambda h: 1.0 - h**0.1])
def test_singular_series_have_no_limit(singular):
    found = limit_of(SIZES, [singular(h) for h in SIZES])
    assert found.value is None and found.left is None
    assert found.order is not None and found.order < 0.25
    assert "do not shrink" in found.why


def test_a_series_that_swings_has_a_limit_only_if_it_settles():
    settling = limit_of(SIZES, (1.0, 1.1, 1.06))
    assert settling.value == 1.06 and settling.left == pytest.approx(0.04 / 1.06)
    assert settling.order is None and settling.ratio == pytest.approx(-0.4)
    assert limit_of(SIZES, (1.0, 1.2, 1.01)).value is None
    late = limit_of(SIZES, (1.0, 1.0, 1.2))
    assert late.value is None and late.ratio is None


def test_an_irregular_series_is_taken_at_its_last_value_with_all_its_change():
    """First peaks of `two_link` on coarse meshes: the first change is small by chance."""
    found = limit_of((0.0790, 0.0546, 0.0403), (3688.8, 3681.4, 3580.4))
    assert found.value == 3580.4 and found.left == pytest.approx(101.0 / 3580.4)
    assert found.order is None and (found.ratio or 0.0) > 10.0


def test_changes_within_two_percent_or_the_resolution_are_a_limit():
    assert limit_of(SIZES, (100.0, 100.2, 101.0)).left == pytest.approx(1.0 / 101.0)
    duration = limit_of(SIZES, (10.0, 11.0, 10.0), resolution=1.0)
    assert duration.value == 10.0 and duration.left == pytest.approx(0.2)


def test_figures_that_runs_lack():
    found = limits((1.0, 0.5), [{"a": 1.0, "b": None, "c": None}, {"a": 1.0, "b": None, "c": 2.0}])
    assert found["a"].value == 1.0
    assert found["b"].why == "no run has this figure"
    assert found["c"].value is None and found["c"].why == "not every run has this figure"


def test_order_of_a_logarithm_is_zero():
    assert observed_order(SIZES, [math.log(h) for h in SIZES]) == pytest.approx(0.0, abs=1e-6)
    assert observed_order(SIZES, (1.0, 1.0, 2.0)) is None
