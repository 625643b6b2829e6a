"""Nastran bulk data: grid points in their systems, solids and properties, what is refused and what is left out."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.geometry.quality import check, volumes

# A unit cube, on it a wedge of volume 1/2, beside it a pyramid of volume 1/3, before it a tetrahedron of volume 1/6.
POINTS = {
    **{k + 1: (x, y, z) for k, (x, y, z) in enumerate([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)])},
    **{k + 11: (x, y, z) for k, (x, y, z) in enumerate([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])},
    **{21: (0, 0.5, 2), 22: (1, 0.5, 2), 31: (2, 0.5, 0.5), 41: (0, -1, 0), 99: (9, 9, 9)},
}
SOLIDS = {
    1: ("CHEXA", 5, (1, 2, 3, 4, 11, 12, 13, 14)),
    2: ("CPENTA", 7, (11, 14, 21, 12, 13, 22)),
    3: ("CPYRAM", 7, (2, 3, 13, 12, 31)),
    4: ("CTETRA", "", (1, 2, 11, 41)),  # without a property, which is then its number
}


def card(name: str, fields: list, layout: str) -> str:
    """A card and the lines that it goes on in."""
    wide = layout == "wide"
    count, texts = 4 if wide else 8, [str(field) for field in fields]
    rows = [texts[k : k + count] for k in range(0, len(texts), count)]
    if layout == "commas":
        return "".join(f"{name if not k else ''},{','.join(row)}\n" for k, row in enumerate(rows))
    heads = [f"{name}*" if wide else name] + [("*" if wide else "+") + f"C{k}" for k in range(1, len(rows))]
    marks = [*heads[1:], ""]
    width = 16 if wide else 8
    return "".join(
        f"{head:8s}{''.join(f'{t:>{width}s}' for t in row):64s}{mark}\n"
        for head, row, mark in zip(heads, rows, marks, strict=True)
    )


def deck(layout: str = "columns", cp: str | int = "", points: dict = POINTS, more: str = "") -> str:
    grid = "".join(
        card("GRID", [n, cp, *(f"{x:.6g}" if x % 1 else f"{x:.0f}." for x in p)], layout) for n, p in points.items()
    )
    solids = "".join(card(name, [n, part, *nodes], layout) for n, (name, part, nodes) in SOLIDS.items())
    return f"SOL 101\nCEND\nDISP = ALL\nBEGIN BULK\n$ a comment\n{more}{grid}{solids}ENDDATA\n"


def read(folder: Path, text: str, suffix: str = ".bdf") -> mca.Mesh:
    (folder / f"it{suffix}").write_text(text)
    return mca.MeshFile(folder / f"it{suffix}").build()


@pytest.mark.parametrize("layout", ["columns", "wide", "commas"])
@pytest.mark.parametrize("suffix", [".bdf", ".nas", ".fem"])
def test_solids_by_property(tmp_path: Path, layout: str, suffix: str):
    mesh = read(tmp_path, deck(layout).replace("CPENTA", "cpenta"), suffix)
    check(mesh, "it")
    assert sorted(volumes(mesh)) == pytest.approx([1 / 6, 1 / 3, 1 / 2, 1])
    assert volumes(mesh)[mesh.cell_sets["part_7"]] == pytest.approx([1 / 2, 1 / 3])
    assert volumes(mesh)[mesh.cell_sets["part_4"]] == pytest.approx([1 / 6])
    assert len(mesh.points) == len(POINTS) - 1 and not mesh.notes


def cylindrical(p: tuple) -> tuple:
    return math.hypot(p[0], p[1]), math.degrees(math.atan2(p[1], p[0])), p[2]


def spherical(p: tuple) -> tuple:
    r = math.hypot(*p)
    return r, math.degrees(math.acos(p[2] / r)) if r else 0.0, math.degrees(math.atan2(p[1], p[0]))


AXES = np.array([[0.0, -1.0, 0.0], [0.6, 0.0, 0.8], [-0.8, 0.0, 0.6]])  # its rows: x, y, z
ORIGIN = np.array([3.0, -1.0, 0.5])
A, B, C = ORIGIN, ORIGIN + 2.0 * AXES[2], ORIGIN + 1.5 * AXES[0] - 0.3 * AXES[2]
SYSTEM = ",".join(f"{x:.9g}" for x in (*A, *B, *C)).split(",")


def second(kind: str, number: int, reference: str | int, points: list) -> str:
    return card(f"CORD2{kind}", [number, reference, *points], "commas")


@pytest.mark.parametrize(
    ("kind", "own"), [("R", lambda p: p), ("C", cylindrical), ("S", spherical)], ids=["straight", "cylinder", "sphere"]
)
@pytest.mark.parametrize("given", ["by points", "in another", "by grid points", "by default"])
def test_grid_points_in_other_systems(tmp_path: Path, kind: str, own, given: str):
    """The mesh is turned and moved with its system, however that is given."""
    points = {n: own(p) for n, p in POINTS.items()}
    if given == "in another":  # half a turn around z, and back within it
        turned = [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, -1.0, 0.0, 0.0]
        inside = [f"{s * x:.9g}" for row in (A, B, C) for s, x in zip((-1, -1, 1), row, strict=True)]
        more = second("R", 8, "", turned) + second(kind, 3, 8, inside)
    elif given == "by grid points":
        grid = "".join(card("GRID", [200 + k, 0, *(f"{x:.9g}" for x in p)], "commas") for k, p in enumerate((A, B, C)))
        more = grid + card(f"CORD1{kind}", [9, 200, 201, 202, 3, 200, 201, 202], "commas")
    else:
        more = second(kind, 3, 0, SYSTEM)
    if given == "by default":
        more, cp = more + "GRDSET,,3\n", ""
    else:
        cp = 3
    mesh = read(tmp_path, deck("commas", cp, points, more).replace("E", "E"))
    plain = read(tmp_path, deck("commas"))
    assert mesh.points == pytest.approx(ORIGIN + plain.points @ AXES, abs=1e-5)


LEFT_OUT = [
    ("CQUAD4,9,2,1,2,3,4\nCBAR,10,1,1,2,0.,0.,1.\nPSHELL,2,1,0.1\nCBAR,11,1,2,3,0.,0.,1.\n", "1 CQUAD4, 2 CBAR"),
    ("CTE5RA,9,1,1,2,3,41\n", "1 CTE5RA"),
    ("CONM2,9,1,,0.1\nCONM2,10,2,,0.1\n", r"2 masses \(CONM2\)"),
    ("RBE2,9,1,123,2,3\n", r"1 rigid elements \(RBE2\)"),
    ("SPC1,1,123,1,2\nFORCE,1,1,,1.,0.,0.,1.\nMAT1,1,2.+11,,.3\n", "1 constraints .*1 loads .*1 materials"),
    ("FROBNIC,1\n", r"other keywords \(FROBNIC\)"),
    ("CORD2R,1,0,0.,0.,0.,0.,0.,1.\n,1.,0.,0.\nPARAM,POST,-1\nPSOLID,5,1\n", "^$"),
]


@pytest.mark.parametrize(("lines", "words"), LEFT_OUT)
def test_what_is_left_out_is_counted(tmp_path: Path, lines: str, words: str):
    assert re.search(words, " ".join(read(tmp_path, deck(more=lines)).notes))


def test_faces_that_gmsh_marks_are_no_shells(tmp_path: Path):
    shells = "CQUAD4,9,2,1,2,3,4\nCTRIA3,10,2,1,41,2\nCTRIA3,11,2,1,41,99\n"
    notes = read(tmp_path, "$ Created by Gmsh\n" + deck(more=shells)).notes
    assert len(notes) == 1 and notes[0].endswith("left out are 1 CTRIA3")


REFUSED = [
    ("INCLUDE 'x.bdf'\n", "line 6: INCLUDE is not read: it puts another file in"),
    ("GRID,50,0,1.,2.,3.\n=,*1,=,*1.,==\n", "line 7: = is not read: it makes cards from those before"),
    ("GRID,1,0,0.,0.,0.5\n", "grid point 1 is given twice"),
    ("CTETRA,1,1,1,2,11,41\n", "element 1 is given twice"),
    ("CTETRA,9,1,1,2,11,77\n", "element 9 has node 77, which is not given"),
    ("CHEXA,9,1,1,2,3,4,11,12\n,13\n", "CHEXA 9 has 7 nodes"),
    ("GRID,50,6,1.,2.,3.\n", "grid point 50: coordinate system 6 is not given"),
    ("GRID,50,6,1.,2.,3.\nCORD3G,6\n", "grid point 50: coordinate system 6: CORD3G is not read"),
    ("GRID,50,6,1.,2.,3.\nCORD1R,6,1,2,50\n", "lies in a system that it defines|defined by itself"),
    (
        "CTETRA  9       1       1       2       11      41      \n+B                      \nGRID,50,x\n",
        "no whole number|is no number",
    ),
    ("CHEXA,9,1,1,2,3,4,11,12,+A\n+B,13,14\n", "goes on from B, which does not stand before it"),
    ("BEGIN SUPER=1\n", "superelements"),
]


@pytest.mark.parametrize(("lines", "words"), REFUSED)
def test_what_would_change_the_mesh_is_refused(tmp_path: Path, lines: str, words: str):
    with pytest.raises(mca.RequestError, match=rf"it\.bdf.*the reader of Nastran files cannot read it \(.*({words})"):
        read(tmp_path, deck(more=lines))
