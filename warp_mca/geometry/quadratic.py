"""Owns the nodes within the edges of ten-node tetrahedra: put there, dropped, and moved where edges bend too far."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.boundary import boundary_faces
from warp_mca.geometry.cell_types import TETRAHEDRON
from warp_mca.geometry.tetra10 import EDGES, POINTS, edges_at

Array = NDArray[np.float64]
Index = NDArray[np.int32]

LEAST = 0.2  # of the mean of the Jacobian determinant, below which the edges of a cell are straightened
_LOOKED_AT = np.concatenate([POINTS, np.eye(4), 0.5 * (np.eye(4)[EDGES[:, 0]] + np.eye(4)[EDGES[:, 1]])])


def edges_of(corners: Index) -> tuple[Index, Index]:
    """Edges of tetrahedra by their two nodes, the lesser first, shape (edge_count, 2), and those of each, shape
    (tetrahedron_count, 6), in the order of `tetra10.EDGES`; corners: shape (tetrahedron_count, 4)."""
    ends = np.sort(corners[:, EDGES], axis=2).reshape(-1, 2)
    key = ends[:, 0].astype(np.int64) * (int(corners.max(initial=0)) + 1) + ends[:, 1]
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    return ends[first].astype(np.int32), number.reshape(-1, len(EDGES)).astype(np.int32)


def with_middles_of_faces(cells: Index, node_sets: Mapping[str, Index], node_count: int) -> dict[str, Index]:
    """Node sets with the nodes within the edges of those faces of the boundary whose corners they have.

    Args:
        cells: nodes of the ten-node tetrahedra, shape (cell_count, 10), int32.
        node_sets: by name, each shape (count,), int32.
        node_count: of the mesh.
    """
    faces, owner, _ = boundary_faces({TETRAHEDRON.name: cells[:, : TETRAHEDRON.corners]}, node_count)
    own = cells[owner]
    corner = (own[:, : TETRAHEDRON.corners, None] == faces[:, None]).any(axis=2)
    on_face = corner[:, EDGES].all(axis=2)
    found = {}
    for name, nodes in node_sets.items():
        member = np.zeros(node_count, dtype=bool)
        member[nodes] = True
        whole = member[faces].all(axis=1)
        member[own[whole, TETRAHEDRON.corners :][on_face[whole]]] = True
        found[name] = np.flatnonzero(member).astype(np.int32)
    return found


def straightened(points: Array, cells: Index, least: float = LEAST) -> Array:
    """Positions of nodes with the edges of cells straight whose Jacobian determinant falls too far anywhere.

    It is looked at in the integration points, at corners and in the middles of edges.

    Args:
        points: [m], shape (node_count, 3), float64.
        cells: nodes of the ten-node tetrahedra, shape (cell_count, 10), int32.
        least: determinant over its mean in the cell from which on edges stay as they are [-].

    Raises:
        ValueError: a node lies within two edges, as where a file has the nodes in another order.
    """
    middle, edge = cells[:, TETRAHEDRON.corners :], edges_of(cells[:, : TETRAHEDRON.corners])[1]
    node, times = np.unique(
        np.unique(np.stack([middle, edge], axis=2).reshape(-1, 2), axis=0)[:, 0], return_counts=True
    )
    if (times > 1).any():
        raise ValueError(f"node {node[times > 1][0]}, counted from 0, lies within several edges of ten-node tetrahedra")
    points = points.copy()
    left = np.arange(len(cells))
    middles = 0.5 * (points[cells[:, EDGES[:, 0]]] + points[cells[:, EDGES[:, 1]]])
    while True:  # straight edges may bend a neighbour more; there is an end, since cells that are straight are good
        found = np.linalg.det(edges_at(points[cells[left]], _LOOKED_AT))
        bad = left[found.min(axis=1) < least * np.abs(found[:, : len(POINTS)].mean(axis=1))]
        bad = bad[(points[cells[bad, 4:]] != middles[bad]).any(axis=(1, 2))]
        if not len(bad):
            return points
        points[cells[bad, 4:]] = middles[bad]
        moved = np.zeros(len(points), dtype=bool)
        moved[cells[bad, 4:]] = True
        left = np.flatnonzero(moved[cells[:, 4:]].any(axis=1))
