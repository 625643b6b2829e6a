"""Cells where a drop strikes: the depth that it crushes beside closed forms, sizes there and elsewhere."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.cad_finer import node_sizes
from warp_mca.scene.extent import extent_of, mesh_of
from warp_mca.scene.struck import ROWS

ABS = mca.library.ABS
HEIGHT = 1.2
SIDES = np.array((0.03, 0.012, 0.02))  # of the block [m]
ENERGY = ABS.rho * SIDES.prod() * 9.81 * HEIGHT
EDGE, CORNER = "xmin-zmin", "xmin-ymin-zmin"


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A STEP file of a block, and beside it round.step, which has round edges, cylinder.step and ball.step."""
    import gmsh

    folder = tmp_path_factory.mktemp("block")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        shapes = gmsh.model.occ
        for name, radius in (("block", 0.0), ("round", 2.0)):
            solid = shapes.addBox(0, 0, 0, *(1e3 * SIDES))
            shapes.synchronize()
            if radius:
                shapes.fillet([solid], [edge for _, edge in gmsh.model.getEntities(1)], [radius])
                shapes.synchronize()
            gmsh.write(str(folder / f"{name}.step"))
            gmsh.clear()
        for name in ("cylinder", "ball"):
            shapes.addCylinder(0, 0, 0, 0, 0, 10, 6) if name == "cylinder" else shapes.addSphere(0, 0, 0, 6)
            shapes.synchronize()
            gmsh.write(str(folder / f"{name}.step"))
            gmsh.clear()
    finally:
        gmsh.finalize()
    return folder / "block.step"


def dropped(path: Path, pose: str, struck: float | str = "auto", **changes: Any) -> mca.Body:
    """The block in its pose, made of ABS."""
    options: dict[str, Any] = {"material": ABS, **changes}
    across, size = options.pop("across", 2.0), options.pop("size", None)
    body = mca.Body(name="block", geometry=mca.Cad(path, across=across, size=size), **options)
    return mca.drop_test(body, height=HEIGHT, pose=pose, struck=struck).bodies[0]


def sizes(body: mca.Body) -> tuple[np.ndarray, np.ndarray]:
    """Height above the floor and mean edge [m] of the corners of its cells."""
    mesh = mesh_of(body)
    placed = mesh.points @ rotation_matrix(np.array(body.rotation)).T + np.array(body.position)
    size = node_sizes(mesh.points, mesh.others["tetra10"][:, :4])
    return placed[size > 0.0, 2], size[size > 0.0]


def slope(body: mca.Body) -> np.ndarray:
    """Of the block's three sides against the floor's normal: direction cosines [-]."""
    return np.abs(rotation_matrix(np.array(body.rotation))[2])


@pytest.mark.parametrize("across", [2.0, 3.0])
def test_an_edge_has_cells_over_the_depth_that_its_energy_crushes(block: Path, across: float):
    """Of a strong block, since cells of a soft one are small enough: length d^2 / (2 n_x n_z) yields."""
    strong = dataclasses.replace(ABS, sigma_y=2e6)
    body = dropped(block, EDGE, across=across, material=strong)
    (place,) = body.geometry.finer  # pyright: ignore[reportAttributeAccessIssue]
    n = slope(body)
    depth = math.sqrt(2.0 * n[0] * n[2] * ENERGY / strong.sigma_y / SIDES[1])
    assert place.size == pytest.approx(depth / (ROWS * across), rel=0.01)
    assert body.kinematics == "finite"


def test_a_corner_is_crushed_as_deep_as_its_tip_holds(block: Path):
    soft = dataclasses.replace(ABS, sigma_y=10e6)
    body = dropped(block, CORNER, material=soft)
    (place,) = body.geometry.finer  # pyright: ignore[reportAttributeAccessIssue]
    depth = (6.0 * slope(body).prod() * ENERGY / soft.sigma_y) ** (1.0 / 3.0)
    assert place.size == pytest.approx(depth / (ROWS * 2.0), rel=0.01)


def test_cells_are_fine_where_it_strikes_and_as_before_elsewhere(block: Path):
    plain, fine = (sizes(dropped(block, EDGE, struck)) for struck in ("off", 0.5e-3))
    assert fine[1][fine[0] < 0.4e-3].mean() == pytest.approx(0.5e-3, rel=0.25)
    far = 0.6 * fine[0].max()
    assert fine[1][fine[0] > far].mean() == pytest.approx(plain[1][plain[0] > far].mean(), rel=0.15)
    assert len(fine[0]) < 4 * len(plain[0])


def test_round_edges_that_are_meshed_again_lie_above_the_floor(block: Path):
    body = dropped(block.with_name("round.step"), EDGE, across=1.0)
    assert body.geometry.finer  # pyright: ignore[reportAttributeAccessIssue]
    assert sizes(body)[0].min() == pytest.approx(1e-6, abs=1e-7)


@pytest.mark.parametrize(
    ("pose", "struck", "changes"),
    [
        ("zmin", "auto", {}),
        (EDGE, "off", {}),
        (EDGE, "auto", {"size": 3e-3}),
        (EDGE, "auto", {"material": mca.library.CONCRETE_C30}),
        (EDGE, "auto", {"rigid": True}),
        (EDGE, 5e-3, {}),
    ],
)
def test_what_is_left_as_it_is(block: Path, pose: str, struck: float | str, changes: dict[str, Any]):
    """Flat sides, sizes that are given, what does not yield, cells that are fine enough."""
    body = dropped(block, pose, struck, **changes)
    assert body.geometry.finer == () and body.kinematics == "corotational"  # pyright: ignore[reportAttributeAccessIssue]


def test_a_size_given_for_the_drop_counts_for_bodies_with_their_own(block: Path):
    body = dropped(block, EDGE, "0.5e-3", size=4e-3)
    (place,) = body.geometry.finer  # pyright: ignore[reportAttributeAccessIssue]
    assert place.size == 0.5e-3
    assert body.geometry.refined(2.0).finer[0].size == 0.25e-3  # pyright: ignore[reportAttributeAccessIssue]


@pytest.mark.parametrize(("stress", "told"), [(45e6, False), (2e10, True)])
def test_what_is_crushed_far_less_than_a_cell_is_told(block: Path, stress: float, told: bool):
    """As metals are on round places: of a block with such an edge the depth is 3 um in cells of .5 mm."""
    body = dropped(block, EDGE, material=dataclasses.replace(ABS, sigma_y=stress))
    n = slope(body)
    depth = math.sqrt(2.0 * n[0] * n[2] * ENERGY / stress / SIDES[1])
    notes = [note for note in mesh_of(body).notes if "the fall crushes block" in note]
    assert len(notes) == told
    if told:
        assert f"about {depth:.2g} m deep" in notes[0] and "give struck a smaller size" in notes[0]


@pytest.mark.parametrize(("name", "told"), [("cylinder", True), ("ball", False)])
def test_the_depth_that_is_told_is_that_of_round_sides(block: Path, name: str, told: bool):
    """Coarse cells make a corner of a round side, which is crushed deeper. A cylinder is crushed over its length L by
    d: sigma L (4 / 3) d sqrt(2 R d) = m g h; its finer cells are still 26 times as wide."""
    steel = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
    body = dropped(block.with_name(f"{name}.step"), "xmin", material=steel if told else ABS, across=1.0)
    notes = [note for note in mesh_of(body).notes if "the fall crushes block" in note]
    assert len(notes) == told
    if told:
        energy, R = math.pi * 0.006**2 * 7850.0 * 9.81 * HEIGHT, 0.006  # per length
        depth = (energy / 250e6 * 0.75 / math.sqrt(2.0 * R)) ** (2.0 / 3.0)
        said = float(notes[0].split("about ")[1].split(" m")[0])
        assert 0.8 * depth < said < 1.5 * depth


def test_sizes_of_their_own_are_told_where_they_are_coarse(block: Path):
    """A ball of aluminium in cells of a third of its radius, with a size or struck="off", has 30 % less force."""
    aluminium = mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=250e6, E_t=0.7e9)
    ball = mca.Body(name="ball", geometry=mca.Cad(block.with_name("ball.step"), size=2e-3), material=aluminium)

    scenes = [mca.drop_test(ball, height=HEIGHT, struck=struck) for struck in ("auto", "off", 0.5e-3)]
    given, off, fine = results = [mca.run(scene, duration=1.8e-5) for scene in scenes]
    assert [scene.listed[0].penalty for scene in scenes] == [None, None, 10.0]
    assert mca.drop_test(ball, height=HEIGHT, struck=0.5e-3, penalty=2.0).listed[0].penalty == 2.0
    told = [[text for text in result.warnings if "the fall crushes ball" in text] for result in results]
    assert given.F_n.max() == off.F_n.max() < 0.8 * fine.F_n.max()
    assert [len(texts) for texts in told] == [1, 1, 0]
    less = 0.5 * float(told[0][0].split(", as ")[1].split(" ")[0])  # since coarse cells are crushed deeper
    assert not mesh_of(mca.drop_test(ball, height=HEIGHT, struck=less).bodies[0]).notes


def test_other_words_are_refused(block: Path):
    with pytest.raises(mca.RequestError, match=r"drop_test\.struck = 'fine': choose auto, off, or a size of cells"):
        dropped(block, EDGE, "fine")
    with pytest.raises(mca.RequestError, match=r"drop_test\.struck"):
        dropped(block, EDGE, -1.0)


def test_mass_is_that_of_all_parts(block: Path):
    body = mca.Body(name="block", geometry=mca.Cad(block), material=ABS)
    assert extent_of((body,)).mass == pytest.approx(ABS.rho * SIDES.prod(), rel=1e-9)
