"""Tests of self-contact: bodies that fold, crush and mushroom keep out of themselves."""

from dataclasses import replace

import numpy as np
import pytest
from folds import ALLOY, folded, press
from impacts import finished, result_of

import warp_mca as mca
from warp_mca.scenes import taylor_bar

FOLDED = mca.ContactAll(mu=0.1)
BALANCE = 0.005  # of the energy at most


def through(result: mca.Result) -> bool:
    return any("went through each other" in warning for warning in result.warnings)


def test_a_strip_folds_on_itself() -> None:
    """A hairpin whose upper arm falls on the lower one, at some 40 m/s."""
    mesh = folded(arms=2, arm=0.02, bend=0.0025, cell=1e-3)
    body = mca.Body(name="strip", geometry=mesh, material=ALLOY, kinematics="finite")
    scene = mca.Scene(
        name="hairpin",
        bodies=(body,),
        gravity=(0.0, -3e5, 0.0),
        fixed=(
            mca.Fixed(body="strip", nodes="low", axes="xy"),
            mca.Fixed(body="strip", nodes="zmin", axes="z"),
            mca.Fixed(body="strip", nodes="zmax", axes="z"),
        ),
        impact=mca.ImpactPhase(duration=4e-4, output_interval=4e-6),
    )
    assert through(mca.run(scene))  # and its remedy is general contact
    result = mca.run(replace(scene, contacts="all"))
    assert result.contacts[0].pressure.max() > 0.0 and not through(result)
    assert result.summary["energy_error"] < BALANCE


def test_eight_folds_are_pressed_on_each_other() -> None:
    mesh = folded(arms=9, arm=0.003, bend=0.9e-3, cell=0.6e-3, around=3, radius=0.006)
    scene = press(mesh, (FOLDED,), 2.45e-4, 30.0, ("z", "x"))
    impact = finished(scene)
    item, spring = impact.solver.model.passes[0], impact.state.contacts[0].spring
    touched = np.repeat(item.slave, item.sides)[spring.depth.numpy() > 0.0]
    height = impact.solver.model.X[touched, 1] / 1.8e-3
    assert set(np.floor(height + 0.5)) == set(range(9))  # each of the arms
    result = result_of(impact)
    assert not through(result)
    assert result.summary["energy_error"] < BALANCE


def test_a_mushrooming_bar_does_not_touch_itself() -> None:
    """Crushed cells at the rim of Taylor's bar are no contact: it moves as it does without."""
    scene = taylor_bar.build(section=2, ring=1, axial=18, duration=4e-5)
    scene = replace(scene, impact=replace(scene.impact, output_interval=2e-8))  # less than any stable step
    alone, kept = mca.run(scene), mca.run(replace(scene, contacts=(*scene.contacts, FOLDED)))
    assert not kept.contacts[1].touched
    assert kept.history["E_plastic"] == pytest.approx(alone.history["E_plastic"], rel=1e-9)
    assert kept.summary["energy_error"] < BALANCE


def test_a_thin_wall_is_not_pressed_by_its_other_side() -> None:
    """A plate of cells five times as wide as thick rings in bending."""
    plate = mca.Box(size=(0.02, 0.0004, 0.02), divisions=(10, 1, 10))
    body = mca.Body(name="plate", geometry=plate, material=ALLOY, velocity=(0.0, 10.0, 0.0))
    scene = mca.Scene(
        name="plate",
        bodies=(body,),
        contacts="all",
        prescribed=(mca.Prescribed(body="plate", nodes="xmin", axis="y", times=(0.0, 1e-4), velocities=(10.0, 0.0)),),
        impact=mca.ImpactPhase(duration=4e-4, output_interval=4e-6, energy_tolerance=0.05),
    )
    result = mca.run(scene)
    assert not result.contacts[0].touched
    assert result.history["E_internal"].max() > 0.1 * result.history["E_kinetic"].max()


@pytest.mark.gpu
def test_folds_on_a_device_are_those_of_the_cpu() -> None:
    scene = press(folded(arms=3, arm=0.003, bend=0.9e-3, cell=0.6e-3), (FOLDED,), 1e-4, 20.0, ("z", "z"))
    cpu, cuda = (mca.run(scene, device=device) for device in ("cpu", "cuda:0"))
    assert cpu.contacts[0].touched
    assert cuda["E_plastic"] == pytest.approx(cpu["E_plastic"], abs=1e-3 * cpu["E_plastic"].max())
