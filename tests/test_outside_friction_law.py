"""A law of friction from outside the package, in this file alone: a film of grease adds eta v per area to mu p."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from outside import own_law, runs_on

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.scene.friction_laws import FRICTION_LAWS, FrictionLaw
from warp_mca.scenes import sliding_block

wp.set_module_options({"enable_backward": False})


@wp.func
def limit(
    before: wp.float64, F_n: wp.float64, speed: wp.float64, parameters: wp.array2d(dtype=wp.float64), row: int
) -> wp.float64:
    """mu F_n + eta A v [N]."""
    return before + parameters[row, 0] * speed


@mca.register
@dataclass(frozen=True, kw_only=True)
class Grease(FrictionLaw):
    """A film that adds the shear stress eta v to that of friction."""

    eta: float  # [Pa s/m]
    law = __name__

    def parameters(self, area: float) -> tuple[float, ...]:
        """eta A [N s/m]."""
        return (self.eta * area,)


SPEED, GRAVITY, MU, MASS, AREA = 1.0, 300.0, 0.2, 0.2, 0.01  # of sliding_block
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def block(law: FrictionLaw | tuple[FrictionLaw, ...] = (), *, rigid: bool = False, onto: str = "plane") -> mca.Scene:
    """The block of `sliding_block` on a plane, a wide plate, or a box with sides that it may slide over."""
    scene = sliding_block.build(mu=MU, cells=1)
    contact, bodies = replace(scene.contacts[0], friction=law), [replace(scene.bodies[0], rigid=rigid)]
    fixed = ()
    if onto != "plane":
        size, origin = ((0.16, 0.02, 0.14), (-0.02, -0.02, -0.02)) if onto == "plate" else (3 * (0.2,), 3 * (-0.2,))
        plate = mca.Box(size=size, divisions=(6, 1, 5) if onto == "plate" else (4, 4, 4), origin=origin)
        name = "ymax" if onto == "plate" else "boundary"
        bodies.append(mca.Body(name="plate", geometry=plate, material=mca.Elastic(E=10e9, nu=0.3, rho=1000.0)))
        contact = replace(contact, master=mca.Surface(body="plate", nodes=name))
        fixed = (mca.Fixed(body="plate", nodes="boundary"),)
        if onto == "box":
            bodies[0] = replace(bodies[0], position=(-0.15, bodies[0].position[1], -0.15))
    return replace(scene, bodies=tuple(bodies), contacts=(contact,), fixed=fixed)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("case", [{}, {"rigid": True}, {"onto": "plate"}, {"onto": "box"}], ids=str)
def test_speed_and_heat_are_those_of_the_equation_of_motion(case: dict, device: str):
    """m dv/dt = -mu m g - eta A v: v = (v_0 + a / b) exp(-b t) - a / b with a = mu g and b = eta A / m."""
    result = mca.run(block(Grease(eta=2000.0), **case), device=device, precision="float64", duration=7e-3)
    a, b = MU * GRAVITY, 2000.0 * AREA / MASS
    speed = SPEED + np.cumsum(result.F_t) * (result.time[1] - result.time[0]) / MASS
    expected = (SPEED + a / b) * np.exp(-b * result.time) - a / b
    assert expected[-1] < 0.25
    np.testing.assert_allclose(speed, expected, atol=0.004)
    heat = 0.5 * MASS * (SPEED**2 - expected[-1] ** 2)
    assert result["E_friction"][-1] == pytest.approx(heat, rel=0.01)
    assert result.summary["energy_error"] < 1e-4


@pytest.fixture
def outside_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    return own_law(
        monkeypatch,
        tmp_path,
        __file__,
        FRICTION_LAWS,
        "Grease",
        "def build(*, eta: float = 2000.0):\n    return block(Grease(eta=eta))",
    )


@pytest.mark.usefixtures("outside_module")
def test_a_model_file_and_a_run_that_was_stopped_give_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    whole = runs_on(monkeypatch, capsys, FRICTION_LAWS, "Grease", "2e-3", "1e-3s")
    assert whole["E_friction"][-1] > 0.01


def test_scenes_of_a_batch_have_parameters_of_their_own():
    scenes = [block(Grease(eta=eta)) for eta in (500.0, 2000.0)]
    for scene, result in zip(scenes, mca.run_batch(scenes, duration=2e-3), strict=True):
        assert np.array_equal(result.F_t, mca.run(scene, duration=2e-3).F_t)
    with pytest.raises(mca.RequestError, match=r"^scenes\[1\].contacts\[0\].friction_laws = 'mu alone': that of s"):
        mca.run_batch([scenes[0], block()])


def test_a_sweep_takes_a_parameter_of_the_law(outside_module: str):
    grid = ["--grid", "eta=500,2000", "--import", outside_module, "--duration", "2e-3", "--out", "swept"]
    assert main(["sweep", "block.py", *grid]) == 0
    with Path("swept/sweep.csv").open(newline="") as file:
        heats = [float(row["energy.friction"]) for row in csv.DictReader(file)]
    assert len(heats) == 2 and 0.01 < heats[0] < 0.9 * heats[1]


def test_what_is_no_law_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Grease, "law", "math")
    with pytest.raises(mca.RequestError, match=r"^law of friction = 'math': name a module that has limit: Attribute"):
        mca.run(block(Grease(eta=1.0)))
    monkeypatch.setattr(Grease, "law", None)
    with pytest.raises(mca.RequestError, match=r"^Grease.law = None: name the module of its function"):
        mca.run(block(Grease(eta=1.0)))
    monkeypatch.setattr(Grease, "parameters", lambda self, area: (math.nan,))
    monkeypatch.setattr(Grease, "law", __name__)
    with pytest.raises(mca.RequestError, match=r"^Grease.parameters\(0.0001\) = \(nan,\): give a tuple of finite"):
        mca.run(block(Grease(eta=1.0)))
