"""Tests of `refine`: meshes of any scene of recipes finer and coarser, with their grading, and what is refused."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.geometry.quality import edge_lengths, scaled_jacobian
from warp_mca.geometry.refinement import refined_count
from warp_mca.phases.meshing import mesh
from warp_mca.scene import catalogue, model_file

pytestmark = pytest.mark.usefixtures("no_figures")

FACTORS = (0.5, 0.7, 1.3, 2.0)
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
FINISHED = ("graded_bars", "stick_slip", "strained_element", "two_metal_bar")  # their bodies are meshes, no recipes
FINISHED += ("arm_strike", "gripper", "leg_landing")
PLATE = {"plate_core_depth": 2, "plate_layers": 4, "plate_extension": 3}
SMALL: dict[str, dict[str, Any]] = {
    "single_link": {"axial": 6, "plate_core": 4, **PLATE},
    "two_link": {"section": 4, "ring": 2, "axial_OA": 5, "axial_AB": 4, "plate_core_x": 4, "plate_core_z": 4, **PLATE},
    "three_link": {"axial": 4, "plate_core": 4, **PLATE},
    "single_rod": {"axial": 10},
    "taylor_bar": {"axial": 6},
}
GRADED = {
    "rod": mca.Rod(radius=0.01, length=0.1, section=8, ring=4, axial=20, axial_ratio=3.0, focus_size=3e-4),
    "flat rod": mca.Rod(radius=0.01, length=0.1, tip="flat", section=8, ring=4, axial=20),
    "ball": mca.Sphere(radius=0.01, section=8, ring=4, pole_size=2e-4, pole_layers=8),
    "plate": mca.Plate(length=0.4, width=0.1, height=0.05, core=(8, 8), core_depth=4, layers=10, extension=12),
    "box": mca.Box(size=(1.0, 1.0, 1.0), divisions=(8, 12, 16)),
}


def scene_of(geometry) -> mca.Scene:
    """One body, in flight for some steps."""
    body = mca.Body(name="part", geometry=geometry, material=STEEL)
    return mca.Scene(name="s", bodies=(body,), impact=mca.ImpactPhase(duration=2e-7, output_interval=1e-7))


@pytest.mark.parametrize("name", [name for name in catalogue.scene_names() if name not in FINISHED])
def test_scenes_run_their_first_steps_finer_and_coarser(name: str):
    """Joints and contacts find their nodes at every density, and no cell is much worse than those of the scene."""
    made = mca.make_scene(name, **SMALL.get(name, {}))
    step = made.impact.output_interval * 1e-3
    scenes = [
        replace(made, refine=R, impact=replace(made.impact, duration=2 * step, output_interval=step)) for R in FACTORS
    ]
    meshes = [mca.mesh(scene) for scene in scenes]
    own = min(scaled_jacobian(mesh).min() for mesh in mca.mesh(made).values())
    assert min(scaled_jacobian(mesh).min() for part in meshes for mesh in part.values()) > 0.85 * own
    results = mca.run_batch(scenes, meshes=meshes)
    assert [result.summary["refine"] for result in results] == list(FACTORS)
    assert all(result.stopped is None for result in results)
    counts = [result.summary["n_elements"] for result in results]
    assert counts == sorted(counts)


@pytest.mark.parametrize("name", GRADED)
@pytest.mark.parametrize("factor", FACTORS)
def test_cells_scale_with_their_grading(name: str, factor: float):
    """The number of cells grows as the cube of the factor; short, usual and long edges fall as its inverse."""
    before, after = GRADED[name].build(), GRADED[name].refined(factor).build()
    assert after.cell_count / before.cell_count == pytest.approx(factor**3, rel=0.35)
    edges = [np.quantile(edge_lengths(mesh), [0.0, 0.1, 0.5, 0.9, 1.0]) for mesh in (before, after)]
    np.testing.assert_allclose(edges[1] * factor, edges[0], rtol=0.35)
    assert set(after.node_sets) == set(before.node_sets)


def test_whole_factors_are_exact():
    """Twice as fine in every direction: eight times the cells, and half the edge of the fine patches."""
    for recipe in GRADED.values():
        assert recipe.refined(2.0).build().cell_count == 8 * recipe.build().cell_count
    assert GRADED["rod"].refined(2.0).focus_size == 1.5e-4
    assert GRADED["plate"].refined(2.0).refined(0.5) == replace(GRADED["plate"], contact=9.6e-3)


def test_counts_are_rounded():
    """To the nearest count, an even one where the middle must be a line of nodes, and never to none."""
    assert [refined_count(6, R, even=True) for R in (0.1, 0.5, 0.7, 1.0, 1.3, 1.5)] == [2, 4, 4, 6, 8, 10]
    assert [refined_count(3, R) for R in (0.1, 0.5, 0.7, 1.0, 1.3, 1.5)] == [1, 2, 2, 3, 4, 5]


def test_coarse_patches_stay_inside():
    """A patch whose counts cannot fall any more is as large as its recipe allows."""
    for name in ("rod", "ball", "plate"):
        mca.mesh(replace(scene_of(GRADED[name]), refine=0.01))


@dataclass(frozen=True)
class Brick:
    """A recipe of one's own, without `refined`."""

    cells: int = 2

    def build(self) -> mca.Mesh:
        """A cube."""
        return mca.Box(size=(1.0, 1.0, 1.0), divisions=(self.cells, self.cells, self.cells)).build()


@dataclass(frozen=True)
class Graded(Brick):
    """A recipe of one's own that can be refined."""

    def refined(self, factor: float) -> Graded:
        """So many times the cells."""
        return Graded(refined_count(self.cells, factor))


def test_recipes_of_ones_own():
    """They are refined by their method; without one they are refused by the body's name."""
    assert mca.mesh(replace(scene_of(Graded()), refine=1.5))["part"].cell_count == 27
    with pytest.raises(mca.RequestError, match=r"refine = 1\.5: body part is a Brick, whose cells cannot"):
        mca.mesh(replace(scene_of(Brick()), refine=1.5))


@dataclass
class Changeable:
    """A recipe of one's own that can be changed, and so not be hashed."""

    cells: int

    def build(self) -> mca.Mesh:
        """A cube."""
        return Brick(self.cells).build()

    def refined(self, factor: float) -> Changeable:
        """So many times the cells."""
        return Changeable(refined_count(self.cells, factor))


def test_recipes_that_cannot_be_hashed_are_told_apart():
    """Refined recipes are let go, and new ones may lie where they were: the meshes of a cache are not theirs."""
    made: dict[object, mca.Mesh] = {}
    scene = scene_of(Changeable(2))
    factors = [k / 2 for k in range(1, 11) if k != 2] * 3
    counts = [mesh(replace(scene, refine=factor), made)["part"].cell_count for factor in factors]
    assert counts == [refined_count(2, factor) ** 3 for factor in factors]


@pytest.mark.parametrize("geometry", [Brick().build(), mca.MeshFile("none.vtu")])
def test_finished_meshes_are_refused(geometry):
    """What is in a file is neither finer nor coarser than it is."""
    with pytest.raises(mca.RequestError, match=f"body part is a {type(geometry).__name__}"):
        mca.run(scene_of(geometry), refine=2.0)
    with pytest.raises(mca.RequestError, match="finished meshes are given"):
        mca.run(scene_of(Brick()), refine=2.0, meshes={"part": Brick().build()})


@pytest.mark.parametrize("factor", [0.0, -1.0, np.nan, np.inf, "two", None])
def test_factors_are_numbers_above_zero(factor):
    """Anything else is refused."""
    with pytest.raises(mca.RequestError, match=r"Scene\.refine"):
        replace(scene_of(Brick()), refine=factor)


def test_command_line_and_model_files(tmp_path, capsys):
    """--refine goes into a built model, whose parameters can still be changed; a built model is not refined."""
    file, out = tmp_path / "rod.mca", tmp_path / "out"
    size = ["--set", "axial=10", "--set", "v=2"]
    assert main(["build", "single_rod", *size, "--refine", "0.5", "-o", str(file)]) == 0
    assert model_file.load(file).meshes["rod"].cell_count == 60
    assert main(["run", str(file), "--set", "mu=0.1", "--duration", "1e-6", "--out", str(out)]) == 0
    assert mca.load(out).summary["refine"] == 0.5
    assert main(["run", str(file), "--refine", "2", "--out", str(tmp_path / "no")]) == 2
    assert "a model file holds finished meshes" in capsys.readouterr().err
