"""Tests of self-contact: bodies that fold, crush and mushroom keep out of themselves."""

import numpy as np
import pytest
from impacts import finished, result_of

import warp_mca as mca
from benchmarks.self_contact import ALLOY, FOLDED, folded, hairpin, mushroom, press, tube

BALANCE = 0.005  # of the energy at most


def through(result: mca.Result) -> bool:
    return any("went through each other" in warning for warning in result.warnings)


def test_a_strip_folds_on_itself() -> None:
    assert through(mca.run(hairpin(())))  # and its remedy is general contact
    result = mca.run(hairpin("all"))
    assert result.contacts[0].pressure.max() > 0.0 and not through(result)
    assert result.summary["energy_error"] < BALANCE


def test_eight_folds_are_pressed_on_each_other() -> None:
    impact = finished(tube())
    item, spring = impact.solver.model.passes[0], impact.state.contacts[0].spring
    touched = np.repeat(item.slave, item.sides)[spring.depth.numpy() > 0.0]
    height = impact.solver.model.X[touched, 1] / 1.8e-3
    assert set(np.floor(height + 0.5)) == set(range(9))  # each of the arms
    result = result_of(impact)
    assert not through(result)
    assert result.summary["energy_error"] < BALANCE


def test_a_mushrooming_bar_does_not_touch_itself() -> None:
    """Crushed cells at the rim of Taylor's bar are no contact: it moves as it does without."""
    alone, kept = (mca.run(mushroom(contacts)) for contacts in ((), (FOLDED,)))
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
