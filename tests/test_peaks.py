"""Greatest stress and plastic strain of each body in the summary, with place and time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.watch.peaks import greatest_peaks

E, YIELD, SLOPE, RHO, LENGTH, SPEED, DURATION = 200e9, 300e6, 2e9, 78.0, 0.1, 2.0, 4e-4
METAL = mca.J2Bilinear(E=E, nu=0.0, rho=RHO, sigma_y=YIELD, E_t=SLOPE)
SOFT = mca.Elastic(E=0.5 * E, nu=0.0, rho=RHO)


def pulled(element: str = "hex8i", kinematics: str = "corotational", speed: float = SPEED, soft: int = 0) -> mca.Scene:
    """A light bar of metal, so that waves count little, which is pulled along; `soft` of its cells are softer."""
    bar = mca.Box(size=(LENGTH, 0.01, 0.01), divisions=(4, 2, 1)).build()
    lower = np.flatnonzero(bar.points[bar.hexahedra].mean(axis=1)[:, 1] < 0.005)
    body = mca.Body(
        name="bar",
        geometry=replace(bar, cell_sets={**bar.cell_sets, "soft": lower[:soft].astype(np.int32)}),
        material={"soft": SOFT, "*": METAL} if soft else METAL,
        element=element,
        kinematics=kinematics,
        position=(1.0, 2.0, 3.0),
        rotation=(0.0, 0.0, 0.5 * np.pi),
    )
    drives = (("xmin", 0.0), ("xmax", speed))
    return mca.Scene(
        name="pulled",
        bodies=(body,),
        prescribed=tuple(
            mca.Prescribed(body="bar", nodes=nodes, axis="y", times=(0.0,), velocities=(value,))
            for nodes, value in drives
        ),
        impact=mca.ImpactPhase(duration=DURATION, output_interval=0.1 * DURATION),
    )


def peaks(scene: mca.Scene, **settings) -> dict:
    found = mca.run(scene, device="cpu", **settings)
    return {"result": found, **found.summary["bodies"]["bar"]}


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("element", ["hex8i", "hex8r", "tet4", "tet10"])
def test_stress_and_plastic_strain_are_those_of_a_bar_in_tension(element, kinematics):
    """Strain is what is elastic and what has flowed; the force falls with the section where strains are finite."""
    found = peaks(pulled(element, kinematics))
    stress, flow, H = found["max_von_mises"], found["max_plastic_strain"], E * SLOPE / (E - SLOPE)
    p = (SPEED * DURATION / LENGTH - YIELD / E) / (1.0 + H / E)
    assert stress["value"] == pytest.approx(YIELD + H * p, rel=0.03)
    assert flow["value"] == pytest.approx(p, rel=0.05)
    assert flow["value"] == pytest.approx(found["result"].summary["max_plastic_strain"], rel=1e-6)
    assert flow["time"] == pytest.approx(DURATION)


def test_the_place_is_that_of_the_harder_cells_in_the_frame_of_the_body():
    """Elastic without Poisson's ratio, cells side by side have one strain, and stress as their moduli."""
    found = peaks(pulled(speed=0.05 * SPEED, soft=4), precision="float64")
    assert found["max_plastic_strain"] == {"value": 0.0, "at": None, "time": None}
    assert found["max_von_mises"]["value"] == pytest.approx(0.05 * SPEED * DURATION / LENGTH * E, rel=0.04)
    assert found["max_von_mises"]["at"][1:] == pytest.approx([0.0075, 0.005])


def test_a_batch_gives_each_scene_its_own():
    """Scenes lie one after the other in each block."""
    slow, fast = pulled(speed=1.0), pulled()
    alone = [mca.run(scene, device="cpu").summary["bodies"] for scene in (slow, fast)]
    assert alone[0] != alone[1]
    assert [result.summary["bodies"] for result in mca.run_batch([slow, fast], device="cpu")] == alone


def test_of_several_impacts_the_greatest_counts_with_its_time():
    """Times of later impacts count from the first one; a body without stress has neither place nor time."""
    none = {"value": 0.0, "at": None, "time": None}
    first = {"a": {"mass": 1.0, "max_von_mises": {"value": 2.0, "at": [0.0], "time": 0.1}, "max_plastic_strain": none}}
    later = {"a": {"mass": 1.0, "max_von_mises": {"value": 3.0, "at": [1.0], "time": 0.2}, "max_plastic_strain": none}}
    found = greatest_peaks([first, later], [0.0, 1.0])["a"]
    assert found["max_von_mises"] == {"value": 3.0, "at": [1.0], "time": pytest.approx(1.2)}
    assert found["max_plastic_strain"] == none and found["mass"] == 1.0
