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
