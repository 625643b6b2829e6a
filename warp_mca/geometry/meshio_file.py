"""Owns the reading of mesh files by meshio, and by VTK where meshio fails or loses cells."""

from __future__ import annotations

import io
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.errors import RequestError
from warp_mca.geometry.cell_types import CELL_TYPES, QUADRATIC
from warp_mca.geometry.deck import ELEMENTS, left_out_notes, linear, quadratic_notes
from warp_mca.geometry.markings import lie_on
from warp_mca.geometry.vtk_file import VTK_SUFFIXES, VtkError, cell_count, read_by_vtk

if TYPE_CHECKING:
    import meshio

_MARKS = {  # corners of cells that may mark faces and edges of solids
    **{"line": 2, "line3": 2, "line4": 2, "triangle": 3, "triangle6": 3, "triangle7": 3, "triangle10": 3},
    **{"quad": 4, "quad8": 4, "quad9": 4, "quad16": 4},
}

_SOLIDS = {cell.meshio for cell in CELL_TYPES.values()}
_KNOWN = _SOLIDS | set(QUADRATIC)


def read_by_meshio(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The mesh of a file with cells of known types, and sentences about what is left out.

    Raises:
        RequestError: VTK, which may read it, is not installed.
        Exception: it cannot be read.
    """
    is_vtk = path.suffix.lower() in VTK_SUFFIXES
    try:
        read = _read(path)
        count = cell_count(path) if is_vtk else None
        if count is not None and count != sum(len(block.data) for block in read.cells):
            raise ValueError(f"meshio finds {sum(len(block.data) for block in read.cells)} of its {count} cells")
        if is_vtk and any(block.dim == 3 and block.type not in _KNOWN for block in read.cells):
            raise ValueError("meshio does not know its cells")
        names = linear(read)
    except Exception as error:
        if not is_vtk or not path.stat().st_size:
            raise
        try:
            read, names = read_by_vtk(path)
        except (RequestError, VtkError) as failure:
            raise ValueError(f"meshio: {error}; {failure}") from error
    return read, quadratic_notes(path, names) + stray_notes(path, read)


def _read(path: Path) -> meshio.Mesh:
    import meshio

    said = io.StringIO()
    try:
        with redirect_stdout(said), redirect_stderr(io.StringIO()):
            return _with_groups(meshio.read(path))
    except SystemExit as error:  # as some of its readers end, after they printed why
        raise ValueError(said.getvalue().strip() or "it gives no reason") from error


def _with_groups(read: meshio.Mesh) -> meshio.Mesh:
    """The mesh with the groups of .med files as its sets: meshio keeps them as the names of each number of a family."""
    cells, points = read.cell_data.get("cell_tags", []), read.point_data.get("point_tags", [])
    for number, names in getattr(read, "cell_tags", {}).items():
        for name in names:
            before = read.cell_sets.get(name, [np.zeros(0, dtype=np.int64)] * len(cells))
            own = [np.flatnonzero(np.asarray(block) == number) for block in cells]
            read.cell_sets[name] = [np.union1d(*pair) for pair in zip(before, own, strict=True)]
    for number, names in getattr(read, "point_tags", {}).items():
        for name in names:
            own = np.flatnonzero(np.asarray(points) == number)
            read.point_sets[name] = np.union1d(read.point_sets.get(name, own), own)
    return read


def stray_notes(path: Path, read: meshio.Mesh) -> list[str]:
    """A sentence about surfaces and curves that do not lie on solid cells, so that they mark nothing; none without."""
    blocks = [block.data for block in read.cells if block.type in _SOLIDS]
    left: Counter[tuple[str, str]] = Counter()
    for block in read.cells:
        if block.type in _SOLIDS or block.type == "vertex" or not len(block.data) or block.dim == 3:
            continue
        corners = _MARKS.get(block.type)
        stray = len(block.data) if corners is None else int((~lie_on(block.data[:, :corners], blocks)).sum())
        if stray:
            left[ELEMENTS, block.type] += stray
    return left_out_notes(path, left) if blocks else []
