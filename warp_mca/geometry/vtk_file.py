"""Owns the reading of VTK files by VTK itself, which knows cells and encodings that meshio does not."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.errors import RequestError

if TYPE_CHECKING:
    import meshio

VTK_SUFFIXES = (".vtk", ".vtu")
# By VTK's code: meshio's name, and the corners in its order. Lagrange cells of any order have their corners first.
_CELLS: dict[int, tuple[str, tuple[int, ...]]] = {
    **{1: ("vertex", (0,)), 3: ("line", (0, 1)), 5: ("triangle", (0, 1, 2)), 9: ("quad", (0, 1, 2, 3))},
    **{8: ("quad", (0, 1, 3, 2)), 11: ("hexahedron", (0, 1, 3, 2, 4, 5, 7, 6))},  # pixel and voxel
    **{10: ("tetra", (0, 1, 2, 3)), 12: ("hexahedron", tuple(range(8))), 13: ("wedge", tuple(range(6)))},
    14: ("pyramid", tuple(range(5))),
}
_QUADRATIC = {
    **{21: 3, 35: 3, 68: 3, 22: 5, 34: 5, 69: 5, 23: 9, 28: 9, 30: 9, 70: 9},
    **{24: 10, 71: 10, 25: 12, 29: 12, 33: 12, 72: 12, 26: 13, 31: 13, 32: 13, 73: 13, 27: 14, 37: 14, 74: 14},
}
_FLAT = {2: "poly_vertex", 4: "poly_line", 6: "triangle_strip", 7: "polygon"}


def cell_count(path: Path) -> int | None:
    """Number of cells that a file of an unstructured grid announces; None where it is of another kind."""
    data = path.read_bytes()
    if path.suffix.lower() == ".vtu":
        head = data.partition(b"<AppendedData")[0]
        found = [m[1] for m in re.finditer(rb"<Piece\b[^>]*\bNumberOfCells\s*=\s*[\"']\s*(\d+)", head)]
    else:
        found = re.findall(rb"^CELL_TYPES\s+(\d+)\s*$", data, re.MULTILINE)[:1]
    return sum(map(int, found)) if found else None


def read_by_vtk(path: Path) -> tuple[meshio.Mesh, dict[str, int]]:
    """The cells of a file by their corners, and the number of quadratic ones and of higher order by VTK's name.

    Raises:
        RequestError: VTK is not installed.
        ValueError: it cannot read the file, or this holds solids of other kinds.
    """
    import meshio

    grid = _grid(path)
    from vtkmodules.util.numpy_support import vtk_to_numpy

    try:
        codes = vtk_to_numpy(grid.GetCellTypes())
    except TypeError:  # before VTK 9.6
        codes = vtk_to_numpy(grid.GetCellTypesArray())
    table = grid.GetCells()
    starts, nodes = vtk_to_numpy(table.GetOffsetsArray()), vtk_to_numpy(table.GetConnectivityArray())
    physical = grid.GetCellData().GetArray("gmsh:physical")
    tags = None if physical is None else vtk_to_numpy(physical)
    cells: list[Any] = []
    groups: list[np.ndarray] = []
    quadratic: dict[str, int] = {}
    for code in map(int, np.unique(codes)):
        own = np.flatnonzero(codes == code)
        name = grid.GetCell(int(own[0])).GetClassName()
        if code in _FLAT:
            kind, corners = _FLAT[code], (0,)
        elif _QUADRATIC.get(code, code) in _CELLS:
            kind, corners = _CELLS[_QUADRATIC.get(code, code)]
        else:
            raise ValueError(f"it holds {len(own)} cells of the type {name}")
        if code in _QUADRATIC and _QUADRATIC[code] >= 10:
            quadratic[name] = len(own)
        cells.append((kind, nodes[starts[own][:, None] + np.array(corners)].astype(np.int64)))
        groups.append(np.zeros(len(own), int) if tags is None else tags[own])
    data: dict[str, Any] = {} if tags is None else {"gmsh:physical": groups}
    return meshio.Mesh(vtk_to_numpy(grid.GetPoints().GetData()).astype(np.float64), cells, cell_data=data), quadratic


def _grid(path: Path) -> Any:
    """The unstructured grid of a file; a structured one is made one."""
    try:
        from vtkmodules.vtkFiltersCore import vtkAppendFilter
        from vtkmodules.vtkIOLegacy import vtkDataSetReader
        from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader
    except ImportError as error:
        what = f"VTK, which may read it, cannot be imported ({error}): pip install 'warp_mca[meshes]'"
        raise RequestError(what) from error
    with _quiet():
        reader = vtkXMLUnstructuredGridReader() if path.suffix.lower() == ".vtu" else vtkDataSetReader()
        reader.SetFileName(str(path))
        reader.Update()
        found = reader.GetOutput()
        if reader.GetErrorCode() or found is None or not found.GetNumberOfCells():
            raise ValueError("VTK finds no cells in it")
        joined = vtkAppendFilter()
        joined.AddInputData(found)
        joined.Update()
        return joined.GetOutput()


@contextmanager
def _quiet() -> Iterator[None]:
    """Without what VTK prints."""
    from vtkmodules.vtkCommonCore import vtkObject

    shown = vtkObject.GetGlobalWarningDisplay()
    vtkObject.GlobalWarningDisplayOff()
    try:
        yield
    finally:
        vtkObject.SetGlobalWarningDisplay(shown)
