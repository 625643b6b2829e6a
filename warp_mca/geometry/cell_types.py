"""Owns the table of cell types: corners, faces, edges and the codes of file formats, for all that reads meshes.

Corners are numbered as in VTK, meshio and gmsh, which agree for linear cells; ten-node tetrahedra as in VTK and meshio.
A mesh stores three types, hexahedra and tetrahedra of four and ten nodes, and those from outside the package. Wedges
and pyramids are stored as hexahedra whose corners coincide; an element may compute them with their own corners
(`physics.elements.cells.body_cells`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

Index = NDArray[np.int32]


@dataclass(frozen=True, kw_only=True)
class CellType:
    """One type of volume cell.

    Attributes:
        name: as `Element.cell` has it.
        mirrored: order of the corners that makes a reflected cell right-handed again.
        stored_as: name of the type in whose array a mesh stores the cell.
        stored_corners: the cell's corner at each corner of the stored one.
        vtk: code of VTK and VTKHDF.
        meshio: name in meshio.
        gmsh: code of gmsh.
        field: attribute of `Mesh` that holds such cells, empty where `Mesh.others` does; it and the following are empty
            for types stored as another.
        natural: natural coordinates of the corners [-], from -1 to 1 for hexahedra and 0 to 1 for tetrahedra.
        faces: corners of each face, three or four, counter-clockwise seen from outside. Faces with nodes within their
            edges are given in parts.
        edges: pairs of corners.
        neighbours: the three corners that edges lead to from each corner, ordered so that these edges are right-handed.
        cut_from: stored types that `degenerate.cut_to` cuts into cells of this type.
        linear: name of the stored type of the first corners, which volumes are taken of and points searched in, for
            cells with further nodes.
        made: mesh -> mesh with cells of this type in place of those of `cut_from`, which `degenerate.cut_to` calls.
    """

    name: str
    mirrored: tuple[int, ...]
    stored_as: str
    stored_corners: tuple[int, ...]
    vtk: int
    meshio: str
    gmsh: int
    field: str = ""
    natural: tuple[tuple[float, float, float], ...] = ()
    faces: tuple[tuple[int, ...], ...] = ()
    edges: tuple[tuple[int, int], ...] = ()
    neighbours: tuple[tuple[int, int, int], ...] = ()
    cut_from: tuple[str, ...] = ()
    linear: str = ""
    made: Callable[[Mesh], Mesh] | None = None

    @property
    def corners(self) -> int:
        """Number of corners."""
        return len(self.mirrored)

    @cached_property
    def quads(self) -> Index:
        """Corners of each face, shape (face_count, 4), int32; triangles have their last one twice."""
        return np.array([(*face, face[-1])[:4] for face in self.faces], dtype=np.int32)

    @property
    def face_depth(self) -> float:
        """Share of a cell's volume that lies behind a face, as in a cell whose faces have no parts [-]."""
        own, whole = CELL_TYPES[self.stored_as], CELL_TYPES[self.linear or self.stored_as]
        return (len(whole.faces) / len(own.faces)) ** 1.5

    @property
    def face_height(self) -> float:
        """Height of a cell over its face, over volume by area [-]: 3 of a pointed cell."""
        return 3.0 if (self.linear or self.name) == "tetrahedron" else 1.0

    @cached_property
    def own_corners(self) -> list[int]:
        """First corner of the stored cell at which each corner of this one stands."""
        return [self.stored_corners.index(corner) for corner in range(self.corners)]


HEXAHEDRON = CellType(
    name="hexahedron",
    mirrored=(0, 3, 2, 1, 4, 7, 6, 5),
    stored_as="hexahedron",
    stored_corners=(0, 1, 2, 3, 4, 5, 6, 7),
    vtk=12,
    meshio="hexahedron",
    gmsh=5,
    field="hexahedra",
    natural=((-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)),
    faces=((0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)),
    edges=((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    neighbours=((1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)),
)
WEDGE = CellType(
    name="wedge",
    mirrored=(0, 2, 1, 3, 5, 4),
    stored_as="hexahedron",
    stored_corners=(0, 1, 2, 2, 3, 4, 5, 5),
    vtk=13,
    meshio="wedge",
    gmsh=6,
)
PYRAMID = CellType(
    name="pyramid",
    mirrored=(0, 3, 2, 1, 4),
    stored_as="hexahedron",
    stored_corners=(0, 1, 2, 3, 4, 4, 4, 4),
    vtk=14,
    meshio="pyramid",
    gmsh=7,
)
TETRAHEDRON = CellType(
    name="tetrahedron",
    mirrored=(0, 2, 1, 3),
    stored_as="tetrahedron",
    stored_corners=(0, 1, 2, 3),
    vtk=10,
    meshio="tetra",
    gmsh=4,
    field="tetrahedra",
    natural=((0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)),
    faces=((0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)),
    edges=((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)),
    neighbours=((1, 2, 3), (0, 3, 2), (0, 1, 3), (0, 2, 1)),
    cut_from=("hexahedron", "tetra10"),
)
_MIDDLES = ((6, 5, 4), (4, 8, 7), (5, 9, 8), (6, 7, 9))  # of the edges of each face of `TETRAHEDRON`
TETRA10 = CellType(
    name="tetra10",
    mirrored=(0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    stored_as="tetra10",
    stored_corners=tuple(range(10)),
    vtk=24,
    meshio="tetra10",
    gmsh=11,
    faces=tuple(
        part
        for (a, b, c), (ab, bc, ca) in zip(TETRAHEDRON.faces, _MIDDLES, strict=True)
        for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    ),
    edges=((0, 4), (4, 1), (1, 5), (5, 2), (2, 6), (6, 0), (0, 7), (7, 3), (1, 8), (8, 3), (2, 9), (9, 3)),
    cut_from=("hexahedron", "tetrahedron"),
    linear="tetrahedron",
)

GMSH_ORDER = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)  # nodes of gmsh's ten-node tetrahedron in the order of `TETRA10`

# In the order in which a mesh counts its cells.
CELL_TYPES = {cell.name: cell for cell in (HEXAHEDRON, WEDGE, PYRAMID, TETRAHEDRON, TETRA10)}
MAX_CORNERS = max(cell.corners for cell in CELL_TYPES.values() if not cell.linear)  # of linear cells


def stored_types() -> dict[str, CellType]:
    """Types that meshes store, by name, in the order in which cells are counted."""
    return {name: cell for name, cell in CELL_TYPES.items() if cell.stored_as == name}


def linear_type(name: str) -> CellType:
    """The type that the first corners of such cells make, by themselves or within the cell."""
    return CELL_TYPES[CELL_TYPES[name].linear or name]


# Cells with nodes within their edges, whose first nodes are the corners: meshio's name and gmsh's code of each, with
# meshio's name of the linear cell and its number of corners. Of these only ten-node tetrahedra are kept.
QUADRATIC = {
    TETRA10.meshio: (TETRA10.gmsh, "tetra", 4),
    "hexahedron20": (17, "hexahedron", 8),
    "hexahedron27": (12, "hexahedron", 8),
    "wedge15": (18, "wedge", 6),
    "wedge18": (13, "wedge", 6),
    "pyramid13": (19, "pyramid", 5),
    "pyramid14": (14, "pyramid", 5),
}


def is_triangle(faces: Index) -> NDArray[np.bool_]:
    """Whether each face is a triangle, shape (face_count,): triangles have their last corner twice.

    Args:
        faces: corners of each face, shape (face_count, 4).
    """
    return faces[:, 2] == faces[:, 3]


def triangulated(faces: Index) -> Index:
    """Triangles and halves of quadrilaterals, shape (triangle_count, 3), int32; the second halves come last."""
    return np.concatenate([faces[:, [0, 1, 2]], faces[~is_triangle(faces)][:, [0, 2, 3]]]).astype(np.int32)
