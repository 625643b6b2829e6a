"""Owns `MeshFile`: a mesh of hexahedra, wedges, pyramids and tetrahedra from a file of another program."""

from __future__ import annotations

import logging
import textwrap
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.abaqus_file import ABAQUS_SUFFIXES, read_abaqus
from warp_mca.geometry.cell_types import CELL_TYPES, TETRA10, stored_types
from warp_mca.geometry.degenerate import stored
from warp_mca.geometry.edit import compact, only_cells
from warp_mca.geometry.end_marks import END_REQUIRED, missing_end
from warp_mca.geometry.keyword_file import KEYWORD_SUFFIXES, read_keywords
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.meshio_file import read_by_meshio
from warp_mca.geometry.nastran_file import NASTRAN_SUFFIXES, read_nastran
from warp_mca.geometry.quadratic import straightened, with_middles_of_faces
from warp_mca.geometry.selection import Select, check_selections, with_selections
from warp_mca.geometry.universal_file import UNIVERSAL_SUFFIXES, read_universal
from warp_mca.geometry.vtk_file import VTK_SUFFIXES

if TYPE_CHECKING:
    import meshio

_READ = {cell.meshio: cell for cell in CELL_TYPES.values()}  # cells that are read, in the order they are kept
Reader = Callable[[Path], "tuple[meshio.Mesh, list[str]]"]
_WHOLE = "write the whole mesh into it, as plain nodes, elements and sets, or save it as .vtu"
_OTHER = "save it as binary .msh or as .vtu"
_READERS: dict[tuple[str, ...], tuple[str, Reader, str]] = {  # by suffix: what reads, and what to do where it cannot
    ABAQUS_SUFFIXES: ("the reader of Abaqus files", read_abaqus, _WHOLE),
    NASTRAN_SUFFIXES: ("the reader of Nastran files", read_nastran, _WHOLE),
    KEYWORD_SUFFIXES: ("the reader of keyword files", read_keywords, _WHOLE),
    UNIVERSAL_SUFFIXES: ("gmsh", read_universal, _OTHER),
    VTK_SUFFIXES: ("meshio or VTK", read_by_meshio, "save it with tetrahedra, hexahedra, wedges and pyramids"),
    (".msh",): ("meshio", read_by_meshio, "save it in gmsh's format 4.1 with Mesh.SaveAll off or as .vtu"),
}
_MESHIO = "meshio", read_by_meshio, _OTHER


@dataclass(frozen=True)
class MeshFile:
    """A mesh from a file; nodes that no cell uses are dropped.

    Readers of our own take input files of Abaqus, Nastran and LS-DYNA, gmsh .unv, meshio .msh, .vtu and all others that
    it knows, VTK those of its files that meshio does not. What would move, add or change nodes, cells or sets and is
    not read is refused; what else a file holds, as shells and loads, is left out with a warning (docs/api/geometry.md).
    Tetrahedra of ten nodes keep them, unless cells of other types share some; all other quadratic cells are taken as
    linear ones, which is a warning too, as are edges that would spoil their cell, which become straight.

    Node sets come from the file's point sets and from its named groups of faces, edges or vertices; cell sets from
    its named groups of cells. Groups are meshio's cell sets and gmsh's physical groups; a physical group without
    a name is called physical_N after its number, a part or property without one part_N.

    Attributes:
        path: of the file.
        scale: metres for one unit of its coordinates, 1e-3 for millimetres.
        select: more node sets.
        only: name of a cell set, all of the mesh that is taken: an instance, a part or a physical volume as a body of
            its own.
    """

    path: str | Path
    scale: float = 1.0
    select: tuple[Select, ...] = ()
    only: str | None = None

    def __post_init__(self) -> None:
        validate.plain(self)
        if not isinstance(self.path, (str, Path)):
            raise bad_value("MeshFile.path", self.path, "give the path of a mesh file")
        validate.positive("MeshFile", scale=self.scale)
        check_selections("MeshFile", self.select)
        if self.only is not None:
            validate.texts("MeshFile", only=self.only)

    def build(self) -> Mesh:
        """Reads the file; what it holds besides is left out with a warning, which `Mesh.notes` keeps.

        Raises:
            RequestError: it cannot be read, or holds something other than sound hexahedra.
        """
        mesh = self.converted(*self._read())
        return with_selections(mesh if self.only is None else only_cells(mesh, self.only), self.select)

    def converted(self, read: meshio.Mesh, notes: list[str]) -> Mesh:
        """What a reader gave as a mesh, with sentences about what is left out, which are told.

        Raises:
            RequestError: it holds something other than sound cells.
        """
        points = self.scale * np.array(read.points, dtype=np.float64)
        if points.ndim != 2 or points.shape[1] != 3:
            raise self._bad("its points are not three-dimensional; save it with x, y and z")
        if not np.isfinite(points).all():
            raise self._bad("it has coordinates that are not finite; repair the mesh")
        cells = self._cells(read)
        for block in cells.values():
            if len(block) and (block.min() < 0 or block.max() >= len(points)):
                raise self._bad(f"its elements use nodes beyond its {len(points)} points; repair the mesh")
        node_sets, cell_sets = _sets(read, self._physical_names())
        arrays: dict[str, Any] = {
            kept.field: np.concatenate(
                [stored(points, cells[name], name) for name, cell in CELL_TYPES.items() if cell.stored_as == kept.name]
            )
            for kept in stored_types().values()
            if kept.field
        }
        quadratic = stored(points, cells[TETRA10.name], TETRA10.name)
        if len(quadratic):
            arrays["others"] = {TETRA10.name: quadratic}
            node_sets = with_middles_of_faces(quadratic, node_sets, len(points))
            try:
                bent, points = points, straightened(points, quadratic)
            except ValueError as error:
                raise self._bad(f"{error}; write their nodes in the order of the format") from error
            if moved := int((bent != points).any(axis=1).sum()):
                notes.append(
                    f"{self.path}: {moved} edges bend so far that they spoil their cell, and are taken as straight"
                )
        for note in notes:
            logging.getLogger("warp_mca").warning("%s", note)
        return compact(Mesh(points, node_sets=node_sets, cell_sets=cell_sets, notes=tuple(notes), **arrays))

    def _read(self) -> tuple[meshio.Mesh, list[str]]:
        """The file's mesh with cells of known types, and sentences about what is left out."""
        path = Path(self.path)
        try:
            found = path.is_file()
        except OSError as error:  # as of a name that is too long
            raise self._bad(f"{error.strerror or error}; check the path") from error
        if not found:
            raise self._bad("there is no such file; check the path")
        notes = self._check_end()
        suffix = path.suffix.lower()
        reader, read, remedy = next((item for suffixes, item in _READERS.items() if suffix in suffixes), _MESHIO)
        try:
            import meshio  # noqa: F401  which all readers answer in
        except ImportError as error:
            raise RequestError(f"meshio cannot be imported ({error}): install it with pip install meshio") from error
        try:
            mesh, more = read(path)
        except RequestError:
            raise
        except Exception as error:  # readers of other packages raise whatever went wrong
            reason = textwrap.shorten(str(error), 300).rstrip(".")
            if not path.stat().st_size:
                reason = "it is empty"
            elif " " not in reason:  # a number or a key, which tells a user nothing
                reason = f"it is damaged, or holds what {reader} does not know ({type(error).__name__} {reason})"
            raise self._bad(f"{reader} cannot read it ({reason}); {remedy}") from error
        return mesh, [*notes, *more]

    def _physical_names(self) -> dict[tuple[int, int], str]:
        """Names of the physical groups of gmsh's file by number and dimension: a surface and a volume may share one,
        of which meshio keeps the last."""
        names: dict[tuple[int, int], str] = {}
        if Path(self.path).suffix.lower() == ".msh":
            with Path(self.path).open("rb") as lines:
                for line in lines:
                    if line.strip() == b"$PhysicalNames":
                        for _ in range(int(next(lines))):
                            dim, number, name = next(lines).decode(errors="replace").split(maxsplit=2)
                            names[int(number), int(dim)] = name.strip().strip('"')
                    if line.strip() in (b"$EndPhysicalNames", b"$Nodes"):
                        break
        return names

    def _check_end(self) -> list[str]:
        """Refuses a file that was cut off, where its format says so; a sentence where it may have been cut off."""
        if not (mark := missing_end(Path(self.path))):
            return []
        if Path(self.path).suffix.lower() in END_REQUIRED:
            raise self._bad(f"it lacks {mark}, as if it had been cut off; write it again, or add that if it is whole")
        return [f"{self.path} lacks {mark}: if it was cut off, cells are missing"]

    def _cells(self, read: meshio.Mesh) -> dict[str, NDArray[np.int32]]:
        """Nodes of the cells of each type, by its name in CELL_TYPES."""
        other = sorted({block.type for block in read.cells if block.dim == 3 and block.type not in _READ})
        if other:
            raise self._bad(f"it holds {', '.join(other)}; save it with linear cells: {', '.join(_READ)}")
        found = {
            cell.name: np.concatenate(
                [np.zeros((0, cell.corners), np.int64), *(block.data for block in read.cells if block.type == kind)]
            )
            for kind, cell in _READ.items()
        }
        if not any(map(len, found.values())):
            raise self._bad("it holds no volume cells; mesh the volume with hexahedra or tetrahedra")
        return {name: cells.astype(np.int32) for name, cells in found.items()}

    def _bad(self, remedy: str) -> RequestError:
        return bad_value("MeshFile.path", str(self.path), remedy)


def _sets(
    read: meshio.Mesh, names: dict[tuple[int, int], str]
) -> tuple[dict[str, NDArray[np.int32]], dict[str, NDArray[np.int32]]]:
    """Node sets and cell sets by name; cells are counted as in `Mesh`, and `names` are those of physical groups."""
    nodes = {name: [np.asarray(members)] for name, members in read.point_sets.items()}
    cells: dict[str, list[NDArray]] = {}
    firsts = _first_cells(read)
    for name, by_block in _groups(read, names).items():
        for block, first, members in zip(read.cells, firsts, by_block, strict=False):
            if members is not None and len(members):
                members = np.asarray(members, dtype=np.int64)
                if block.type in _READ:
                    cells.setdefault(name, []).append(first + members)
                else:
                    nodes.setdefault(name, []).append(np.asarray(block.data)[members].ravel())
    return _merged(nodes), _merged(cells)


def _first_cells(read: meshio.Mesh) -> list[int]:
    """Index that the first cell of each block of the file has in the mesh."""
    firsts = [0] * len(read.cells)
    count = 0
    for kind in _READ:
        for index, block in enumerate(read.cells):
            if block.type == kind:
                firsts[index] = count
                count += len(block.data)
    return firsts


def _groups(read: meshio.Mesh, names: dict[tuple[int, int], str]) -> dict[str, list]:
    """Members of each named group, block by block: meshio's cell sets and gmsh's physical groups, with their names."""
    groups: dict[str, list] = {
        name: by_block for name, by_block in read.cell_sets.items() if not name.startswith("gmsh:")
    }
    physical = read.cell_data.get("gmsh:physical", [])
    if physical:
        names = {(int(number), int(dim)): name for name, (number, dim) in read.field_data.items()} | names
    for index, (block, numbers) in enumerate(zip(read.cells, physical, strict=False)):
        for number in np.unique(numbers):
            if number:
                name = names.get((int(number), block.dim), f"physical_{number}")
                by_block = groups.setdefault(name, [None] * len(read.cells))
                by_block[index] = np.flatnonzero(numbers == number)
    return groups


def _merged(sets: dict[str, list[NDArray]]) -> dict[str, NDArray[np.int32]]:
    return {name: np.unique(np.concatenate(parts)).astype(np.int32) for name, parts in sets.items()}
