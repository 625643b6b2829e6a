"""Keyword files of LS-DYNA: nodes, solids of each shape, parts and sets, in columns and between commas."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.geometry.keyword_file import read_keywords
from warp_mca.geometry.quality import check, volumes

# A unit cube, on it a wedge of volume 1/2, beside it a pyramid of volume 1/3, before it a tetrahedron of volume 1/6.
POINTS = {
    **{k + 1: (x, y, z) for k, (x, y, z) in enumerate([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])},
    **{k + 11: (x, y, z) for k, (x, y, z) in enumerate([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])},
    21: (0, 0.5, 2),
    22: (1, 0.5, 2),
    31: (2, 0.5, 0.5),
    41: (0, -1, 0),
    99: (9, 9, 9),
}
SOLIDS = {
    1: (1, (1, 2, 3, 4, 11, 12, 13, 14)),
    2: (2, (11, 12, 13, 14, 21, 22, 22, 21)),
    5: (2, (2, 3, 13, 12, 31, 31, 31, 31)),
    7: (1, (1, 2, 11, 41, 41, 41, 41, 41)),
}
WEDGE = (14, 11, 12, 13, 21, 21, 22, 22)  # its last nodes are those of the edge
WEDGE18 = "1,2,3,11,12,13,14,21,22,\n31,41,99,2,3,4,11,12,13\n"  # as gmsh writes one
HEAD = "*KEYWORD\n$ a comment\n*TITLE\nparts\n"
TAIL = """*PART
steel block
         1         1         1
*PART

         2         1         1
*SET_NODE_LIST_TITLE
top edge
         7
        21        22
*SET_NODE_LIST
         3       0.0
         1         2
        41
*SET_SEGMENT
         4
         1         2         3         4
*SET_NODE_LIST_GENERATE
         5
        11        14
*END
"""


def columns(nodes: list[int], two_cards: bool) -> str:
    head = "".join(f"{n:8d}" for n in nodes[:2])
    return head + ("\n" if two_cards else "") + "".join(f"{n:8d}" for n in nodes[2:]) + "\n"


def test_parameters_and_long_fields(tmp_path: Path):
    """A set from a formula, nodes in fields of 20 columns, numbers of solids in ten."""
    text = deck("columns")
    nodes = "".join(f"{n:20d}{x:20.9e}{y:20.9e}{z:20.9e}\n" for n, (x, y, z) in POINTS.items())
    start = text.index("*NODE")
    cells = "".join("".join(f"{n:10d}" for n in (k, part, *own)) + "\n" for k, (part, own) in SOLIDS.items() if k != 2)
    rest = text[text.index("*PART") :].replace("        11        14\n", "      &low     &high\n")
    formula = "*PARAMETER\nI      low        11\n*PARAMETER_EXPRESSION\nI     high  low + sqrt(9)\n"
    (tmp_path / "it.k").write_text(f"{text[:start]}*NODE+\n{nodes}*ELEMENT_SOLID%\n{cells}{formula}{rest}")
    mesh = mca.MeshFile(tmp_path / "it.k").build()
    assert sorted(volumes(mesh)) == pytest.approx([1 / 6, 1 / 3, 1])
    assert {tuple(mesh.points[n].tolist()) for n in mesh.nodes("set_5")} == {POINTS[n] for n in range(11, 15)}


def deck(layout: str) -> str:
    """The parts in one of the layouts of cards."""
    solids = {**SOLIDS, 2: (2, WEDGE)}
    rows = [[number, part, *nodes] for number, (part, nodes) in solids.items()]
    if layout == "commas":
        nodes = "".join(f"{n}, {x}, {y}, {z}\n" for n, (x, y, z) in POINTS.items())
        cells = "".join(", ".join(map(str, row)) + "\n" for row in rows)
    else:
        nodes = "".join(f"{n:8d}{x:16.9e}{y:16.9e}{z:16.9e}       0       0\n" for n, (x, y, z) in POINTS.items())
        cells = "".join(columns(row, layout == "two cards") for row in rows)
    return f"{HEAD}*NODE\n{nodes}*ELEMENT_SOLID\n{cells}{TAIL}"


@pytest.mark.parametrize("layout", ["columns", "two cards", "commas"])
def test_solids_parts_and_sets(tmp_path: Path, layout: str):
    (tmp_path / "it.k").write_text(deck(layout))
    mesh = mca.MeshFile(tmp_path / "it.k", scale=0.1).build()
    check(mesh, "it")
    assert [len(mesh.hexahedra), len(mesh.tetrahedra), len(mesh.points)] == [3, 1, len(POINTS) - 1]
    assert sorted(volumes(mesh)) == pytest.approx([1e-3 / 6, 1e-3 / 3, 1e-3 / 2, 1e-3])
    assert volumes(mesh)[mesh.cell_sets["steel block"]] == pytest.approx([1e-3, 1e-3 / 6])
    assert volumes(mesh)[mesh.cell_sets["part_2"]] == pytest.approx([1e-3 / 2, 1e-3 / 3])
    places = {
        name: {tuple(np.round(10 * mesh.points[n], 6).tolist()) for n in mesh.nodes(name)} for name in mesh.node_sets
    }
    wanted = {"top edge": (21, 22), "set_3": (1, 2, 41), "set_4": (1, 2, 3, 4), "set_5": (11, 12, 13, 14)}
    assert places == {name: {POINTS[n] for n in members} for name, members in wanted.items()}


def test_elements_other_than_solids_are_left_out_with_a_word(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    shell = f"*ELEMENT_SHELL_THICKNESS\n{columns([9, 3, 1, 2, 3, 4], False)}*ELEMENT_BEAM\n"
    (tmp_path / "it.k").write_text(deck("columns").replace("*ELEMENT_SOLID", f"{shell}*ELEMENT_SOLID"))
    assert len(mca.MeshFile(tmp_path / "it.k").build().hexahedra) == 3
    (record,) = caplog.records
    assert record.getMessage().endswith("left out are 1 cards of *ELEMENT_SHELL_THICKNESS")


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (
            "*ELEMENT_BEAM\n       1       1       2       3\n       2       1       2       3\n",
            "2 cards of .ELEMENT_BEAM",
        ),
        ("*ELEMENT_MASS\n       1       2     0.1\n", "1 cards of .ELEMENT_MASS"),
        ("*CONSTRAINED_NODAL_RIGID_BODY\n1,0,3\n*MAT_ELASTIC\n1,1.,1.,.3\n", "1 constraints .*1 materials"),
        ("*LOAD_NODE_SET\n1,1,1\n*RIGIDWALL_PLANAR\n1,1\n", "loads .*1 constraints"),
        ("*SET_NODE_GENERAL\n1\nALL\n", r"1 sets \(.SET_NODE_GENERAL\)"),
        ("*PART_INERTIA\nname\n1,1,1\n0.,0.,0.,1.\n", "1 inertias of parts"),
        ("*FROBNICATE\n1\n", r"other keywords \(.FROBNICATE\)"),
        ("*SET_NODE\n6\n1,888\n", "1 numbers in sets that nothing has"),
        ("*DEFINE_CURVE\n1\n0.,1.\n*SECTION_SOLID\n1,1\n", "1 definitions .*1 sections"),
        (
            "*CONTROL_TERMINATION\n0.1\n*DATABASE_GLSTAT\n1.\n*DATABASE_FORMAT\n",
            r"1 settings .*2 requests of output \(.DATABASE_GLSTAT, .DATABASE_FORMAT\)$",
        ),
        ("*TITLE\nit\n*COMMENT\nword\n", "^$"),
    ],
)
def test_what_is_left_out_is_counted(tmp_path: Path, lines: str, words: str):
    (tmp_path / "it.k").write_text(deck("columns").replace("*NODE", f"{lines}*NODE", 1))
    assert re.search(words, " ".join(mca.MeshFile(tmp_path / "it.k").build().notes))


def test_sets_of_segments_columns_and_solids(tmp_path: Path):
    """A segment has four nodes, of which 0 is none, and numbers behind them that are not read."""
    sets = (
        "*SET_SEGMENT\n         8       0.0       0.0       0.0       0.0MECH\n"
        "        11        12        21         0       0.0       1.5\n"
        "*SET_NODE_COLUMN\n9\n        41       2.5\n        31\n*SET_SOLID_TITLE\nends\n1\n2,7\n"
        "*SET_SOLID_GENERATE\n2\n1,3\n"
    )
    (tmp_path / "it.k").write_text(deck("columns").replace("*NODE", f"{sets}*NODE", 1))
    mesh = mca.MeshFile(tmp_path / "it.k").build()
    assert [len(mesh.nodes(name)) for name in ("set_8", "set_9")] == [3, 2]
    assert volumes(mesh)[mesh.cell_sets["ends"]] == pytest.approx([1 / 2, 1 / 6])
    assert sorted(volumes(mesh)[mesh.cell_sets["set_2"]]) == pytest.approx([1 / 2, 1])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("*TITLE", "*INCLUDE", "line 4: there is no file parts, which .INCLUDE names"),
        ("*TITLE", "*INCLUDE_TRANSFORM", "INCLUDE_TRANSFORM is not read"),
        ("*TITLE\nparts", "*PARAMETER\nx,1", "line 4: parameter 'x' has no type; begin its name with R, I or C"),
        ("        11        14\n", "      &low        14\n", "there is no parameter low; give it before it is used"),
        ("*TITLE\nparts", "*PARAMETER_EXPRESSION\nR x       open(1)", "the formula 'open.1.' is not read"),
        ("*TITLE", "*PART_MOVE", "PART_MOVE is not read: it moves nodes"),
        ("*TITLE", "*NODE_TRANSFORM", "NODE_TRANSFORM is not read"),
        ("*TITLE", "*DEFINE_TRANSFORMATION", "DEFINE_TRANSFORMATION is not read"),
        ("*TITLE", "*SET_NODE_LIST_COLLECT", "SET_NODE_LIST_COLLECT is not read: it adds to other sets"),
        ("*PART\n", "*NODE\n11, 0, 0, 1.01\n*PART\n", "node 11 is given twice"),
        ("*PART\n", "*ELEMENT_SOLID\n7,1,1,2,11,41\n*PART\n", "element 7 is given twice"),
        ("*PART\n", f"*ELEMENT_SOLID\n8,1,{WEDGE18}*PART\n", "a solid with 18 nodes is of no known type"),
        ("*ELEMENT_SOLID", "*ELEMENT_SOLID_ORTHO", "ELEMENT_SOLID_ORTHO is not read"),
        ("      31      31\n", "      31      14\n", "is of no known type"),
        ("       1       2       3       4", "       1       2       3       8", "has node 8, which is not given"),
        ("       1       2       3       4", "       1       2       x       4", "line 20: 'x' is no whole number"),
    ],
)
def test_what_is_not_read_is_refused(tmp_path: Path, old: str, new: str, words: str):
    text = deck("columns")
    assert old in text
    (tmp_path / "it.key").write_text(text.replace(old, new, 1))
    with pytest.raises(mca.RequestError, match=rf"the reader of keyword files cannot read it \(.*{words}"):
        mca.MeshFile(tmp_path / "it.key").build()


def test_wedges_of_gmsh_are_those_of_ls_dyna(tmp_path: Path):
    """gmsh 4.15 writes the corners of a wedge in another order; the first line of its files says who wrote them."""
    corners = ((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (0, 1, 1))  # one triangle, then the other
    nodes = "".join(f"{k},{x},{y},{z}\n" for k, (x, y, z) in enumerate(corners, 1))
    found = []
    for title, solid in (
        ("$ by hand", "1,1,1,2,5,4,3,3,6,6"),
        ("$# LS-DYNA Keyword file created by Gmsh", "1,1,1,2,3,4,5,5,6,6"),
    ):
        file = tmp_path / "wedge.k"
        file.write_text(f"{title}\n*KEYWORD\n*NODE\n{nodes}*ELEMENT_SOLID\n{solid}\n*END\n")
        (block,) = read_keywords(file)[0].cells
        assert block.type == "wedge"
        found.append(block.data.tolist())
    assert found[0] == found[1] == [[0, 1, 2, 3, 4, 5]]
