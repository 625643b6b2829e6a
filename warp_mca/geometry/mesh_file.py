"""Owns `MeshFile`: a mesh of hexahedra read from any file format that meshio knows."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.errors import RequestError, bad_value
from warp_mca.geometry.edit import compact
from warp_mca.geometry.mesh import Mesh

if TYPE_CHECKING:
    import meshio


@dataclass(frozen=True)
class MeshFile:
    """A mesh from a file; nodes that no hexahedron uses are dropped.

    Node sets come from the file's point sets and from its named groups of faces, edges or vertices; cell sets from
    its named groups of hexahedra. Groups are meshio's cell sets and gmsh's physical groups; a physical group without
    a name is called physical_N after its number.

    Attributes:
        path: of the file, in metres.
    """

    path: str | Path

    def __post_init__(self) -> None:
        if not isinstance(self.path, (str, Path)):
            raise bad_value("MeshFile.path", self.path, "give the path of a mesh file")

    def build(self) -> Mesh:
        """Reads the file.

        Raises:
            RequestError: it cannot be read, or holds something other than sound hexahedra.
        """
        read = self._read()
        hexahedra = self._hexahedra(read)
        points = np.array(read.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise self._bad("its points are not three-dimensional; save it with x, y and z")
        if not np.isfinite(points).all():
            raise self._bad("it has coordinates that are not finite; repair the mesh")
        if hexahedra.min() < 0 or hexahedra.max() >= len(points):
            raise self._bad(f"its elements use nodes beyond its {len(points)} points; repair the mesh")
        node_sets, cell_sets = _sets(read)
        return compact(Mesh(points, hexahedra.astype(np.int32), node_sets, cell_sets))

    def _read(self) -> meshio.Mesh:
        if not Path(self.path).is_file():
            raise self._bad("there is no such file; check the path")
        try:
            import meshio
        except ImportError as error:
            raise RequestError(f"meshio cannot be imported ({error}): install it with pip install meshio") from error
        try:
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                return meshio.read(self.path)
        except (Exception, SystemExit) as error:  # some of its readers exit, others raise whatever went wrong
            raise self._bad("meshio cannot read it; save it as binary .msh or as .vtu") from error

    def _hexahedra(self, read: meshio.Mesh) -> NDArray[np.integer]:
        other = sorted({block.type for block in read.cells if block.dim == 3 and block.type != "hexahedron"})
        if other:
            raise self._bad(f"it holds {', '.join(other)}; only 8-node hexahedra are supported so far")
        blocks = [block.data for block in read.cells if block.type == "hexahedron" and len(block.data)]
        if not blocks:
            raise self._bad("it holds no hexahedra; mesh the volume with hexahedra")
        return np.concatenate(blocks)

    def _bad(self, remedy: str) -> RequestError:
        return bad_value("MeshFile.path", str(self.path), remedy)


def _sets(read: meshio.Mesh) -> tuple[dict[str, NDArray[np.int32]], dict[str, NDArray[np.int32]]]:
    """Node sets and cell sets by name; cells are counted over the file's blocks of hexahedra."""
    nodes = {name: [np.asarray(members)] for name, members in read.point_sets.items()}
    cells: dict[str, list[NDArray]] = {}
    for name, by_block in _groups(read).items():
        first = 0
        for block, members in zip(read.cells, by_block, strict=False):
            is_volume = block.type == "hexahedron"
            if members is not None and len(members):
                members = np.asarray(members, dtype=np.int64)
                if is_volume:
                    cells.setdefault(name, []).append(first + members)
                else:
                    nodes.setdefault(name, []).append(np.asarray(block.data)[members].ravel())
            first += len(block.data) if is_volume else 0
    return _merged(nodes), _merged(cells)


def _groups(read: meshio.Mesh) -> dict[str, list]:
    """Members of each named group, block by block: meshio's cell sets and gmsh's physical groups."""
    groups: dict[str, list] = {
        name: by_block for name, by_block in read.cell_sets.items() if not name.startswith("gmsh:")
    }
    physical = read.cell_data.get("gmsh:physical", [])
    names = {(int(number), int(dim)): name for name, (number, dim) in read.field_data.items()} if physical else {}
    for index, (block, numbers) in enumerate(zip(read.cells, physical, strict=False)):
        for number in np.unique(numbers):
            if number:
                name = names.get((int(number), block.dim), f"physical_{number}")
                by_block = groups.setdefault(name, [None] * len(read.cells))
                by_block[index] = np.flatnonzero(numbers == number)
    return groups


def _merged(sets: dict[str, list[NDArray]]) -> dict[str, NDArray[np.int32]]:
    return {name: np.unique(np.concatenate(parts)).astype(np.int32) for name, parts in sets.items()}
