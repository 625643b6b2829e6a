"""Damping of bodies beside closed forms: ring-down, free flight, energy, stable step, rotation, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import test_cycle
from impacts import begun, finished, result_of
from outside import goes_on

import warp_mca as mca
from warp_mca.phases.cycle import Cycle
from warp_mca.phases.impact import Impact
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import Settings

L, CELLS = 0.1, 10
ALUMINIUM = mca.Elastic(E=70e9, nu=0.0, rho=2700.0)
BAR = mca.Body(
    name="bar", geometry=mca.Box(size=(L, 0.01, 0.01), divisions=(CELLS, 1, 1)), material=ALUMINIUM, element="hex8i"
)
C = ALUMINIUM.wave_speeds["bar"]
F = 2.0 * CELLS / math.pi * math.sin(0.5 * math.pi / CELLS) * C / (2.0 * L)  # of the chain of lumped masses
W = 2.0 * math.pi * F
LOSS = mca.Damping(body="bar", loss_factor=0.04, band=(F / 5.0, 5.0 * F))
MESH = mca.Box(size=(L, 0.01, 0.01), divisions=(CELLS, 1, 1)).build()
EDGE = np.flatnonzero((MESH.points[:, :2] == 0.0).all(axis=1)).astype(np.int32)
HINGED = replace(BAR, geometry=replace(MESH, node_sets={"edge": EDGE}))
ALL = (mca.Damping(body="bar", mass=0.04 * W), mca.Damping(body="bar", stiffness=0.04 / W), LOSS)


def ringing(*dampings: mca.Damping, periods: float = 6.0, **change: Any) -> mca.Scene:
    """A free bar of lumped masses, whose velocity along itself is to be that of its first mode."""
    span = periods / F
    impact = mca.ImpactPhase(duration=span, output_interval=span / 200.0, energy_tolerance=1e-4)
    tip = mca.Point(body="bar", at=(L, 0.005, 0.005))
    return replace(mca.Scene(name="ring", bodies=(BAR,), loads=dampings, impact=impact, tip=tip), **change)


def struck(scene: mca.Scene, **settings: Any) -> Impact:
    """Its impact phase, with that velocity."""
    impact = begun(scene, **settings)
    v = impact.state.v.numpy()
    v[:, 0] += np.cos(math.pi * impact.solver.model.X[:, 0] / L)
    impact.state.v.assign(v)
    return impact


def ring_down(impact: Impact) -> tuple[float, float]:
    """Frequency [Hz] and damping ratio of the tip's velocity."""
    from scipy.optimize import least_squares

    impact.advance()
    assert impact.stopped == [None]
    result = result_of(impact)
    time, value = result.time, result["tip_vx"]

    def left_over(x: np.ndarray) -> np.ndarray:
        w = x[0] * W
        wave = np.exp((1j - x[1]) * w * time)
        basis = np.column_stack([wave.real, wave.imag])
        return value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]

    found = least_squares(left_over, [1.0, 0.01], xtol=1e-12, ftol=1e-12, gtol=1e-12).x
    return float(found[0] * F), float(found[1])


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("damping", ALL, ids=("mass", "stiffness", "loss"))
def test_a_bar_rings_down_at_its_damping_ratio(damping: mca.Damping, precision: str, device: str):
    """xi = alpha / (2 w) + beta w / 2, or that of the complex modulus of the branches, which raises the frequency."""
    impact = struck(ringing(damping), precision=precision, device=device)
    frequency, ratio = ring_down(impact)
    if damping is LOSS:
        share, times = damping.branches()
        modulus = 1.0
        for _ in range(20):  # s^2 = -w^2 (1 + sum g s tau / (1 + s tau)) for the factor exp(s t)
            s = 1j * W * np.sqrt(modulus)
            modulus = 1.0 + (share * s * times / (1.0 + s * times)).sum()
        assert frequency == pytest.approx(s.imag / (2.0 * math.pi), rel=2e-3)
        assert ratio == pytest.approx(-s.real / s.imag, rel=5e-3) == pytest.approx(0.02, rel=0.03)
    else:
        assert frequency == pytest.approx(F, rel=5e-3)  # alpha dt / 4 of it for the velocity of half a step before
        assert ratio == pytest.approx(0.5 * damping.loss_at(F), rel=6e-3)
        assert ratio == pytest.approx(0.02, rel=6e-3)
    energy = result_of(impact).summary["energy"]
    assert energy["damping"] > 0.7 * energy["initial"] and abs(energy["error"]) < 1e-6 * energy["initial"]


@pytest.mark.parametrize("ratio", [1.01, 1.5, 10.0, 1e5])
@pytest.mark.parametrize("loss", [1e-3, 0.05, 0.5])
def test_the_loss_factor_holds_to_a_percent_within_its_band(loss: float, ratio: float):
    damping = mca.Damping(body="bar", loss_factor=loss, band=(100.0, 100.0 * ratio))
    share, times = damping.branches()
    assert (share > 0.0).all() and (times > 0.0).all() and len(share) <= 3 + 3 * math.log10(ratio)
    found = [damping.loss_at(f) for f in np.geomspace(100.0, 100.0 * ratio, 57)]
    np.testing.assert_allclose(found, loss, rtol=0.011)


@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r", "tet4", "tet10"])
def test_the_stable_step_counts_damping(element: str):
    """At the whole stable step noise decays to the rigid motion alone, whose momentum stays."""
    body = replace(BAR, geometry=mca.Box(size=(0.03, 0.01, 0.01), divisions=(6, 2, 2)), element=element)
    impact = mca.ImpactPhase(duration=1e-4, output_interval=1e-5, time_step_scale=1.0, energy_tolerance=1e-3)
    whole = prepared_step(mca.Scene(name="noise", bodies=(body,), impact=impact))
    steps = []
    for damping in (
        mca.Damping(body="bar", stiffness=0.5 * whole),
        mca.Damping(body="bar", loss_factor=0.4, band=(0.002 / whole, 0.1 / whole)),
        mca.Damping(body="bar", mass=1.0 / whole),
    ):
        scene = mca.Scene(name="noise", bodies=(body,), impact=impact, loads=(damping,))
        run = begun(scene, precision="float64")
        v = run.state.v.numpy() + np.random.default_rng(0).standard_normal((run.solver.model.node_count, 3))
        run.state.v.assign(v)
        before = run.solver.model.mass @ v
        run.advance()
        assert run.stopped == [None]
        np.testing.assert_allclose(run.solver.model.mass @ run.state.v.numpy(), before, rtol=1e-9)
        energy = result_of(run).summary["energy"]
        assert energy["elastic"] < 0.02 * v.var() * run.solver.model.mass.sum()
        steps.append(run.solver.model.stable.dt / whole)
    # dt = 2 / w (sqrt(1 + xi^2) - xi) with w = 2 / whole: xi = beta w / 2 = 0.5, and alpha / (2 w) = 0.25
    assert steps[0] == pytest.approx(math.sqrt(1.25) - 0.5, rel=1e-9)
    assert steps[2] == pytest.approx(math.sqrt(1.0 + 0.25**2) - 0.25, rel=1e-9)
    assert 0.3 < steps[1] < 1.0


def prepared_step(scene: mca.Scene) -> float:
    """Stable step of a scene [s]."""
    return begun(scene).solver.model.stable.dt


@pytest.mark.parametrize("damping", ALL, ids=("mass", "stiffness", "loss"))
def test_falling_and_spinning_go_on_as_without_damping(damping: mca.Damping):
    """Free fall keeps g t, a spin its angular momentum and, once it has stretched, its energy."""
    falling = ringing(damping, gravity=(0.0, -1000.0, 0.0))
    run = begun(falling, precision="float64")
    model = run.solver.model
    centre = model.mass @ model.X / model.mass.sum()
    v = np.array([3.0, 0.0, 0.0]) + np.cross([0.0, 300.0, 1000.0], model.X - centre)
    run.state.v.assign(v)
    spin = model.mass @ np.cross(model.X - centre, v)
    run.advance()
    assert run.stopped == [None]
    v, span = run.state.v.numpy(), run.state.steps * run.solver.dt
    x = model.X + run.state.u.numpy() - 0.5 * run.solver.dt * v
    mean = model.mass @ v / model.mass.sum()
    np.testing.assert_allclose(mean, [3.0, -1000.0 * span, 0.0], rtol=1e-9, atol=1e-10)
    arm = x - model.mass @ x / model.mass.sum()
    np.testing.assert_allclose(model.mass @ np.cross(arm, v), spin, rtol=1e-6, atol=1e-9 * np.abs(spin).max())
    energy = result_of(run).summary["energy"]
    assert 0.0 < energy["damping"] < 4.0 * energy["elastic"]  # only the stretching that sets in at once


def test_mass_about_the_ground_slows_what_flies_and_about_the_body_what_stays():
    flying = replace(BAR, velocity=(0.0, 5.0, 0.0))
    alpha, span = 0.05 * W, 6.0 / F
    scene = ringing(mca.Damping(body="bar", mass=alpha, about="ground"), bodies=(flying,))
    result = result_of(finished(scene, precision="float64"))
    assert result["tip_vy"][-1] == pytest.approx(5.0 * math.exp(-alpha * span), rel=1e-3)
    # a bar that moves along with one driven end: its motion relative to that decays, at a quarter of the wave
    held = {"body": "bar", "nodes": "xmin"}
    prescribed = [mca.Prescribed(**held, axis=a, times=(0.0,), velocities=(5.0 * (a == "y"),)) for a in "xyz"]
    driven = ringing(mca.Damping(body="bar", mass=alpha), bodies=(flying,), prescribed=tuple(prescribed))
    result = result_of(finished(driven, precision="float64"))
    assert np.abs(result["tip_vy"] - 5.0).max() < 1e-9


def test_what_yields_is_damped_less_and_energy_closes():
    """Noise of speeds at which cells yield: no force grows beyond bounds, and the ledger closes."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=2e8, E_t=1e9)
    for damping in (mca.Damping(body="bar", stiffness=2e-7), replace(LOSS, loss_factor=0.2)):
        scene = ringing(damping, bodies=(replace(BAR, material=metal),), periods=3.0)
        run = begun(replace(scene, impact=replace(scene.impact, time_step_scale=0.2, energy_tolerance=1e-2)))
        run.state.v.assign(30.0 * np.random.default_rng(1).standard_normal((run.solver.model.node_count, 3)))
        run.advance()
        assert run.stopped == [None]
        energy = result_of(run).summary["energy"]
        assert energy["plastic"] > 0.05 * energy["initial"] and energy["damping"] > 0.05 * energy["initial"]
        assert abs(energy["error"]) < 3e-3 * energy["initial"]


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    both = replace(LOSS, mass=100.0, stiffness=1e-8)
    goes_on(ringing(both, periods=1.0, bodies=(replace(BAR, velocity=(0.0, 1.0, 0.0)),), gravity=(1e5, 0, 0)), tmp_path)


def test_threads_and_batches_give_what_scenes_give_alone():
    scenes = [ringing(damping, periods=1.0, gravity=(1e5, 0.0, 0.0)) for damping in ALL]
    scenes = [replace(scene, fixed=(mca.Fixed(body="bar", nodes="xmin"),)) for scene in scenes]
    for scene, result in zip(scenes, mca.run_batch(scenes), strict=True):
        alone = mca.run(scene)
        for name in ("E_damping", "E_kinetic", "tip_vx"):
            np.testing.assert_allclose(result[name], alone[name], rtol=2e-5, atol=1e-5 * np.abs(alone[name]).max())
    for damping in ALL:
        states = [struck(ringing(damping, periods=1.0), threads=threads) for threads in (1, 3)]
        for impact in states:
            impact.advance()
        assert states[0].state.differences(states[1].state) == []


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, r"Damping of bar.mass = 0.0: nothing damps"),
        ({"mass": -1.0}, r"Damping of bar.mass = -1.0: give a number from 0 to 1e"),
        ({"loss_factor": 0.1}, r"Damping of bar.band = None: give the frequencies"),
        ({"band": (1.0, 2.0), "mass": 1.0}, r"Damping of bar.loss_factor = 0.0: give that of the band"),
        ({"loss_factor": 0.1, "band": (2.0, 1.0)}, r"Damping of bar.band = \(2.0, 1.0\): give two frequencies f1 < f2"),
        ({"loss_factor": 0.9, "band": (1.0, 2.0)}, r"Damping of bar.loss_factor = 0.9: give a number from 0 to 0.5"),
        ({"mass": 1.0, "about": "air"}, r"Damping of bar.about = 'air': choose body or ground"),
    ],
)
def test_values_that_damp_nothing_are_refused(given: dict, message: str):
    with pytest.raises(mca.RequestError, match=message):
        mca.Damping(body="bar", **given)


@pytest.mark.parametrize(
    ("change", "damping", "settings", "message"),
    [
        ({"bodies": (replace(BAR, rigid=True),)}, LOSS, {}, "Damping.body = 'bar': loads act on nodes of flexible"),
        ({}, LOSS, {"multi_rate": 2}, "Scene.loads = 'Damping': it does not go with multi_rate; its forces"),
        (
            {"impact": mca.ImpactPhase(duration=1e-5, bulk_viscosity=0.06)},
            LOSS,
            {},
            "ImpactPhase.bulk_viscosity = 0.06: its rate does not go with stiffness and loss_factor",
        ),
        (
            {"bodies": (HINGED,), "fixed": (mca.Fixed(body="bar", nodes="edge"),)},
            ALL[0],
            {},
            'Damping of bar.about = .body.: its held nodes let it turn .* give "ground"',
        ),
    ],
)
def test_what_damping_does_not_go_with_is_refused(change: dict, damping: mca.Damping, settings: dict, message: str):
    with pytest.raises(mca.RequestError, match=message):
        mca.run(ringing(damping, **change), **settings)


def test_swings_and_impacts_in_turn_keep_what_damping_took():
    """Rigid swings take nothing; the columns go on from one impact to the next, and the ledger closes."""
    swinging = test_cycle.scene("single_link", t_end=0.35)
    damped = replace(swinging, loads=(mca.Damping(body="OA", loss_factor=0.05, band=(500.0, 5e4)),))
    result = Cycle(damped, None, Request(span=1.5e-3, settings=Settings("cpu", "mixed", 1))).run()
    kinds, energy = [phase["kind"] for phase in result.summary["phases"]], result.summary["energy"]
    assert kinds == ["rigid", "impact", "rigid"]
    assert energy["damping"] == result["E_damping"][-1] == result["E_damping"][-200] > 0.01
    assert abs(energy["error"]) < 2e-3 * energy["damping"]
    with pytest.raises(mca.RequestError, match="loads act in an impact alone"):
        replace(damped, loads=(mca.Spring(name="s", body="OA", nodes="tip", other_at=(0, 0, 0), stiffness=1.0),))


def test_moduli_rise_over_the_band_as_much_as_the_page_says():
    """By eta at its lower end and (2 / pi) eta ln(f2 / f1) more at the upper one: Kramers and Kronig's relation."""
    for loss, ratio in ((0.01, 10.0), (0.02, 100.0), (0.05, 10.0)):
        share, times = mca.Damping(body="bar", loss_factor=loss, band=(100.0, 100.0 * ratio)).branches()
        x = 2.0 * math.pi * np.array([100.0, 100.0 * ratio])[:, None] * times
        low, high = (share * x * x / (1.0 + x * x)).sum(axis=1)
        assert low == pytest.approx(loss, rel=0.3)
        assert high - low == pytest.approx(2.0 / math.pi * loss * math.log(ratio), rel=0.25)
