"""Bodies that lie on each other under their weight: the dashpot that contacts have there by default."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from impacts import begun

import warp_mca as mca

SLOPE, G = 0.3, 100.0  # angle [rad], gravity [m/s^2]
DOWN = np.array([math.cos(SLOPE), -math.sin(SLOPE), 0.0])
SOFT = mca.Elastic(E=1e8, nu=0.3, rho=1000.0)


def on_slope(load: float, *, duration: float = 8e-3, cells: int = 2, **more) -> mca.Scene:
    """A block is laid on a slope, which takes the share `load` of what friction can hold."""
    plane = mca.RigidPlane(normal=(math.sin(SLOPE), math.cos(SLOPE), 0.0))
    box = mca.Box(size=(0.02, 0.01, 0.02), divisions=(2 * cells, cells, 2 * cells))
    block = mca.Body(name="block", geometry=box, material=SOFT, rotation=(0.0, 0.0, -SLOPE)).place_on(plane)
    skin = mca.Surface(body="block", nodes="ymin")
    return mca.Scene(
        name="slope",
        bodies=(block,),
        gravity=(0.0, -G, 0.0),
        contacts=(mca.Contact(slave=skin, master=plane, mu=math.tan(SLOPE) / load),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 80),
        probes=(mca.Probe(name="skin", body="block", nodes="boundary"),),
        **more,
    )


def creep(result: mca.Result) -> float:
    """Mean speed down the slope in the last quarter [m/s]."""
    way, first = result.probes[0].position @ DOWN, 3 * len(result.time) // 4
    return float((way[-1] - way[first]) / (result.time[-1] - result.time[first]))


@pytest.mark.parametrize(
    ("load", "more"),
    [
        (0.62, {}),
        (0.95, {"duration": 0.014}),
        (0.95, {"cells": 4, "phases": (mca.Settle(),)}),
    ],
    ids=["at once", "at once, near the limit", "settled"],
)
def test_a_block_on_a_slope_stays(load: float, more: dict):
    """It crept at 0.7 mm/s: its weight, laid on at once, made it bounce on the springs for ever."""
    result = mca.run(on_slope(load, **more))
    assert abs(creep(result)) < 1e-6
    assert result.F_n[-20:] == pytest.approx(4e-3 * G * math.cos(SLOPE), rel=1e-4)


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_it_settles_on_a_slope_with_the_energy_that_it_has(precision: str):
    """Changes of velocity hid the way of a step from the springs of friction: it was stopped at 3.4 % of the energy."""
    still = on_slope(0.845, cells=1, phases=(mca.Settle(),), duration=2e-3)
    flat, tilt = replace(still.bodies[0], rotation=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0)), 0.4
    contact = replace(still.contacts[0], master=mca.RigidPlane(), mu=0.5)
    pull = (-9.81 * math.sin(tilt), -9.81 * math.cos(tilt), 0.0)
    result = mca.run(replace(still, bodies=(flat,), contacts=(contact,), gravity=pull), precision=precision)
    assert result.summary["energy_error"] < 0.01


def test_beyond_friction_it_slides():
    result = mca.run(on_slope(1.25))
    speed = np.gradient(result.probes[0].position @ DOWN, result.time)[-10:].mean()
    held = 0.8 * result.time[-6]
    assert speed == pytest.approx(G * math.sin(SLOPE) * (result.time[-6] - held), rel=0.02)


def law(scene: mca.Scene) -> str:
    return begun(scene).solver.model.passes[0].law


def test_only_bodies_at_rest_under_their_weight_have_the_dashpot():
    still = on_slope(0.5)
    body, contact = still.bodies[0], still.contacts[0]
    damped, plain = mca.DampedPenalty.law, mca.Penalty.law
    assert law(still) == damped
    assert law(replace(still, gravity=(0.0, 0.0, 0.0))) == plain
    assert law(replace(still, contacts=(replace(contact, law=mca.Penalty()),))) == plain
    assert law(replace(still, bodies=(replace(body, velocity=(0.0, -0.1, 0.0)),))) == plain
    assert law(replace(still, bodies=(replace(body, position=(0.0, 1e-3, 0.0)),))) == plain  # falls
    along = tuple((0.1 * DOWN).tolist())
    assert law(replace(still, bodies=(replace(body, velocity=along),))) == damped  # slides, and does not approach


def test_a_batch_has_the_bits_of_each_scene():
    still = on_slope(0.5, duration=4e-4)
    thrown = replace(still, bodies=(replace(still.bodies[0], velocity=(0.0, -0.1, 0.0)),))
    step = replace(still.impact, time_step_scale=0.5)
    scenes = [replace(still, impact=step), replace(thrown, impact=step)]
    alone = [mca.run(scene, threads=1) for scene in scenes]
    for one, other in zip(mca.run_batch(scenes, threads=1), alone, strict=True):
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in other.history)


def test_an_impact_on_a_body_at_rest_keeps_its_energy():
    """The dashpot takes part in it up to speeds only that weight gives."""
    still = on_slope(0.5, duration=6e-4)
    low = still.bodies[0]
    other = mca.Body(
        name="other", geometry=low.geometry, material=SOFT, velocity=(0.0, -2.0, 0.0), position=(0.0, 0.0101, 0.0)
    )
    hit = mca.Contact(slave=mca.Surface(body="other", nodes="ymin"), master=mca.Surface(body="block", nodes="ymax"))
    flat = replace(still.contacts[0], master=mca.RigidPlane())
    lying = replace(low, rotation=(0.0, 0.0, 0.0), position=(0.0, 0.0, 0.0))
    scene = replace(still, bodies=(lying, other), contacts=(flat, hit), gravity=(0.0, -9.81, 0.0))
    result = mca.run(scene)
    assert 0.0 < result.summary["energy"]["damping"] < 1e-3 * 0.5 * 4e-3 * 2.0**2
    assert result.summary["energy_error"] < 2e-3
