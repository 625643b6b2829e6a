"""Owns the tests of what runs of one process keep for the next: meshes of recipes, and swings."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.kept import Kept, unchanged
from warp_mca.geometry.parts import Part, Parts
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.model import stable_step
from warp_mca.model.build import build_model
from warp_mca.phases.meshing import mesh
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handoff import hand_off
from warp_mca.step.solver import Solver

STEEL = mca.Elastic(E=2e11, nu=0.3, rho=7850.0)


def alone(geometry: object) -> mca.Scene:
    body = mca.Body(name="it", geometry=geometry, material=STEEL)  # type: ignore[arg-type]
    return mca.Scene(name="one", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))


def test_what_was_used_longest_ago_goes_first():
    kept: Kept[str] = Kept(10)
    kept.put("a", "A", 4)
    kept.put("b", "B", 4)
    assert kept.get("a") == "A"
    kept.put("c", "C", 5)
    kept.put("large", "LARGE", 11)
    assert [kept.get(key) for key in ("a", "b", "c", "large")] == ["A", None, "C", None]


def test_a_recipe_is_meshed_once_for_runs_and_anew_for_the_user():
    scene = alone(mca.Rod(radius=0.013, length=0.2177))
    first, again = (mesh(scene, {})["it"] for _ in range(2))
    assert first is again
    own = mca.mesh(scene)["it"]
    np.testing.assert_array_equal(own.points, first.points)
    own.points[:] = np.nan
    assert np.isfinite(mesh(scene, {})["it"].points).all()
    other = mesh(alone(mca.Rod(radius=0.013, length=0.2178)), {})["it"]
    assert other.points[:, 0].max() == 0.2178 and other.boundary[0] is not None


def test_meshes_with_the_same_cells_share_their_faces():
    made: dict[object, mca.Mesh] = {}
    one, other = (mesh(alone(mca.Box(size=(x, 1.0, 1.0), divisions=(2, 2, 2))), made)["it"] for x in (1.0, 2.0))
    finer = mesh(alone(mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 3))), made)["it"]
    assert one.boundary[0] is other.boundary[0] and len(finer.boundary[0]) == 32
    assert other.cell_volumes.sum() == pytest.approx(2.0, rel=1e-14)


def test_nodes_of_a_given_mesh_may_be_moved_between_runs():
    own = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    scene = alone(own)
    assert mesh(scene, {})["it"].cell_volumes.sum() == pytest.approx(1.0)
    own.points[:, 0] *= 2.0
    assert mesh(scene, {})["it"].cell_volumes.sum() == pytest.approx(2.0)
    own.points[:, 0] *= -1.0
    with pytest.raises(mca.RequestError, match="inverted"):
        mesh(scene, {})


def test_a_run_compares_a_mesh_once():
    """Between runs, and where a recipe of the user's own changes its mesh after a look, each change is seen."""
    own = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    with unchanged():
        first = own.known
        with unchanged():
            own.cell_volumes.sum()
            own.points[:, 0] *= 2.0  # which nobody may do here, or it would cost a look each time
            assert own.known is first
    assert own.cell_volumes.sum() == pytest.approx(2.0)

    class Stretched:
        def build(self) -> mca.Mesh:
            made = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
            made.points[:, 0] *= 3.0 / made.cell_volumes.sum()
            return made

    with unchanged():
        assert mesh(alone(Stretched()), {})["it"].cell_volumes.sum() == pytest.approx(3.0)


def test_a_mesh_from_another_process_comes_with_what_is_known_of_it_as_it_is():
    own = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    volumes = own.cell_volumes
    came = pickle.loads(pickle.dumps(own))
    np.testing.assert_array_equal(came.known["integrals"][1], volumes)
    came.points[:, 0] *= 2.0
    assert not came.known and came.cell_volumes.sum() == pytest.approx(2.0)
    own.points[:, 0] *= 3.0
    assert pickle.loads(pickle.dumps(own)).cell_volumes.sum() == pytest.approx(3.0)


def test_a_run_sees_what_changed_since_the_one_before():
    own = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build()
    scene, masses = alone(own), []
    for _ in range(2):
        masses.append(mca.run(scene, duration=1e-6).summary["bodies"]["it"]["mass"])
        own.points[:, 0] *= 2.0
    assert masses[1] == pytest.approx(2.0 * masses[0])


def test_what_depends_on_more_than_numbers_is_meshed_for_each_run(tmp_path):
    """A recipe of the user, and parts that hold a mesh."""
    path = tmp_path / "size.txt"
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1))

    class FromFile:
        def build(self) -> mca.Mesh:
            return replace(box, size=(float(path.read_text()), 1.0, 1.0)).build()

    held = box.build()
    scenes = [alone(FromFile()), alone(Parts(parts=(Part(name="one", geometry=held),)))]
    for size in (1.0, 3.0):
        path.write_text(str(size))
        held.points[:, 0] *= size / np.ptp(held.points[:, 0])
        for scene in scenes:
            assert np.ptp(mesh(scene, {})["it"].points[:, 0]) == pytest.approx(size)


def test_an_equal_swing_is_computed_once():
    """Its arrays are each run's own; another angle, plane or time gives another swing."""
    scene = mca.make_scene("two_link", section=4, ring=1, axial_OA=4, axial_AB=4)
    meshes = mca.mesh(scene)
    masses = nodal_masses(scene, meshes)
    first, again = (hand_off(scene, meshes, masses).swing for _ in range(2))
    assert first is not None and again is not None
    assert first.theta_t is not again.theta_t
    np.testing.assert_array_equal(first.theta_t, again.theta_t)
    first.theta_t[:] = 0.0
    third = hand_off(scene, meshes, masses).swing
    assert third is not None and third.theta_t.any()
    lower = mca.make_scene("two_link", section=4, ring=1, axial_OA=4, axial_AB=4, H=0.36)
    assert hand_off(lower, meshes, masses).t_contact != hand_off(scene, meshes, masses).t_contact


def test_a_stable_step_of_equal_arrays_is_found_once(monkeypatch):
    """Runs with another speed have the same; another modulus, mass or spring gives another one."""
    found: list[float] = []
    largest = stable_step._worst
    monkeypatch.setattr(stable_step, "_worst", lambda *args: (found.append(0.0), largest(*args))[1])
    scene = mca.make_scene("single_rod", section=2, ring=1, axial=21)

    def step(**changes: float) -> float:
        changed = mca.make_scene("single_rod", section=2, ring=1, axial=21, **changes)
        points = {name: mesh.points for name, mesh in meshes.items()}
        return build_model(changed, meshes, points, {name: 0.0 * x for name, x in points.items()}).stable.dt

    meshes = mca.mesh(scene)
    first = step()
    count = len(found)
    assert step(v=2.0) == first and len(found) == count > 0
    assert step(E=3e11) < first and step(rho=3000.0) > first and step(penalty=9.0) <= first
    assert len(found) == 4 * count


def test_kernels_that_are_loaded_are_not_hashed_anew():
    """Warp hashes a module again, for 15 ms, whose options were set."""
    scene = alone(mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)))
    meshes = mca.mesh(scene)
    points = {"it": meshes["it"].points}
    model = build_model(scene, meshes, points, {"it": 0.0 * points["it"]})

    def loaded() -> list[dict]:
        solver = Solver(model, device="cpu", precision="mixed", dt=model.stable.dt)
        solver.compile()
        (stage,) = solver.elements
        return [kernel.module.hashers for kernel in (stage.force_kernel, stage.energy_kernel, stage.stress_kernel)]

    first, made = loaded(), [maker.cache_info().misses for maker in (energy_kernel, stress_kernel)]
    again = loaded()
    assert made == [maker.cache_info().misses for maker in (energy_kernel, stress_kernel)]
    assert any(first) and all(a is b for a, b in zip(first, again, strict=True))
