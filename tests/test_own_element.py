"""An element of the user's own: host side (`linear_tet.py`), kernels and one registration; everything else takes it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
from linear_tet import LinearTet
from scipy.spatial.transform import Rotation
from test_elements import STEEL, energy, held_of

import warp_mca as mca
from warp_mca.geometry.cell_types import TETRAHEDRON
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.physics.elements.cells import body_cells
from warp_mca.recorders import UsdFile, VtkHdfFile
from warp_mca.step.output import NodalStress
from warp_mca.verify.runner import verify
from warp_mca.verify.small_meshes import mixed_cube

SOFT = mca.Elastic(E=70e9, nu=0.0, rho=2700.0)
NAME = LinearTet.name
LENGTH, SIDE, SPEED = 0.1, 0.005, 2.0  # of the bar [m], [m/s]


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The one registration."""
    register(LinearTet())


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_constant_strain_gives_constant_stress_and_no_force_inside(kinematics: str):
    """Patch test: Hooke's law at all nodes, and nodes inside the cube in balance; wedges and pyramids are cut."""
    mesh = mixed_cube()
    held = held_of(mesh, NAME, kinematics)
    strain = 1e-6 * np.array([[3.0, 1.0, -2.0], [1.0, -1.0, 0.5], [-2.0, 0.5, 2.0]])
    X = held.solver.model.X
    force = held.forces(X @ strain)
    inside = ((X > 1e-9) & (X < 1.0 - 1e-9)).all(axis=1)
    assert inside.sum() == 2
    assert np.abs(force[inside]).max() < 1e-9 * np.abs(force).max()
    recorded = NodalStress(held.solver, np.arange(len(X), dtype=np.int32))
    recorded.launch(held.state)
    stress = 2.0 * STEEL.shear_modulus * strain
    stress += (STEEL.bulk_modulus - 2.0 / 3.0 * STEEL.shear_modulus) * np.trace(strain) * np.eye(3)
    expected = stress[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(recorded.tensor.numpy(), np.tile(expected, (len(X), 1)), rtol=2e-5)


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_rotation_gives_no_force_and_forces_are_the_slope_of_the_energy(kinematics: str):
    rng, mesh = np.random.default_rng(0), mixed_cube()
    held = held_of(mesh, NAME, kinematics)
    X = held.solver.model.X
    strained = np.abs(held.forces(1e-3 * X)).max()
    turned = Rotation.from_rotvec([0.7, -1.1, 0.4]).apply(X) - X
    assert np.abs(held.forces(turned)).max() < 1e-10 * strained
    u = turned + 1e-3 * rng.uniform(-1.0, 1.0, X.shape)
    force, way, h = held.forces(u), rng.normal(size=X.shape), 1e-7
    slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
    assert -np.sum(force * way) == pytest.approx(slope, rel={"finite": 1e-6, "corotational": 5e-3}[kinematics])


def flying_bar(element: str = NAME, cells: int = 60) -> mca.Scene:
    """A bar without lateral strain that flies along x against a rigid wall, and probes along its axis."""
    box = mca.Box(size=(LENGTH, SIDE, SIDE), divisions=(cells, 2, 2))
    wall = mca.RigidPlane(point=(LENGTH, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    axis = mca.Line(body="bar", start=(0.0, 0.5 * SIDE, 0.5 * SIDE), end=(LENGTH, 0.5 * SIDE, 0.5 * SIDE))
    return mca.Scene(
        name="flying_bar",
        bodies=(mca.Body(name="bar", geometry=box, material=SOFT, element=element, velocity=(SPEED, 0.0, 0.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall, penalty=2.0),),
        paths=(mca.Path(name="axis", lines=(axis,), spacing=0.05 * LENGTH),),
        impact=mca.ImpactPhase(duration=4.2e-5, output_interval=2e-7),
    )


def test_a_bar_strikes_a_wall_as_the_wave_equation_says(tmp_path: Path):
    """Force A rho c v until the wave is back at 2 L / c, c = sqrt(E / rho), and the speed of its front is c."""
    recorders = VtkHdfFile(tmp_path / "bar.vtkhdf"), UsdFile(tmp_path / "bar.usda")
    result = mca.run(flying_bar(), recorders=recorders)
    c = np.sqrt(SOFT.E / SOFT.rho)
    time, F = result.time, result.F_n
    plateau = (time > 0.3 * LENGTH / c) & (time < 1.7 * LENGTH / c)
    assert F[plateau].mean() == pytest.approx(SIDE**2 * SOFT.rho * c * SPEED, rel=0.01)
    assert result.summary["contact_duration"] == pytest.approx(2.0 * LENGTH / c, rel=0.03)
    early = time < LENGTH / c
    near, far = (-result.paths[0].stress[early][:, probe, 0] for probe in (16, 4))
    arrival = [np.interp(0.5 * SOFT.rho * c * SPEED, axial, time[early]) for axial in (near, far)]
    assert 0.6 * LENGTH / (arrival[1] - arrival[0]) == pytest.approx(c, rel=0.01)
    assert result.summary["element"] == NAME and result.summary["energy_error"] < 5e-3

    with h5py.File(tmp_path / "bar.vtkhdf") as file:
        assert set(file["VTKHDF/Types"][:]) == {TETRAHEDRON.vtk}
        assert len(file["VTKHDF/Types"]) == result.summary["n_elements"]
    assert result.failed == ()
    from pxr import Usd, UsdGeom

    shown = Usd.Stage.Open(str(tmp_path / "bar.usda"))
    assert set(UsdGeom.Mesh(shown.GetPrimAtPath("/World/bar")).GetFaceVertexCountsAttr().Get()) == {3}


def test_a_batch_gives_the_bits_of_a_run():
    scenes = [flying_bar(cells=6), flying_bar(element="hex8", cells=6)]
    scenes = [dataclasses.replace(s, impact=mca.ImpactPhase(duration=2e-6, output_interval=2e-7)) for s in scenes]
    alone, batch = mca.run(scenes[0]), mca.run_batch(scenes)  # whose step is that of the tetrahedra
    assert alone.F_n.max() > 0.0
    for name in alone.history:
        assert np.array_equal(batch[0][name], alone[name], equal_nan=True)
    assert batch[0].summary["element"] == NAME and batch[1].summary["element"] == "hex8"


def test_tetrahedra_of_a_mesh_go_to_the_bodys_own_element():
    """In a body of hexahedra they go to the first element for them."""
    mesh = mixed_cube()
    own, mixed = (mca.Body(name="cube", geometry=mesh, material=STEEL, element=name) for name in (NAME, "hex8r"))
    assert [part.element.name for part in body_cells(own, tetrahedral(mesh))] == [NAME]
    assert [part.element.name for part in body_cells(mixed, mesh)] == ["hex8r", "tet4"]


def test_verification_runs_with_it(capsys: pytest.CaptureFixture[str]):
    outcomes = verify(["rigid_rotation"], element=NAME)
    assert outcomes and all(row.verdict != "NOT MET" for outcome in outcomes for row in outcome.rows)
