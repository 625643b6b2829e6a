"""Bulk viscosity in the kernels of a CUDA device: patches, lanes of what yields, steps in one launch, several rates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun
from test_gpu import oblique
from test_viscosity import block

import warp_mca as mca

pytestmark = pytest.mark.gpu

NEAR = {"mixed": 1e-4, "float64": 1e-7}


def viscous(element: str, plastic: bool, two_way: bool = True) -> mca.Scene:
    """`oblique` with elements of one kind and both parts of the viscosity."""
    scene = oblique()
    metal = scene.bodies[0].material if plastic else mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    return replace(
        scene,
        bodies=tuple(replace(body, material=metal, element=element) for body in scene.bodies),
        contacts=(replace(scene.contacts[0], two_way=two_way),),
        impact=replace(scene.impact, bulk_viscosity=(0.06, 1.2)),
    )


@pytest.mark.parametrize("precision", NEAR)
@pytest.mark.parametrize("plastic", [True, False])
@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r"])
def test_patches_give_the_figures_of_the_cpu_and_repeat_bit_for_bit(element: str, plastic: bool, precision: str):
    scene = viscous(element, plastic)
    host, one, two = (mca.run(scene, device=name, precision=precision) for name in ("cpu", "cuda:0", "cuda:0"))
    assert (host.summary["max_plastic_strain"] > 1e-4) == plastic
    for name in ("F_n_N", "F_t_N", "tip_vx", "E_kinetic", "E_plastic", "E_friction"):
        assert one[name] == pytest.approx(host[name], abs=NEAR[precision] * max(np.abs(host[name]).max(), 1e-9))
    taken = host.summary["energy"]["damping"]
    assert taken > 1e-3 * host.summary["energy"]["initial"]
    assert one.summary["energy"]["damping"] == pytest.approx(taken, rel=10.0 * NEAR[precision])
    assert one.summary["energy_error"] < 0.01
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)


@pytest.mark.parametrize("precision", NEAR)
@pytest.mark.parametrize("plastic", [True, False])
@pytest.mark.parametrize("element", ["hex8i", "hex8"])
def test_steps_of_one_launch_give_what_launches_of_each_step_give(element: str, plastic: bool, precision: str):
    runs = [begun(viscous(element, plastic, two_way=False), device="cuda:0", precision=precision) for _ in range(3)]
    assert runs[0].solver.resident is not None
    runs[2].solver.resident = None
    for run in runs:
        run.advance()
        assert run.stopped == [None]
    together, again, single = (run.state for run in runs)
    assert again.differences(together) == []
    for name in ("u", "v"):
        a, b = (state.arrays()[name].numpy() for state in (together, single))
        assert a == pytest.approx(b, abs=(1e-4 if precision == "mixed" else 1e-9) * np.abs(b).max()), name
    taken = [run.scene_runs[0].ledger.energy()["damping"] for run in runs]
    assert taken[0] == pytest.approx(taken[2], rel=1e-3 if precision == "mixed" else 1e-8)
    assert taken[0] > 0.0


@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r"])
def test_elements_of_several_rates_have_the_steps_of_their_levels(element: str):
    box = mca.Box(size=(0.04, 0.01, 0.01), divisions=(24, 6, 6)).build()
    points = box.points.copy()
    points[:, 0] = 0.04 * (points[:, 0] / 0.04) ** 2
    scene = block(element, 0.1, geometry=mca.Mesh(points, box.hexahedra, box.node_sets, box.cell_sets))
    taken, velocity = [], []
    for device in ("cpu", "cuda:0"):
        impact = begun(scene, device=device, precision="float64", multi_rate=3)
        assert impact.solver.model.rates is not None
        impact.state.v.assign(10.0 * np.sin(np.pi * impact.solver.model.X / 0.02))
        impact.advance()
        assert impact.stopped == [None]
        taken.append(impact.scene_runs[0].ledger.energy()["damping"])
        velocity.append(impact.state.v.numpy())
    assert taken[0] > 0.0
    assert taken[1] == pytest.approx(taken[0], rel=1e-8)
    assert velocity[1] == pytest.approx(velocity[0], abs=1e-8 * np.abs(velocity[0]).max())


def test_a_state_goes_on_where_elements_are_computed_one_by_one(tmp_path):
    """Rows of viscosity are the same on both devices."""
    scene = viscous("hex8", False)
    first, whole = (begun(scene, device="cuda:0", precision="float64") for _ in range(2))
    first.advance(until=whole.steps.count // 2)
    first.save(tmp_path / "state")
    second = begun(scene, device="cpu", precision="float64")
    second.load(tmp_path / "state")
    second.advance()
    whole.advance()
    a, b = (run.state.v.numpy() for run in (whole, second))
    assert a == pytest.approx(b, abs=1e-6 * np.abs(b).max())
