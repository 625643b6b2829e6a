"""Assemblies of CAD files: a body for each solid and instance, glued, tied and in contact; sizes from walls."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from parts import GAP, OVERLAP, PHONE, write_phone
from statics import Static

import warp_mca as mca
from warp_mca.geometry import cad
from warp_mca.geometry.cad_drawing import plain_name
from warp_mca.geometry.cad_solids import solid_names
from warp_mca.geometry.quality import check, volumes
from warp_mca.geometry.shape_volume import of_cells

ABS, ALUMINIUM = mca.library.ABS, mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=110e6, E_t=1e9)
MATERIALS = {"*": ALUMINIUM, "shell": ABS, "chip*": ABS}


@pytest.fixture(scope="module")
def phone(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A STEP file of six solids."""
    return write_phone(tmp_path_factory.mktemp("phone"))


def drawn(file: Path, *boxes: tuple[Any, ...]) -> Path:
    """A STEP file of boxes (x, y, z, dx, dy, dz) in millimetres."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        for box in boxes:
            gmsh.model.occ.addBox(*box)
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()
    return file


def built(body: mca.Body) -> mca.Mesh:
    """The mesh of a body of an assembly."""
    assert isinstance(body.geometry, mca.Cad)
    return body.geometry.build()


def test_each_solid_and_each_instance_is_a_body_of_its_own_mass(phone: Path):
    assembly = mca.Assembly(phone, size=6e-3, materials=MATERIALS)
    assert set(assembly.names) == set(PHONE)
    assert [body.name for body in assembly.bodies] == list(assembly.names)
    meshes = {body.name: built(body) for body in assembly.bodies}
    for body in assembly.bodies:
        mesh = meshes[body.name]
        check(mesh, body.name)
        assert of_cells(mesh) @ volumes(mesh) == pytest.approx(1e-9 * PHONE[body.name], rel=1e-6)
        assert body.material is (ABS if body.name in ("shell", "chip", "chip_2") else ALUMINIUM)
        assert list(mesh.cell_sets) == [body.name]
    moved = meshes["chip_2"].points.min(axis=0) - meshes["chip"].points.min(axis=0)
    assert moved == pytest.approx((5e-3, 0.0, 0.0), abs=1e-8)
    (general,) = assembly.contacts
    assert isinstance(general, mca.ContactAll) and general.exclude == ()


class Labels:
    """gmsh's model of solids with these labels."""

    def __init__(self, *labels: str) -> None:
        self.labels = labels

    def getEntities(self, dim: int) -> list[tuple[int, int]]:
        return [(dim, tag) for tag in range(len(self.labels))]

    def getEntityName(self, dim: int, tag: int) -> str:
        return self.labels[tag]


def test_names_are_the_innermost_labels_that_say_something():
    labels = (
        "Shapes/as1/rod_1/nut & & 256",
        "Shapes/as1/rod_2/nut",
        "",
        "Shapes/as1/lid/SOLID",
        "Shapes/as1/3/COMPOUND",
    )
    assert list(solid_names(Labels(*labels)).values()) == ["nut", "nut_2", "solid_3", "lid", "as1"]


def test_gaps_and_overlaps_of_the_file_are_told_with_place_and_depth(phone: Path):
    assembly = mca.Assembly(phone, size=6e-3, materials=MATERIALS)
    found = {touch.solids: touch for touch in assembly.touching}
    pairs = {("shell", "board"), ("shell", "battery"), ("shell", "glass"), ("board", "chip"), ("board", "chip_2")}
    assert set(found) == pairs
    battery, glass, board = (found["shell", name] for name in ("battery", "glass", "board"))
    assert (battery.gap, battery.depth) == (0.0, pytest.approx(OVERLAP, rel=0.01))
    assert battery.at == pytest.approx((18e-3, 5e-3, 0.995e-3), abs=1e-6)
    assert (glass.gap, glass.depth) == (pytest.approx(GAP, rel=1e-3), 0.0)
    assert (board.gap, board.depth) == (0.0, 0.0)
    notes = [note for body in assembly.bodies for note in built(body).notes]
    assert notes == [f"{touch.text} in phone.step" for touch in (battery, glass)]


def test_glued_solids_share_nodes_and_keep_their_volumes(phone: Path):
    """Where the file has a gap or an overlap, too."""
    join = {("shell", "*"): "glue", ("board", "chip*"): "glue"}
    assembly = mca.Assembly(phone, size=6e-3, materials=MATERIALS, join=join)
    (body,) = assembly.bodies
    mesh = built(body)
    check(mesh, body.name)
    assert body.name == "+".join(assembly.names)
    for name, volume in PHONE.items():
        cells = mesh.cell_sets[name]
        assert of_cells(mesh)[cells] @ volumes(mesh)[cells] == pytest.approx(1e-9 * volume, rel=1e-6)
    nodes = {name: set(mesh.others["tetra10"][cells].ravel()) for name, cells in mesh.cell_sets.items()}
    for touch in assembly.touching:
        one, other = touch.solids
        shared = mesh.points[sorted(nodes[one] & nodes[other])]
        assert len(shared) >= 6 and np.ptp(shared, axis=0).max() > 3.9e-3, touch.text
    assert isinstance(body.material, dict) and body.material["shell"] is ABS


def test_a_tie_is_a_bond_without_strength_and_solids_may_be_apart(phone: Path):
    join = {("shell", "glass"): "tie", ("shell", "battery"): mca.Bond(normal=1e6), ("chip*", "board"): "apart"}
    general, *bonds = mca.Assembly(phone, size=6e-3, materials=MATERIALS, join=join).contacts
    assert isinstance(general, mca.ContactAll)
    assert general.exclude == (("board", "chip"), ("board", "chip_2"))
    found = {bond.sides: bond.bond for bond in bonds if isinstance(bond, mca.Contact)}
    assert found == {("glass", "shell"): mca.Bond(), ("battery", "shell"): mca.Bond(normal=1e6)}


def deflection(mesh: mca.Mesh, element: str, length: float, direction: int) -> float:
    """Of a strip that is held at x = 0 under a load that its end at x = `length` shares [m/N]."""
    static = Static(mesh, element, mca.Elastic(E=70e9, nu=0.33, rho=2700.0))
    X = static.X
    held = np.repeat(X[:, :1] < 1e-9, 3, axis=1)
    end = X[:, 0] > length - 1e-9
    force = np.zeros_like(X)
    force[end, direction] = 1.0 / end.sum()
    return float(static.solved(force, held)[end, direction].mean())


def test_glued_strips_bend_as_one_strip_of_cells_that_match(tmp_path: Path):
    """Loose, they would bend four times as far."""
    file = drawn(tmp_path / "strips.step", (0, 0, 0, 20, 3, 1), (0, 0, 1, 20, 3, 1))
    assembly = mca.Assembly(file, size=1.5e-3, materials={"*": ABS}, join={"*": "glue"})
    (body,) = assembly.bodies
    by_hand = mca.Box(size=(20e-3, 3e-3, 2e-3), divisions=(30, 3, 4)).build()
    assert deflection(built(body), "tet10", 20e-3, 2) == pytest.approx(deflection(by_hand, "hex8i", 20e-3, 2), rel=0.01)


def test_a_strip_with_a_corner_bends_right_with_one_layer_of_coarse_cells(tmp_path: Path):
    """An L of 1.5 mm in cells of 3 mm, against four layers of hexahedra."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        shapes = gmsh.model.occ
        legs = shapes.addBox(0, 0, 0, 30, 9, 1.5), shapes.addBox(28.5, 0, 0, 1.5, 9, 20)
        shapes.fuse([(3, legs[0])], [(3, legs[1])])
        shapes.synchronize()
        gmsh.write(str(tmp_path / "strip.step"))
    finally:
        gmsh.finalize()
    low = mca.Box(size=(30e-3, 9e-3, 1.5e-3), divisions=(80, 8, 4)).build()
    high = mca.Box(size=(1.5e-3, 9e-3, 18.5e-3), divisions=(4, 8, 50), origin=(28.5e-3, 0.0, 1.5e-3)).build()
    points, cell = np.unique(np.concatenate([low.points, high.points]).round(9), axis=0, return_inverse=True)
    cells = cell.ravel()[np.concatenate([low.hexahedra, high.hexahedra + len(low.points)])].astype(np.int32)
    layers = mca.Mesh(points, cells)
    strip = mca.Cad(tmp_path / "strip.step", size=3e-3).build()
    for direction in (0, 2):
        assert tip(strip, "tet10", direction) == pytest.approx(tip(layers, "hex8i", direction), rel=0.04)


def tip(mesh: mca.Mesh, element: str, direction: int) -> float:
    """Motion of the end of the upright leg under a force there [m/N]; the strip is held at x = 0."""
    static = Static(mesh, element, mca.Elastic(E=70e9, nu=0.33, rho=2700.0))
    X = static.X
    held, end, force = np.repeat(X[:, :1] < 1e-9, 3, axis=1), X[:, 2] > 20e-3 - 1e-9, np.zeros_like(X)
    force[end, direction] = 1.0 / end.sum()
    return float(static.solved(force, held)[end, direction].mean())


@pytest.mark.parametrize("across", [1.0, 2.0])
def test_cells_follow_the_thickness_of_walls(tmp_path: Path, across: float):
    """A wall of 1 mm on a block of 6 mm."""
    file = drawn(tmp_path / "wall.step", (0, 0, 0, 6, 6, 6), (6, 0, 0, 8, 6, 1))
    (body,) = mca.Assembly(file, materials={"*": ABS}, across=across, join={"*": "glue"}).bodies
    mesh = built(body)
    cells = mesh.others["tetra10"][:, :4]
    edges = np.linalg.norm(
        mesh.points[cells[:, [0, 0, 0, 1, 1, 2]]] - mesh.points[cells[:, [1, 2, 3, 2, 3, 3]]], axis=2
    )
    wall = mesh.points[cells].mean(axis=1)[:, 0] > 7e-3
    block = mesh.points[cells].mean(axis=1)[:, 2] > 4e-3
    assert np.median(edges[wall]) == pytest.approx(1e-3 / across, rel=0.3)
    assert np.median(edges[block]) > 1.4 * np.median(edges[wall])


def test_where_one_algorithm_fails_the_next_is_tried(phone: Path, monkeypatch: pytest.MonkeyPatch):
    tried = []

    def failing(part: mca.Cad, algorithms: dict[str, float]) -> mca.Mesh:
        tried.append(algorithms["Mesh__Algorithm3D"])
        if len(tried) < 2:
            raise cad._MeshingError("it fails")
        return meshed(part, algorithms)

    meshed = cad._meshed_by
    monkeypatch.setattr(cad, "_meshed_by", failing)
    mesh = mca.Cad(phone, size=5e-3, solids=("glass",)).build()
    assert tried == [10.0, 1.0]
    assert volumes(mesh).sum() == pytest.approx(1e-9 * PHONE["glass"], rel=1e-6)


def test_where_all_algorithms_fail_at_the_own_size_fewer_cells_over_a_wall_are_tried(
    phone: Path, monkeypatch: pytest.MonkeyPatch
):
    def failing(part: mca.Cad, algorithms: dict[str, float]) -> mca.Mesh:
        if part.size is not None or part.across > 0.5:
            raise cad._MeshingError("it fails")
        return meshed(part, algorithms)

    meshed = cad._meshed_by
    monkeypatch.setattr(cad, "_meshed_by", failing)
    mesh = mca.Cad(phone, across=1.9, solids=("glass",)).build()
    assert mesh.notes == ("gmsh meshes phone.step with across=0.475 but not with 1.9",)
    assert volumes(mesh).sum() == pytest.approx(1e-9 * PHONE["glass"], rel=1e-6)
    with pytest.raises(mca.RequestError, match="it fails"):
        mca.Cad(phone, size=4.9e-3, solids=("glass",)).build()


def test_names_are_without_what_opencascade_adds():
    assert plain_name("nut & & 256") == "nut"
    assert [plain_name(label) for label in ("=>[0:1:1:3]", "SOLID", "Open CASCADE STEP 7", "")] == [""] * 4


REFUSED = [
    ({"materials": {"shell": ABS}}, "give a material for board"),
    ({"materials": {"*": ABS, "lid": ABS}}, "the file has shell, board, chip"),
    ({"size": {"lid": 1e-3}}, "Assembly.size = 'lid'"),
    ({"size": -1.0}, "Assembly.size"),
    ({"across": 0.0}, "Cad.across"),
    ({"join": {("chip", "glass"): "glue"}}, "no such solids touch .*shell and battery overlap by 1e-05 m at"),
    ({"join": {"chip": "weld"}}, "choose glue, tie, contact, apart or a Bond"),
    ({"join": {3: "glue"}}, "give names of solids"),
    ({"path": "phone.stl"}, "an STL file holds one solid"),
    ({"path": "none.step"}, "No such file"),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_no_assembly_can_mean_is_refused(phone: Path, number: int):
    changes, words = REFUSED[number]
    with pytest.raises(mca.RequestError, match=words):
        mca.Assembly(**{"path": phone, "materials": MATERIALS, **changes}).bodies  # noqa: B018


def test_no_pair_is_glued_that_was_not_named(tmp_path: Path):
    """Three blocks in a ring."""
    file = drawn(tmp_path / "ring.step", (0, 0, 0, 4, 4, 4), (4, 0, 0, 4, 4, 4), (2, 0, 4, 4, 4, 4))
    pairs = {("solid_1", "solid_2"): "glue", ("solid_2", "solid_3"): "glue"}
    with pytest.raises(mca.RequestError, match="solid_1 and solid_3 touch, and both are glued"):
        mca.Assembly(file, materials={"*": ABS}, join=pairs).bodies  # noqa: B018
