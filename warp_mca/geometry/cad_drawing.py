"""Owns how gmsh reads the solids of a CAD file into its model, and what it says of files that it cannot read."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value

# Metres for one unit of the coordinates that gmsh gives: of STEP and IGES files, which name their unit, it gives mm.
UNITS = {".step": 1e-3, ".stp": 1e-3, ".iges": 1e-3, ".igs": 1e-3, ".brep": 1.0, ".stl": 1.0}
_HEADER, _FACET = 80, 50  # length of the header of a binary STL file, and of a triangle in it [byte]
_TRIANGLE = 2  # number of the linear triangle in gmsh
_SHARP = math.radians(40.0)  # angle between triangles of an STL file from which an edge parts two faces
_BLUNT = math.radians(120.0)  # the same for surfaces whose faces gmsh cannot flatten otherwise
GENERIC_NAMES = ("COMPOUND", "SOLID", "SHELL", "FACE")  # names that OpenCASCADE gives to what has none
NO_NAMES = ("Open CASCADE", "=>[")  # so begin others of these, and references to other labels
_READ, _BYTE = 20.0, 5e-5  # time that gmsh may take to read any file, and for a byte of it, many times its need [s]


def file_stamp(path: str | Path) -> tuple[int, int]:
    """When a CAD file was changed last [ns], and its size [byte].

    Raises:
        RequestError: there is no such file.
    """
    try:
        found = Path(path).stat()
    except OSError as error:
        raise bad_value("Cad.path", str(path), f"{error.strerror or error}; check the path") from error
    return found.st_mtime_ns, found.st_size


def reading_time(path: str | Path) -> float:
    """Time that gmsh may take for reading a file [s]."""
    return _READ + _BYTE * Path(path).stat().st_size


@contextmanager
def explained(path: str) -> Iterator[None]:
    """Raise what gmsh reports about a file as RequestError."""
    try:
        yield
    except Exception as error:
        if type(error) is not Exception:  # gmsh raises nothing more specific than this
            raise
        words = " ".join(str(error).split()).rstrip(".") or "it gives no reason"
        remedy = "repair the part in the CAD program or take another size"
        raise bad_value("Cad.path", path, f"gmsh cannot read or mesh it ({words}); {remedy}") from error


def draw(gmsh: Any, path: str) -> tuple[str, ...]:
    """Reads the part into gmsh's model; sews the faces of a file without solids together.

    Returns:
        Sentences on what is drawn otherwise than the file has it.
    """
    merge(gmsh, path)
    notes: tuple[str, ...] = ()
    if Path(path).suffix.lower() == ".stl":
        _check_closed(gmsh, path)
        if _part_faces(gmsh, path) == _BLUNT:
            notes = (f"gmsh cannot part the faces of {Path(path).name}: cells do not follow its sharp edges",)
        faces = [tag for _, tag in gmsh.model.getEntities(2)]
        if faces:
            gmsh.model.geo.addVolume([gmsh.model.geo.addSurfaceLoop(faces)])
        gmsh.model.geo.synchronize()
    elif not gmsh.model.getEntities(3):
        gmsh.model.occ.healShapes(tolerance=1e-6 * diagonal(gmsh), sewFaces=True, makeSolids=True)
        gmsh.model.occ.synchronize()
    if not gmsh.model.getEntities(3):
        raise bad_value("Cad.path", path, "it holds no solid; save the part as a closed solid")
    if loose := sum(not len(gmsh.model.getAdjacencies(2, face)[0]) for _, face in gmsh.model.getEntities(2)):
        notes += (f"faces of {Path(path).name} that bound no solid are left out: {loose}",)
    return notes


def merge(gmsh: Any, path: str) -> None:
    """Read a file into gmsh's model: a binary STL file with another header, since gmsh fails at zeros and "solid"."""
    with Path(path).open("rb") as file:
        start = file.read(_HEADER + 4)
        count = int.from_bytes(start[_HEADER:], "little")
        binary = Path(path).suffix.lower() == ".stl" and Path(path).stat().st_size == _HEADER + 4 + _FACET * count
        if not binary:
            gmsh.merge(path)
            return
        with TemporaryDirectory() as folder:
            copy = Path(folder) / "binary.stl"
            copy.write_bytes(b"binary".ljust(_HEADER) + start[_HEADER:] + file.read())
            gmsh.merge(str(copy))


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


def _part_faces(gmsh: Any, path: str) -> float:
    """Part the triangles of an STL file into faces; the angle from which an edge parts two of them.

    Closed faces, as a whole sphere, are also cut into pieces that can be flattened.
    """
    ways = ((_SHARP, False), (_SHARP, True), (_BLUNT, True))
    for number, (angle, cut) in enumerate(ways, start=1):
        try:
            gmsh.model.mesh.classifySurfaces(angle, True, cut, math.pi)
            gmsh.model.mesh.createGeometry()
            return angle
        except Exception:
            if number == len(ways):
                raise
            gmsh.model.remove()
            gmsh.model.add("warp_mca")
            merge(gmsh, path)
    raise AssertionError  # the last way has returned or raised


def diagonal(gmsh: Any) -> float:
    """Of the box around the model, in the file's unit."""
    box = gmsh.model.getBoundingBox(-1, -1)
    return math.dist(box[:3], box[3:])


def entity_name(model: Any, dim: int, tag: int) -> str:
    """Name of a face or a solid in the file, without those of the assemblies that it lies in; "" without one."""
    return plain_name(model.getEntityName(dim, tag).rpartition("/")[2])


def plain_name(label: str) -> str:
    """A label that gmsh gives, without the further ones that it joins by " & "; "" for one that names nothing."""
    name = label.partition(" & ")[0].strip()
    return "" if name in GENERIC_NAMES or name.startswith(NO_NAMES) else name
