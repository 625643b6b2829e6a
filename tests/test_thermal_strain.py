"""Thermal strains: free and clamped bodies, the energy ledger, what a run is stored as, and what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import finished, result_of
from outside import goes_on

import warp_mca as mca

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
SIZE, STRAIN = (0.02, 0.01, 0.01), -1.2e-3
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
SOFT = mca.J2Bilinear(E=210e9, nu=0.3, rho=7800.0, sigma_y=100e6, E_t=2e9)
ENDS = tuple(mca.Fixed(body="block", nodes=name, axes="x") for name in ("xmin", "xmax"))
COLD = mca.ThermalStrain(body="block", expansion=12e-6, temperature=-100.0, amplitude=mca.Amplitude.smooth_step(4e-5))


def cooled(element: str = "hex8i", kinematics: Any = "corotational", material: Any = STEEL, **change: Any) -> mca.Scene:
    box = mca.Box(size=SIZE, divisions=(4, 2, 2))
    body = mca.Body(name="block", geometry=box, material=material, element=element, kinematics=kinematics)
    middle = mca.Line(body="block", start=(0.0, 0.005, 0.005), end=(0.02, 0.005, 0.005))
    scene = mca.Scene(
        name="cooled",
        bodies=(body,),
        loads=(COLD,),
        paths=(mca.Path(name="middle", lines=(middle,), spacing=0.01),),
        impact=mca.ImpactPhase(duration=6e-5, output_interval=1e-6),
    )
    return replace(scene, **change)


@pytest.mark.parametrize("precision", ["float64", "mixed"])
@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(("element", "kinematics"), [("hex8i", "corotational"), ("tet4", "finite")])
def test_a_free_body_shrinks_without_stress(element: str, kinematics: str, device: str, precision: str):
    """All sides by the thermal strain; what vibrates after 40 us is a thousandth of the stress of a clamped one."""
    impact = finished(cooled(element, kinematics), device=device, precision=precision)
    width = np.ptp(impact.state.u.numpy() + impact.solver.model.X, axis=0)
    assert width == pytest.approx((1.0 + STRAIN) * np.array(SIZE), rel=3e-3 * abs(STRAIN))
    stress = result_of(impact).paths[0].stress[-1]
    assert np.abs(stress).max() < 2e-3 * STEEL.E * abs(STRAIN)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_a_clamped_bar_has_the_stress_of_its_strain(kinematics: str, device: str):
    """-E alpha dT, over the cross-section that is left; the ledger has the work that went into it."""
    impact = finished(cooled(kinematics=kinematics, fixed=ENDS), device=device)
    result = result_of(impact)
    section = (1.0 + (1.0 + STEEL.nu) * STRAIN) ** -2 if kinematics == "finite" else 1.0
    strain = -np.log1p(STRAIN) if kinematics == "finite" else -STRAIN
    assert result.paths[0].stress[-1, :, 0] == pytest.approx(STEEL.E * strain * section, rel=5e-4)
    energy = result.summary["energy"]
    assert energy["elastic"] == pytest.approx(0.5 * STEEL.E * strain**2 * np.prod(SIZE), rel=1e-3)
    assert abs(energy["error"]) < 1e-5 * energy["external_work"]


@pytest.mark.parametrize("device", DEVICES)
def test_a_clamped_metal_yields_by_its_thermal_strain(device: str):
    """sigma_y and what hardens of the strain beyond it."""
    result = result_of(finished(cooled(material=SOFT, fixed=ENDS), device=device))
    beyond = -STRAIN - SOFT.sigma_y / SOFT.E
    stress = result.paths[0].stress[-1, :, 0] - result.paths[0].stress[-1, :, 1]
    assert stress == pytest.approx(SOFT.sigma_y + SOFT.E_t * beyond, rel=2e-3)
    energy = result.summary["energy"]
    assert energy["plastic"] > 2.0 * energy["elastic"]
    assert abs(energy["error"]) < 3e-4 * energy["external_work"]


def test_a_strain_that_is_there_from_the_start_keeps_the_balance():
    """The bar springs from t = 0 on, and its thermal energy at the start is that of its thermal strain undone."""
    scene = cooled(loads=(replace(COLD, amplitude=None),))
    impact = finished(scene, precision="float64")
    result = result_of(impact)
    undone = 4.5 * STEEL.bulk_modulus * STRAIN**2 * np.prod(SIZE)
    assert result["E_internal"][0] == pytest.approx(undone, rel=1e-9)
    assert result.summary["energy_error"] < 1e-4
    assert np.abs(impact.solver.model.mass @ impact.state.v.numpy()).max() < 1e-12


def test_a_clamped_bar_settles_to_its_preload():
    """A constant strain may come before the impact; then the bar is at rest, with the stress of its strain."""
    rest = {"phases": (mca.Settle(duration=1e-3, tolerance=1e-8),), "loads": (replace(COLD, amplitude=None),)}
    result = mca.run(cooled(fixed=ENDS, **rest))
    impact = result.time > 0.0
    assert result.paths[0].stress[impact, :, 0] == pytest.approx(-STEEL.E * STRAIN, rel=2e-3)
    assert result["E_kinetic"][impact].max() < 1e-6 * result["E_internal"].max()


def test_a_heated_body_leaves_others_alone():
    """A second block beside it, of the same kind, stays as it is."""
    other = replace(cooled().bodies[0], name="other", position=(0.0, 0.1, 0.0))
    impact = finished(cooled(bodies=(other, *cooled().bodies)))
    u, first = impact.state.u.numpy(), impact.solver.model.node_start["block"]
    assert not u[:first].any()
    assert np.ptp(u[first:, 0]) == pytest.approx(-STRAIN * SIZE[0], rel=1e-3)


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    goes_on(cooled(), tmp_path)


def test_a_batch_gives_the_figures_of_the_scenes_alone():
    """One of them with two bodies, whose strains count from those of the scene before."""
    other = replace(cooled().bodies[0], name="other", position=(0.0, 0.1, 0.0))
    two = cooled(bodies=(*cooled().bodies, other), loads=(COLD, replace(COLD, body="other", temperature=50.0)))
    for result, scene in zip(mca.run_batch([two, cooled(fixed=ENDS)]), (two, cooled(fixed=ENDS)), strict=True):
        alone = mca.run(scene)
        for name in ("E_kinetic", "E_internal"):
            assert result[name] == pytest.approx(alone[name], rel=1e-9, abs=1e-15)
        works = [found.summary["energy"]["external_work"] for found in (result, alone)]
        assert works[0] == pytest.approx(works[1], rel=1e-9)


def test_viscosity_acts_beside_it():
    """What vibrates is damped, and the body is as large as without."""
    scene = cooled(loads=(replace(COLD, amplitude=None),))
    damped = replace(scene, impact=replace(scene.impact, bulk_viscosity=0.5))
    results = [mca.run(item, precision="float64") for item in (scene, damped)]
    assert results[1]["E_kinetic"][-10:].mean() < 0.5 * results[0]["E_kinetic"][-10:].mean()
    assert results[1].summary["energy_error"] < 1e-2


def test_what_it_does_not_go_with_is_refused_by_name():
    def refused(words: str) -> Any:
        return pytest.raises(mca.RequestError, match=words)

    with refused(r"Scene.loads = .ThermalStrain.: it does not go with multi_rate; leave multi_rate out"):
        mca.run(cooled(), multi_rate=2)
    with refused(r"ThermalStrain.body = .block.: it has two thermal strains"):
        mca.run(cooled(loads=(COLD, COLD)))
    with refused(r"ThermalStrain of block.temperature = 1000000.0: it makes a strain of 12"):
        replace(COLD, temperature=1e6)
    with refused(r"ThermalStrain.body = .block.: loads act on nodes of flexible bodies"):
        rigid = replace(cooled().bodies[0], rigid=True)
        mca.run(cooled(bodies=(rigid, replace(rigid, name="b", rigid=False)), paths=()))
