"""What a run says of bodies that no contact keeps apart, and of velocities that joints and fixed nodes contradict."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import begun

import warp_mca as mca
from warp_mca.watch.passing import DEPTH

SOFT = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
FLOOR = mca.RigidPlane()


def said(result: mca.Result, word: str) -> list[str]:
    return [text for text in result.warnings if word in text]


def ball(nodes: str, **impact: float) -> mca.Scene:
    """A ball falls on a floor; its pole points along x, away from it."""
    body = mca.Body(name="ball", geometry=mca.Sphere(radius=0.01), material=SOFT, velocity=(0.0, -5.0, 0.0))
    return mca.Scene(
        name="ball",
        bodies=(body.place_on(FLOOR, 1e-4),),
        contacts=(mca.Contact(slave=mca.Surface(body="ball", nodes=nodes), master=FLOOR),),
        impact=mca.ImpactPhase(**{"duration": 1e-3, "output_interval": 5e-6} | impact),
    )


def test_nodes_that_a_contact_leaves_out_do_not_go_through_a_plane_unseen():
    (warning,) = said(mca.run(ball("pole")), "went below the rigid plane")
    assert warning.startswith(
        "nodes of ball that are not in its contact's surface went below the rigid plane from t = "
    )
    assert not said(mca.run(ball("boundary")), "went below")


def boxes(element: str = "hex8", gap: float = 1e-3, speed: float = 20.0, **more: Any) -> mca.Scene:
    """A small box flies at a large one, which nothing keeps it out of."""
    large = mca.Box(size=(0.02, 0.02, 0.02), divisions=(4, 4, 4))
    small = mca.Box(size=(0.004, 0.004, 0.004), divisions=(2, 2, 2), origin=(0.008, 0.02 + gap, 0.008))
    bodies = (
        mca.Body(name="large", geometry=large, material=SOFT, element=element),
        mca.Body(name="small", geometry=small, material=SOFT, velocity=(0.0, -speed, 0.0)),
    )
    return mca.Scene(name="boxes", bodies=bodies, impact=mca.ImpactPhase(duration=6e-4, output_interval=6e-6), **more)


def test_bodies_without_a_contact_do_not_go_through_each_other_unseen():
    (warning,) = said(mca.run(boxes()), "went into each other")
    assert warning.startswith("large and small went into each other from t = 7.2e-05 s on, up to 0.004 m deep at (")
    assert warning.endswith("take contacts='all', or all of the surface, such as nodes='boundary', in a Contact")
    sides = [mca.Surface(body=name, nodes="boundary") for name in ("small", "large")]
    scene = boxes(contacts=(mca.Contact(slave=sides[0], master=sides[1]),))
    careful = replace(scene, impact=replace(scene.impact, time_step_scale=0.5))
    assert not said(mca.run(careful), "went into each other")


def test_one_that_has_left_again_was_seen():
    """It passes 20 mm in 0.6 ms, and is beyond at the end."""
    fast = replace(boxes(speed=60.0), impact=mca.ImpactPhase(duration=6e-4, output_interval=6e-6))
    (warning,) = said(mca.run(fast), "went into each other")
    assert "0.00" in warning


def test_bodies_that_overlap_from_the_start_are_meant():
    assert not said(mca.run(boxes(gap=-0.01)), "went into each other")


def test_what_was_seen_is_stored_with_the_state(tmp_path: Path):
    whole, stored = begun(boxes(speed=60.0)), begun(boxes(speed=60.0))
    stored.advance(until=2 * stored.steps.count // 3)
    stored.save(tmp_path / "state")
    other = begun(boxes(speed=60.0))
    other.load(tmp_path / "state")
    for impact in (whole, other):
        impact.advance()
    assert whole.state.scenes[0].passed[0, DEPTH] > 0.003
    assert other.state.differences(whole.state) == []


@pytest.mark.parametrize("rigid", [True, False])
def test_velocities_that_a_joint_does_not_allow_are_told(rigid: bool):
    """Two equal bars, of which one flies, lose half of the energy; elastic ones that of the welded face alone."""
    bar = mca.Box(size=(0.1, 0.02, 0.02), divisions=(10, 4, 4), origin=(0.0, -0.01, -0.01))

    def scene(speed: float) -> mca.Scene:
        bodies = (
            mca.Body(name="a", geometry=bar, material=SOFT, velocity=(1.0, 0.0, 0.0), rigid=rigid),
            mca.Body(
                name="b", geometry=bar, material=SOFT, position=(0.1, 0.0, 0.0), velocity=(speed, 0.0, 0.0), rigid=rigid
            ),
        )
        weld = mca.Weld(name="W", body="a", nodes="xmax", other="b", other_nodes="xmin")
        return mca.Scene(name="weld", bodies=bodies, joints=(weld,), impact=mca.ImpactPhase(duration=2e-5))

    (warning,) = said(mca.run(scene(0.0)), "contradict")
    lost = "0.01" if rigid else "0.0005"
    assert warning.startswith(f"{lost} J of the 0.02 J of kinetic energy that bodies were given are lost at the start")
    assert "joint W" in warning
    assert not said(mca.run(scene(1.0)), "contradict")
    assert not said(mca.run(scene(1.0)), "each other")  # what is joined may lie in each other there


@pytest.mark.parametrize("rigid", [True, False])
def test_a_body_at_rest_has_no_velocities_that_a_joint_contradicts(rigid: bool):
    """Let go under gravity, its first energy is that of half a step before and after, which is below 0."""
    bar = mca.Box(size=(0.1, 0.1, 0.1), divisions=(1, 1, 1))
    scene = mca.Scene(
        name="drop",
        bodies=(mca.Body(name="a", geometry=bar, material=SOFT, rotation=(0.0, 0.0, -1.0), rigid=rigid),),
        joints=(mca.Revolute(name="O", body="a", at=(0.0, 0.0, 0.0)),),
        gravity=(0.0, -9.8, 0.0),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4),
    )
    result = mca.run(scene)
    assert result["E_kinetic"][0] < 1e-3 * result["E_kinetic"][-1]
    assert not said(result, "contradict")


@pytest.mark.parametrize(("velocity", "spin", "warns"), [((3.0, 2.0, 1.0), 0.0, 0), ((0.0, 0.0, 0.0), 200.0, 1)])
def test_fixed_nodes_that_move_apart_are_told(velocity: tuple, spin: float, warns: int):
    bar = mca.Box(size=(0.1, 0.02, 0.02), divisions=(10, 2, 2), origin=(0.0, -0.01, -0.01))
    body = mca.Body(name="a", geometry=bar, material=SOFT, velocity=velocity, angular_velocity=(0.0, 0.0, spin))
    scene = mca.Scene(
        name="hub",
        bodies=(body,),
        fixed=(mca.Fixed(body="a", nodes="xmin"),),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-4),
    )
    found = said(mca.run(scene), "fixed nodes xmin of a keep velocities that differ")
    assert len(found) == warns
    if warns:  # the far ends of a line that turns by 0.2 move apart by 1 / 50
        share = float(found[0].partition("change by ")[2].split()[0])
        assert share == pytest.approx((np.hypot(1.0, 0.2) - 1.0) / np.sqrt(2.0), rel=0.05)
