"""LS-DYNA decks as scenes: each format, units, what is read of each keyword, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.decks.units import Units

CORNERS = [(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)]
BRICK = (1, 2, 4, 3, 5, 6, 8, 7)


def bar(first: int, at: float, cells: int = 2) -> tuple[list[list[float]], list[list[int]]]:
    """Nodes (number, x, y, z) and hexahedra of a bar of cubes of 2 mm along z, in millimetres."""
    nodes = [
        [first + 4 * k + j, 2.0 * x, 2.0 * y, at + 2.0 * k]
        for k in range(cells + 1)
        for j, (x, y, _) in enumerate(CORNERS[:4])
    ]
    return nodes, [[first - 1 + 4 * k + corner for corner in BRICK] for k in range(cells)]


def card(layout: str, values: Sequence[object], widths: Sequence[int] = (10,) * 10) -> str:
    """A card in columns of the usual widths, of the long format, or between commas."""
    texts = [f"{value:.10g}" if isinstance(value, float) else str(value) for value in values]
    if layout == "commas":
        return ", ".join(texts) + "\n"
    wide = [20] * len(widths) if layout == "long" else widths
    return "".join(text.rjust(width) for text, width in zip(texts, wide, strict=False)) + "\n"


def mesh_text(layout: str) -> str:
    """Two bars end on end, 0.01 mm apart."""
    text = {"NODE": "*NODE\n", "SOLID": "*ELEMENT_SOLID\n"}
    number = 0
    for part, at in ((1, 0.0), (2, 4.01)):
        nodes, cells = bar(1 + 100 * (part - 1), at)
        for node in nodes:
            text["NODE"] += card(layout, node, (8, 16, 16, 16, 8, 8))
        for cell in cells:
            number += 1
            text["SOLID"] += card(layout, [number, part, *cell], (8,) * 10)
    return text["NODE"] + text["SOLID"]


def deck(layout: str, more: str = "", steel: str | None = None) -> str:
    """The bars, of which the second strikes the first, held at its foot, at 20 m/s; units t-mm-s."""

    def row(*values: object, widths: Sequence[int] = (10,) * 10) -> str:
        return card(layout, values, widths)

    steel = steel or "*MAT_PLASTIC_KINEMATIC\n" + row(7, 7.85e-9, 2.1e5, 0.3, 250.0, 1000.0, 0.5) + row(0)
    return (
        ("*KEYWORD LONG=Y\n" if layout == "long" else "*KEYWORD\n")
        + "$ a comment\n*PARAMETER\n"
        + row("R speed", -2.0e4, "I  part", 2)
        + "*TITLE\nbars\n"
        + mesh_text(layout)
        + "*PART\nanvil\n"
        + row(1, 1, 7)
        + "*PART\nhammer\n"
        + row(2, 1, 7)
        + "*SECTION_SOLID_TITLE\nsolids\n"
        + row(1, 2)
        + steel
        + "*DEFINE_BOX\n"
        + row(5, -1.0, 3.0, -1.0, 3.0, -0.1, 0.1)
        + "*SET_NODE_GENERAL\n"
        + row(3)
        + row("BOX", 5)
        + "*BOUNDARY_SPC_SET\n"
        + row(3, 0, 1, 1, 1)
        + "*INITIAL_VELOCITY_GENERATION\n"
        + row("&part", 2, 0, 0, 0, "&speed")
        + row(0)
        + "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE\n"
        + row(2, 1, 3, 3)
        + row(0.2, 0.1, 1e-3)
        + row(1)
        + "*CONTROL_TERMINATION\n"
        + row(2e-6)
        + "*CONTROL_TIMESTEP\n"
        + row(0, 0.8)
        + "*DATABASE_GLSTAT\n"
        + row(1e-7)
        + more
        + "*END\n"
    )


STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9, beta=0.5)


def by_hand() -> mca.Scene:
    """The same scene. Its step: e^2 / (1 - e) = rho v^2 / sigma_y = 0.01256 gives e = 0.106, (1 - e)^2 0.8 = 0.64."""

    def body(name: str, at: float, speed: float, sets: dict[str, np.ndarray]) -> mca.Body:
        nodes, cells = bar(1, at)
        mesh = mca.Mesh(1e-3 * np.array(nodes)[:, 1:], np.array(cells, dtype=np.int32) - 1, sets)
        return mca.Body(
            name=name, geometry=mesh, material=STEEL, element="hex8", kinematics="finite", velocity=(0.0, 0.0, speed)
        )

    foot = np.arange(4, dtype=np.int32)
    skins = (mca.Surface(body=name, nodes="boundary") for name in ("hammer", "anvil"))
    friction = (mca.DecayingFriction(kinetic=0.1, decay=1.0),)
    return mca.Scene(
        name="it",
        bodies=(body("anvil", 0.0, 0.0, {"held_xyz": foot}), body("hammer", 4.01, -20.0, {})),
        contacts=(mca.Contact(slave=next(skins), master=next(skins), mu=0.2, friction=friction, two_way=True),),
        fixed=(mca.Fixed(body="anvil", nodes="held_xyz", axes="xyz"),),
        impact=mca.ImpactPhase(
            duration=2e-6, output_interval=2e-6 / 400, time_step_scale=0.64, bulk_viscosity=(0.06, 1.5)
        ),
    )


def read(tmp_path: Path, text: str, units: str = "t-mm-s") -> mca.Scene:
    (tmp_path / "it.k").write_text(text)
    return mca.read_deck(tmp_path / "it.k", units)


def check_equal(found: mca.Scene, wanted: mca.Scene) -> None:
    """The same bodies, with the same arrays, and the same of all else."""
    for one, other in zip(found.bodies, wanted.bodies, strict=True):
        assert isinstance(one.geometry, mca.Mesh) and isinstance(other.geometry, mca.Mesh)
        np.testing.assert_array_equal(one.geometry.points, other.geometry.points)
        np.testing.assert_array_equal(one.geometry.hexahedra, other.geometry.hexahedra)
        assert one.geometry.node_sets.keys() == other.geometry.node_sets.keys()
        for name, nodes in one.geometry.node_sets.items():
            np.testing.assert_array_equal(nodes, other.geometry.node_sets[name])
        for name in ("name", "material", "element", "kinematics", "velocity", "angular_velocity", "rigid"):
            assert getattr(one, name) == getattr(other, name), name
    for name in ("contacts", "fixed", "prescribed", "ties", "joints", "loads", "gravity", "impact"):
        assert getattr(found, name) == getattr(wanted, name), name


@pytest.mark.parametrize("layout", ["columns", "commas", "long"])
def test_a_deck_is_the_scene_written_by_hand(tmp_path: Path, layout: str):
    check_equal(read(tmp_path, deck(layout)), by_hand())


def test_units_are_asked_for_and_converted(tmp_path: Path):
    """kg, mm and ms: stresses in GPa, densities in kg/mm^3, speeds in m/s."""
    text = deck("commas").replace("7.85e-09, 210000, 0.3, 250, 1000", "7.85e-06, 210, 0.3, 0.25, 1")
    for old, new in (("-20000", "-20"), ("0.2, 0.1, 0.001", "0.2, 0.1, 1"), ("2e-06", "2e-3")):
        assert old in text
        text = text.replace(old, new)
    check_equal(read(tmp_path, text, "kg-mm-ms"), by_hand())
    with pytest.raises(mca.RequestError, match=r"units = 'mm': decks name none; give SI, t-mm-s, .* g-mm-ms, g-cm-us"):
        read(tmp_path, text, "mm")


def test_steel_in_grams_centimetres_and_microseconds():
    units = Units("g-cm-us")
    assert units.si(7.896, "density") == 7896.0
    assert units.si(2.1, "stress") == 2.1e11  # Mbar
    assert units.si(0.1246, "velocity") == 1246.0
    assert units.length == 0.01


def test_files_that_are_included(tmp_path: Path):
    """Mesh in a file of its own in a folder, which *INCLUDE_PATH names."""
    text = deck("columns")
    mesh = mesh_text("columns")
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "mesh.k").write_text(f"*KEYWORD\n{mesh}*END\n")
    text = text.replace(mesh, "*INCLUDE_PATH_RELATIVE\nparts\n*INCLUDE\nmesh.k\n")
    check_equal(read(tmp_path, text), by_hand())
    mesh = mca.MeshFile(tmp_path / "it.k", scale=1e-3).build()  # the mesh alone, too
    assert mesh.cell_count == 4 and set(mesh.cell_sets) == {"anvil", "hammer"}
    (tmp_path / "parts" / "mesh.k").write_text("*KEYWORD\n*NODE\n1,a\n*END\n")
    with pytest.raises(mca.RequestError, match=r"line 3 of mesh.k: 'a' is no number"):
        mca.read_deck(tmp_path / "it.k", "SI")
    with pytest.raises(mca.RequestError, match=r"there is no file gone.k, which .INCLUDE names; put it beside"):
        read(tmp_path, text.replace("mesh.k", "gone.k"))
    with pytest.raises(mca.RequestError, match=r"it.k includes itself"):
        read(tmp_path, text.replace("mesh.k", "../it.k"))


def test_the_deck_runs_as_the_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """By the command, and in Python, the same force."""
    from warp_mca.cli.main import main

    (tmp_path / "it.k").write_text(deck("columns", "*DAMPING_GLOBAL\n0,1.\n"))
    out, words = tmp_path / "out", ["run", str(tmp_path / "it.k"), "--units", "t-mm-s"]
    assert main(words) == 2
    assert "name them in leave_out (--leave-out)" in capsys.readouterr().err
    assert main([*words, "--leave-out", "DAMPING_*", "--out", str(out)]) == 0
    wanted = mca.run(by_hand(), device="cpu")
    assert wanted.F_n.max() > 100.0
    np.testing.assert_array_equal(mca.load(out).F_n, wanted.F_n)


def test_units_belong_to_decks(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    from warp_mca.cli.main import main

    (tmp_path / "it.k").write_text(deck("columns"))
    for words, error in (
        (
            ["two_link", "--units", "SI"],
            "--units = 'SI': it gives those of a keyword deck (.k, .key, .dyn); leave it out",
        ),
        ([str(tmp_path / "it.k"), "--units", "SI", "--set", "mu=0.1"], "--set = 'mu': a deck has no parameters"),
        (["two_link", "--leave-out", "HOURGLASS"], "--leave-out = 'HOURGLASS': it is for decks that run with --units"),
        ([str(tmp_path / "it.k"), "--leave-out", "HOURGLASS"], "it is for decks that run with --units"),
    ):
        assert main(["run", *words]) == 2
        assert error in capsys.readouterr().err
    assert main(["run", str(tmp_path / "it.k")]) == 0
    assert "--units t-mm-s, or others, runs the deck's own materials" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            "*ELEMENT_SHELL\n9,1,1,2,3,4\n*DAMPING_GLOBAL\n0,1.\n",
            r"\*ELEMENT_SHELL \(line \d+\), \*DAMPING_GLOBAL .*are not",
        ),
        (
            "*CONTACT_AUTOMATIC_SURFACE_TO_SURFACE\n2,1,3,3\n0.1,0,0,0,0,0,0,1e-7\n",
            "birth and death times are not read",
        ),
        ("*BOUNDARY_SPC_NODE\n112,4,1\n*DEFINE_COORDINATE_SYSTEM\n4,0,0,0,1,1,0\n0,1,0\n", "is none of the world"),
        ("*INITIAL_VELOCITY_NODE\n101,0,0,9.\n", "velocities of hammer are not those of a rigid motion.* node 101"),
        (
            "*LOAD_BODY_Z\n1,1.\n*DEFINE_CURVE\n1\n0,9810\n1e-7,9810\n",
            "goes from 0 to 1e-07 s, the run from 0 to 2e-06 s",
        ),
        ("*CASE_BEGIN_1\n*INITIAL_VELOCITY_NODE\n101,0,0,0.\n*CASE_END_1\n", r"\*CASE_BEGIN_1 .*\*CASE_END_1"),
        ("*RIGIDWALL_PLANAR\n0\n0,0,-1,0,0,0,2.\n", "FRIC = 2 is not read"),
        ("*PART\nthird\n3,1,9\n*ELEMENT_SOLID\n9,3,1,2,4,3,5,6,8,7\n", "part 3 has no material 9"),
        ("*SENSOR_CONTROL\n1,CONTACT,1\n1,ON\n", r"\*SENSOR_CONTROL .* not read"),
        ("*CONTROL_TERMINATION\n1e-6,100\n", "ENDCYC = 100 is not read"),
        ("*INITIAL_VELOCITY\n77\n1.\n", "there is no .SET_NODE 77; add it to the deck"),
    ],
)
def test_what_is_not_understood_is_refused(tmp_path: Path, more: str, words: str):
    with pytest.raises(mca.RequestError, match=words):
        read(tmp_path, deck("columns", more))


def test_keywords_are_left_out_when_asked(tmp_path: Path):
    (tmp_path / "it.k").write_text(deck("columns", "*DAMPING_GLOBAL\n0,1.\n*HOURGLASS\n1,4\n"))
    found = mca.read_deck(tmp_path / "it.k", "t-mm-s", leave_out=["damping_*"])
    assert isinstance(found.bodies[0].geometry, mca.Mesh)
    words = " ".join(found.bodies[0].geometry.notes)
    assert "*HOURGLASS (line" in words and "*DAMPING_GLOBAL (line" in words


def test_all_keywords_that_are_not_read_are_listed(tmp_path: Path):
    silent = ("DATABASE_BINARY_D3PLOT", "CONTROL_ENERGY", "CONTROL_OUTPUT", "CONTROL_SHELL", "SENSOR_DEFINE_NODE")
    own, empty = ("CONTROL_HOURGLASS", "CONTROL_ACCURACY", "CONTROL_SOLID"), "DAMPING_GLOBAL"
    more = "".join(f"*{name}\n{card('columns', [1])}" for name in (*silent, *own, "FROBNICATE")) + f"*{empty}\n"
    (tmp_path / "it.k").write_text(deck("columns", more))
    mesh = mca.read_deck(tmp_path / "it.k", "t-mm-s", ["FROB*"]).bodies[0].geometry
    assert isinstance(mesh, mca.Mesh)
    words = mesh.notes
    for why, names in (
        ("left out, which changes no result", ("DATABASE_GLSTAT", *silent)),
        ("are left to the elements of this program", own),
        ("is left out, without cards", (empty,)),
        ("is left out, as asked", ("FROBNICATE",)),
    ):
        (note,) = (note for note in words if note.endswith(why))
        assert [name.split(" ")[0] for name in note.split("*")[1:]] == list(names)
    assert not any(word in note for word in ("TITLE", "KEYWORD") for note in words)


@pytest.mark.parametrize(("slsfac", "endeng", "told"), [(0.1, 0.0, 0), (0.5, 0.0, 1), (0.0, 0.1, 1), (0.5, 0.1, 2)])
def test_factors_of_penalties_and_ends_by_energy_are_said_to_be_left_out(
    tmp_path: Path, slsfac: float, endeng: float, told: int
):
    more = "*CONTROL_CONTACT\n" + card("usual", [slsfac])
    more += "*CONTROL_TERMINATION\n" + card("usual", [2e-6, 0, 0.0, endeng])
    notes = mca.mesh(read(tmp_path, deck("usual", more)))["anvil"].notes
    assert len([note for note in notes if "are left out: " in note]) == told
