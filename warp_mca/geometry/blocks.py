"""Owns `Blocks`: hexahedral multi-block meshes, described by their corner points and meshed transfinitely by gmsh."""

from __future__ import annotations

import math
from collections.abc import Sequence
from types import ModuleType

import numpy as np
from numpy.typing import ArrayLike

from warp_mca.base.errors import RequestError
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.geometry.gmsh_session import gmsh_here
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.recipe import check_size

_SIDE = np.array(HEXAHEDRON.natural)  # -1 or 1 along each direction of a block, shape (8 corners, 3)
_LOW, _HIGH = ([np.flatnonzero(_SIDE[:, axis] == side) for axis in range(3)] for side in (-1, 1))
# Edges of a block that run along each direction, from its low to its high side.
_EDGES = [
    [(a, b) if side[a] < side[b] else (b, a) for a, b in HEXAHEDRON.edges if side[a] != side[b]] for side in _SIDE.T
]
FINEST = 1e-8  # smallest edge of a cell, as a share of the extent of all blocks


def growth(length: float, count: int, before: float) -> float:
    """Factor q by which `count` cells must grow, one from the next, to fill `length` after a cell of size `before`.

    Solves sum(before * q**i, i = 1..count) = length; where the cells would have to shrink, q is 1.
    """
    if before * count >= length:
        return 1.0
    q, low, high = 1.0, 1.0, 1e3
    for _ in range(100):
        q = (low * high) ** 0.5
        low, high = (q, high) if before * _powers(q, count) < length else (low, q)
    return q


def _powers(q: float, count: int) -> float:
    """q + q**2 + … + q**count, or infinity where no float holds it."""
    try:
        return sum(q**i for i in range(1, count + 1))
    except OverflowError:
        return math.inf


class Blocks:
    """Hexahedral blocks that share corners, edges and faces; equal calls in equal order give bit-identical meshes.

    Points are handles returned by `point`. Edges are straight unless `arc` bends them, faces are interpolated from
    their edges unless `on_sphere` puts them on a sphere.
    """

    def __init__(self, owner: str, /, **counts: int | tuple[int, ...]) -> None:
        """Begins without blocks.

        Args:
            owner: the recipe, for messages.
            counts: its values that divisions follow from.
        """
        self._owner, self._counts = owner, counts
        self._points: list[tuple[float, float, float]] = []
        self._arcs: dict[frozenset[int], int] = {}
        self._growth: dict[tuple[int, int], float] = {}
        self._count: dict[tuple[int, int], int] = {}
        self._spheres: dict[frozenset[int], int] = {}
        self._blocks: list[tuple[tuple[int, ...], tuple[int, int, int], str]] = []
        self._faces: dict[str, list[frozenset[int]]] = {}

    def point(self, position: ArrayLike) -> int:
        """Handle of a new point at `position` [m], shape (3,)."""
        x, y, z = np.asarray(position, dtype=np.float64)
        self._points.append((float(x), float(y), float(z)))
        return len(self._points) - 1

    def position(self, point: int) -> np.ndarray:
        """Coordinates of a point [m], shape (3,), float64."""
        return np.array(self._points[point])

    def arc(self, a: int, b: int, centre: int) -> None:
        """Makes the edge a-b the circle arc (of less than half a turn) about the point `centre`."""
        self._arcs[frozenset((a, b))] = centre

    def grow(self, a: int, b: int, factor: float) -> None:
        """Makes each cell of the edge a-b `factor` times as long as the one before, from a to b."""
        self._growth[a, b] = factor
        self._growth[b, a] = 1.0 / factor

    def on_sphere(self, corners: Sequence[int], centre: int) -> None:
        """Puts the face with these corners, whose edges must be arcs about `centre`, on the sphere about it."""
        self._spheres[frozenset(corners)] = centre

    def name_face(self, name: str, corners: Sequence[int]) -> None:
        """Adds the nodes of the face with these corners to the node set `name`."""
        self._faces.setdefault(name, []).append(frozenset(corners))

    def block(self, corners: Sequence[int], divisions: tuple[int, int, int], cells: str) -> None:
        """Adds a block to the cell set `cells`.

        Args:
            corners: eight points in the order of a VTK hexahedron.
            divisions: number of cells along the edges 0-1, 0-3 and 0-4.
            cells: name of the cell set.

        Raises:
            RequestError: a neighbour divides a shared edge differently, or there are too many cells by now.
        """
        for edges, count in zip(_EDGES, divisions, strict=True):
            for i, j in edges:
                a, b = corners[i], corners[j]
                if self._count.setdefault((min(a, b), max(a, b)), count) != count:
                    raise RequestError(
                        f"blocks that share the edge {a}-{b} divide it differently: give equal divisions"
                    )
        self._blocks.append((tuple(corners), divisions, cells))
        check_size(self._owner, [counts for _, counts, _ in self._blocks], **self._counts)

    def mesh(self) -> Mesh:
        """Meshes all blocks.

        Raises:
            RequestError: gmsh cannot be loaded, or cannot mesh these blocks.
        """
        self._check_cells()
        with gmsh_here() as gmsh:
            try:
                surfaces, volumes = self._draw(gmsh.model.geo)
                gmsh.model.geo.synchronize()
                gmsh.model.mesh.generate(3)
                return self._read(gmsh.model.mesh, surfaces, volumes)
            except Exception as error:
                if type(error) is not Exception:  # gmsh raises nothing more specific than this
                    raise
                raise RequestError(f"gmsh could not mesh the blocks ({error}): change the recipe's values") from error

    def _check_cells(self) -> None:
        """Refuses cells so small or large beside others that gmsh crashes, or computes for hours."""
        points = np.array(self._points)
        extent = float(np.ptp(points, axis=0).max())
        for (a, b), count in self._count.items():
            length, factor = math.dist(self._points[a], self._points[b]), self._growth.get((a, b), 1.0)
            smallest = (
                math.log(length) - math.log(count) - (count - 1) * abs(math.log(factor)) if length > 0.0 else None
            )
            if smallest is None or not (math.isfinite(extent) and smallest > math.log(extent * FINEST)):
                raise RequestError(
                    f"{self._owner}: some cells would be {1.0 / FINEST:g} times smaller than the body, or of no size; "
                    "bring its lengths closer together, or take fewer cells"
                )

    def _draw(self, geo: ModuleType) -> tuple[dict[frozenset[int], int], list[int]]:
        """Emits the geometry; returns gmsh's surface tags by corners and its volume tags in block order."""
        points = [geo.addPoint(*position) for position in self._points]
        curves: dict[tuple[int, int], int] = {}
        surfaces: dict[frozenset[int], int] = {}

        def curve(a: int, b: int) -> int:
            if (b, a) in curves:
                return -curves[b, a]
            if (a, b) not in curves:
                centre = self._arcs.get(frozenset((a, b)))
                ends = points[a], points[b]
                tag = geo.addLine(*ends) if centre is None else geo.addCircleArc(ends[0], points[centre], ends[1])
                count = self._count[min(a, b), max(a, b)]
                geo.mesh.setTransfiniteCurve(tag, count + 1, "Progression", self._growth.get((a, b), 1.0))
                curves[a, b] = tag
            return curves[a, b]

        def surface(corners: list[int]) -> int:
            key = frozenset(corners)
            if key not in surfaces:
                loop = geo.addCurveLoop([curve(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)])
                centre = self._spheres.get(key)
                tag = geo.addSurfaceFilling([loop], sphereCenterTag=-1 if centre is None else points[centre])
                geo.mesh.setTransfiniteSurface(tag, cornerTags=[points[corner] for corner in corners])
                geo.mesh.setRecombine(2, tag)
                surfaces[key] = tag
            return surfaces[key]

        volumes = []
        for corners, *_ in self._blocks:
            shell = geo.addSurfaceLoop([surface([corners[i] for i in face]) for face in HEXAHEDRON.faces])
            volumes.append(geo.addVolume([shell]))
            geo.mesh.setTransfiniteVolume(volumes[-1], [points[corner] for corner in corners])
        return surfaces, volumes

    def _read(self, meshed: ModuleType, surfaces: dict[frozenset[int], int], volumes: list[int]) -> Mesh:
        """Collects hexahedra and sets; nodes that no hexahedron uses (arc centres) are left out."""
        blocks = [meshed.getElementsByType(HEXAHEDRON.gmsh, tag)[1].reshape(-1, HEXAHEDRON.corners) for tag in volumes]
        if [len(block) for block in blocks] != [math.prod(counts) for _, counts, _ in self._blocks]:
            raise RequestError("gmsh left a block without its hexahedra: change the recipe's values")
        tags, hexahedra = np.unique(np.concatenate(blocks), return_inverse=True)
        all_tags, coordinates, _ = meshed.getNodes()
        rank = np.argsort(all_tags)
        points = coordinates.reshape(-1, 3)[rank][np.searchsorted(all_tags[rank], tags)]

        owner = np.repeat(np.arange(len(blocks)), [len(block) for block in blocks])
        of_block = np.array([cells for *_, cells in self._blocks])
        cell_sets = {name: np.flatnonzero(of_block[owner] == name).astype(np.int32) for name in dict.fromkeys(of_block)}
        node_sets = {}
        for name, faces in self._faces.items():
            on_faces = [meshed.getNodes(2, surfaces[face], includeBoundary=True)[0] for face in faces]
            node_sets[name] = np.searchsorted(tags, np.unique(np.concatenate(on_faces))).astype(np.int32)
        hexahedra = _outwards(points, hexahedra.reshape(-1, HEXAHEDRON.corners).astype(np.int32))
        return Mesh(points, hexahedra, node_sets, {str(name): cells for name, cells in cell_sets.items()})


def _outwards(points: np.ndarray, hexahedra: np.ndarray) -> np.ndarray:
    """Swaps bottom and top of the elements that gmsh numbered left-handed."""
    p = points[hexahedra]
    u, v, w = (p[:, high].sum(1) - p[:, low].sum(1) for low, high in zip(_LOW, _HIGH, strict=True))
    left_handed = np.einsum("ij,ij->i", np.cross(u, v), w) < 0.0
    return np.where(left_handed[:, None], np.roll(hexahedra, 4, axis=1), hexahedra)
