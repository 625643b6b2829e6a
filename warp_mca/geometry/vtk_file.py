"""Owns the reading of VTK files by VTK itself, which knows cells and encodings that meshio does not."""

from __future__ import annotations

import io
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.errors import RequestError
from warp_mca.geometry.deck import linear

if TYPE_CHECKING:
    import meshio

VTK_SUFFIXES = (".vtk", ".vtu")
# By VTK's code: meshio's name, and the corners in its order. Lagrange cells of any order have their corners first.
_CELLS: dict[int, tuple[str, tuple[int, ...]]] = {
    **{1: ("vertex", (0,)), 3: ("line", (0, 1)), 5: ("triangle", (0, 1, 2)), 9: ("quad", (0, 1, 2, 3))},
    **{8: ("quad", (0, 1, 3, 2)), 11: ("hexahedron", (0, 1, 3, 2, 4, 5, 7, 6))},  # pixel and voxel
    **{10: ("tetra", (0, 1, 2, 3)), 12: ("hexahedron", tuple(range(8))), 13: ("wedge", tuple(range(6)))},
    **{14: ("pyramid", tuple(range(5))), 24: ("tetra10", tuple(range(10)))},
}
_QUADRATIC = {
    **{21: 3, 35: 3, 68: 3, 22: 5, 34: 5, 69: 5, 23: 9, 28: 9, 30: 9, 70: 9},
    **{71: 10, 25: 12, 29: 12, 33: 12, 72: 12, 26: 13, 31: 13, 32: 13, 73: 13, 27: 14, 37: 14, 74: 14},
}
_TIME, _TIME_PER_BYTE = 20.0, 5e-5  # that VTK may take to start and to read [s], many times what it takes
_SCRIPT = Path(__file__).with_name("vtk_process.py")
_FLAT = {2: "poly_vertex", 4: "poly_line", 6: "triangle_strip", 7: "polygon"}


class VtkError(ValueError):
    """VTK cannot read a file."""


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
    """The cells of a file by their corners, ten-node tetrahedra by all nodes, and the number of quadratic ones and of
    higher order that lost theirs, by meshio's name.

    Raises:
        RequestError: VTK is not installed.
        VtkError: it cannot read the file.
        ValueError: the file holds solids of other kinds.
    """
    import meshio
    from meshio._vtk_common import vtk_to_meshio_type

    grid = _grid(path)
    codes, starts, nodes = grid["types"], grid["offsets"], grid["connectivity"].astype(np.int64)
    cells: list[Any] = []
    groups: list[np.ndarray] = []
    quadratic: dict[str, int] = {}
    for code in map(int, np.unique(codes)):
        own = np.flatnonzero(codes == code)
        name = vtk_to_meshio_type.get(code, f"VTK's type {code}")
        if code in _FLAT:
            kind, corners = _FLAT[code], (0,)
        elif _QUADRATIC.get(code, code) in _CELLS:
            kind, corners = _CELLS[_QUADRATIC.get(code, code)]
        else:
            raise ValueError(f"it holds {len(own)} cells {name}")
        if code in _QUADRATIC and _QUADRATIC[code] >= 10:
            quadratic[name] = len(own)
        cells.append((kind, nodes[starts[own][:, None] + np.array(corners)]))
        groups.append(grid["physical"][own] if "physical" in grid else own)
    data: dict[str, Any] = {"gmsh:physical": groups} if "physical" in grid else {}
    read = meshio.Mesh(grid["points"].astype(np.float64), cells, cell_data=data)
    return read, quadratic | linear(read)


def _grid(path: Path) -> dict[str, np.ndarray]:
    """The arrays of a file's grid, which VTK reads in a process of its own, since a damaged file may crash it."""
    if find_spec("vtkmodules") is None:
        raise RequestError("VTK, which may read it, is not installed: pip install 'warp_mca[meshes]'")
    limit = _TIME + _TIME_PER_BYTE * path.stat().st_size
    command = [sys.executable, "-P", str(_SCRIPT), str(path.resolve())]
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit, start_new_session=True)
    except subprocess.TimeoutExpired as error:
        raise VtkError(f"VTK took more than {limit:.2g} s, as damaged files may make it") from error
    if done.returncode < 0:
        raise VtkError("VTK crashed, as damaged files may make it")
    if done.returncode:
        raise VtkError(done.stderr.decode(errors="replace").strip().rpartition("\n")[2])
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        return dict(archive)
