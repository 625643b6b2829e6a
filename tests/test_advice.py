"""What a run says of its scene: where results deserve less trust, and what else may be wrong when a guard stops it."""

from __future__ import annotations

import re
import sys
import warnings
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import GuardError, RequestError
from warp_mca.cli import main as cli
from warp_mca.geometry import Mesh
from warp_mca.geometry.quality import doubled_nodes, pieces
from warp_mca.scene import model_file as scene_file

ALUMINIUM = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
SHORT = mca.ImpactPhase(duration=2e-6)


def cube(cells: int) -> mca.Box:
    return mca.Box(size=(0.02, 0.02, 0.02), divisions=(cells, cells, cells))


def alone(geometry: object, **changes) -> mca.Scene:
    body = mca.Body(name="it", geometry=geometry, material=ALUMINIUM, **changes)
    return mca.Scene(name="alone", bodies=(body,), impact=SHORT)


def stacked(lower: int, upper: int, gap: float = 0.0, **contact) -> mca.Scene:
    """A cube on another, of so many cells along their edges."""
    bodies = (
        mca.Body(name="lower", geometry=cube(lower), material=ALUMINIUM),
        mca.Body(name="upper", geometry=cube(upper), material=ALUMINIUM, position=(0.0, 0.02 + gap, 0.0)),
    )
    meet = mca.Contact(
        slave=mca.Surface(body="upper", nodes="ymin"), master=mca.Surface(body="lower", nodes="ymax"), **contact
    )
    return mca.Scene(name="stacked", bodies=bodies, contacts=(meet,), impact=SHORT)


@pytest.mark.parametrize(
    ("lower", "upper", "two_way", "told"),
    [(4, 2, False, True), (4, 4, False, False), (2, 4, False, False), (4, 2, True, False)],
)
def test_a_slave_coarser_than_its_master_is_pointed_out(lower: int, upper: int, two_way: bool, told: bool):
    said = mca.run(stacked(lower, upper, two_way=two_way)).warnings
    assert sum("slave upper are 2 times as wide" in warning for warning in said) == told


def test_parts_of_a_mesh_that_only_touch_are_pointed_out():
    one = cube(2).build()
    n = len(one.points)
    touching = Mesh(
        np.concatenate([one.points, one.points + np.array([0.02, 0.0, 0.0])]),
        np.concatenate([one.hexahedra, one.hexahedra + n]),
    )
    assert (doubled_nodes(one), doubled_nodes(touching)) == (0, 9)
    (said,) = mca.run(alone(touching)).warnings
    assert said.startswith("9 nodes of body it lie where others of it do")
    assert not mca.run(alone(one)).warnings


def test_pieces_of_a_mesh_that_share_no_node_are_pointed_out():
    one = cube(2).build()
    apart = Mesh(
        np.concatenate([one.points, one.points + np.array([0.015, 0.005, 0.005])]),
        np.concatenate([one.hexahedra, one.hexahedra + len(one.points)]),
    )
    assert (pieces(one), pieces(apart)) == (1, 2)
    (said,) = mca.run(alone(apart)).warnings
    assert said.startswith("body it is 2 pieces that share no node: they fall apart")


def test_strain_of_one_kind_of_body_is_not_laid_to_the_other():
    scene = stacked(2, 2, gap=0.01)
    stretched = replace(scene.bodies[1], kinematics="finite")
    drive = mca.Prescribed(body="upper", nodes="ymax", axis="y", times=(0.0,), velocities=(200.0,))
    held = mca.Fixed(body="upper", nodes="ymin")
    pulled = replace(scene, bodies=(scene.bodies[0], stretched), prescribed=(drive,), fixed=(held,))
    told = mca.run(replace(pulled, impact=mca.ImpactPhase(duration=2.5e-5, energy_tolerance=1.0))).warnings
    assert not [sentence for sentence in told if "choose kinematics='finite'" in sentence]


@dataclass(frozen=True, kw_only=True)
class Rusty(mca.Elastic):
    """A material of the user's own, which no kernel knows."""


def test_a_material_without_kernels_is_refused():
    with pytest.raises(RequestError, match=r"Body it\.material = .*give an Elastic or a J2Bilinear"):
        mca.Body(name="it", geometry=cube(1), material=Rusty(E=1e9, nu=0.3, rho=1e3))


@dataclass(frozen=True)
class Box:
    """A recipe of the user's own that goes by a name of warp_mca's."""

    cells: int = 2

    def build(self) -> Mesh:
        """Made by another."""
        return cube(self.cells).build()


def test_a_recipe_of_the_users_own_is_stored_as_its_mesh_whatever_its_name(tmp_path):
    scene = alone(Box())
    scene_file.save(tmp_path / "it.mca", scene, mca.mesh(scene))
    stored = scene_file.load(tmp_path / "it.mca").scene.bodies[0].geometry
    assert isinstance(stored, Mesh)
    assert np.array_equal(stored.points, Box().build().points)


def test_a_class_that_a_model_file_cannot_name_is_refused_and_nothing_written(tmp_path):
    @dataclass(frozen=True, kw_only=True)
    class Longer(mca.ImpactPhase):
        pass

    scene = replace(alone(cube(1)), impact=Longer(duration=1e-6))
    with pytest.raises(RequestError, match="scene = 'Longer': a model file holds warp_mca's own classes"):
        scene_file.save(tmp_path / "it.mca", scene, mca.mesh(scene))
    assert not list(tmp_path.iterdir())


def test_moduli_beyond_numbers_are_refused_in_a_sentence():
    body = mca.Body(
        name="it", geometry=mca.Rod(radius=0.01, length=0.1), material=mca.Elastic(E=1e300, nu=0.3, rho=7800.0)
    )
    with warnings.catch_warnings(), pytest.raises(RequestError, match="exceed the range of numbers"):
        warnings.simplefilter("error")
        mca.run(mca.Scene(name="stiff", bodies=(body,), impact=SHORT))


def sliver() -> Mesh:
    """A cube of 4 x 4 x 4 cells, one layer of which is a hundred times thinner than the others."""
    mesh = cube(4).build()
    points = mesh.points.copy()
    points[np.isclose(points[:, 2], 0.005), 2] = 0.0099
    return Mesh(points, mesh.hexahedra, mesh.node_sets, mesh.cell_sets)


SLIVER = r"element \d+ of body it, at \(.*\) m in the body's frame, makes the time step \d+ times shorter"


def test_slivers_are_reported_before_the_first_step(caplog: pytest.LogCaptureFixture):
    logged = []
    scene = alone(sliver())
    result = mca.run(scene, progress=lambda stage, done: logged.append((stage, caplog.text)))
    before = next(text for stage, text in logged if stage == "compile")
    assert re.search(SLIVER, before)
    assert [re.match(SLIVER, warning) is not None for warning in result.warnings] == [True]
    assert result.warnings == mca.quality_table(scene, mca.mesh(scene)).warnings
    caplog.clear()
    mca.run_batch([scene, scene])
    assert len(re.findall(SLIVER, caplog.text)) == 1


def test_the_command_line_reports_slivers_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(Path(__file__).parent)
    Path("thin.py").write_text(
        "def build():\n    import test_advice\n    return test_advice.alone(test_advice.sliver())\n"
    )
    assert cli.main(["build", "thin.py", "-o", "thin.mca"]) == 0
    assert re.search("warning: " + SLIVER, capsys.readouterr().out)
    tell = nullcontext(lambda stage, done: print(stage, file=sys.stderr))
    monkeypatch.setattr("warp_mca.base.progress.progress_bar", lambda: tell)
    assert cli.main(["run", "thin.py"]) == 0
    captured = capsys.readouterr()
    assert re.search("^warning: " + SLIVER + r"(.|\n)*\nimpact\n", captured.err, re.MULTILINE)
    assert re.search("^warning: " + SLIVER, captured.out, re.MULTILINE)


def small(size: float, speed: float = 1.0) -> mca.Scene:
    """A bar of that length [m] strikes a wall; all scales with its size."""
    box = mca.Box(size=(size, 0.1 * size, 0.1 * size), divisions=(10, 1, 1))
    body = mca.Body(name="bar", geometry=box, material=ALUMINIUM, velocity=(speed, 0.0, 0.0))
    wall = mca.RigidPlane(point=(size, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    meet = mca.Contact(slave=mca.Surface(body="bar", nodes="xmax"), master=wall)
    phase = mca.ImpactPhase(duration=4e-4 * size, output_interval=2e-5 * size)
    return mca.Scene(name="small", bodies=(body,), contacts=(meet,), impact=phase)


def test_bodies_too_small_for_float32_are_refused_and_run_in_float64():
    """2 nm in mixed precision: the run was said to be unstable, for whatever time step; tetrahedra felt no strain."""
    with pytest.raises(RequestError, match=r"size of element 0 of body bar \[m\] = 2e-10: .*--precision float64"):
        mca.run(small(2e-9))
    with pytest.raises(RequestError, match=r"^scenes\[1\]: size of element 0 of body bar"):
        mca.run_batch([small(1e-8), replace(small(2e-9), impact=small(1e-8).impact)])
    tiny, usual = mca.run(small(2e-9), precision="float64"), mca.run(small(1.0), precision="float64")
    assert tiny.F_n == pytest.approx(4e-18 * usual.F_n, rel=1e-6)
    assert mca.run(small(1e-8)).F_n == pytest.approx(1e-16 * usual.F_n, rel=1e-3, abs=1e-20 * usual.F_n.max())


def test_speeds_lost_in_rounding_are_not_laid_to_the_place():
    with pytest.raises(RequestError, match=r"speed of the bodies = 1e-12: positions are rounded to .*; give a greater"):
        mca.run(small(1.0, 1e-12))


def test_numbers_out_of_range_are_not_laid_to_the_time_step():
    with pytest.raises(GuardError, match=r"not a number at t = 0, before the first step: .*check their units"):
        mca.run(replace(alone(cube(1), velocity=(1e200, 0.0, 0.0)), impact=SHORT))


def test_a_balance_of_rounding_alone_stops_no_run():
    """The bar lies still; the wall is a rounding of positions inside it: 17 % of 1e-25 J were missing."""
    scene = small(1.0, 0.0)
    wall = replace(scene.contacts[0].master, point=(1.0 - 2e-16, 0.0, 0.0))
    result = mca.run(replace(scene, contacts=(replace(scene.contacts[0], master=wall),)))
    assert result.summary["energy"]["initial"] > 0.0
    assert result.summary["energy_error"] < 1e-2


@pytest.mark.parametrize(("gap", "penalty"), [(0.0, True), (1.0, False)])
def test_penalty_is_named_only_where_contact_was_touched(gap: float, penalty: bool):
    scene = stacked(2, 2, gap)
    fast = replace(scene.bodies[1], velocity=(0.0, -1.0, 0.0), angular_velocity=(0.0, 0.0, 2e4 * (not penalty)))
    strict = replace(SHORT, energy_tolerance=1e-12, duration=4e-5)
    with pytest.raises(GuardError, match="energy imbalance") as stopped:
        mca.run(replace(scene, bodies=(scene.bodies[0], fast), impact=strict))
    assert ("penalty" in str(stopped.value)) == penalty
    assert ("float64" in str(stopped.value)) == (not penalty)


def test_rubber_of_tetrahedra_is_not_told_of_an_element_of_hexahedra():
    """A body of tetrahedra alone has tet10 or tet4 where hex8i, the default, is asked for."""
    from watched import told_of

    from warp_mca.watch import elements

    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]) * 0.01
    tetrahedron = Mesh(points=points, hexahedra=np.zeros((0, 8), np.int32), tetrahedra=np.arange(4)[None].astype("i4"))
    rubber = mca.NeoHookean(C10=1e6, nu=0.495, rho=1000.0)
    for geometry, warned in ((cube(1), True), (tetrahedron, False)):
        body = replace(alone(geometry).bodies[0], material=rubber, kinematics="finite")
        said = told_of(elements.enriched_rubber, replace(alone(geometry), bodies=(body,)))
        assert bool(said) == warned
