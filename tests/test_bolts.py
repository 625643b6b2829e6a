"""Bolts beside closed forms: stiffness of a beam, preload after settling and after an impact, turns, refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import begun, finished, momentum, prepared, result_of

import warp_mca as mca
from warp_mca.physics.loads.bolts import BoltNodes, truss

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
SIDE, L, D = 0.01, 0.02, 0.004
EA = 210e9 * math.pi * D**2 / 4.0
EI = EA * D**2 / 16.0
BLOCK = mca.Body(
    name="a",
    geometry=mca.Box(size=(SIDE,) * 3, divisions=(2, 2, 2), origin=(-0.5 * SIDE,) * 3),
    material=STEEL,
    rigid=True,
)
OTHER = replace(BLOCK, name="b", position=(0.0, 0.0, L))
MASS = STEEL.rho * SIDE**3
BOLT = mca.Bolt(name="bolt1", body="a", at=(0.0, 0.0, 0.0), other="b", other_at=(0.0, 0.0, 0.0), diameter=D)


def scene(bodies: tuple = (BLOCK, OTHER), bolt: mca.Bolt = BOLT, span: float = 1e-4, **change: Any) -> mca.Scene:
    impact = mca.ImpactPhase(duration=span, output_interval=span / 200.0)
    return replace(mca.Scene(name="bolt", bodies=bodies, loads=(bolt,), impact=impact), **change)


def stiffness(bolt: mca.Bolt, length: float) -> np.ndarray:
    """Of the springs of a bolt along z for the motion and the turn of its second end, shape (6, 6); the first rests."""
    own, angles = truss(bolt, length), 2.0 * np.pi * np.arange(3) / 3.0
    ring = own.radius * np.stack([np.cos(angles), np.sin(angles), np.zeros(3)], axis=1)
    K = np.zeros((6, 6))
    for i in range(3):
        for j in range(3):
            way = ring[j] + (0.0, 0.0, length) - ring[i]
            n = way / np.linalg.norm(way)
            row = np.concatenate([n, np.cross(ring[j], n)])
            K += (own.straight if i == j else own.slanted) * np.outer(row, row)
    return K


@pytest.mark.parametrize("slenderness", [0.3, 1.0, 5.0, 50.0])
def test_its_springs_are_a_timoshenko_beam(slenderness: float):
    """The stiffness matrix of a cantilever, with the shear coefficient of a circle."""
    length = slenderness * D
    G, kappa = 210e9 / 2.6, 6.0 * 1.3 / 8.8
    phi = 12.0 * EI / (kappa * G * EA / 210e9 * length**2)
    beam = EI / length**3 / (1.0 + phi)
    K = stiffness(BOLT, length)
    assert K[2, 2] == pytest.approx(EA / length, rel=1e-9)
    for x, turn, sign in ((0, 4, -1.0), (1, 3, 1.0)):
        assert K[x, x] == pytest.approx(12.0 * beam, rel=1e-9)
        assert K[x, turn] == pytest.approx(sign * 6.0 * beam * length, rel=1e-9)
        assert K[turn, turn] == pytest.approx((4.0 + phi) * beam * length**2, rel=1e-9)
    rest = K - np.where(np.abs(K) < 1e-9 * np.abs(K).max(), K, 0.0)
    assert np.count_nonzero(rest[2]) == 1
    assert truss(BOLT, length).straight >= 0.0


def test_two_rigid_blocks_swing_on_it():
    """w^2 = 2 E A / (L m); momentum stays; E_spring by closed form."""
    w, v = math.sqrt(2.0 * EA / (L * MASS)), 1.0
    moving = replace(OTHER, velocity=(0.0, 0.0, v))
    impact = finished(scene((BLOCK, moving), span=4.0 * math.pi / w), precision="float64")
    result = result_of(impact)
    force = EA / L * v / w * np.sin(w * result.time)
    assert np.abs(result["bolt_bolt1_N"] - force).max() < 2e-3 * EA / L * v / w
    assert np.abs(result["bolt_bolt1_shear_N"]).max() < 1e-6 * EA / L * v / w
    assert np.abs(result["E_spring"] - 0.5 * force**2 * L / EA).max() < 4e-3 * 0.25 * MASS
    assert momentum(impact)[2] == pytest.approx(MASS * v, rel=1e-9)
    (text,) = (text for text in result.warnings if "bolt bolt1 bore a compression of" in text)
    assert "give it its preload" in text
    told = result.summary["bolts"]["bolt1"]
    assert told["max_force"]["value"] == result["bolt_bolt1_N"].max()
    assert told["min_force"]["time"] == result.time[result["bolt_bolt1_N"].argmin()]


def test_a_turn_of_both_bodies_strains_nothing():
    """Blocks that tumble about their common centre: the bolt carries m w^2 L / 2 and no shear."""
    w = 500.0
    axis = (w, 0.0, 0.0)
    bodies = tuple(
        replace(body, angular_velocity=axis, velocity=(0.0, sign * 0.5 * w * L, 0.0))
        for body, sign in ((BLOCK, 1.0), (OTHER, -1.0))
    )
    result = result_of(finished(scene(bodies, span=4e-3), precision="float64"))
    pull = 0.5 * MASS * w**2 * L
    assert result["bolt_bolt1_N"][40:].mean() == pytest.approx(pull, rel=0.02)
    assert result["bolt_bolt1_shear_N"].max() < 0.02 * pull


PLATE = mca.Body(
    name="base",
    geometry=mca.Box(size=(0.02, 0.02, 4e-3), divisions=(6, 6, 2), origin=(-0.01, -0.01, -4e-3)),
    material=replace(STEEL, E=70e9, rho=2700.0),
)
LID = replace(PLATE, name="lid", position=(0.0, 0.0, 4e-3))
SCREW = mca.Bolt(
    name="screw",
    body="lid",
    at=(0.0, 0.0, 0.0),
    other="base",
    other_at=(0.0, 0.0, -4e-3),
    diameter=4e-3,
    preload=2000.0,
)
PRESSED = mca.Contact(
    name="seat",
    slave=mca.Surface(body="lid", nodes="zmin"),
    master=mca.Surface(body="base", nodes="zmax"),
    mu=0.2,
)


def clamped(**change: Any) -> mca.Scene:
    """Two plates that a screw holds together."""
    made = mca.Scene(
        name="clamped",
        bodies=(PLATE, LID),
        contacts=(PRESSED,),
        loads=(SCREW,),
        phases=(mca.Settle(),),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6),
    )
    return replace(made, **change)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_the_impact_begins_with_its_preload(device: str):
    """The joint presses with it; the plates' own elasticity takes nothing of it."""
    result = mca.run(clamped(), device=device)
    impact = result.time >= 0.0
    assert result["bolt_screw_N"][impact] == pytest.approx(SCREW.preload, rel=2e-3)
    assert result.contacts[0].pressure[impact] == pytest.approx(SCREW.preload, rel=0.01)
    assert result.summary["energy_error"] < 1e-2


def test_plates_that_ring_in_time_with_the_looks_rest():
    """What is left of this motion turns back every ten steps, when all stands still: it was never damped, and stopped.

    Weight and a warm plate leave the joint with the force of its screw, and nothing rings: there is no warning.
    """
    plate = mca.Box(size=(0.04, 0.04, 0.01), divisions=(8, 8, 2), origin=(-0.02, -0.02, -0.01))
    lower = mca.Body(name="base", geometry=plate, material=STEEL)
    screw = replace(SCREW, diameter=6e-3, other_at=(0.0, 0.0, -0.01), preload=5000.0)
    made = clamped(
        bodies=(lower, replace(lower, name="lid", position=(0.0, 0.0, 0.01))),
        contacts=(replace(PRESSED, slave=mca.Surface(body="lid", nodes="zmin")),),
        fixed=(mca.Fixed(body="base", nodes="zmin"),),
        loads=(screw,),
        phases=(mca.Settle(duration=1e-3),),
    )
    warm = mca.ThermalStrain(body="lid", expansion=1.2e-5, temperature=10.0)
    for scene in (made, replace(made, loads=(screw, warm), gravity=(0.0, 0.0, -9.81))):
        result = mca.run(scene, device="cpu")
        impact = result.time >= 0.0
        assert result["bolt_screw_N"][impact] == pytest.approx(5000.0, rel=1e-3)
        assert result.contacts[0].pressure[impact] == pytest.approx(5000.0, rel=5e-3)
        assert not [text for text in result.warnings if "still in progress" not in text]


def test_its_preload_is_back_after_an_impact():
    """A ball's blow opens and shears the joint; damped, the screw pulls as before within 1 %; parts that fall, too."""
    falling = tuple(replace(body, velocity=(0.0, 0.0, -2.0)) for body in (PLATE, LID))
    floor = mca.RigidPlane(point=(0.0, 0.0, -4.02e-3), normal=(0.0, 0.0, 1.0))
    hit = mca.Contact(name="floor", slave=mca.Surface(body="base", nodes="zmin"), master=floor)
    made = clamped(
        bodies=falling,
        contacts=(PRESSED, hit),
        gravity=(0.0, 0.0, -9.81),
        phases=(mca.Settle(falling=True),),
        loads=(SCREW, *(mca.Damping(body=name, mass=5e4) for name in ("base", "lid"))),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=1e-6),
        criteria=("max_force(screw) < 2100", "max_shear(screw) < 1e6", "min_force(screw) > 1000"),
        probes=(mca.Probe(name="lid", body="lid", nodes="zmax", cfc=1000.0),),
    )
    result = mca.run(made, device="cpu")
    force = result["bolt_screw_N"]
    start = int(np.argmax(result.time >= 0.0))
    assert force[start] == pytest.approx(SCREW.preload, rel=5e-3)
    assert np.abs(force[start:] / SCREW.preload - 1.0).max() > 0.03
    assert force[-30:].mean() == pytest.approx(SCREW.preload, rel=5e-3)
    assert force[-30:] == pytest.approx(SCREW.preload, rel=0.03)  # while the plates still ring
    assert result.summary["energy_error"] < 1e-2
    told = {item["criterion"]: item["value"] for item in result.summary["criteria"]}
    assert told["max_force(screw) < 2100"] == pytest.approx(force.max())
    (probe,), (alone,) = result.probes, result.impact().probes  # its 2 m/s of the fall begin with the impact
    assert probe.velocity[start, 2] == pytest.approx(-2.0, rel=1e-3) and not probe.acceleration[start].any()
    np.testing.assert_array_equal(probe.filtered()[start:], alone.filtered())


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_ends_of_many_nodes_are_added_up_in_parts(device: str, monkeypatch: pytest.MonkeyPatch):
    """The sums of parts, of which the last are shorter, give the same bolt."""
    scene = clamped()
    whole = mca.run(scene, device=device)
    monkeypatch.setattr("warp_mca.physics.loads.springs_stage.PART", 4)
    parts = mca.run(scene, device=device)
    assert begun(scene, device=device).solver.Bolt.parts
    for column in ("bolt_screw_N", "bolt_screw_shear_N"):
        assert parts[column] == pytest.approx(whole[column], rel=1e-6, abs=1e-6 * SCREW.preload)


def test_a_tightened_bolt_goes_on_from_a_saved_state(tmp_path: Path):
    """The lengths of its springs, which tightening sets, are part of the State."""
    impact = begun(clamped())
    impact.solver.Bolt.settle(True)
    impact.advance(until=impact.steps.count // 2)
    impact.solver.Bolt.settle(False)
    impact.save(tmp_path / "middle.state")
    impact.advance()
    later = begun(clamped())
    later.load(tmp_path / "middle.state")
    later.advance()
    assert later.state.differences(impact.state) == []
    assert result_of(later)["bolt_screw_N"][-1] > 0.1 * SCREW.preload


def test_a_batch_gives_each_scene_its_bolts():
    scenes = [
        scene((BLOCK, replace(OTHER, velocity=(0.0, 0.0, v))), replace(BOLT, diameter=d), span=2e-5)
        for v, d in ((1.0, D), (2.0, 2.0 * D))
    ]
    for result, one in zip(mca.run_batch(scenes), scenes, strict=True):
        alone = mca.run(one)
        for name in ("bolt_bolt1_N", "E_spring"):
            np.testing.assert_allclose(result[name], alone[name], rtol=5e-3, atol=5e-3 * np.abs(alone[name]).max())


def test_parts_that_fall_do_not_sink_while_their_bolts_are_tightened():
    """With general contact as well; ten thousand times heavier than on Earth, they would be on the floor."""
    falling = tuple(replace(body, velocity=(0.0, 0.0, -2.0)) for body in (PLATE, LID))
    floor = mca.RigidPlane(point=(0.0, 0.0, -4.02e-3), normal=(0.0, 0.0, 1.0))
    hit = mca.Contact(name="floor", slave=mca.Surface(body="base", nodes="zmin"), master=floor)
    made = clamped(
        bodies=falling,
        contacts=(mca.ContactAll(mu=0.2), hit),
        gravity=(0.0, 0.0, -9.81e4),
        phases=(mca.Settle(falling=True, tolerance=1e-3),),
        impact=mca.ImpactPhase(duration=1e-6, output_interval=1e-6),
    )
    result = mca.run(made, device="cpu")
    assert result.contacts[-1].pressure[result.time <= 0.0].max() == 0.0
    assert result["bolt_screw_N"][-1] == pytest.approx(SCREW.preload, rel=5e-3)


REFUSED = [
    ({"other_at": (0.0, 0.0, -L)}, "its ends lie in one place"),
    ({"diameter": 0.0}, "Bolt bolt1.diameter"),
    ({"other": "c"}, "the scene's bodies are a, b"),
    ({"preload": 10.0}, r"give Scene.phases=\(mca.Settle\(\),\)"),
    ({"name": "a,b"}, "columns have it"),
    ({"nu": 0.5}, "Poisson"),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_no_bolt_can_be_is_refused(number: int):
    change, words = REFUSED[number]
    with pytest.raises(mca.RequestError, match=words):
        begun(scene(bolt=replace(BOLT, **change)))


def test_an_end_without_nodes_near_is_refused():
    with pytest.raises(mca.RequestError, match=r"0 nodes of lid within reach = 0.0001 m .* give a greater reach"):
        begun(clamped(loads=(replace(SCREW, reach=1e-4, at=(1.6e-3, 0.0, 1e-3)),)))
    with pytest.raises(mca.RequestError, match=r"base moves, and must settle too .*Settle\(falling=True\)"):
        clamped(bodies=(replace(PLATE, velocity=(0.0, 0.0, 1.0)), LID))
    with pytest.raises(mca.RequestError, match="bolt"):
        clamped(loads=(SCREW, SCREW))


def test_without_a_reach_an_end_takes_the_cell_around_it_where_cells_are_coarse():
    """Cells are 3.3 mm wide and 2 mm high, the shank is 0.1 mm thick."""
    thin = replace(SCREW, diameter=1e-4, at=(1.5e-3, 1.5e-3, -0.8e-3), other_at=(1.5e-3, 1.5e-3, -3.2e-3))
    parts = prepared(clamped(loads=(thin,)))
    (bolt,) = parts.model.loads["Bolt"]
    assert isinstance(bolt, BoltNodes)
    bar, w = bolt.bars[0], 0.02 / 6.0
    held = parts.model.X[bar.node[:8]]
    assert sorted(map(tuple, held.round(9))) == [
        pytest.approx((x, y, z), abs=1e-8) for x in (0.0, w) for y in (0.0, w) for z in (2e-3, 4e-3)
    ]
    assert bar.weight[:8].sum() == pytest.approx(-1.0)
    with pytest.raises(mca.RequestError, match="0 nodes of lid within reach"):
        begun(clamped(loads=(replace(thin, at=(0.0, 0.0, 0.1)),)))


def test_an_end_between_coarse_cells_lies_in_their_middle():
    """It was held by one of the four around it: a plate that was pulled along its bolt turned."""
    plate = mca.Box(size=(0.04, 0.04, 0.004), divisions=(4, 4, 2))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    low, high = (
        mca.Body(name=name, geometry=plate, material=steel, position=(0, 0, z))
        for name, z in (("a", 0.0), ("b", 0.005))
    )
    result = mca.run(
        mca.Scene(
            name="pulled",
            bodies=(low, high),
            fixed=(mca.Fixed(body="a", nodes="zmin"),),
            loads=(
                replace(BOLT, body="b", at=(0.02, 0.02, 0.004), other="a", other_at=(0.02, 0.02, 0.0)),
                mca.Force(body="b", nodes="zmax", force=(0.0, 0.0, 2e3), spread="area"),
            ),
            probes=(mca.Probe(name="b", body="b", nodes="zmin"),),
            impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-5),
        ),
        figures="none",
    )
    moved = result.probes[0].position[-1] - result.probes[0].position[0]
    assert moved[2] > 5e-7 and np.abs(moved[:2]).max() < 1e-6 * moved[2]
    assert result["bolt_bolt1_shear_N"].max() < 1e-4 * result["bolt_bolt1_N"].max()
