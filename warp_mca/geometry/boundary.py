"""Owns the boundary of a volume mesh: the faces that belong to one cell only."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.geometry.cell_types import CELL_TYPES, is_triangle

BITS = 20  # of the numbers that nodes get: sums over 600 cells around a node are exact in float64


def boundary_faces(cells: Mapping[str, Index], node_count: int) -> tuple[Index, Index, Index]:
    """Faces that belong to one cell only, oriented outwards: nodes (face_count, 4), cell (face_count,).

    Triangles have their last corner twice.

    Args:
        cells: nodes of the cells of each type, as `Mesh.cells`; cells are counted in this order.
        node_count: of the mesh.

    Returns:
        Nodes and cells, and the first two cells that lie on the same side of a face, shape (2,), or none, (0,).
    """
    near = _near_boundary(cells, node_count)
    faces, owners, first = [], [], 0
    for name, conn in cells.items():
        table = CELL_TYPES[name].quads
        index = np.flatnonzero(near[conn].any(axis=1))
        found = _triangles_last(conn[index][:, table].reshape(-1, 4))
        kept = near[found].any(axis=1)  # all cells around such a face are among these
        kept &= found[:, 1] != found[:, 2]  # faces that collapsed to an edge or a point are left out
        faces.append(found[kept])
        owners.append((first + np.repeat(index, len(table)))[kept])
        first += len(conn)
    nodes, owner = np.concatenate(faces), np.concatenate(owners)
    key = nodes.copy()
    key[is_triangle(nodes), 3] = -1
    key = np.sort(key, axis=1)
    _, place, group, count = np.unique(key, axis=0, return_index=True, return_inverse=True, return_counts=True)
    own = np.sort(place[count == 1])
    return nodes[own].astype(np.int32), owner[own].astype(np.int32), _overlapping(nodes, owner, group, count)


def faces_between(cells: Mapping[str, Index]) -> tuple[Index, Index, Index]:
    """Faces between two cells, both sides of each, in the order of the cells.

    Returns:
        Nodes, oriented outwards, shape (face_count, 4), triangles with their last corner twice; the cell that each
        bounds, and the one on its other side, shape (face_count,); all int32.
    """
    faces, owners, first = [], [], 0
    for name, conn in cells.items():
        table = CELL_TYPES[name].quads
        found = _triangles_last(conn[:, table].reshape(-1, 4))
        kept = found[:, 1] != found[:, 2]
        faces.append(found[kept])
        owners.append((first + np.repeat(np.arange(len(conn)), len(table)))[kept])
        first += len(conn)
    node, owner = np.concatenate(faces), np.concatenate(owners)
    key = node.copy()
    key[is_triangle(node), 3] = -1
    key = np.sort(key, axis=1)
    order = np.lexsort(key.T[::-1])
    same = (key[order[1:]] == key[order[:-1]]).all(axis=1)
    one, other = order[:-1][same], order[1:][same]
    opposite = np.full(len(node), -1)
    opposite[one], opposite[other] = owner[other], owner[one]
    inner = opposite >= 0
    return node[inner].astype(np.int32), owner[inner].astype(np.int32), opposite[inner].astype(np.int32)


def _overlapping(nodes: Index, owner: Index, group: NDArray, count: NDArray) -> Index:
    """The first two cells on the same side of a face, of faces in groups with the same corners."""
    shared = np.flatnonzero(count[group] > 1)
    side = group[shared] * 2 + _turns_left(nodes[shared])
    order = np.argsort(side, kind="stable")
    same = np.flatnonzero(side[order[1:]] == side[order[:-1]])
    return owner[shared[order[same[:1, None] + [0, 1]]]].ravel().astype(np.int32)


def _turns_left(faces: Index) -> NDArray[np.bool_]:
    """Sense in which corners go around each face, whichever comes first; it is reversed as seen from behind."""
    rows, last = np.arange(len(faces)), np.where(is_triangle(faces), 2, 3)
    least = np.argmin(faces, axis=1)
    return faces[rows, (least + 1) % (last + 1)] < faces[rows, (least + last) % (last + 1)]


def _near_boundary(cells: Mapping[str, Index], node_count: int) -> NDArray[np.bool_]:
    """Whether faces around a node may be on the boundary, shape (node_count,): the others need no sorting.

    Nodes get two random numbers each, as if they were coordinates in a plane, and every face its area there, as seen
    from outside its cell. The two cells of an inner face see it with opposite signs, so that areas around an inner
    node sum to 0, exactly because they are whole numbers. That they do so at all nodes of a face on the boundary has a
    chance below 1e-30.
    """
    u, v = np.random.default_rng(0).integers(1 << BITS, size=(2, node_count)).astype(np.float64)
    total = np.zeros(node_count)
    for name, conn in cells.items():
        table = CELL_TYPES[name].quads
        for part in chunks(len(conn), CHUNK):
            corner = np.ascontiguousarray(conn[part].T)
            p, q = u[corner], v[corner]
            area = np.zeros(corner.shape)
            for a, b, c, d in table:
                size = (p[a] - p[c]) * (q[b] - q[d]) - (p[b] - p[d]) * (q[a] - q[c])
                for k in {a, b, c, d}:
                    area[k] += size
            np.add.at(total, corner.ravel(), area.ravel())
    return total != 0.0


def _triangles_last(faces: Index) -> Index:
    """Faces with their corners rotated so that a repeated one comes last; corners 1 and 2 of collapsed faces agree."""
    rotated = faces.copy()
    for k in range(3):
        twice = faces[:, k] == faces[:, k + 1]
        rotated[twice] = np.roll(faces, 2 - k, axis=1)[twice]
    ends = (faces[:, 0] == faces[:, 3]) & (faces[:, 0] != faces[:, 1])
    rotated[ends] = np.roll(faces, -1, axis=1)[ends]
    collapsed = _corner_counts(faces) < 3
    rotated[collapsed] = faces[collapsed][:, :1]
    return rotated


def _corner_counts(faces: Index) -> NDArray[np.intp]:
    """Number of different corners of each face."""
    ordered = np.sort(faces, axis=1)
    return 1 + (np.diff(ordered, axis=1) != 0).sum(axis=1)
