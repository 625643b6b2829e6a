"""Owns the boundary of a volume mesh: the faces that belong to one cell only."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.elements.hexahedron import CHUNK, chunks

Index = NDArray[np.int32]

# Faces in VTK/gmsh node order, each listed counter-clockwise seen from outside; triangles have their last corner twice.
HEX_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]], dtype=np.int32
)
TET_FACES = np.array([[0, 2, 1, 1], [0, 1, 3, 3], [1, 2, 3, 3], [2, 0, 3, 3]], dtype=np.int32)

BITS = 20  # of the numbers that nodes get: sums over 600 cells around a node are exact in float64


def boundary_faces(hexahedra: Index, tetrahedra: Index, node_count: int) -> tuple[Index, Index]:
    """Faces that belong to one cell only, oriented outwards: nodes (face_count, 4), cell (face_count,).

    Cells are counted over the hexahedra, then the tetrahedra. Triangles have their last corner twice.
    """
    near = _near_boundary(hexahedra, tetrahedra, node_count)
    faces, owners = [], []
    for cells, table, first in ((hexahedra, HEX_FACES, 0), (tetrahedra, TET_FACES, len(hexahedra))):
        index = np.flatnonzero(near[cells].any(axis=1))
        found = _triangles_last(cells[index][:, table].reshape(-1, 4))
        kept = near[found].any(axis=1)  # all cells around such a face are among these
        faces.append(found[kept])
        owners.append((first + np.repeat(index, len(table)))[kept])
    nodes, owner = np.concatenate(faces), np.concatenate(owners)
    key = nodes.copy()
    key[nodes[:, 2] == nodes[:, 3], 3] = -1
    key = np.sort(key, axis=1)
    _, place, count = np.unique(key, axis=0, return_index=True, return_counts=True)
    own = np.sort(place[count == 1])
    own = own[nodes[own, 1] != nodes[own, 2]]  # what collapsed to an edge or a point is no face
    return nodes[own].astype(np.int32), owner[own].astype(np.int32)


def _near_boundary(hexahedra: Index, tetrahedra: Index, node_count: int) -> NDArray[np.bool_]:
    """Whether faces around a node may be on the boundary, shape (node_count,): the others need no sorting.

    Nodes get two random numbers each, as if they were coordinates in a plane, and every face its area there, as seen
    from outside its cell. The two cells of an inner face see it with opposite signs, so that areas around an inner
    node sum to 0, exactly because they are whole numbers. That they do so at all nodes of a face on the boundary has a
    chance below 1e-30.
    """
    u, v = np.random.default_rng(0).integers(1 << BITS, size=(2, node_count)).astype(np.float64)
    total = np.zeros(node_count)
    for cells, table in ((hexahedra, HEX_FACES), (tetrahedra, TET_FACES)):
        for part in chunks(len(cells), CHUNK):
            corner = np.ascontiguousarray(cells[part].T)
            p, q = u[corner], v[corner]
            area = np.zeros(corner.shape)
            for a, b, c, d in table:
                size = (p[a] - p[c]) * (q[b] - q[d]) - (p[b] - p[d]) * (q[a] - q[c])
                for k in {a, b, c, d}:
                    area[k] += size
            np.add.at(total, corner.ravel(), area.ravel())
    return total != 0.0


def _triangles_last(faces: Index) -> Index:
    """Faces turned so that a corner that appears twice comes last; with more than two alike, corners 1 and 2 are."""
    turned = faces.copy()
    for k in range(3):
        twice = faces[:, k] == faces[:, k + 1]
        turned[twice] = np.roll(faces, 2 - k, axis=1)[twice]
    ends = (faces[:, 0] == faces[:, 3]) & (faces[:, 0] != faces[:, 1])
    turned[ends] = np.roll(faces, -1, axis=1)[ends]
    collapsed = _kinds(faces) < 3
    turned[collapsed] = faces[collapsed][:, :1]
    return turned


def _kinds(faces: Index) -> NDArray[np.intp]:
    """Number of different corners of each face."""
    ordered = np.sort(faces, axis=1)
    return 1 + (np.diff(ordered, axis=1) != 0).sum(axis=1)
