"""The 25 lines of docs/tutorials/drop.md, from a CAD file or a mesh to acceleration, picture, .vtkhdf and table."""

from __future__ import annotations

import math
from pathlib import Path

import h5py
import numpy as np
import pytest
from parts import VOLUME, write_parts
from PIL import Image

from benchmarks.pages import page_blocks

pytest.importorskip("pandas")
PAGE = "tutorials/drop.md"
DRAWING, DROP = [block for block in page_blocks(PAGE) if block.language == "python"][:2]
READ = 'mca.Cad("bracket.step", size=10e-3)'
CAD = {suffix: f'mca.Cad("part.{suffix}", size=12e-3, scale=1e-3)' for suffix in ("iges", "brep", "stl")}
MESHES = {suffix: f'mca.MeshFile("part.{suffix}", scale=1e-3)' for suffix in ("msh", "unv", "bdf", "inp", "k")}

PICTURED = ("stl", "inp")  # a picture takes seconds, and does not know what file the mesh came from


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bracket of the page as gmsh writes it in other formats."""
    write_parts(folder := tmp_path_factory.mktemp("parts"))
    (folder / "part.key").rename(folder / "part.k")
    return folder


def test_the_page_goes_from_a_step_file_to_a_table_in_25_lines():
    """`test_pages.py` runs them."""
    assert 'gmsh.write("bracket.step")' in DRAWING.text and READ in DROP.text
    assert len(DROP.text.splitlines()) <= 25


@pytest.mark.parametrize("suffix", [*CAD, *MESHES])
def test_the_same_lines_drop_other_files(
    suffix: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(folder)
    code = DROP.text.replace(READ, {**CAD, **MESHES}[suffix]).replace("200e-6", "30e-6")
    if suffix not in PICTURED:
        code = code.replace("recorders=[picture, ", "recorders=[")
    assert ("part." in code, "30e-6" in code, "recorders=[picture" in code) == (True, True, suffix in PICTURED)
    names: dict = {}
    exec(compile(code, f"docs/{PAGE}, {suffix}", "exec"), names)
    table, peak = names["table"], names["peak"]
    check(folder, pictured=suffix in PICTURED)
    assert "peak acceleration" in capsys.readouterr().out
    impulse = 1e-6 * table["F_n_N"].sum() / (2700.0 * VOLUME * math.sqrt(2.0 * 9.81 * 2.0))
    assert 0.1 < impulse < 2.0  # over m v; 2 were a rebound without loss
    assert np.linalg.norm(table[["head.ax", "head.ay", "head.az"]], axis=1).max() == pytest.approx(peak)
    assert table.attrs["units"]["head.ax"] == "m/s^2"
    assert names["result"].summary["max_plastic_strain"] > 1e-4


def check(folder: Path, pictured: bool) -> None:
    """That file and picture are there, and show plastic strain."""
    with h5py.File(folder / "drop.vtkhdf") as file:
        assert np.asarray(file["VTKHDF/PointData/plastic_strain"]).max() > 1e-4
    if pictured:
        with Image.open(folder / "drop.png") as picture:
            assert len(picture.convert("RGB").getcolors(1_000_000) or ()) > 50
        (folder / "drop.png").unlink()
