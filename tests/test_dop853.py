"""The integrator of swings, and the search for a touch: bit by bit SciPy's, which takes long to import and to run."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import DOP853, OdeSolution
from scipy.optimize import brentq

from warp_mca.rigid.brent import brent_root
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.dop853 import Dop853, states
from warp_mca.rigid.flow import flow
from warp_mca.rigid.link import Link
from warp_mca.rigid.plain_chain import acceleration_of
from warp_mca.rigid.swing import swing_until


def chain(count: int, slide: tuple[float, float] | None = None) -> Chain:
    draw = np.random.default_rng(count).uniform
    links = tuple(
        Link(body=f"{k}", mass=draw(0.5, 2.0), centre=(draw(0.05, 0.2), 0.01), inertia=1e-3, hinge_out=(0.2, -0.01))
        for k in range(count)
    )
    return Chain(links=links, slide=slide, carriage_mass=0.7 if slide else 0.0)


@pytest.mark.parametrize(
    "slopes, start, until, longest",
    [
        (flow(chain(2), 0.0), (1.2, 0.4, 0.0, 3.0), 0.6, 0.02),  # steps are as long as they may be
        (flow(chain(3, (0.6, 0.8)), 0.0), (0.0, 1.2, 0.4, 0.1, 0.5, 0.0, 3.0, -1.0), 0.3, math.inf),
        (
            lambda t, y: np.array([y[1], -400.0 * y[0] * (1.0 + 50.0 * (t > 0.1))]),
            (1.0, 0.0),
            0.3,
            math.inf,
        ),  # some fail
        (lambda t, y: np.zeros(1), (2.0,), 1.0, math.inf),
    ],
)
def test_steps_and_states_between_them_are_those_of_scipy(
    slopes: Callable, start: tuple[float, ...], until: float, longest: float
):
    y = np.array(start)
    ours = Dop853(slopes, 0.0, y, until, longest=longest, rtol=1e-12, atol=1e-14)
    theirs = DOP853(slopes, 0.0, y, until, max_step=longest, rtol=1e-12, atol=1e-14)
    times, pieces, others = [0.0], [], []
    while not ours.done:
        assert ours.step() is theirs.step() is None
        assert ours.t == theirs.t and np.array_equal(ours.y, theirs.y)
        pieces.append(ours.path())
        others.append(theirs.dense_output())
        times.append(ours.t)
        between = 0.3 * times[-2] + 0.7 * times[-1]
        assert np.array_equal(pieces[-1](between), others[-1](between))
    assert theirs.status == "finished"
    t = np.linspace(0.0, until, 40)
    assert np.array_equal(states(times, pieces, t), OdeSolution(times, others)(t).T)


def test_a_motion_that_ends_within_a_finite_time_breaks_off():
    """y' = y^2 from 1 is infinite at t = 1."""
    steps = Dop853(lambda t, y: y * y, 0.0, np.ones(1), 2.0, longest=math.inf, rtol=1e-12, atol=1e-14)
    with np.errstate(over="ignore", invalid="ignore"):
        while not (message := steps.step()):
            assert steps.t < 1.0 + 1e-9
    assert "step size" in message and steps.t == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize(
    "value, low, high",
    [
        (lambda x: x**3 - 2.0, 0.0, 2.0),
        (math.cos, 1.0, 2.0),
        (lambda x: math.atan(40.0 * (x - 0.3)), -9.0, 1.0),
        (lambda x: x - 0.25, 0.25, 1.0),
        (lambda x: x - 1.0, 0.25, 1.0),
        (lambda x: math.copysign(1.0, x - 0.1), -3.0, 1.0),
    ],
)
def test_roots_are_those_of_scipy(value: Callable[[float], float], low: float, high: float):
    accuracy = 4.0 * 2.0**-52
    found = brent_root(value, low, high, (value(low), value(high)), accuracy)
    assert found == brentq(value, low, high, xtol=accuracy, rtol=accuracy)  # pyright: ignore


@pytest.mark.parametrize("slide", [None, (0.6, 0.8)])
@pytest.mark.parametrize("count", [1, 2, 3, 7])
def test_slopes_without_loads_are_rates_and_accelerations(count: int, slide: tuple[float, float] | None):
    """Those of two links, which are written out, have the same bits as those of any number."""
    links = chain(count, slide)
    slopes, plain = flow(links, 0.0), acceleration_of(links)
    for y in np.random.default_rng(1).uniform(-3.0, 3.0, (30, 2 * links.coordinate_count)):
        q, v = np.split(y, 2)
        assert np.array_equal(slopes(0.0, y), np.concatenate([v, plain(q, v, None)]))
    if count < 7:
        with np.errstate(invalid="ignore"):  # no sine of an infinite angle
            assert not np.isfinite(slopes(0.0, np.full(2 * links.coordinate_count, math.inf))).all()


def test_a_swing_whose_way_is_not_kept_ends_in_the_same_state():
    """At a touch, and at the end of the time."""
    for gap, ended_by in ((lambda t, q: 0.3 + q[1], "touch"), (lambda t, q: 9.0 + q[1], "t_end")):
        whole, ends = (swing_until(chain(2), (1.2, 0.4), (0.0, -3.0), (gap,), t_end=0.4, kept=k) for k in (True, False))
        assert whole.ended_by == ends.ended_by == ended_by and whole.t_end == ends.t_end
        assert whole.closest == ends.closest and ends.energy_drift < 1e-12
        np.testing.assert_allclose([*ends.theta, *ends.theta_dot], [*whole.theta, *whole.theta_dot], rtol=1e-14)
        np.testing.assert_allclose(ends.theta_t, whole.theta_t[[0, -1]], rtol=1e-14)
        assert list(ends.t) == [0.0, whole.t_end]
