"""Owns `Cad`: a mesh of tetrahedra in a part of a CAD file, or in the closed surface of an STL file, made by gmsh."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.geometry.cad_volume import solid_volumes
from warp_mca.geometry.cell_types import GMSH_ORDER, TETRA10
from warp_mca.geometry.degenerate import stored
from warp_mca.geometry.edit import compact
from warp_mca.geometry.gmsh_session import allow, gmsh_session
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quadratic import straightened
from warp_mca.geometry.quality import volumes
from warp_mca.geometry.recipe import LIMIT
from warp_mca.geometry.selection import Select, check_selections, with_selections
from warp_mca.geometry.shape_volume import of_cells, with_ratios

# Metres for one unit of the coordinates that gmsh gives: of STEP and IGES files, which name their unit, it gives mm.
UNITS = {".step": 1e-3, ".stp": 1e-3, ".iges": 1e-3, ".igs": 1e-3, ".brep": 1.0, ".stl": 1.0}
_HXT = 10.0  # gmsh's number of its algorithm for tetrahedra with the fewest slivers
_TRIANGLE = 2  # number of the linear triangle in gmsh
_SHARP = math.radians(40.0)  # angle between triangles of an STL file from which an edge parts two faces
_GENERIC = ("COMPOUND", "SOLID", "SHELL", "FACE")  # names that OpenCASCADE gives to what has none
# Time that gmsh may take, many times what it needs: to read and to mesh any part, for a byte of its file, for an
# element [s].
_READ, _MESH, _BYTE, _ELEMENT = 20.0, 60.0, 5e-5, 1e-4
_KEPT = 4  # meshes that stay in memory, so that a body that is placed on a plane is not meshed twice


@dataclass(frozen=True)
class Cad:
    """Ten-node tetrahedra in the solids of a STEP, IGES, BREP or STL file, of which `Body.element` "tet4" takes four.

    Edges follow the curves and faces of the file, but for those of an STL file and those that would spoil their cell
    (`quadratic.straightened`), which are straight.

    Node sets are the faces, by the name that gmsh reads in the file, or "face_1", "face_2", ..., and the selections;
    cell sets are the solids, by name or "solid_1", .... Faces of an STL file are parted by edges sharper than 40
    degrees.

    Attributes:
        path: of the file.
        size: greatest edge of a tetrahedron [m], about; small faces make smaller ones.
        scale: metres for one unit of the file. None takes the file's own unit where it names one (STEP, IGES), and
            metres for BREP and STL. STEP and IGES count in millimetres here whatever unit they name.
        select: more node sets.
    """

    path: str | Path
    size: float
    scale: float | None = None
    select: tuple[Select, ...] = ()

    def __post_init__(self) -> None:
        validate.plain(self)
        if not isinstance(self.path, str | Path):
            raise bad_value("Cad.path", self.path, "give the path of a CAD file")
        if Path(self.path).suffix.lower() not in UNITS:
            known = ", ".join(UNITS)
            raise bad_value("Cad.path", str(self.path), f"CAD files end in {known}; MeshFile reads finished meshes")
        validate.within("Cad", 1e-12, 1e6, size=self.size)
        if self.scale is not None:
            validate.within("Cad", 1e-12, 1e6, scale=self.scale)
        check_selections("Cad", self.select)

    def refined(self, factor: float) -> Cad:
        """The same part with tetrahedra `factor` times smaller."""
        return replace(self, size=self.size / factor)

    @property
    def volume(self) -> float | None:
        """Of the solids in the file [m^3]; the part is meshed for it. None where triangles of an STL file face about.

        Raises:
            RequestError: as in `build`.
        """
        mesh = self.build()
        return float(of_cells(mesh) @ volumes(mesh)) if len(mesh.volume_ratio) else None

    def build(self) -> Mesh:
        """Meshes the part, or takes its mesh from memory if the file is as it was.

        Raises:
            RequestError: there is no such file, gmsh cannot read or mesh it, or it has no solid.
        """
        try:
            found = Path(self.path).stat()
        except OSError as error:
            raise bad_value("Cad.path", str(self.path), f"{error.strerror or error}; check the path") from error
        scale = self.scale or UNITS[Path(self.path).suffix.lower()]
        mesh = _meshed(str(Path(self.path).resolve()), (found.st_mtime_ns, found.st_size), self.size, scale)
        return with_selections(mesh, self.select)


def extent(path: str | Path, scale: float | None = None) -> float:
    """Diagonal of the box around the part in a CAD file [m]; `scale` as in `Cad`.

    Raises:
        RequestError: there is no such file, gmsh cannot read it, or it has no solid.
    """
    part = Cad(path, size=1.0, scale=scale)
    if not Path(path).is_file():
        raise bad_value("Cad.path", str(path), "there is no such file; check the path")
    with gmsh_session(_reading(path)) as gmsh, _explained(str(path)):
        _draw(gmsh, str(path))
        return _diagonal(gmsh) * (part.scale or UNITS[Path(path).suffix.lower()])


@lru_cache(maxsize=_KEPT)
def _meshed(path: str, stamp: tuple[int, int], size: float, scale: float) -> Mesh:
    """The mesh of a file that was changed last at `stamp`: time [ns] and size [byte]."""
    # without a least size gmsh divides the part in ten
    options = {"Mesh__Algorithm3D": _HXT, "Mesh__MeshSizeMax": size / scale, "Mesh__MeshSizeMin": size / scale}
    with gmsh_session(_reading(path), **options) as gmsh, _explained(path):
        _draw(gmsh, path)
        x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(-1, -1)
        count = 6.0 * (x1 - x0) * (y1 - y0) * (z1 - z0) * (scale / size) ** 3  # at most: of a part that fills its box
        if count > LIMIT:
            remedy = f"up to {count:.2g} elements would result in a part of {_diagonal(gmsh) * scale:.3g} m"
            raise bad_value("Cad.size", size, f"{remedy}; take a greater size, or check the scale")
        allow(gmsh, _MESH + _reading(path) + _ELEMENT * count)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.SecondOrderLinear", float(Path(path).suffix.lower() == ".stl"))
        gmsh.model.mesh.setOrder(2)
        return _read(gmsh.model, scale, scale**3 * solid_volumes(gmsh, path))


def _reading(path: str | Path) -> float:
    """Time that gmsh may take for reading a file [s]."""
    return _READ + _BYTE * Path(path).stat().st_size


@contextmanager
def _explained(path: str) -> Iterator[None]:
    """Raise what gmsh reports about a file as RequestError."""
    try:
        yield
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises nothing more specific than this
            raise
        words = " ".join(str(error).split()).rstrip(".") or "it gives no reason"
        remedy = "repair the part in the CAD program or take another size"
        raise bad_value("Cad.path", path, f"gmsh cannot read or mesh it ({words}); {remedy}") from error


def _draw(gmsh: Any, path: str) -> None:
    """Reads the part into gmsh's model; sews the faces of a file without solids together."""
    gmsh.merge(path)
    if Path(path).suffix.lower() == ".stl":
        _check_closed(gmsh, path)
        try:
            _part_faces(gmsh, False)
        except Exception:  # closed faces, as a whole sphere, cannot be flattened
            gmsh.model.remove()
            gmsh.model.add("warp_mca")
            gmsh.merge(path)
            _part_faces(gmsh, True)
        faces = [tag for _, tag in gmsh.model.getEntities(2)]
        if faces:
            gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(faces)])
        gmsh.model.geo.synchronize()
    elif not gmsh.model.getEntities(3):
        gmsh.model.occ.healShapes(tolerance=1e-6 * _diagonal(gmsh), sewFaces=True, makeSolids=True)
        gmsh.model.occ.synchronize()
    if not gmsh.model.getEntities(3):
        raise bad_value("Cad.path", path, "it holds no solid; save the part as a closed solid")


def _check_closed(gmsh: Any, path: str) -> None:
    """Refuse triangles that leave an edge open: gmsh may never return from dividing them into faces.

    Raises:
        RequestError: an edge has an odd number of triangles, or closed surfaces lie beside each other.
    """
    triangles = gmsh.model.mesh.getElementsByType(_TRIANGLE)[1].reshape(-1, 3)
    edges = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    edges, count = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    if open_count := int((count % 2).sum()):
        remedy = f"{open_count} edges of its triangles lack a neighbour; close the surface and save it again"
        raise bad_value("Cad.path", path, remedy)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    if len(triangles) and (
        count := _solids(np.searchsorted(np.sort(tags), triangles), coordinates.reshape(-1, 3)[np.argsort(tags)])
    ):
        remedy = f"its {count} closed surfaces do not lie in one of them; save each part in a file of its own"
        raise bad_value("Cad.path", path, remedy)


def _solids(triangles: NDArray, points: NDArray) -> int:
    """Number of closed surfaces, where one lies outside the box around the largest: it bounds no hole; 0 otherwise."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    a, b = np.concatenate([triangles[:, :2], triangles[:, 1:]]).T
    links = coo_array((np.ones(len(a), dtype=bool), (a, b)), shape=(len(points), len(points)))
    label = connected_components(links, directed=False)[1]
    boxes = np.array([_box(points[label == k]) for k in np.unique(label[triangles])])
    largest = boxes[np.ptp(boxes, axis=1).prod(axis=1).argmax()]
    inside = (boxes[:, 0] >= largest[0]) & (boxes[:, 1] <= largest[1])
    return 0 if inside.all() else len(boxes)


def _box(points: NDArray) -> NDArray:
    return np.array([points.min(axis=0), points.max(axis=0)])


def _part_faces(gmsh: Any, cut: bool) -> None:
    """Parts the triangles of an STL file along sharp edges, and if `cut`, into pieces that can be flattened."""
    gmsh.model.mesh.classifySurfaces(_SHARP, True, cut, math.pi)
    gmsh.model.mesh.createGeometry()


def _diagonal(gmsh: Any) -> float:
    """Of the box around the model, in the file's unit."""
    box = gmsh.model.getBoundingBox(-1, -1)
    return math.dist(box[:3], box[3:])


def _read(model: Any, scale: float, exact: NDArray) -> Mesh:
    """Collects tetrahedra and sets of solids of these volumes [m^3]; nodes that no tetrahedron uses are left out."""
    solids = [tag for _, tag in model.getEntities(3)]
    blocks = [model.mesh.getElementsByType(TETRA10.gmsh, tag)[1].reshape(-1, TETRA10.corners) for tag in solids]
    if not all(map(len, blocks)):
        raise RequestError(
            "gmsh left a solid without tetrahedra: repair the part in the CAD program or take another size"
        )
    tags, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], scale * coordinates.reshape(-1, 3)[order]
    node_sets: dict[str, np.ndarray] = {}
    for k, (_, tag) in enumerate(model.getEntities(2)):
        nodes = np.searchsorted(tags, model.mesh.getNodes(2, tag, includeBoundary=True)[0])
        name = _name(model, 2, tag) or f"face_{k + 1}"  # several faces may have one name
        node_sets[name] = np.union1d(node_sets.get(name, np.zeros(0)), nodes).astype(np.int32)
    cell_sets: dict[str, np.ndarray] = {}
    first = 0
    for k, (tag, block) in enumerate(zip(solids, blocks, strict=True)):
        name = _name(model, 3, tag) or f"solid_{k + 1}"
        more = np.arange(first, first + len(block))
        cell_sets[name] = np.append(cell_sets.get(name, np.zeros(0)), more).astype(np.int32)
        first += len(block)
    cells = np.searchsorted(tags, np.concatenate(blocks)[:, list(GMSH_ORDER)]).astype(np.int32)
    cells = stored(points, cells, TETRA10.name)
    points = straightened(points, cells)
    mesh = compact(Mesh(points, np.zeros((0, 8), np.int32), node_sets, cell_sets, others={TETRA10.name: cells}))
    if not len(exact):
        return mesh
    counts = list(map(len, blocks))
    own = np.add.reduceat(volumes(mesh), np.cumsum([0, *counts[:-1]]))
    return with_ratios(mesh, np.repeat(exact / own, counts))


def _name(model: Any, dim: int, tag: int) -> str:
    """Name of a face or a solid in the file, without those of the assemblies that it lies in; "" without one."""
    name = model.getEntityName(dim, tag).rpartition("/")[2].strip()
    return "" if name in _GENERIC or name.startswith("Open CASCADE") else name
