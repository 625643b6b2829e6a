"""Parts from CAD files and meshes of other programs: read, selected, placed and dropped, their units checked."""

from __future__ import annotations

import dataclasses
import math
import re
from pathlib import Path

import numpy as np
import pytest
from parts import CAD, LENGTH, MESHES, VOLUME, write_parts, write_phone
from recipes import area

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.geometry.cad import extent
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.quality import check, volumes
from warp_mca.scene.model_file import load, save

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
FLOOR, DOWN = mca.RigidPlane(normal=(0.0, 0.0, 1.0)), (0.0, 0.0, -9.81)
AREA, FOOT_AREA = 56e-4, 8e-4  # m^2


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the part."""
    write_parts(folder := tmp_path_factory.mktemp("parts"))
    return folder


def part(path: Path, **changes) -> mca.Cad | mca.MeshFile:
    """The part of a file in millimetres, with cells of 12 mm if it is to be meshed."""
    if path.suffix[1:] in CAD:
        return mca.Cad(path, **{"size": 12e-3, "scale": 1e-3, **changes})
    return mca.MeshFile(path, **{"scale": 1e-3, **changes})


@pytest.mark.parametrize("suffix", [*CAD, *MESHES])
def test_each_format_gives_the_same_part(folder: Path, suffix: str, capfd: pytest.CaptureFixture[str]):
    below = mca.Select("below", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -2.0))
    end = mca.Select("end", low=(LENGTH, -1.0, -1.0), high=(LENGTH, 1.0, 1.0))
    mesh = part(folder / f"part.{suffix}", select=(below, end)).build()
    check(mesh, suffix)
    assert len(mesh.cells["tetra10" if suffix in CAD else "tetrahedron"]) == mesh.cell_count
    assert volumes(mesh).sum() == pytest.approx(VOLUME, rel=1e-5)
    assert area(mesh, "below") == pytest.approx(FOOT_AREA, rel=1e-5)
    assert area(mesh, "end") == pytest.approx(4e-4, rel=1e-5)
    if suffix in CAD:
        faces = [name for name in mesh.node_sets if name.startswith("face_")]
        assert faces == [f"face_{k + 1}" for k in range(8)]
        assert sum(area(mesh, name) for name in faces) == pytest.approx(AREA, rel=1e-5)
        assert np.array_equal(mesh.cell_sets["solid_1"], np.arange(mesh.cell_count))
    elif suffix != "bdf":
        foot = "set_1" if suffix == "key" else "foot"
        assert np.array_equal(mesh.nodes(foot), mesh.nodes("below"))
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("suffix", ["msh", "unv", "bdf", "inp", "key"])
def test_quadratic_tetrahedra_keep_their_nodes_or_are_taken_as_linear_ones(folder: Path, suffix: str):
    """The foot of either has all nodes there."""
    below = mca.Select("below", point=(0.0, 0.0, 0.0), normal=(0.0, 0.0, -2.0))
    mesh = part(folder / f"quadratic.{suffix}", select=(below,)).build()
    linear = part(folder / f"part.{suffix}").build()
    assert len(mesh.others["tetra10"]) == mesh.cell_count and not mesh.notes
    cut = tetrahedral(mesh)
    assert (cut.cell_count, len(cut.points)) == (linear.cell_count, len(linear.points))
    for made in (mesh, cut):
        check(made, suffix)
        assert volumes(made).sum() == pytest.approx(VOLUME, rel=1e-5)
        assert area(made, "below") == pytest.approx(FOOT_AREA, rel=1e-5)
        if suffix != "bdf":
            assert np.array_equal(made.nodes("set_1" if suffix == "key" else "foot"), made.nodes("below"))


def test_refined_divides_the_size_and_a_changed_file_is_meshed_again(folder: Path, tmp_path: Path):
    file = tmp_path / "part.step"
    file.write_bytes((folder / "part.step").read_bytes())
    coarse = mca.Cad(file, size=12e-3)  # the file names its unit
    assert coarse.refined(2.0) == dataclasses.replace(coarse, size=6e-3)
    assert coarse.build().points is coarse.build().points
    assert coarse.refined(2.0).build().cell_count > 3 * coarse.build().cell_count
    assert extent(file) == pytest.approx([0.04, 0.02, 0.04], rel=1e-5)
    file.write_text(file.read_text().replace("40.", "50."))
    assert np.ptp(coarse.build().points, axis=0)[0] == pytest.approx(0.05, rel=1e-5)


def test_the_unit_that_a_step_file_names_is_followed(folder: Path, tmp_path: Path):
    text = (folder / "part.step").read_text()
    assert "SI_UNIT(.MILLI.,.METRE.)" in text
    (tmp_path / "part.step").write_text(text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)"))
    assert np.ptp(mca.Cad(tmp_path / "part.step", size=12.0).build().points, axis=0)[0] == pytest.approx(40.0, rel=1e-5)


def test_a_closed_face_of_an_stl_file_is_meshed(folder: Path):
    """gmsh flattens faces to mesh them, and cannot flatten a whole sphere; facets of 3 mm lie within it."""
    mesh = mca.Cad(folder / "ball.stl", size=3e-3, scale=1e-3).build()
    check(mesh, "ball")
    assert volumes(mesh).sum() == pytest.approx(4.0 / 3.0 * math.pi * 1e-6, rel=0.06)


def test_selections_join_faces_by_name_and_number(folder: Path):
    plain = part(folder / "part.brep").build()
    mesh = part(folder / "part.brep", select=(mca.Select("pair", faces=(2, "face_3")),)).build()
    assert np.array_equal(mesh.nodes("pair"), np.union1d(plain.nodes("face_2"), plain.nodes("face_3")))


def test_place_on_and_drop(folder: Path):
    c, s = math.cos(0.3), math.sin(0.3)
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    body = mca.Body(
        name="part",
        geometry=part(folder / "part.step"),
        material=STEEL,
        rotation=(0.3, 0.0, 0.0),
        position=(1.0, 2.0, 3.0),
        velocity=(0.5, 0.0, 0.0),
    )
    aslant = mca.RigidPlane(point=(0.0, 0.0, 0.1), normal=(0.0, 3.0, 4.0))
    placed = body.place_on(aslant, gap=1e-4)
    heights = (part(folder / "part.step").build().points @ rotation.T + placed.position - [0.0, 0.0, 0.1]) @ [
        0,
        0.6,
        0.8,
    ]
    assert heights.min() == pytest.approx(1e-4, abs=1e-12)
    moved = np.subtract(placed.position, body.position)
    assert np.cross(moved, aslant.normal) == pytest.approx(0.0, abs=1e-12)
    speed = math.sqrt(2.0 * 9.81 * 0.2)
    assert body.drop(0.2, DOWN).velocity == pytest.approx((0.5, 0.0, -speed))
    for call, words in (
        (lambda: body.place_on(FLOOR, gap=-1.0), "place_on: gap = -1.0"),
        (lambda: body.drop(-0.1), "drop: height = -0.1"),
        (lambda: body.drop(0.1, (0.0, 0.0, 0.0)), "drop: gravity"),
    ):
        with pytest.raises(mca.RequestError, match=words):
            call()


MOMENTUM = 7850.0 * VOLUME * math.sqrt(2.0 * 9.81 * 0.2)  # N s, of the part after a fall of 0.2 m


def falling(geometry: mca.Cad | mca.MeshFile) -> mca.Scene:
    """The part just above the floor, with the velocity of a fall of 0.2 m."""
    body = mca.Body(name="part", geometry=geometry, material=STEEL).place_on(FLOOR, gap=1e-7).drop(0.2, DOWN)
    contact = mca.Contact(slave=mca.Surface(body="part", nodes="boundary"), master=FLOOR)
    impact = mca.ImpactPhase(duration=6e-5, output_interval=1e-6)
    return mca.Scene(name="drop", bodies=(body,), contacts=(contact,), gravity=DOWN, impact=impact)


def test_a_part_falls_on_a_floor_and_takes_part_in_model_files(folder: Path, tmp_path: Path):
    """The floor's impulse lies between m v, of a body that stays, and 2 m v, of one that rebounds without loss."""
    scene = falling(mca.Cad(str(folder / "part.step"), size=12e-3))
    result = mca.run(scene, device="cpu")
    assert 1.0 < 1e-6 * result.F_n.sum() / MOMENTUM < 2.0
    assert not [text for text in result.warnings if "scale=" in text]
    save(tmp_path / "drop.mca", scene, mca.mesh(scene))
    stored = load(tmp_path / "drop.mca")
    assert stored.scene == scene
    again = mca.run(stored.scene, device="cpu", meshes=stored.meshes)
    assert np.array_equal(again.F_n, result.F_n)


def test_parts_of_all_formats_fall_alike(folder: Path):
    scenes = [falling(part(folder / f"part.{suffix}")) for suffix in (*CAD, *MESHES)]
    results = mca.run_batch(scenes, device="cpu")
    impulses = np.array([1e-6 * result.F_n.sum() for result in results]) / MOMENTUM
    assert ((impulses > 1.0) & (impulses < 2.0)).all()
    assert np.ptp(impulses) < 0.1  # their meshes differ


@pytest.mark.parametrize(
    ("changes", "material", "words"),
    [
        ({}, STEEL, None),
        ({"scale": 1.0}, STEEL, r"body part is 40 m long and weighs 1.88e\+08 kg, .*stable step is .*give scale=1e-3"),
        ({"scale": 1e-6}, STEEL, "check it"),
        (
            {},
            dataclasses.replace(STEEL, E=210e3, rho=7.85e-9),
            r"if E is in MPa and rho in tonne/mm\^3, give them in Pa and kg/m\^3",
        ),
    ],
)
def test_units_that_cannot_be_are_told(folder: Path, changes: dict, material: mca.Elastic, words: str | None):
    geometry = part(folder / "part.msh", **changes)
    impact = mca.ImpactPhase(duration=1e-5)
    scene = mca.Scene(name="s", bodies=(mca.Body(name="part", geometry=geometry, material=material),), impact=impact)
    found = mca.quality_table(scene, mca.mesh(scene)).warnings
    if words is None:
        assert not found
    else:
        assert len([text for text in found if re.search(words, text)]) == 1


@pytest.mark.parametrize("name", ["part.step", "part.msh"])
def test_run_of_a_part_prints_a_scene_that_runs(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, name: str
):
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(folder / name)]) == 0
    out, err = capsys.readouterr()
    assert f"{name} is a part, not a scene" in err and err.count("\n") == 2
    assert "#   face_1 (" in out if name == "part.step" else "#   foot (" in out
    Path("part_drop.py").write_text(out)
    scene = mca.make_scene("part_drop.py", height=1.0)
    assert scene.bodies[0].velocity == pytest.approx((0.0, 0.0, -math.sqrt(2.0 * 9.81)))
    assert np.ptp(mca.mesh(scene)["part"].points, axis=0) == pytest.approx((0.04, 0.02, 0.04), rel=1e-5)
    short = dataclasses.replace(scene, impact=mca.ImpactPhase(duration=4e-6, output_interval=1e-6))
    result = mca.run(short, device="cpu")
    assert result.F_n.max() > 0.0
    assert result.summary["element"] == ("tet10" if Path(name).suffix[1:] in CAD else "tet4")


def test_run_of_a_mesh_says_once_what_is_left_out(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """Of the file that the script is made of, which is read several times, and of the run of that script."""
    monkeypatch.chdir(tmp_path)
    text = (folder / "part.bdf").read_text().replace("ENDDATA", "RBE2,1,1,123,2\nENDDATA")
    Path("part.bdf").write_text(text)
    main(["run", "part.bdf"])
    out, err = capsys.readouterr()
    assert err.count("left out are 1 rigid elements (RBE2)") == 1 and "build(" in out
    Path("drop.py").write_text(out)
    assert main(["run", "drop.py", "--duration", "1e-7", "--out", "results"]) == 0
    assert capsys.readouterr().err.count("left out are 1 rigid elements (RBE2)") == 1
    assert "left out are 1 rigid elements (RBE2)" in Path("results/summary.json").read_text()


UNIVERSAL = {  # changes of a .unv file that gmsh would pass over, or that would crash it
    "GROUP": ("         8      1523", "         8     99500", "a group has element 99500, which is not given"),
    "NODE": (
        "         2         1         1        11\n",
        "         1         1         1        11\n",
        "node 1 is given",
    ),
    "ELEMENT": ("      1523       111", "      1522       111", "element 1522 is given twice"),
}


@pytest.mark.parametrize("name", UNIVERSAL)
def test_universal_files_that_gmsh_misreads_are_refused(folder: Path, tmp_path: Path, name: str):
    old, new, words = UNIVERSAL[name]
    text = (folder / "part.unv").read_text()
    assert old in text
    (tmp_path / "it.unv").write_text(text.replace(old, new, 1))
    with pytest.raises(mca.RequestError, match=words):
        part(tmp_path / "it.unv").build()


def test_springs_of_a_universal_file_are_told(folder: Path, tmp_path: Path):
    text = (folder / "part.unv").read_text()
    spring = f"{9000:10d}{136:10d}{1:10d}{1:10d}{7:10d}{2:10d}\n{1:10d}{2:10d}\n"
    (tmp_path / "it.unv").write_text(text.replace("  2412\n", f"  2412\n{spring}", 1))
    (note,) = part(tmp_path / "it.unv").build().notes
    assert note.endswith("left out are 1 of the type 136")


FACET = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet"


def tetrahedron(x: float) -> str:
    """Triangles of an STL file around a tetrahedron with its corner at x."""
    corner = [f"vertex {x + a} {b} {c}" for a, b, c in ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1))]
    faces = ("\n".join(corner[i] for i in face) for face in ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)))
    return "\n".join(f"facet normal 0 0 0\nouter loop\n{face}\nendloop\nendfacet" for face in faces)


TWO = f"solid a\n{tetrahedron(0.0)}\n{tetrahedron(3.0)}\nendsolid a\n"
REFUSED = [
    (
        lambda folder: mca.Cad(_written(folder, "two.stl", TWO), size=0.5).build(),
        "its 2 closed surfaces do not lie in one",
    ),
    (lambda folder: mca.Cad(folder / "none.step", size=1.0).build(), "No such file"),
    (lambda folder: mca.Cad(folder / "part.msh", size=1.0), "CAD files end in .step.*MeshFile reads finished meshes"),
    (lambda folder: mca.Cad(folder / "part.step", size=1e-6).build(), "elements would result in a part of 0.06 m"),
    (lambda folder: mca.Cad(_written(folder, "bad.step", "nonsense"), size=1.0).build(), "gmsh cannot read or mesh it"),
    (lambda folder: mca.Cad(_written(folder, "bad.stl", "solid a\nendsolid a\n"), size=1.0).build(), "gmsh|no solid"),
    (
        lambda folder: mca.Cad(_written(folder, "open.stl", f"solid a\n{FACET}\nendsolid a\n"), size=0.5).build(),
        "3 edges of its triangles lack",
    ),
    (lambda folder: part(folder / "part.brep", select=(mca.Select("a", faces=9),)).build(), "face_9"),
    (lambda folder: part(folder / "part.msh", select=(mca.Select("a", (), (1, 1, 1), (2, 2, 2)),)).build(), "no node"),
    (lambda folder: mca.Select("a", faces=(1,), point=(0, 0, 0), normal=(0, 0, 1)), "give faces, or low and high"),
    (lambda folder: mca.Select("a", low=(0, 0, 0)), "give faces, or low and high"),
    (lambda folder: mca.MeshFile(_written(folder, "bad.unv", "nonsense")).build(), "no volume cells|gmsh cannot read"),
]


@pytest.mark.parametrize("number", range(len(REFUSED)))
def test_what_cannot_be_read_or_meshed_is_refused(folder: Path, number: int, capfd: pytest.CaptureFixture[str]):
    call, words = REFUSED[number]
    with pytest.raises(mca.RequestError, match=words):
        call(folder)
    assert capfd.readouterr() == ("", "")


def _written(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


PAGE = (Path(__file__).parent.parent / "docs" / "parts.md").read_text(encoding="utf-8")
EXAMPLES = re.findall(r"```python\n(.*?)```", PAGE, flags=re.S)


def test_the_page_of_parts_runs(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    """Its blocks go on from each other, beside files of the part under the names that it uses."""
    monkeypatch.chdir(tmp_path)
    for name, source in (("bracket.step", "part.step"), ("bracket.key", "part.key")):
        Path(name).write_bytes((folder / source).read_bytes())
    write_phone(tmp_path)
    names: dict = {}
    for number, example in enumerate(EXAMPLES):
        exec(compile(example, f"docs/parts.md, example {number + 1}", "exec"), names)
    assert {"kN" in capsys.readouterr().out, len(EXAMPLES) > 2} == {True}


@pytest.mark.parametrize("header", [b"", b"solid of a program"])
def test_binary_stl_files_may_have_any_header(folder: Path, tmp_path: Path, header: bytes):
    """gmsh reads none of zeros, and takes one that begins with "solid" for text."""
    numbers = re.findall(r"(?:normal|vertex) +(\S+) +(\S+) +(\S+)", (folder / "part.stl").read_text())
    rows = np.array(numbers, dtype=np.float32).reshape(-1, 12)
    facets = b"".join(row.tobytes() + b"\0\0" for row in rows)
    file = tmp_path / "binary.stl"
    file.write_bytes(header.ljust(80, b"\0") + len(rows).to_bytes(4, "little") + facets)
    part = mca.Cad(file, size=12e-3, scale=1e-3)
    assert part.volume == pytest.approx(VOLUME, rel=1e-6)
    check(part.build(), "part")
