"""Extremes of single steps, and checks between rows of the history, do not depend on the output interval."""

from __future__ import annotations

import random
import re
from dataclasses import replace

import numpy as np
import pytest
from test_elements import KINDS, STEEL, held_of
from test_run import bar

import warp_mca as mca
from warp_mca.step.steps import CHECK_STEPS, CHECK_TIME, Steps

METAL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=400e6, E_t=2e9)
DT = 2.5e-8  # of most runs here: rows differ, steps do not


def run(
    scene: mca.Scene, monkeypatch: pytest.MonkeyPatch, rows: int, steps: int, dt: float = DT, **more: object
) -> mca.Result:
    """A run of so many rows of as many steps each."""
    division = Steps(dt=dt, per_search=steps, searches=1, intervals=rows)
    with monkeypatch.context() as patch:
        patch.setattr("warp_mca.phases.impact.divide_alike", lambda *_: division)
        return mca.run(scene, **more)


def fast(element: str = "hex8") -> mca.Scene:
    """A bar of 40 elements that strikes a wall at 600 m/s, a ninth of its wave speed, and has left it after 30 us."""
    scene = bar(penalty=10.0, energy_tolerance=1.0)
    body = replace(
        scene.bodies[0],
        geometry=mca.Box(size=(0.04, 0.01, 0.01), divisions=(40, 2, 2)),
        velocity=(600.0, 0.0, 0.0),
        element=element,
    )
    wall = mca.RigidPlane(point=(0.04, 0.0, 0.0), normal=(-1, 0, 0))
    tip = mca.Point(body="bar", at=(0.0, 0.0, 0.0))
    return replace(scene, bodies=(body,), contacts=(replace(scene.contacts[0], master=wall),), tip=tip)


@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4", "tet10"])
def test_rows_200_times_as_long_give_the_same_extremes(element, monkeypatch):
    """A single row showed a fraction of the greatest force, and no strain: the bar was free again."""
    short, long = (run(fast(element), monkeypatch, *division) for division in ((200, 6), (1, 1200)))
    one, other = short.summary["extremes"], long.summary["extremes"]
    for name in ("F_n_max", "max_strain", "max_speed"):
        assert one[name] == other[name], name
    assert long.summary["F_n_max"] < 0.7 * short.summary["F_n_max"] < one["F_n_max"]
    for result in (short, long):
        assert result.summary["max_strain"] == one["max_strain"] > 0.1
        assert any("strain reached" in warning for warning in result.warnings)
    assert other["min_jacobian"] == pytest.approx(one["min_jacobian"], rel={"hex8": 0.05}.get(element, 1e-6))
    assert (0.2 if element == "tet10" else 0.5) < one["min_jacobian"] < 0.95


def heads_on(two_way: bool) -> mca.Scene:
    """Two equal bars, end to end."""
    half = mca.Box(size=(0.02, 0.01, 0.01), divisions=(10, 2, 2))
    steel = {"geometry": half, "material": STEEL, "element": "hex8"}  # whose balance is off most while bars touch
    left = mca.Body(name="left", velocity=(2.0, 0.0, 0.0), **steel)
    right = mca.Body(name="right", position=(0.02, 0.0, 0.0), **steel)
    ends = mca.Surface(body="left", nodes="xmax"), mca.Surface(body="right", nodes="xmin")
    contact = mca.Contact(slave=ends[0], master=ends[1], two_way=two_way, penalty=1.0)
    return mca.Scene(name="heads on", bodies=(left, right), contacts=(contact,), impact=mca.ImpactPhase(duration=1e-5))


@pytest.mark.parametrize("scene", [bar(), heads_on(False), heads_on(True)], ids=["plane", "surface", "two-way"])
def test_greatest_force_is_that_of_rows_of_one_step(scene, monkeypatch):
    """Their mean is the force itself, and all normals lie along the bar: nu = 0, or almost no bulging."""
    result = run(scene, monkeypatch, 200, 1)
    assert result.summary["F_n_max"] > 100.0
    assert result.summary["extremes"]["F_n_max"] == pytest.approx(result.summary["F_n_max"], rel=1e-9)
    coarse = run(scene, monkeypatch, 2, 100)
    assert coarse.summary["extremes"]["F_n_max"] == result.summary["extremes"]["F_n_max"] > coarse.summary["F_n_max"]


@pytest.mark.parametrize(("v", "fastest"), [(0.0, 1e4 * 100.5 * DT), (1.0, 1.0)])
def test_greatest_speed_of_a_falling_body(v, fastest, monkeypatch):
    """g t at the last half step; one thrown upwards is fastest when it starts, not half a step before."""
    scene = replace(bar(), contacts=(), gravity=(0.0, -1e4, 0.0))
    scene = replace(scene, bodies=(replace(scene.bodies[0], velocity=(0.0, v, 0.0)),))
    extremes = run(scene, monkeypatch, 1, 100).summary["extremes"]
    assert extremes["max_speed"] == pytest.approx(fastest, rel=1e-7)
    assert extremes["F_n_max"] == 0.0


@pytest.mark.parametrize("material", [STEEL, METAL], ids=["elastic", "plastic"])
@pytest.mark.parametrize(("element", "kinematics"), KINDS)
def test_strain_and_loss_of_volume_of_a_past_step_stay(element, kinematics, material):
    """Half as long along x: J = 1/2; then less, then none. A block that was inside out stays counted as such."""
    block = mca.Box(size=(0.02, 0.01, 0.01), divisions=(2, 1, 1)).build()
    held = held_of(block, element, kinematics, "float64", material)
    X = held.solver.model.X

    def extremes() -> tuple[float, float]:
        energy = held.energies()
        return float(energy[2].max()), float(energy[3].min())

    strain = 1.0 / 3.0 if kinematics == "corotational" else 2.0 / 3.0 * np.log(2.0)
    for share in (0.5, 0.1, 0.0):
        held.forces(X * [-share, 0.0, 0.0])
        assert extremes() == pytest.approx((strain, 0.5), rel=1e-6)  # the rotation's error at this stretch
    held.forces(X * [-2.0, 0.0, 0.0])
    held.forces(0.0 * X)
    assert extremes()[1] == pytest.approx(-1.0, rel=1e-6)


def test_an_imbalance_between_two_rows_stops_the_run(monkeypatch):
    """The balance is off by half as much again while bars touch as when they are free, in the row at the end."""
    scene = heads_on(False)
    dt = CHECK_TIME / CHECK_STEPS
    fine, coarse = (run(scene, monkeypatch, *division, dt) for division in ((2400, 1), (1, 2400)))
    last = abs(fine["E_total_error"][-1]) / fine.summary["energy"]["initial"]
    assert coarse["E_total_error"].shape == (2,)
    assert coarse.summary["extremes"]["energy_error"] == coarse.summary["energy_error"] > 1.5 * last
    assert coarse.summary["energy_error"] > 0.6 * fine.summary["energy_error"]
    strict = replace(scene, impact=replace(scene.impact, energy_tolerance=0.6 * last))
    with pytest.raises(mca.GuardError, match=r"energy imbalance .* at t = ") as found:
        run(strict, monkeypatch, 1, 2400, dt)
    time = float(re.search(r"at t = (\S+) s", str(found.value))[1])
    assert 0.0 < time < 2400 * dt
    assert time / CHECK_TIME == pytest.approx(round(time / CHECK_TIME), abs=1e-6)


@pytest.mark.parametrize("count", [1, 3])
def test_rows_hold_their_whole_interval_whatever_checks_lie_in_it(count, monkeypatch):
    """More checks in a row than the device keeps records; stress along paths is that of the rows."""
    scene = mca.make_scene("single_rod", axial=40, mu=0.0)
    monkeypatch.setattr("warp_mca.step.solver.RANGE", 64)
    fine, coarse = (run(scene, monkeypatch, *division, threads=count) for division in ((140, 10), (2, 700)))
    assert coarse.summary["n_steps"] == fine.summary["n_steps"] == 1400
    for name in ("time_s", "tip_vx", "E_kinetic", "E_internal", "E_contact"):
        assert np.array_equal(coarse[name][1:], fine[name][70::70]), name
    impulse = fine.F_n[1:].reshape(2, 70).mean(axis=1)
    assert coarse.F_n[1:] == pytest.approx(impulse, rel=1e-12)
    assert np.array_equal(coarse.paths[0].stress, fine.paths[0].stress[::70])
    assert coarse.summary["extremes"]["F_n_max"] == fine.summary["extremes"]["F_n_max"]


def test_checks_fill_an_output_interval_with_no_gap_too_long():
    """Records lie where `time` says, searches at equal distances, and few lengths of parts make few graphs."""
    rng = random.Random(0)
    for _ in range(300):
        steps = Steps(10.0 ** rng.uniform(-9.5, -5.0), rng.randint(1, 300), rng.randint(1, 60), 3)
        parts = list(steps.parts(0))
        begin = np.cumsum([0, *(part.count for part in parts)])
        assert begin[-1] == steps.per_interval
        searches = [b for b, part in zip(begin, parts, strict=False) if part.begins_search]
        assert searches == [steps.per_search * k for k in range(steps.searches)]
        checks = np.array([b for b, part in zip(begin, parts, strict=False) if part.begins_check])
        assert len(checks) == steps.checks
        assert np.diff([*checks, begin[-1]]).max() <= max(CHECK_STEPS, CHECK_TIME / steps.dt * (1.0 + 1e-9))
        times = [steps.time(steps.checks + k) for k in range(steps.checks)]
        assert times == pytest.approx(steps.interval + steps.dt * checks, rel=1e-12)
        assert len({(part.count, part.begins_check) for part in parts}) <= 3
    rare = Steps(1e-6 / 40, 40, 1, 10, intervals_per_search=3)
    assert [sum(part.begins_search for part in rare.parts(k)) for k in range(5)] == [1, 0, 0, 1, 0]
    assert Steps(1e-6 / 40, 40, 1, 10).checks == Steps(1e-7, 10, 2, 10).checks == 1
