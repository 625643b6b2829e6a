"""Owns `FinalState`: the deformed mesh at the end of a run, with its fields, in any format that meshio writes."""

from __future__ import annotations

import io
import itertools
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_mca.base.errors import McaError, RequestError, bad_value
from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, CellType
from warp_mca.geometry.degenerate import cell_names
from warp_mca.recorders.recorder import DISK_RESERVE, VOLUME, Cadence, FramesOnly, check_file, file_path
from warp_mca.scene.elements import ELEMENTS

if TYPE_CHECKING:
    import meshio

    from warp_mca.recorders.recorder import Frame, RunInfo
    from warp_mca.system.model import Model

USUAL = "name a .vtu, .vtk, .xdmf, .med or .msh file"
# Formats whose readers take six components as xx, yy, zz, xy, yz, xz; XDMF's take yy as the fourth, gmsh takes none.
SIX_COMPONENTS = ("vtu", "vtk")
SCALES = (1e3, 1e-6, 1e-17)  # of coordinates along x, y and z in the trial; the last are residues of rounding [m]
COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")


class FinalState(FramesOnly):
    """Writes the last frame: displaced points, hexahedra, the fields at nodes, body and material of each element.

    The file appears, complete, when the run has ended without an error; an older file stays until then.
    """

    def __init__(self, file: str | os.PathLike[str]) -> None:
        """Write to `file`, in the format of its suffix; one element is written and read back as a trial.

        Raises:
            RequestError: `file` cannot be written, or its format holds no 8-node hexahedra.
        """
        meshio = _load_meshio()
        suffix = file_path("final", file).suffix
        if suffix not in meshio.extension_to_filetypes:
            raise bad_value("final", str(file), f"meshio knows no format with this suffix; {USUAL}")
        self.path = check_file("final", file, suffix)
        self.name = str(self.path)
        self.needs = frozenset((VOLUME,))
        self.cadence = Cadence(frames=2)
        self.left_out, parts = _try(self.path)
        self.files = tuple(check_file("final", self.path.with_name(part), Path(part).suffix) for part in parts)
        self._fields: dict[str, NDArray] | None = None

    def start(self, info: RunInfo) -> None:
        """Make missing folders, and warn about fields that the format cannot hold.

        Raises:
            RequestError: the folder cannot be made.
        """
        self.model, self._fields = info.model, None
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise bad_value("final", str(self.path), f"its folder cannot be made ({error.strerror})") from error
        if self.left_out:
            info.warn(f"{self.path}: this format has no place for {', '.join(self.left_out)}; {USUAL} to keep them")

    def frame(self, frame: Frame) -> None:
        """Keep it in place of the one before."""
        assert frame.volume is not None
        self._fields = {name: np.array(field) for name, field in vars(frame.volume).items() if field is not None}

    def finish(self, ok: bool) -> None:
        """Write the file; after a run that failed there is no final state, and none is written.

        Raises:
            McaError: it cannot be written.
        """
        fields, self._fields = self._fields, None
        if ok and fields is not None:
            runs, body, material = cells(self.model)
            if "failed" in fields:  # are left out
                left = ~fields.pop("failed")
                ends = np.cumsum([len(nodes) for _, nodes in runs])[:-1]
                parts = zip(runs, np.split(left, ends), strict=True)
                runs = [(cell, nodes[own]) for (cell, nodes), own in parts if own.any()]
                body, material = body[left], material[left]
            points = self.model.X + fields["displacement"]
            _save(self.path, _mesh(self.path, points, runs, fields, {"body": body, "material": material}))


def cells(model: Model) -> tuple[list[tuple[CellType, NDArray[np.int64]]], NDArray[np.int32], NDArray[np.int32]]:
    """Runs of cells of one type, as (type, nodes); index of each cell's body in the scene; its row in `Model.law`.

    Cells come in the order of the concatenated meshes, which is not the model's.
    """
    count = len(model.element_of)
    blocks = [(block, CELL_TYPES[ELEMENTS[block.element].cell]) for block in (*model.blocks, *model.rigid_blocks)]
    most = max((len(cell.stored_corners) for _, cell in blocks), default=0)
    nodes, names = np.full((count, most), -1, dtype=np.int64), np.full(count, "", dtype=object)
    material = np.empty(count, dtype=np.int32)
    for block, cell in blocks:
        index = model.element_of[block.first : block.first + block.conn.shape[1]]
        stored = block.conn[list(cell.stored_corners)].T
        nodes[index, : len(cell.stored_corners)] = stored
        material[index] = block.material
        names[index] = cell_names(stored) if cell.name == HEXAHEDRON.name else cell.name
    ends = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1), len(names)]
    runs = []
    for first, end in itertools.pairwise(ends):
        cell = CELL_TYPES[str(names[first])]
        runs.append((cell, nodes[first:end][:, cell.own_corners]))
    start = list(model.element_start.values())
    body = np.searchsorted(start, np.arange(count), side="right") - 1
    return runs, body.astype(np.int32), material


def _load_meshio():
    try:
        import meshio
    except ImportError as error:
        raise RequestError(f"meshio cannot be imported ({error}): install it with pip install meshio") from error
    return meshio


def _format(path: Path) -> str:
    """meshio's name of the format; .msh stands for gmsh's, and not for the other one that meshio has."""
    known = _load_meshio().extension_to_filetypes[path.suffix]
    return "gmsh" if "gmsh" in known else known[0]


def _mesh(
    path: Path,
    points: NDArray,
    runs: list[tuple[CellType, NDArray]],
    fields: Mapping[str, NDArray],
    cell_fields: Mapping[str, NDArray],
) -> meshio.Mesh:
    """What is written to `path`: where formats disagree on six components, stress becomes six scalars."""
    at_points: dict[str, ArrayLike] = dict(fields)
    if _format(path) not in SIX_COMPONENTS:
        stress = fields["stress"]
        del at_points["stress"]
        at_points |= {f"stress_{name}": np.ascontiguousarray(stress[:, k]) for k, name in enumerate(COMPONENTS)}
    ends = np.cumsum([len(nodes) for _, nodes in runs])[:-1]
    at_cells: dict[str, list[ArrayLike]] = {name: list(np.split(field, ends)) for name, field in cell_fields.items()}
    blocks: list[Any] = [(cell.meshio, nodes) for cell, nodes in runs]
    return _load_meshio().Mesh(points, blocks, point_data=at_points, cell_data=at_cells)


def _write(path: Path, mesh: meshio.Mesh) -> None:
    """Let meshio write, and suppress what it prints; its newer version of gmsh's format holds cells of one type."""
    kind = _format(path)
    if kind == "gmsh" and len({block.type for block in mesh.cells}) > 1:
        kind = "gmsh22"
    with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
        _load_meshio().write(path, mesh, file_format=kind)


def _try(path: Path) -> tuple[list[str], list[str]]:
    """Names of the fields that a format drops, and of the files that it takes: one element is written and read again.

    Raises:
        RequestError: the element does not come back.
    """
    # Some formats have no room for all digits, a sign and an exponent of two digits.
    points = np.array(HEXAHEDRON.natural, dtype=float) / 3.0 * SCALES
    widths = {"displacement": (3,), "velocity": (3,), "stress": (6,), "von_mises": (), "plastic_strain": ()}
    fields = {name: np.zeros((len(points), *width), np.float32) for name, width in widths.items()}
    nodes, index = np.arange(len(points))[None], np.zeros(1, dtype=np.int32)
    mesh = _mesh(path, points, [(HEXAHEDRON, nodes)], fields, {"body": index, "material": index})
    with tempfile.TemporaryDirectory() as folder:
        trial = Path(folder) / path.name
        try:
            _write(trial, mesh)
            with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
                read = _load_meshio().read(trial)
            if [block.type for block in read.cells] != [HEXAHEDRON.meshio] or (read.cells[0].data != nodes).any():
                raise ValueError("they do not come back")
            parts = [part.name for part in trial.parent.iterdir()]
        except (Exception, SystemExit) as error:  # meshio's writers and readers raise any exception, or exit
            remedy = f"meshio cannot write 8-node hexahedra in this format ({_reason(error)}); {USUAL}"
            raise bad_value("final", str(path), remedy) from error
    wanted = [(name, read.point_data) for name in fields] + [(name, read.cell_data) for name in mesh.cell_data]
    # some split fields
    return [name for name, kept in wanted if not any(key.startswith(name) for key in kept)], parts


def _save(path: Path, mesh: meshio.Mesh) -> None:
    """Write beside `path` first and then rename, so that the file there is complete at any time.

    Raises:
        McaError: meshio or the disk fails.
    """
    folder = None
    try:
        arrays = [mesh.points, *(block.data for block in mesh.cells), *mesh.point_data.values()]
        if shutil.disk_usage(path.parent).free < DISK_RESERVE + sum(array.nbytes for array in arrays):
            raise OSError("too little is free on its disk")
        folder = Path(tempfile.mkdtemp(prefix=f".{path.stem}-", dir=path.parent))
        _write(folder / path.name, mesh)
        # Some formats take two files, of which the one that was asked for names the other.
        for part in sorted(folder.iterdir(), key=lambda part: part.name == path.name):
            part.replace(path.with_name(part.name))
    except (Exception, SystemExit) as error:
        raise McaError(f"the final state could not be written: {_reason(error)}") from error
    finally:
        if folder:
            shutil.rmtree(folder, ignore_errors=True)


def _reason(error: BaseException) -> str:
    """What an error says in one line, or the name of its type."""
    return " ".join(str(error).split()) or type(error).__name__
