"""Cubes whose elements fail on a rigid plane: energy of the springs beneath, and stored runs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from impacts import begun
from test_failure import ALUMINIUM

import warp_mca as mca


def crushed(element: str, strain: float, count: int, speed: float = 150.0) -> mca.Scene:
    """A cube of aluminium that falls flat on a rigid plane; strain at failure, inf without."""
    cube = mca.Box(size=(0.01,) * 3, divisions=(count,) * 3, origin=(-0.005, -0.005, 1e-6))
    fails = mca.PlasticStrainFailure(strain=strain) if np.isfinite(strain) else None
    body = mca.Body(
        name="cube", geometry=cube, material=replace(ALUMINIUM, failure=fails), kinematics="finite", element=element,
        velocity=(0.0, 0.0, -speed),
    )  # fmt: skip
    plane = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    contact = mca.Contact(slave=mca.Surface(body="cube", nodes="boundary"), master=plane)
    impact = mca.ImpactPhase(duration=1.3e-5, output_interval=5e-7)
    return mca.Scene(name="crushed", bodies=(body,), contacts=(contact,), impact=impact)


@pytest.mark.parametrize(("element", "strain", "count"), [("tet10", 0.1, 2), ("tet10", 0.3, 3), ("hex8", 0.05, 3)])
def test_springs_on_a_plane_make_no_energy_as_elements_fail(element, strain, count):
    """Springs that are pressed keep their stiffness, though the surface around them is another, and not flat."""
    result = mca.run(crushed(element, strain, count))
    assert result.failed == ()
    assert result.summary["failure"]["cube"]["elements"] > 3
    assert result.summary["energy_error"] < 2e-3


def test_failure_adds_nothing_to_what_is_off_without_it():
    """Internal vectors of `hex8i` lag by some; springs that let go lose what they hold less half a step's work."""
    plain, fails = (mca.run(crushed("hex8i", strain, 4)).summary for strain in (math.inf, 0.3))
    assert fails["failure"]["cube"]["elements"]
    assert fails["energy_error"] < plain["energy_error"] + 5e-4


def test_a_stored_run_on_a_plane_goes_on_with_equal_bits(tmp_path):
    whole, other = begun(crushed("tet10", 0.1, 2)), begun(crushed("tet10", 0.1, 2))
    half = whole.steps.per_interval * (whole.steps.intervals * 2 // 3)
    whole.advance(until=half)
    assert sum(int(item.failing.left.numpy().sum()) for item in whole.state.elements)
    whole.save(tmp_path / "state.npz")
    whole.advance()
    other.load(tmp_path / "state.npz")
    other.advance()
    assert whole.state.differences(other.state) == []


def loaded(element: str, *loads: mca.Load, failure: mca.PrincipalStressFailure | None) -> mca.Scene:
    """A brittle bar, held at one end, under loads on the other."""
    glass = mca.Elastic(E=70e9, nu=0.0, rho=2500.0, failure=failure)
    bar = mca.Body(
        name="bar", geometry=mca.Box(size=(0.003, 0.001, 0.001), divisions=(3, 1, 1)), material=glass, element=element
    )
    held = mca.Fixed(body="bar", nodes="xmin", axes="xyz")
    impact = mca.ImpactPhase(duration=4e-6, output_interval=1e-7)
    return mca.Scene(name="loaded", bodies=(bar,), fixed=(held,), loads=loads, impact=impact)


@pytest.mark.parametrize("element", ["hex8i", "tet10"])
@pytest.mark.parametrize("kind", ["pressure", "traction", "force", "area"])
def test_loads_end_with_the_elements_that_they_act_on(element, kind):
    """A pull above the strength of the cells takes them off; their nodes fly on with the speed that they have then."""
    given = {"body": "bar", "nodes": "xmax"}
    load = {
        "pressure": lambda: mca.Pressure(**given, pressure=-2e8),
        "traction": lambda: mca.Traction(**given, traction=(2e8, 0.0, 0.0), follows=True),
        "force": lambda: mca.Force(**given, force=(200.0, 0.0, 0.0)),
        "area": lambda: mca.Force(**given, force=(200.0, 0.0, 0.0), spread="area"),
    }[kind]()
    brittle = mca.PrincipalStressFailure(stress=1e8)
    impact = begun(loaded(element, load, failure=brittle))
    impact.advance(until=impact.steps.per_interval * (impact.steps.intervals - 10))
    (own,) = (item.failing for item in impact.state.elements)
    block, failed = impact.solver.model.blocks[0], own.age.numpy() < 0
    end = np.flatnonzero(impact.solver.model.X[:, 0] > 0.003 - 1e-9)
    loose = np.setdiff1d(end, block.conn[:, ~failed])
    assert len(loose) > 3
    before, loads = impact.state.v.numpy()[loose], impact.state.parts[type(load).__name__]
    work = loads.work.numpy()
    impact.advance()
    assert impact.stopped == [None]
    np.testing.assert_array_equal(impact.state.v.numpy()[loose], before)
    np.testing.assert_array_equal(loads.work.numpy()[np.isin(end, loose)], work[np.isin(end, loose)])


def test_a_body_force_goes_on_acting_on_nodes_without_elements():
    loads = (
        mca.BodyForce(body="bar", acceleration=(1e8, 0.0, 0.0)),
        mca.Pressure(body="bar", nodes="xmax", pressure=-2e8),
    )
    impact = begun(loaded("hex8i", *loads, failure=mca.PrincipalStressFailure(stress=1e8)))
    impact.advance(until=impact.steps.per_interval * 30)
    end = np.flatnonzero(impact.solver.model.X[:, 0] > 0.003 - 1e-9)
    before, steps = impact.state.v.numpy()[end, 0], impact.state.steps
    impact.advance()
    gained = 1e8 * impact.solver.dt * (impact.state.steps - steps)
    np.testing.assert_allclose(impact.state.v.numpy()[end, 0] - before, gained, rtol=1e-9)


@pytest.mark.gpu
def test_a_gpu_does_alike():
    pull = mca.Pressure(body="bar", nodes="xmax", pressure=-2e8)
    for scene in (crushed("tet10", 0.1, 2), loaded("hex8i", pull, failure=mca.PrincipalStressFailure(stress=1e8))):
        one, other = (mca.run(scene, device=device).summary for device in ("cpu", "cuda:0"))
        assert other["energy_error"] < 5e-3
        name = scene.bodies[0].name
        assert other["failure"][name]["elements"] == pytest.approx(one["failure"][name]["elements"], rel=0.2)
        work = one["energy"]["external_work"]
        assert other["energy"]["external_work"] == pytest.approx(work, rel=0.02, abs=1e-9)
