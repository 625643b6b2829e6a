"""Abaqus and CalculiX input files: nodes, solids and sets as the format says, what is refused and what is left out."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.geometry.quality import volumes

# Two unit cubes on each other, then a column of two more beside them.
POINTS = {1 + i + 2 * j + 4 * k: (i, j, k) for k in range(3) for j in range(2) for i in range(2)}
NODES = "".join(f"{n}, {x}., {y}., {z}.\n" for n, (x, y, z) in POINTS.items())
LOW, HIGH = "1, 1,2,4,3,5,6,8,7\n", "2, 5,6,8,7,9,10,12,11\n"
MESH = f"*NODE\n{NODES}*ELEMENT, TYPE=C3D8, ELSET=all\n{LOW}{HIGH}"


@pytest.fixture
def read(tmp_path: Path):
    """Builds the mesh of a text; beside it, the sentences about what is left out."""

    def build(text: str) -> tuple[mca.Mesh, str]:
        (tmp_path / "it.inp").write_text(text)
        mesh = mca.MeshFile(tmp_path / "it.inp").build()
        return mesh, " ".join(mesh.notes)

    return build


def heights(mesh: mca.Mesh, name: str) -> list[float]:
    """Heights of the nodes of a set."""
    return sorted(mesh.points[mesh.nodes(name), 2].tolist())


SETS: list[tuple[str, dict[str, list[int]], dict[str, list[int]]]] = [  # lines; cells of sets; nodes of sets
    ("*ELSET, ELSET=xy\nx,y\n*ELSET, ELSET=x\n1\n*elset,elset=Y\n2,\n", {"xy": [0, 1], "x": [0], "Y": [1]}, {}),
    ("*ELSET, ELSET=x\n1\n*ELSET, ELSET=X\n2\n", {"x": [0, 1]}, {}),
    ("*ELSET, ELSET=x, GENERATE\n1, 2\n", {"x": [0, 1]}, {}),
    ("*ELSET, ELSET=x, GENERATE\n2,\n", {"x": [1]}, {}),
    ("*NSET, NSET=n, GENERATE\n1, 11, 5\n9, 10\n", {}, {"n": [1, 6, 9, 10, 11]}),
    ("*NSET, NSET=n, GENERATE\n1, 2000000000, 4\n", {}, {"n": [1, 5, 9]}),
    (
        "*NSET, NSET=n\n" + ",".join(map(str, range(1, 13))) + ",\n*NSET, NSET=m\n n,\n",
        {},
        {"n": [*range(1, 13)], "m": [*range(1, 13)]},
    ),
    ("*ELSET, ELSET=x\n2\n*NSET, NSET=n, ELSET=x\n", {"x": [1]}, {"n": [*range(5, 13)]}),
    ("*NSET, NSET=n\nx, 1\n*ELSET, ELSET=x\n2\n", {"x": [1]}, {"n": [1, *range(5, 13)]}),
    ("*NSET,\nNSET=n\n1\n** a comment\n\n2,3\n", {}, {"n": [1, 2, 3]}),
    ("*NSET, NSET=n,\n1, 2\n", {}, {"n": [1, 2]}),
    ("*NSET, NSET=n, UNSORTED,\nGENERATE\n1, 3\n", {}, {"n": [1, 2, 3]}),
    ('*NSET, NSET="a b"\n4\n* N S E T , nset = n\n"a b", 1\n', {}, {"a b": [4], "n": [1, 4]}),
    ("*ELEMENT, TYPE=S4, ELSET=skin\n7, 9,10,12,11\n", {}, {"skin": [9, 10, 11, 12]}),
]


@pytest.mark.parametrize(("lines", "cell_sets", "node_sets"), SETS)
@pytest.mark.parametrize("before", [False, True])
def test_sets(read, lines: str, cell_sets: dict, node_sets: dict, before: bool):
    """Wherever they stand: sets may come before what they hold."""
    mesh, _ = read(lines + MESH if before else MESH + lines)
    found = {name: sorted(cells.tolist()) for name, cells in mesh.cell_sets.items()}
    assert found == {"all": [0, 1], **cell_sets}
    assert set(mesh.node_sets) == set(node_sets)
    for name, members in node_sets.items():
        assert heights(mesh, name) == sorted(POINTS[n][2] for n in members)


def test_nodes_of_several_blocks_and_their_set(read):
    half = NODES.splitlines(keepends=True)
    first, second = "".join(half[:5]), "".join(half[5:]).replace("1., 2.", "1.0D0, 2.000+0")
    mesh, notes = read(f"*Node, nset=n\n{first}*NODE, NSET=N\n{second}*ELEMENT, TYPE=C3D8R\n{LOW}{HIGH}")
    assert volumes(mesh) == pytest.approx([1.0, 1.0]) and not notes
    assert len(mesh.nodes("n")) == 12
    assert read(MESH + "*NODE\n7, 0., 1., 1.0\n")[0].cell_count == 2  # the same node again


def test_elements_that_go_on_in_the_next_line(read):
    numbers = [1, *range(1, 21)]
    cut = [numbers[:11], numbers[11:]]
    rng = np.random.default_rng(1)
    places = np.concatenate([[POINTS[n] for n in (1, 2, 4, 3, 5, 6, 8, 7)], rng.random((12, 3))])
    nodes = "".join(f"{k}, {x}, {y}, {z}\n" for k, (x, y, z) in enumerate(places, 1))
    for end in (",\n", "\n"):
        lines = "".join(",".join(map(str, part)) + end for part in cut)
        mesh, notes = read(f"*NODE\n{nodes}*ELEMENT, TYPE=C3D20R, ELSET=e\n{lines}")
        assert volumes(mesh) == pytest.approx([1.0])
        assert len(mesh.points) == 8 and "1 quadratic cells (hexahedron20) are taken as linear ones" in notes


def part(transform: str = "", assembly: str = "") -> str:
    head = f"*Part, name=Bar\n{MESH}*Nset, nset=Set-1\n1, 2\n*End Part\n*Assembly, name=A\n"
    return f"{head}*Instance, name=Bar-1, part=Bar\n{transform}*End Instance\n{assembly}*End Assembly\n"


def test_a_part_and_its_assembly(read):
    """Numbers of the assembly's own nodes and those of the part are not the same ones."""
    own = "*Node\n1, 9., 9., 9.\n*Nset, nset=Ref\n1,\n*Nset, nset=Set-1, instance=Bar-1\n9, 10\n"
    more = "*Elset, elset=top, instance=Bar-1\n2\n"
    more += "*Nset, nset=both\nSet-1, Bar-1.Set-1, Bar-1.3\n"
    mesh, notes = read(part(transform="0., 0., 0.\n", assembly=own + more))
    assert mesh.points.max() == 2.0 and not notes
    assert heights(mesh, "Set-1") == [2.0, 2.0] and heights(mesh, "Bar-1.Set-1") == [0.0, 0.0]
    assert heights(mesh, "both") == [0.0, 0.0, 0.0, 2.0, 2.0]
    assert mesh.cell_sets["top"].tolist() == [1]


def test_instances_stand_where_the_assembly_puts_them(read, tmp_path: Path):
    """Two bars, the second moved by 10 along x, then turned by 90 degrees about the line x = 10 along z, and a cube."""
    cube = f"*Part, name=Cube\n*NODE\n{NODES}*ELEMENT, TYPE=C3D8\n{LOW}*End Part\n"
    moved = "*Instance, name=Bar-2, part=BAR\n10.\n10., 0., 0., 10., 0., 1., 90.\n*End Instance\n"
    more = f"{moved}*Instance, name=Cube-1, part=Cube\n0., 0., 5.\n*End Instance\n"
    sets = "*Nset, nset=tops, instance=Bar-2\n9, 10\n*Nset, nset=ends\nBar-1.Set-1, Cube-1.8\n*Nset, nset=few\nends\n"
    mesh, notes = read(cube + part(assembly=more + sets))
    assert not notes and volumes(mesh) == pytest.approx([1.0] * 5)
    assert {name: len(cells) for name, cells in mesh.cell_sets.items() if "-" in name[-2:]} == {
        **{"Bar-1": 2, "Bar-2": 2, "Cube-1": 1}
    }
    assert mesh.points[mesh.nodes("tops")] == pytest.approx(np.array([[10.0, 0.0, 2.0], [10.0, 1.0, 2.0]]))
    assert mesh.points[mesh.nodes("Bar-2.Set-1")] == pytest.approx(np.array([[10.0, 0.0, 0.0], [10.0, 1.0, 0.0]]))
    assert heights(mesh, "ends") == heights(mesh, "few") == [0.0, 0.0, 6.0]
    one = mca.MeshFile(tmp_path / "it.inp", only="Bar-2").build()
    assert one.points.min(axis=0) == pytest.approx([9.0, 0.0, 0.0])
    assert one.points.max(axis=0) == pytest.approx([10.0, 1.0, 2.0])
    assert (len(one.points), one.cell_count, len(one.nodes("tops")), len(one.node_sets["ends"])) == (12, 2, 2, 0)
    assert one.cell_sets["Bar-2"].tolist() == [0, 1] and "Cube-1" not in one.cell_sets
    with pytest.raises(mca.RequestError, match=r"cell set = 'Bar-3': the mesh has .*Bar-1"):
        mca.MeshFile(tmp_path / "it.inp", only="Bar-3").build()


LEFT_OUT = [
    ("*ELEMENT, TYPE=S4, ELSET=s\n3, 1,2,4,3\n*ELEMENT, TYPE=B31\n4, 1,2\n5, 2,4\n", "1 S4, 2 B31"),
    ("*ELEMENT, TYPE=MASS, ELSET=m\n3, 1\n*MASS, ELSET=m\n0.2\n", "1 MASS"),
    ("*ELEMENT, TYPE=SPRINGA\n3, 1, 2\n*ELEMENT, TYPE=COH3D8\n4, 1,2,4,3,5,6,8,7\n", "1 SPRINGA, 1 COH3D8"),
    (
        "*RIGID BODY, NSET=n, REF NODE=1\n*EQUATION\n2\n1,1,1.,2,1,-1.\n",
        r"1 rigid bodies .*1 constraints \(\*EQUATION\)",
    ),
    (
        "*MATERIAL, NAME=m\n*ELASTIC\n1.,.3\n*STEP\n*STATIC\n*CLOAD\n1,1,1.\n*END STEP\n",
        "1 materials .*1 steps .*loads",
    ),
    ("*Frobnicate\n1, 2\n", r"other keywords \(\*FROBNICATE\)"),
    ("*NSET, NSET=n\n1, 77\n", "1 numbers in sets that nothing has"),
    ("*ELEMENT, TYPE=CPS4, ELSET=Surface1\n3, 1,2,4,3\n", "^$"),  # as gmsh marks a face
    ("*ELEMENT, TYPE=CPS4, ELSET=Surface1\n3, 1,2,12,11\n", "1 CPS4"),
    ("*ELEMENT, TYPE=T3D2, ELSET=Line1\n3, 1,2\n*ELEMENT, TYPE=T3D2, ELSET=Line2\n4, 1,12\n", "are 1 T3D2"),
    ("*ELEMENT, TYPE=T3D2, ELSET=tie\n3, 1,2\n", "1 T3D2"),
    ("*HEADING\na\n*SOLID SECTION, ELSET=all\n*TRANSFORM, NSET=n\n0.,0.,1.,1.,0.,0.\n*SYSTEM\n*NODE PRINT\nU\n", "^$"),
]


@pytest.mark.parametrize(("lines", "words"), LEFT_OUT)
def test_what_is_left_out_is_counted(read, lines: str, words: str, caplog: pytest.LogCaptureFixture):
    import re

    mesh, notes = read(MESH + lines)
    assert mesh.cell_count == 2 and re.search(words, notes)
    assert [record.getMessage() for record in caplog.records] == list(mesh.notes)


def test_a_run_has_it_among_its_warnings(tmp_path: Path):
    """Of each scene of a batch, also where a mesh is cut to tetrahedra, or is one of several parts."""
    (tmp_path / "it.inp").write_text(MESH + "*ELEMENT, TYPE=S4\n3, 1,2,4,3\n")
    steel, file = mca.Elastic(E=210e9, nu=0.3, rho=7850.0), mca.MeshFile(tmp_path / "it.inp", scale=0.01)
    block = mca.Part(name="c", geometry=mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1)), at=(0.05, 0.0, 0.0))
    both = mca.Parts(parts=(mca.Part(name="a", geometry=file), block))
    bodies = (
        mca.Body(name="b", geometry=file, material=steel),
        mca.Body(name="b", geometry=file, material=steel, element="tet4"),
        mca.Body(name="b", geometry=both, material=steel),
    )
    impact = mca.ImpactPhase(duration=1e-7, output_interval=1e-7)
    scenes = [mca.Scene(name="s", bodies=(body,), impact=impact) for body in bodies]
    for result in mca.run_batch(scenes, device="cpu"):
        assert sum("left out are 1 S4" in text for text in result.warnings) == 1


REFUSED: Iterable[tuple[str, str]] = [
    ("*INCLUDE, INPUT=x.inp\n", r"line 17: \*INCLUDE is not read: it puts another file in"),
    ("*ELGEN, ELSET=e\n1, 2, 4, 1\n", r"\*ELGEN is not read"),
    ("*ELCOPY, OLD SET=a, NEW SET=b\n", r"\*ELCOPY is not read"),
    ("*NGEN\n1, 3, 1\n", r"\*NGEN is not read"),
    ("*NFILL\na, b\n", r"\*NFILL is not read"),
    ("*NCOPY\na, b\n", r"\*NCOPY is not read"),
    ("*SYSTEM\n0., 0., 5.\n", r"\*SYSTEM is not read"),
    ("*PARAMETER\na = 2\n", r"\*PARAMETER is not read"),
    ("*NODE, SYSTEM=C\n20, 1., 90., 0.\n", "SYSTEM other than R"),
    ("*NODE, INPUT=x\n", r"\*NODE with the parameter INPUT"),
    ("*NODE\n3, 0., 1., 0.1\n", "node 3 is given twice"),
    ("*ELEMENT, TYPE=C3D8\n1, 1,2,4,3,5,6,8,7\n", "element 1 is given twice"),
    ("*ELEMENT, TYPE=S4\n2, 1,2,4,3\n", "element 2 is given twice"),
    ("*ELEMENT, TYPE=C3D8\n3, 1,2,4,3,5,6,8\n", "element 3 has 7 nodes in place of 8"),
    ("*ELEMENT, TYPE=C3D8\n3, 1,2,4,3,5,6,8,77\n", "element 3 has node 77, which is not given"),
    ("*ELEMENT, TYPE=C3D15V\n3, 1,2,4,3,5,6,8,77\n", "type C3D15V are not read"),
    ("*ELSET, ELSET=x\ny\n", "set x holds set Y, which is not given"),
    ("*ELSET, ELSET=x\ny\n*ELSET, ELSET=y\n1, x\n", "set x holds itself"),
    ("*NSET, NSET=x, ELSET=y\n", "node set x is that of element set Y"),
    ("*NSET\n1\n", "NSET lacks a name"),
    ("*NODE\n20, a, 0., 0.\n", "line 18: 'a' is no number"),
]


@pytest.mark.parametrize(("lines", "words"), REFUSED)
def test_what_would_change_the_mesh_is_refused(read, lines: str, words: str):
    with pytest.raises(mca.RequestError, match=rf"it\.inp.*the reader of Abaqus files cannot read it \(.*{words}"):
        read(MESH + lines)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (part(transform="0., 0.\n0., 0., 0., 0., 0., 1.\n"), "INSTANCE takes a translation and, in a second line"),
        (part(transform="0.\n1., 0., 0., 1., 0., 0., 30.\n"), "two points of the axis of an .INSTANCE are one"),
        (part(assembly="*Instance, name=BAR-1, part=Bar\n*End Instance\n"), "instance BAR-1 is given twice"),
        (part(assembly="*Instance, name=b, part=Rod\n*End Instance\n"), r"no \*PART Rod for instance b"),
        (part() + f"*Part, name=bar\n{MESH}*End Part\n", "part bar is given twice"),
        (part(assembly="*Nset, nset=n, instance=Rod-1\n1\n"), r"no \*INSTANCE Rod-1"),
    ],
)
def test_parts_that_cannot_be_placed_are_refused(read, text: str, words: str):
    with pytest.raises(mca.RequestError, match=words):
        read(text)
