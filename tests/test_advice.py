"""What a run says of its scene: where results deserve less trust, and what else may be wrong when a guard stops it."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
import pytest

import warp_mca as mca
from warp_mca import scene_file
from warp_mca.errors import RequestError
from warp_mca.geometry import Mesh
from warp_mca.geometry.quality import doubled_nodes

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


def test_strain_of_one_kind_of_body_is_not_laid_to_the_other():
    scene = stacked(2, 2, gap=0.01)
    stretched = replace(scene.bodies[1], kinematics="finite")
    drive = mca.Prescribed(body="upper", nodes="ymax", axis="y", times=(0.0,), velocities=(200.0,))
    held = mca.Fixed(body="upper", nodes="ymin")
    pulled = replace(scene, bodies=(scene.bodies[0], stretched), prescribed=(drive,), fixed=(held,))
    said, _ = mca.run(replace(pulled, impact=mca.ImpactPhase(duration=2.5e-5, energy_tolerance=1.0))).warnings
    assert said.endswith("choose kinematics='finite', if that was in lower")


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
