"""A contact law of the user's own: functions (`stiffening.py`), a dataclass and one registration."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from test_contact_stiffness import PLATE, block_on_plate

import warp_mca as mca
from warp_mca.kernels.contact import penalty
from warp_mca.model.build import build_model
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handoff import hand_off
from warp_mca.scene import model_file
from warp_mca.scene.contact_laws import CONTACT_LAWS, ContactLaw


@dataclass(frozen=True, kw_only=True)
class Stiffening(ContactLaw):
    """F = k g_0 (g / g_0)^(3/2), with the depth g_0 [m] at which it is that of the linear spring."""

    g_0: float
    law = "stiffening"

    @property
    def parameters(self) -> tuple[float, ...]:
        """g_0 [m]."""
        return (self.g_0,)

    def stiffening(self, depth: float) -> float:
        """Its slope at that depth."""
        return 1.5 * math.sqrt(depth / self.g_0)


@dataclass(frozen=True, kw_only=True)
class Again(ContactLaw):
    """The linear spring, as a law that the kernels do not know to be linear."""

    law = "again"

    def stiffening(self, depth: float) -> float:
        """As of `Penalty`."""
        return 1.0


@pytest.fixture
def registered(register: Callable[..., object], monkeypatch: pytest.MonkeyPatch) -> None:
    """The one registration of each."""
    register(Stiffening)
    register(Again)
    monkeypatch.setitem(sys.modules, "again", SimpleNamespace(force=penalty.force, energy=penalty.energy))


SIDE, SPEED, RHO = 0.01, 1.0, 2000.0


def block(law: ContactLaw, **contact) -> mca.Scene:
    """A stiff cube on soft springs of 1 / 10,000 of its stiffness, which flies against a wall."""
    cube = mca.Box(size=(SIDE, SIDE, SIDE), divisions=(2, 2, 2))
    material = mca.Elastic(E=70e9, nu=0.0, rho=RHO)
    wall = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.0, 1.0, 0.0))
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="cube", geometry=cube, material=material, velocity=(0.0, -SPEED, 0.0)),),
        contacts=(
            mca.Contact(slave=mca.Surface(body="cube", nodes="ymin"), master=wall, law=law, penalty=1e-4, **contact),
        ),
        impact=mca.ImpactPhase(duration=4e-4, output_interval=1e-6),
    )


def stiffness(scene: mca.Scene) -> float:
    """Sum of the stiffness k of all springs [N/m]."""
    meshes = mca.mesh(scene)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    (item,) = build_model(scene, meshes, start.positions, start.velocities).passes
    return float(item.stiffness.sum())


def test_a_block_rebounds_as_the_law_has_it(registered: None):
    """m v^2 / 2 = 2 / 5 k g_0^2 (g / g_0)^(5/2) at the greatest depth; what was stored all comes back."""
    scene = block(Stiffening(g_0=2e-5))
    result = mca.run(scene, precision="float64")
    mass, k = RHO * SIDE**3, stiffness(scene)
    fall = 0.5 * mass * SPEED**2
    deepest = 2e-5 * (2.5 * fall / (k * 2e-5**2)) ** 0.4
    assert deepest > 4e-5
    assert result.summary["max_penetration"] == pytest.approx(deepest, rel=2e-3)
    assert result.summary["F_n_max"] == pytest.approx(2.5 * fall / deepest, rel=2e-3)
    duration = 2.0 * deepest / SPEED * quad(lambda x: 1.0 / math.sqrt(1.0 - x**2.5), 0.0, 1.0)[0]
    assert result.summary["contact_duration"] == pytest.approx(duration, rel=0.01)
    closing = result["closing_speed"][np.isfinite(result["closing_speed"])]
    assert closing[2] == pytest.approx(SPEED, rel=0.01) and closing[-3] == pytest.approx(-SPEED, rel=0.01)
    assert result["E_contact"].max() == pytest.approx(fall, rel=2e-3)
    assert result["E_contact"][-1] == 0.0
    assert result.F_n.sum() * 1e-6 == pytest.approx(2.0 * mass * SPEED, rel=2e-3)
    assert result["E_kinetic"][-1] + result["E_internal"][-1] == pytest.approx(fall, rel=1e-5)
    assert result.summary["energy_error"] < 1e-4


def test_a_law_that_stiffens_shortens_the_step(registered: None):
    """At the depth that stops the run, a quarter of the cube's side, by as much as the slope is there."""
    linear = mca.run(replace_contact(block(mca.Penalty()), penalty=5.0), duration=1e-6)
    steeper = mca.run(replace_contact(block(Stiffening(g_0=2.5e-3 / 16)), penalty=5.0 / 6.0), duration=1e-6)
    assert steeper.summary["dt"] == pytest.approx(linear.summary["dt"], rel=1e-12)


def replace_contact(scene: mca.Scene, **change) -> mca.Scene:
    return replace(scene, contacts=(replace(scene.contacts[0], **change),))


@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_linear_law_gives_the_forces_of_the_penalty(registered: None, mu: float):
    """The block slides from steel on to plastic: springs soften while they are pressed, and lose as much."""
    plastic = mca.Elastic(E=2e9, nu=0.3, rho=1000.0)
    scene = block_on_plate(PLATE, plastic, speed=200.0, start=0.012, mu=mu, penalty=1.0)
    known = mca.run(scene, precision="float64")
    own = mca.run(replace_contact(scene, law=Again()), precision="float64")
    assert own.F_n == pytest.approx(known.F_n, rel=1e-9, abs=1e-9 * known.F_n.max())
    assert own["E_contact"] == pytest.approx(known["E_contact"], rel=1e-9, abs=1e-9 * known["E_contact"].max())
    closing = known["closing_speed"]
    assert own["closing_speed"] == pytest.approx(closing, rel=1e-6, abs=1e-6 * np.nanmax(np.abs(closing)), nan_ok=True)
    assert own.summary["energy"]["contact_loss"] == pytest.approx(known.summary["energy"]["contact_loss"], rel=1e-3)


def test_the_ledger_closes_with_friction_on_faces_that_soften(registered: None):
    plastic = mca.Elastic(E=2e9, nu=0.3, rho=1000.0)
    scene = block_on_plate(PLATE, plastic, speed=200.0, start=0.012, mu=0.3, law=Stiffening(g_0=1e-6))
    energy = mca.run(scene, precision="float64").summary["energy"]
    assert energy["friction"] > 0.05 * 0.5 * 7850.0 * 1e-6
    assert energy["contact_loss"] > 20.0 * abs(energy["error"])


def test_scenes_of_a_batch_have_parameters_of_their_own(registered: None):
    scenes = [block(Stiffening(g_0=g_0)) for g_0 in (1e-5, 4e-5)]
    for scene, result in zip(scenes, mca.run_batch(scenes, duration=2e-5), strict=True):
        assert np.array_equal(result.F_n, mca.run(scene, duration=2e-5).F_n)
    with pytest.raises(mca.RequestError, match=r"scenes\[1\].contacts\[0\].law = 'Penalty': that of scenes\[0\] is"):
        mca.run_batch([scenes[0], block(mca.Penalty())])


def test_a_model_file_holds_the_law(registered: None, tmp_path):
    for law in (mca.Penalty(), Stiffening(g_0=1e-5)):
        scene = block(law)
        model_file.save(tmp_path / "block.mca", scene, mca.mesh(scene))
        assert model_file.load(tmp_path / "block.mca").scene.contacts == scene.contacts
    del CONTACT_LAWS["Stiffening"]
    with pytest.raises(mca.RequestError, match="scene = 'Stiffening': a model file holds warp_mca's own classes"):
        model_file.save(tmp_path / "own.mca", scene, mca.mesh(scene))


def test_what_is_not_registered_is_refused():
    with pytest.raises(
        mca.RequestError,
        match=r"^Contact.law = 'Stiffening': give a Penalty.*; register other classes by warp_mca.register",
    ):
        block(Stiffening(g_0=1e-5))


def test_a_law_that_is_none_is_refused(registered: None, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(Stiffening, "law", "math")
    with pytest.raises(mca.RequestError, match=r"^law of a contact = 'math': name a module that has force and energy:"):
        mca.run(block(Stiffening(g_0=1e-5)))
