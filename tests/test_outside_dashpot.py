"""A contact law with a dashpot from outside the package, in this file alone: F = k (g + tau g'), which never pulls."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from impacts import prepared
from outside import own_law, runs_on
from scipy.integrate import solve_ivp

import warp_mca as mca
from warp_mca.scene.contact_laws import CONTACT_LAWS, ContactLaw

wp.set_module_options({"enable_backward": False})


@wp.func
def force(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """k g [N]."""
    return k * depth


@wp.func
def energy(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    """k g^2 / 2 [J]."""
    return wp.float64(0.5) * k * depth * depth


@wp.func
def dashpot(
    depth: wp.float64, rate: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int
) -> wp.float64:
    """k tau g' [N]."""
    return k * parameters[s, 0] * rate


@mca.register
@dataclass(frozen=True, kw_only=True)
class Damped(ContactLaw):
    """A spring and a dashpot side by side, after Kelvin and Voigt: F = k (g + tau g') with the time tau [s]."""

    tau: float
    law = __name__

    @property
    def parameters(self) -> tuple[float, ...]:
        """tau [s]."""
        return (self.tau,)

    def stiffening(self, depth: float) -> float:
        """As of the linear spring."""
        return 1.0

    def damping(self, depth: float) -> float:
        """tau [s]."""
        return self.tau


SIDE, SPEED, RHO, E, PENALTY = 0.01, 1.0, 2000.0, 70e9, 1e-4
MASS = RHO * SIDE**3
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def block(tau: float, *, rigid: bool = False, onto: str = "plane", mu: float = 0.0) -> mca.Scene:
    """A stiff cube on springs 10,000 times softer flies against a wall, or against a plate that cannot move."""
    cube = mca.Box(size=(SIDE, SIDE, SIDE), divisions=(2, 2, 2))
    stiff = mca.Elastic(E=E, nu=0.0, rho=RHO)
    bodies = [mca.Body(name="cube", geometry=cube, material=stiff, velocity=(0.0, -SPEED, 0.0), rigid=rigid)]
    master, fixed = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0)), ()
    if onto == "plate":
        plate = mca.Box(size=(0.03, 0.01, 0.03), divisions=(3, 1, 3), origin=(-0.01, -0.01, -0.01))
        bodies.append(mca.Body(name="plate", geometry=plate, material=replace(stiff, E=70e9)))
        master, fixed = mca.Surface(body="plate", nodes="ymax"), (mca.Fixed(body="plate", nodes="boundary"),)
    bottom = mca.Surface(body="cube", nodes="ymin")
    contact = mca.Contact(slave=bottom, master=master, law=Damped(tau=tau), penalty=PENALTY, mu=mu)
    impact = mca.ImpactPhase(duration=8e-4, output_interval=1e-6)
    return mca.Scene(name="block", bodies=tuple(bodies), contacts=(contact,), fixed=fixed, impact=impact)


def restitution(k: float, tau: float) -> float:
    """Speed after over speed before of a mass m with m g'' = -max(k (g + tau g'), 0)."""

    def pull(t: float, y: np.ndarray) -> list[float]:
        return [y[1], -max(k * (y[0] + tau * y[1]), 0.0) / MASS]

    def leaves(t: float, y: np.ndarray) -> float:
        return y[0] if t > 0.0 else 1.0

    leaves.terminal, leaves.direction = True, -1.0  # pyright: ignore[reportFunctionMemberAccess]
    end = 20.0 * math.sqrt(MASS / k) * (1.0 + tau / math.sqrt(MASS / k))
    found = solve_ivp(pull, (0.0, end), [0.0, SPEED], events=leaves, rtol=1e-10, atol=1e-16, max_step=end / 2e4)
    return float(-found.y[1, -1] / SPEED)


def stiffness(scene: mca.Scene, device: str = "cpu") -> float:
    """Sum of the stiffness of all springs [N/m], from the half period without a dashpot: pi sqrt(m / k)."""
    plain = replace(scene, contacts=(replace(scene.contacts[0], law=mca.Penalty()),))
    result = mca.run(plain, precision="float64", device=device)
    return float((result.F_n.max() / SPEED) ** 2 / MASS)  # F = v sqrt(k m)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("case", [{}, {"rigid": True}, {"onto": "plate"}], ids=lambda case: "-".join(case) or "plain")
@pytest.mark.parametrize("zeta", [0.1, 0.5, 1.5])
def test_the_restitution_is_that_of_the_equation_of_motion(zeta: float, case: dict, device: str):
    k = stiffness(block(1e-6, **case), device)
    tau = 2.0 * zeta * math.sqrt(MASS / k)
    result = mca.run(block(tau, **case), precision="float64", device=device)
    expected = restitution(k, tau)
    assert 0.02 < expected < 0.9
    found = result.F_n.sum() * 1e-6 / (MASS * SPEED) - 1.0
    assert found == pytest.approx(expected, rel=0.01, abs=0.002)
    energy = result.summary["energy"]
    fall = 0.5 * MASS * SPEED**2
    assert energy["damping"] == pytest.approx(fall * (1.0 - expected**2), rel=0.01)
    assert result.summary["energy_error"] < 1e-4
    assert (result.F_n >= 0.0).all() and result["E_contact"][-1] == 0.0


@pytest.fixture
def outside_module(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    return own_law(
        monkeypatch, tmp_path, __file__, CONTACT_LAWS, "Damped", "def build():\n    return block(2e-5, mu=0.3)"
    )


@pytest.mark.usefixtures("outside_module")
def test_a_model_file_and_a_run_that_was_stopped_give_the_same_bits(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    """The dashpot's force is in the State: a run that was stopped while it presses goes on to equal bits."""
    whole = runs_on(monkeypatch, capsys, CONTACT_LAWS, "Damped", "4e-4", "1.5e-4s")
    assert whole.summary["energy"]["damping"] > 0.1 * whole.summary["energy"]["initial"]


def test_scenes_of_a_batch_have_dashpots_of_their_own():
    scenes = [block(tau, mu=0.2) for tau in (1e-5, 4e-5)]
    for scene, result in zip(scenes, mca.run_batch(scenes, duration=2e-4), strict=True):
        alone = mca.run(scene, duration=2e-4)
        assert np.array_equal(result.F_n, alone.F_n)
        assert result.summary["energy"]["damping"] == alone.summary["energy"]["damping"] > 0.0


def test_steps_of_several_rates_are_refused_by_name():
    with pytest.raises(mca.RequestError, match=r"^multi_rate = 2: contact laws with a dashpot take steps of one rate"):
        mca.run(block(1e-5), multi_rate=2)


def test_the_stable_step_counts_the_dashpot():
    """w^2 h^2 + 2 a h = 4 with the step h without a dashpot and the rate a = tau k / m of a corner's node."""
    hard = replace(block(1e-12).contacts[0], penalty=1.0)
    model, damped = (
        prepared(replace(block(tau), contacts=(replace(hard, law=Damped(tau=tau)),))).model for tau in (1e-12, 1e-6)
    )
    (item,) = damped.passes
    a, h, w = 1e-6 * (item.stiffness / damped.mass[item.slave]).max(), damped.stable.dt, 2.0 / model.stable.dt
    assert (w * h) ** 2 + 2.0 * a * h == pytest.approx(4.0, rel=1e-5)
    assert h < 0.6 * model.stable.dt
    scene = replace(block(1e-6), contacts=(replace(hard, law=Damped(tau=1e-6)),))
    result = mca.run(scene, duration=2e-5)
    assert result.summary["energy_error"] < 1e-3 and result.F_n.max() < 1e5


def test_a_law_that_hides_its_dashpot_is_refused(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Damped, "damping", lambda self, depth: 0.0)
    with pytest.raises(mca.RequestError, match=r"^ContactLaw\.damping\(\) = 0.0: give the greatest slope of the dash"):
        mca.run(block(1e-5))
