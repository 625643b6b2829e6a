"""Owns `hex8w` and `hex8w3`: `hex8i` with two or three points in each half of a wall's thickness, and its direction."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.base.errors import bad_value
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.geometry.hexahedron import CORNERS
from warp_mca.physics.elements.element import Array
from warp_mca.physics.elements.hex8i import Hex8i

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.scene import Body

LEAST = 0.7  # cosine between a direction that is named and edges of cells across, at least

# Corners in their new order if each axis becomes the third one, by cyclic rotations.
_TURNED = np.array(
    [
        [np.flatnonzero((np.roll(CORNERS, shift, axis=1) == corner).all(axis=1))[0] for corner in CORNERS]
        for shift in (2, 1, 0)
    ]
)
_START = np.array([np.flatnonzero(CORNERS[:, axis] < 0.0) for axis in range(3)])  # of the four edges of each axis
_END = np.array(
    [
        [np.flatnonzero((CORNERS[a] + 2.0 * np.eye(3)[axis] == CORNERS).all(axis=1))[0] for a in _START[axis]]
        for axis in range(3)
    ]
)
_ENDS = [  # of the faces of `HEXAHEDRON.faces`: axis that they end
    int(np.flatnonzero(np.ptp(CORNERS[list(face)], axis=0) == 0.0)[0]) for face in HEXAHEDRON.faces
]


class Hex8w(Hex8i):
    """`hex8i` with 16 or 24 points, two or three in each half of the third direction, which is turned through the wall.

    Points in halves give the plastic moment of a wall of one layer of cells (`hex8i`: 15.5 % too much).
    """

    def oriented(self, body: Body, mesh: Mesh, conn: Index, index: Index) -> Index:
        """Nodes of cells with corners in an order that takes their third direction through the wall.

        This is `Body.across`, or else found: where cells have both faces of a direction on the surface of the body,
        it is across; of several or none, the one with the shortest edges. Neighbours agree: cells that have edges of a
        direction in common, one after the other, form a sheet, and each cell takes the direction of the sheet that most
        cells would.

        Args:
            body, mesh: as they are.
            conn: nodes of cells of the mesh, shape (cell_count, 8), int32.
            index: of each in the mesh, shape (cell_count,), int32.

        Returns:
            Nodes, shape (cell_count, 8), int32. Edges across never have the same node at both ends, as some of wedges
            and pyramids have.

        Raises:
            RequestError: cells have no edges along `Body.across`.
        """
        edges = mesh.points[conn[:, _END]] - mesh.points[conn[:, _START]]
        whole = (conn[:, _END] != conn[:, _START]).all(axis=2)
        if body.across is None:
            axis = _by_sheets(_by_cells(mesh, conn, index, edges, whole), conn, whole)
        else:
            axis = _named(body, edges.mean(axis=2), whole)
        return np.take_along_axis(conn, _TURNED[axis], axis=1)


def _named(body: Body, edge: Array, whole: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Axis of each cell along `Body.across`, from its mean edges, shape (cell_count, 3, 3)."""
    across = np.array(body.across, dtype=float)
    size = np.linalg.norm(edge, axis=2) * np.linalg.norm(across)
    cosine = np.where(whole, np.abs(edge @ across) / np.where(size > 0.0, size, 1.0), 0.0)
    off = int((cosine.max(axis=1) < LEAST).sum())
    if off:
        what = f"{off} of its cells have no edges within 45 degrees of it"
        remedy = "give the direction through the wall in the body's frame, or leave it out"
        raise bad_value(f"Body {body.name}.across", body.across, f"{what}; {remedy}")
    return cosine.argmax(axis=1)


def _by_cells(mesh: Mesh, conn: Index, index: Index, edges: Array, whole: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Axis that each cell would take by itself."""
    place = np.full(mesh.cell_count, -1)
    place[index] = np.arange(len(index))
    faces, owner = mesh.boundary
    faces, owner = faces[place[owner] >= 0], place[owner[place[owner] >= 0]]
    count = np.zeros((len(conn), 3), dtype=np.int8)
    key = np.sort(faces, axis=1)
    for face, axis in zip(HEXAHEDRON.faces, _ENDS, strict=True):
        same = (np.sort(conn[owner][:, list(face)], axis=1) == key).all(axis=1)
        count[owner[same], axis] += 1
    through = (count == 2) & whole
    length = np.linalg.norm(edges, axis=3).mean(axis=2)
    length = np.where(through | ~through.any(axis=1, keepdims=True), length, np.inf)
    length[~whole] = np.inf
    # Edges of equal length differ by rounding; of these the last.
    shortest = length <= length.min(axis=1, keepdims=True) * (1.0 + 1e-9)
    return 2 - shortest[:, ::-1].argmax(axis=1)


def _by_sheets(own: NDArray[np.intp], conn: Index, whole: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Axis of each cell whose sheet most cells would take by themselves; its own among equals."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.sort(np.stack([conn[:, _START], conn[:, _END]]), axis=0).astype(np.int64)
    _, edge = np.unique((ends[0] * (int(conn.max()) + 1) + ends[1])[whole], return_inverse=True)
    axes = np.repeat(np.flatnonzero(whole.ravel()), 4)
    size = whole.size + int(edge.max(initial=-1)) + 1
    links = coo_array((np.ones(len(axes), np.int8), (axes, whole.size + edge.ravel())), shape=(size, size))
    sheet = connected_components(links, directed=False)[1][: whole.size].reshape(whole.shape)
    rows = np.arange(len(conn))
    takes = np.where(whole, np.bincount(sheet[rows, own], minlength=size)[sheet], -1)
    best = takes.argmax(axis=1)
    return np.where(takes[rows, own] >= takes[rows, best], own, best)
