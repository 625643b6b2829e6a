"""Tests of mass scaling: the step that is reached, who gains mass, weight, and what is reported and refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun, finished, momentum, prepared, result_of
from test_timestep import CASES, DEPTH, H, box, frequencies, graded, scene

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.model import mass_scaling
from warp_mca.system.model import Model


@pytest.fixture
def unlimited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Small models gain much of their mass, which is refused otherwise."""
    monkeypatch.setattr(mass_scaling, "LIMIT", np.inf)


def scaled(made: mca.Scene, asked: float | str | None) -> mca.Scene:
    """The scene with mass scaling."""
    return replace(made, impact=replace(made.impact, mass_scaling=asked))


def model_of(made: mca.Scene, asked: float | str | None) -> Model:
    """Its model."""
    return prepared(scaled(made, asked)).model


@pytest.mark.usefixtures("unlimited")
@pytest.mark.parametrize("name", CASES)
def test_steps_get_as_long_as_asked(name: str):
    """Within a per mille, and no frequency of the assembled model exceeds what the step allows."""
    made = CASES[name][0]
    plain, little, model = (model_of(made, factor) for factor in (None, 1.3, 3.0))
    assert little.stable.dt == pytest.approx(1.3 * plain.stable.dt, rel=1e-3)
    assert model.stable.dt == pytest.approx(3.0 * plain.stable.dt, rel=1e-3)
    assert frequencies(model).max() <= (2.0 / model.stable.dt) ** 2 * (1.0 + 1e-6)


@pytest.mark.usefixtures("unlimited")
def test_elements_of_longer_steps_gain_nothing():
    """A uniform half and a finer one: one cell's mass grows by the square of the ratio of steps, the other's not."""
    points = box(2, 1, 1).points
    points[:, 0] = np.where(points[:, 0] > 1.5 * H, 1.25 * H, points[:, 0])  # cells of H and H / 4
    made = scene(replace(box(2, 1, 1), points=points))
    plain = model_of(made, None)
    model = model_of(made, 1.5)
    alone = prepared(scene(replace(box(1, 1, 1, size=(0.25 * H, H, 2 * H))))).model
    assert plain.stable.dt == pytest.approx(alone.stable.dt, rel=1e-12)
    assert model.scaling is not None and model.scaling.elements == 1
    gain = 1.5**2 - 1.0
    expected = np.where(points[:, 0] > 0.5 * H, gain * alone.mass[0], 0.0)
    np.testing.assert_allclose(model.scaling.added, expected, rtol=2e-3)
    np.testing.assert_array_equal(model.mass, plain.mass + model.scaling.added)


@pytest.mark.usefixtures("unlimited")
def test_a_wanted_step_is_met():
    """Given in seconds; one that is shorter than the stable step changes nothing."""
    made = CASES["alike"][0]
    plain = model_of(made, None)
    assert model_of(made, "1e-6s").stable.dt == pytest.approx(1e-6, rel=1e-3)
    kept = model_of(made, f"{0.9 * plain.stable.dt!r}s")
    assert kept.stable == plain.stable
    np.testing.assert_array_equal(kept.mass, plain.mass)


def flying(asked: float | None = None, gravity: float = 0.0, **contact) -> mca.Scene:
    """A graded block, over a plane that it may reach, whose smallest cells gain 1 % of its mass."""
    made = scene(graded(box(6, 4, 6)), **contact)
    body = replace(made.bodies[0], velocity=(0.0, -3.0, 0.0), position=(0.0, 2.0 * DEPTH, 0.0))
    impact = mca.ImpactPhase(duration=2e-5, output_interval=1e-6, mass_scaling=asked)
    return replace(made, bodies=(body,), impact=impact, gravity=(0.0, -gravity, 0.0))


def test_added_mass_has_no_weight():
    """In free fall momentum grows by physical weight times time, and the ledger balances."""
    g, factor = 1e5, 1.3
    impact = finished(flying(factor, g))
    model, result = impact.solver.model, result_of(impact)
    assert model.scaling is not None
    added, t = float(model.scaling.added.sum()), result.time[-1]
    mass = float(model.mass.sum())
    assert added > 0.01 * mass
    gained = momentum(impact)[1] + 3.0 * mass
    assert gained == pytest.approx(-(mass - added) * g * (t + 0.5 * impact.steps.dt), rel=1e-6)
    assert result.summary["energy_error"] < 1e-6
    a = (1.0 - added / mass) * g  # of the mass centre
    assert result.summary["energy"]["external_work"] == pytest.approx(mass * a * (3.0 * t + 0.5 * a * t**2), rel=1e-3)


def test_what_is_reported():
    """Masses by body, and momentum and energy of a body in flight, which change by its share."""
    plain, found = mca.run(flying()).summary, mca.run(flying(1.3)).summary
    share, report = found["mass_added"]["lower"], found["mass_scaling"]
    assert found["stable_dt"] == pytest.approx(1.3 * plain["stable_dt"], rel=1e-3)
    assert report["plain_stable_dt"] == plain["stable_dt"]
    assert share == report["striking"] == report["greatest"] > 0.0
    assert report["striking_body"] == "lower"
    assert report["momentum"] == pytest.approx(share, rel=1e-12)
    assert report["kinetic_energy"] == pytest.approx(share, rel=1e-12)
    assert report["F_n_first_peak"] == mass_scaling.PEAK_ERROR * share
    energies = [summary["energy"]["initial"] for summary in (plain, found)]
    assert energies[1] / energies[0] == pytest.approx(1.0 + share, rel=1e-9)
    assert "mass_added" not in plain and "mass_scaling" not in plain


def test_batches():
    """A scene of a batch comes out as it does alone, with gravity and contact, whatever the others add."""
    own, other = flying(1.3, 1e3, penalty=1.0), flying(1.1, 0.0, penalty=1.0)
    batch = mca.run_batch([own, other, scaled(own, None)])
    assert [r.summary.get("mass_added", {}).get("lower", 0.0) > 0.0 for r in batch] == [True, True, False]
    alone = begun(own)
    alone.advance()
    pair = mca.run_batch([own, replace(own, name="again")])
    for name, column in result_of(alone).history.items():
        np.testing.assert_array_equal(pair[1][name], column)


def test_too_much_is_refused():
    """With the body, the share and the estimate; so are cycles, whose links get rigid again."""
    with pytest.raises(mca.RequestError, match=r"mass_scaling = 3.*times its mass to body lower and move.*at most 10%"):
        model_of(flying(), 3.0)
    made = mca.make_scene("single_link", t_end=1.0)
    with pytest.raises(mca.RequestError, match=r"mass_scaling = 1\.5: links that get rigid again"):
        scaled(made, 1.5)


@pytest.mark.parametrize("asked", [0.5, -1.0, np.nan, np.inf, True, "2", "s", "-1s", "nans", "infs", (2.0,)])
def test_factors_and_steps(asked):
    """A factor of at least 1, or a time with its unit."""
    with pytest.raises(mca.RequestError, match=r"ImpactPhase\.mass_scaling"):
        mca.ImpactPhase(duration=1e-3, mass_scaling=asked)


def test_command_line(tmp_path, capsys):
    """A factor or a step; what is added is printed with the figures."""
    base = ["run", "hertz_sphere", "--duration", "1e-6", "--out"]
    assert main([*base, str(tmp_path / "a"), "--mass-scaling", "1.2"]) == 0
    assert "mass added" in capsys.readouterr().out
    assert mca.load(tmp_path / "a").summary["mass_scaling"]["asked"] == 1.2
    assert main([*base, str(tmp_path / "b"), "--mass-scaling", "8e-9s"]) == 0
    assert mca.load(tmp_path / "b").summary["stable_dt"] == pytest.approx(8e-9, rel=1e-3)
    assert main([*base, str(tmp_path / "c"), "--mass-scaling", "fast"]) == 2
