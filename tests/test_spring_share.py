"""Tests of what contact springs give away: the share that is reported, and `penalty="auto"`, which bounds it."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from impacts import prepared

import warp_mca as mca
from warp_mca.physics.contact.auto_penalty import SHARE
from warp_mca.scene import catalogue
from warp_mca.watch.spring_loss import PEAK_LOSS

STEEL = mca.Elastic(E=200e9, nu=0.0, rho=7800.0)


@cache
def ball(penalty: float | str, target: str = "plane") -> mca.Result:
    """A ball that strikes, until after its greatest force."""
    made = mca.make_scene("hertz_sphere", section=6, pole_size=1.5e-4, pole_layers=5, penalty=penalty, target=target)
    return mca.run(made, duration=0.45 * made.impact.duration)


@pytest.mark.parametrize("target", ["plane", "block"])
@pytest.mark.parametrize("penalty", [0.2, 1.0])
def test_loss_of_the_peak_follows_the_share(target: str, penalty: float):
    """It is within a factor of 2 of the estimate, against springs that are an order stiffer."""
    (loss,) = ball(penalty, target).summary["contact_spring_loss"].values()
    (rest,) = ball(10.0, target).summary["contact_spring_loss"].values()
    measured = ball(penalty, target).F_n.max() / ball(10.0, target).F_n.max() - 1.0
    assert 0.5 < (loss - rest) / measured < 2.0


@pytest.mark.parametrize("target", ["plane", "block"])
def test_a_ball_gets_the_springs_that_hertz_asks_for(target: str):
    """Radius, mass and speed are those of the scene, and springs hold the share that was foreseen."""
    summary = ball("auto", target).summary
    (chosen,), (share,) = summary["penalty"].values(), summary["contact_spring_share"].values()
    assert chosen["why"] == "curved"
    assert chosen["radius"] == pytest.approx(0.01, rel=0.03)
    assert chosen["mass"] == pytest.approx(4.0 / 3.0 * np.pi * 0.01**3 * 7850.0, rel=0.05)
    assert chosen["speed"] == pytest.approx(1.0)
    assert chosen["share"] == pytest.approx(SHARE, rel=0.01)
    assert 0.5 * SHARE < share < 1.2 * SHARE
    assert -0.03 < ball("auto", target).F_n.max() / ball(10.0, target).F_n.max() - 1.0 < 0.005
    assert summary["contact_spring_loss"]["sphere–" + target] == -PEAK_LOSS * share


@pytest.mark.parametrize("slave", ["pad", "block"])
@pytest.mark.parametrize("cells", [2, 5])
def test_what_springs_take_of_a_block_on_a_soft_pad_is_said(cells: int, slave: str):
    """A block M on a bar m held at its end: Z v sqrt(M / m), and after Boussinesq Z v more as waves run up and down."""
    size, foam = 0.02, mca.Elastic(E=5e6, nu=0.0, rho=50.0)
    pad = mca.Box(size=(size, size, size), divisions=(2, 2, cells))
    block = mca.Box(size=(size, size, size), divisions=(1, 1, 1))
    bodies = (
        mca.Body(name="pad", geometry=pad, material=foam),
        mca.Body(
            name="block", geometry=block, material=STEEL, position=(0.0, 0.0, size + 1e-6), velocity=(0.0, 0.0, -1.0)
        ),
    )
    skins = {"pad": mca.Surface(body="pad", nodes="zmax"), "block": mca.Surface(body="block", nodes="zmin")}
    master = skins["block" if slave == "pad" else "pad"]
    scene = mca.Scene(
        name="pad",
        bodies=bodies,
        contacts=(mca.Contact(slave=skins[slave], master=master),),
        fixed=(mca.Fixed(body="pad", nodes="zmin"),),
        impact=mca.ImpactPhase(duration=2e-3, output_interval=1e-5),
    )
    result = mca.run(scene)
    (loss,) = result.summary["contact_spring_loss"].values()
    wave = np.sqrt(5e6 * 50.0) * size**2
    slow = wave * np.sqrt(7800.0 / 50.0)
    assert 0.96 * slow < result.F_n.max() / (1.0 + loss) < slow + wave
    assert any(f"some {-loss:.0%} below that of stiff springs" in warning for warning in result.warnings)


def test_springs_take_of_a_wave_what_its_force_lacks():
    """A cube of four cells strikes a wall: rho c v A within 2 %, though springs hold half of the energy."""
    scene = drop(1.0, None)
    cube = replace(scene.bodies[0], geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 4, 2)))
    summary = mca.run(replace(scene, bodies=(cube,)), duration=8e-6).summary
    wave = np.sqrt(200e9 * 7800.0) * 1e-4
    assert summary["F_n_max"] == pytest.approx(wave, rel=0.02)
    assert summary["contact_spring_share"]["cube–plane"] > 0.3
    assert summary["contact_spring_loss"]["cube–plane"] == pytest.approx(summary["F_n_max"] / wave - 1.0, abs=1e-3)


def test_nothing_is_said_of_a_round_bar_that_lands_on_its_end():
    """It presses with Z v A, whatever its springs, which ring; its skin is curved elsewhere."""
    radius, floor, steel = 0.01, mca.RigidPlane(normal=(1.0, 0.0, 0.0)), replace(STEEL, nu=0.3)
    bar = mca.Rod(radius=radius, length=0.04, tip="flat", section=4, ring=2, axial=10)
    body = mca.Body(name="bar", geometry=bar, material=steel, velocity=(-1.0, 0.0, 0.0)).place_on(floor, gap=1e-7)
    scene = mca.Scene(
        name="end",
        bodies=(body,),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="boundary"), master=floor),),
        impact=mca.ImpactPhase(duration=3e-5, output_interval=5e-7),
    )
    result = mca.run(scene)
    (loss,), (share,) = (result.summary[f"contact_spring_{what}"].values() for what in ("loss", "share"))
    wave = steel.rho * steel.wave_speeds["dilatational"] * math.pi * radius**2
    assert result.F_n[1:6].mean() == pytest.approx(wave, rel=0.2)
    assert share > 0.1
    assert loss == 0.0
    assert not any("springs held" in text for text in result.warnings)


def test_finer_meshes_take_softer_springs():
    """The layer of springs of one cell's depth is as thin as the cell: its factor falls with it."""

    def factor(size: float) -> float:
        (chosen,) = prepared(mca.make_scene("hertz_sphere", penalty="auto", pole_size=size)).model.penalties
        assert chosen is not None
        return chosen.penalty

    assert factor(1e-4) / factor(5e-5) == pytest.approx(2.0, rel=0.05)


def drop(speed: float, penalty: Any = "auto") -> mca.Scene:
    """A cube over a plane."""
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    body = mca.Body(name="cube", geometry=box, material=STEEL, velocity=(0.0, -speed, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="cube", nodes="ymin"), master=mca.RigidPlane(), penalty=penalty)
    impact = mca.ImpactPhase(duration=1e-6, output_interval=1e-7)
    return mca.Scene(name="drop", bodies=(body,), contacts=(contact,), impact=impact)


def test_flat_contacts_take_the_default():
    """The stiffness of the whole end without a penalty: a node within it has the same, those of its rim share less."""
    chosen, default = (prepared(drop(1.0, penalty)).model for penalty in ("auto", None))
    assert chosen.penalties[0] is not None and chosen.penalties[0].why == "flat"
    assert default.penalties == (None,)
    shares = np.array([1.0, 2.0, 1.0, 2.0, 4.0, 2.0, 1.0, 2.0, 1.0]) / 4.0
    np.testing.assert_allclose(default.passes[0].stiffness, chosen.passes[0].stiffness * shares, rtol=1e-12)


def test_a_ball_at_rest_takes_the_default():
    """There is no impact to tell the size of the contact."""
    made = mca.make_scene("hertz_sphere", penalty="auto")
    still = replace(made, bodies=tuple(replace(body, velocity=(0.0, 0.0, 0.0)) for body in made.bodies))
    (chosen,) = prepared(still).model.penalties
    assert chosen is not None and chosen.why == "no approach"


def test_shares_without_force():
    """None where nothing was touched, and no word of a choice where the scene gives the penalty."""
    summary = mca.run(drop(-1.0, 1.0)).summary
    assert summary["contact_spring_share"] == summary["contact_spring_loss"] == {"cube–plane": None}
    assert "penalty" not in summary


def test_words():
    """auto is the only one, in scenes and on the command line."""
    with pytest.raises(mca.RequestError, match=r"Contact\.penalty = 'stiff': give a finite number above 0, auto"):
        drop(1.0, "stiff")
    source = catalogue.load_source("two_link")
    assert source.resolve(None, {"penalty": "auto"})["penalty"] == "auto"
    assert source.parameters["penalty"].param.range == "above 0 or auto"
    with pytest.raises(mca.RequestError, match=r"penalty = 'stiff': give a finite number, above 0 or auto"):
        source.resolve(None, {"penalty": "stiff"})


@pytest.mark.parametrize("bond", [None, mca.Bond()])
def test_what_springs_take_of_a_slow_drive_is_said(bond: mca.Bond | None):
    """Halves of a bar that a drive presses on each other, or pulls where they are glued: in series with springs."""
    size, strain = 0.02, -1e-3 if bond is None else 1e-3
    steel = mca.Elastic(E=210e9, nu=0.0, rho=7850.0)
    half = mca.Box(size=(0.5 * size, size, size), divisions=(2, 2, 2))
    one = mca.Body(name="one", geometry=half, material=steel)
    two = replace(one, name="two", position=(0.5 * size, 0.0, 0.0))
    slave, master = mca.Surface(body="one", nodes="xmax"), mca.Surface(body="two", nodes="xmin")
    drive = mca.Prescribed(
        body="two", nodes="xmax", axis="x", times=(0.0, 2e-4, 3e-4), displacements=(0.0, strain * size, strain * size)
    )
    scene = mca.Scene(
        name="pressed",
        bodies=(one, two),
        contacts=(mca.Contact(slave=slave, master=master, bond=bond),),
        fixed=(mca.Fixed(body="one", nodes="xmin", axes="x"),),
        prescribed=(drive,),
        loads=tuple(mca.Damping(body=name, mass=4e4, about="ground") for name in ("one", "two")),
        sections=(mca.Section(name="s", body="one", at=(2.6e-3, 0.01, 0.01), normal=(1.0, 0.0, 0.0)),),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=5e-6),
    )
    result = mca.run(scene, precision="float64")
    (loss,) = result.summary["contact_spring_loss"].values()
    measured = result.sections[0].force[-1][0] / (210e9 * strain * size**2) - 1.0
    assert measured < -0.15
    assert loss == pytest.approx(measured, abs=0.02)
    assert any(f"some {-loss:.0%} below that of stiff springs" in warning for warning in result.warnings)


@pytest.mark.parametrize(("layers", "least", "most"), [(1, 0.4, 0.55), (4, 0.1, 0.2), (16, 0.0, 0.03)])
def test_what_springs_take_of_a_thin_plate_that_lands_flat_is_said(layers: int, least: float, most: float):
    """It presses with rho c A v until waves are back from its upper side: soft springs take longer."""
    E, nu, rho = (getattr(mca.library.ABS, name) for name in ("E", "nu", "rho"))
    side, speed = 0.02, 4.85
    plate = mca.Box(size=(side, side, 0.002), divisions=(10, 10, layers), origin=(0.0, 0.0, 1e-6))
    body = mca.Body(name="plate", geometry=plate, material=mca.library.ABS, velocity=(0.0, 0.0, -speed))
    floor = mca.Contact(
        slave=mca.Surface(body="plate", nodes="boundary"), master=mca.RigidPlane(normal=(0.0, 0.0, 1.0))
    )
    phase = mca.ImpactPhase(duration=6e-6, output_interval=1e-7)
    result = mca.run(mca.Scene(name="landing", bodies=(body,), contacts=(floor,), impact=phase))
    wave = math.sqrt(rho * E * (1.0 - nu) / (1.0 + nu) / (1.0 - 2.0 * nu)) * side**2 * speed
    (loss,) = result.summary["contact_spring_loss"].values()
    assert -loss == pytest.approx(1.0 - result.F_n.max() / wave, abs=0.01)
    assert least <= -loss < most
    assert any("of plate–plane was greatest: its peak is some" in text for text in result.warnings) == (-loss > 0.03)


def test_what_is_said_of_soft_springs_below_a_flat_end_can_be_done():
    """Springs that stiff ask for shorter steps where cells are thin across: the balance of energy stopped such runs."""
    box = mca.Box(size=(0.02, 0.02, 0.01), divisions=(4, 4, 2))
    block = mca.Body(name="block", geometry=box, material=replace(STEEL, nu=0.3))
    soft, stiff = (mca.drop_test(block, height=1.0, pose="zmin", penalty=penalty) for penalty in (None, 2.0))
    (text,) = (text for text in mca.run(soft).warnings if "springs held" in text)
    assert "give the contact penalty=2 and a time_step_scale at which its energy balance holds" in text
    with pytest.raises(mca.GuardError, match="lower time_step_scale"):
        mca.run(stiff)
    result = mca.run(replace(stiff, impact=replace(stiff.impact, time_step_scale=0.6)))
    assert result.summary["energy_error"] < stiff.impact.energy_tolerance
    assert not any("springs held" in text for text in result.warnings)
