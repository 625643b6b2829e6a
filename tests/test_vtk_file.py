"""VTK files that meshio cannot read, or of which it loses cells: by VTK itself, where it is installed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.geometry import vtk_file
from warp_mca.geometry.quality import volumes

vtk = pytest.importorskip("vtk")

KINDS = {  # name of VTK's type; volume; quadratic
    "VTK_TETRA": (1 / 6, False),
    "VTK_VOXEL": (1.0, False),
    "VTK_HEXAHEDRON": (1.0, False),
    "VTK_WEDGE": (1 / 2, False),
    "VTK_PYRAMID": (1 / 3, False),
    "VTK_QUADRATIC_TETRA": (1 / 6, False),
    "VTK_QUADRATIC_HEXAHEDRON": (1.0, True),
    "VTK_QUADRATIC_WEDGE": (1 / 2, True),
    "VTK_QUADRATIC_PYRAMID": (1 / 3, True),
    "VTK_TRIQUADRATIC_HEXAHEDRON": (1.0, True),
    "VTK_QUADRATIC_LINEAR_WEDGE": (1 / 2, True),
    "VTK_BIQUADRATIC_QUADRATIC_WEDGE": (1 / 2, True),
}


def grid(*kinds: str) -> Any:
    """One cell of each kind, in its natural coordinates, beside each other."""
    made, points = vtk.vtkUnstructuredGrid(), vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for k, kind in enumerate(kinds):
        cell = vtk.vtkGenericCell()
        cell.SetCellType(getattr(vtk, kind))
        places = np.array(cell.GetRepresentativeCell().GetParametricCoords()[: 3 * cell.GetNumberOfPoints()])
        ids = [points.InsertNextPoint(x + 2.0 * k, y, z) for x, y, z in places.reshape(-1, 3)]
        made.InsertNextCell(getattr(vtk, kind), len(ids), ids)
    made.SetPoints(points)
    return made


def write(path: Path, made: Any, version: int = 51, binary: bool = True) -> Path:
    writer = vtk.vtkUnstructuredGridWriter() if path.suffix == ".vtk" else vtk.vtkXMLUnstructuredGridWriter()
    if path.suffix == ".vtk":
        writer.SetFileVersion(version)
        writer.SetFileType(2 if binary else 1)
    writer.SetFileName(str(path))
    writer.SetInputData(made)
    writer.Write()
    return path


@pytest.mark.parametrize(("name", "version", "binary"), [("a.vtk", 42, True), ("a.vtk", 51, False), ("a.vtu", 0, True)])
def test_each_kind_of_cell(tmp_path: Path, name: str, version: int, binary: bool):
    """All in one grid, of which meshio loses voxels without a word, and fails on others."""
    mesh = mca.MeshFile(write(tmp_path / name, grid(*KINDS), version, binary)).build()
    assert sorted(volumes(mesh)) == pytest.approx(sorted(volume for volume, _ in KINDS.values()))
    quadratic = sum(quadratic for _, quadratic in KINDS.values())
    assert [f"{quadratic} quadratic cells" in note for note in mesh.notes] == [True]


@pytest.mark.parametrize("name", ["a.vtk", "a.vtu"])
def test_voxels_are_not_lost(tmp_path: Path, name: str):
    file = write(tmp_path / name, grid("VTK_HEXAHEDRON", "VTK_VOXEL"))
    assert volumes(mca.MeshFile(file).build()) == pytest.approx([1.0, 1.0])


def test_what_meshio_reads_needs_no_vtk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(vtk_file, "find_spec", lambda name: None)
    kinds = ("VTK_TETRA", "VTK_HEXAHEDRON", "VTK_WEDGE", "VTK_PYRAMID", "VTK_QUADRATIC_TETRA")
    mesh = mca.MeshFile(write(tmp_path / "a.vtu", grid(*kinds))).build()
    assert sorted(volumes(mesh)) == pytest.approx(sorted(KINDS[kind][0] for kind in kinds))


def test_faces_that_are_none_of_a_solid_are_told(tmp_path: Path):
    made = grid("VTK_HEXAHEDRON")
    made.InsertNextCell(vtk.VTK_QUAD, 4, [0, 1, 2, 3])
    made.InsertNextCell(vtk.VTK_QUAD, 4, [0, 1, 6, 7])  # both lie in the cube; one is no face, but marks within it
    made.InsertNextCell(vtk.VTK_LINE, 2, [0, 1])
    assert not mca.MeshFile(write(tmp_path / "a.vtu", made)).build().notes
    apart = made.GetPoints().InsertNextPoint(5.0, 5.0, 5.0)
    made.InsertNextCell(vtk.VTK_TRIANGLE, 3, [0, 1, apart])
    (note,) = mca.MeshFile(write(tmp_path / "a.vtu", made)).build().notes
    assert note.endswith("left out are 1 triangle")


def test_what_vtk_cannot_give_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd):
    prism = write(tmp_path / "prism.vtu", grid("VTK_HEXAGONAL_PRISM"))
    with pytest.raises(mca.RequestError, match=r"it holds 1 cells hexa_prism\); save it with tetra"):
        mca.MeshFile(prism).build()
    (tmp_path / "bad.vtk").write_text("# vtk DataFile Version 3.0\nx\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 9 x\n")
    with pytest.raises(mca.RequestError, match="VTK finds no cells in it"):
        mca.MeshFile(tmp_path / "bad.vtk").build()
    monkeypatch.setattr(vtk_file, "find_spec", lambda name: None)
    with pytest.raises(mca.RequestError, match=r"VTK, which may read it, is not installed: pip install 'warp_mca"):
        mca.MeshFile(write(tmp_path / "wedge.vtu", grid("VTK_QUADRATIC_WEDGE"))).build()
    assert capfd.readouterr() == ("", "")


def test_a_crash_of_vtk_is_a_refusal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    (tmp_path / "crash.py").write_text("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)")
    monkeypatch.setattr(vtk_file, "_SCRIPT", tmp_path / "crash.py")
    with pytest.raises(mca.RequestError, match="VTK crashed, as damaged files may make it"):
        mca.MeshFile(write(tmp_path / "wedge.vtu", grid("VTK_QUADRATIC_WEDGE"))).build()
    (tmp_path / "crash.py").write_text("import time; time.sleep(9)")
    monkeypatch.setattr(vtk_file, "_TIME", 0.1)
    with pytest.raises(mca.RequestError, match=r"VTK took more than 0\.\d+ s"):
        mca.MeshFile(tmp_path / "wedge.vtu").build()


def test_structured_files_announce_no_cells(tmp_path: Path):
    (tmp_path / "a.vtk").write_text("# vtk DataFile Version 3.0\nx\nASCII\nDATASET STRUCTURED_POINTS\n")
    assert vtk_file.cell_count(tmp_path / "a.vtk") is None
