"""Owns normals that are smooth over curved skins and keep sharp edges: one for each group of face corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import is_triangle

CREASE = np.cos(np.radians(35.0))  # faces that meet at a greater angle keep a sharp edge
WATCHED = 60  # faces that are looked at for a turn, at least, and less than twice as many
TURNED = np.cos(np.radians(5.0))  # faces that turned by more get new normals


class Creases:
    """Groups of the corners of faces at a vertex, cut where faces meet at an edge.

    Attributes:
        group: of each corner of each face, faces one after the other; triangles have three; shape (corner_count,),
            int32.
        count: how many there are.
    """

    def __init__(self, quads: NDArray[np.int32], points: NDArray[np.floating]) -> None:
        """Find the edges of a skin.

        Args:
            quads: vertices of each face, triangles with their last one twice, shape (face_count, 4), int32.
            points: of the vertices [m], shape (vertex_count, 3), float32 or float64.
        """
        from scipy.sparse import coo_matrix
        from scipy.sparse.csgraph import connected_components

        self.quads = quads
        count = np.where(is_triangle(quads), 3, 4)
        self._used = np.arange(4) < count[:, None]
        first, second = _corners_over_edges(quads, count, _units(_normals(points, quads)))
        size = self.quads.size
        links = coo_matrix((np.ones(len(first), dtype=bool), (first, second)), shape=(size, size))
        label = connected_components(links, directed=False)[1].reshape(self.quads.shape)
        groups, group = np.unique(label[self._used], return_inverse=True)
        self.group, self.count = group.astype(np.int32), len(groups)
        self._watched = quads[:: max(1, len(quads) // WATCHED)]
        self._seen: NDArray[np.floating] | None = None

    def normals(self, points: NDArray[np.floating]) -> NDArray[np.float32] | None:
        """Unit normals of the groups, shape (count, 3), float32; None where no face turned by more than 5 degrees.

        Some sixty faces spread over the skin are looked at.
        """
        watched = _units(_normals(points, self._watched))
        if self._seen is not None and (np.einsum("ij,ij->i", watched, self._seen) >= TURNED).all():
            return None
        self._seen = watched
        face = _normals(points, self.quads)
        corner = np.broadcast_to(face[:, None], (*self.quads.shape, 3))[self._used]
        sums = [np.bincount(self.group, corner[:, k], minlength=self.count) for k in range(3)]
        return _units(np.stack(sums, axis=1)).astype(np.float32)

    def by_triangle(self, points: NDArray[np.floating]) -> tuple[NDArray[np.floating], NDArray[np.int32]]:
        """Normals at the corners of faces cut in triangles, shape (count, 3, 3); their vertices, shape (count, 3)."""
        normals = self.normals(points)
        assert normals is not None  # first call
        group = np.zeros(self.quads.shape, dtype=np.int32)
        group[self._used] = self.group
        halves = [(slice(None), [0, 1, 2]), (self._used[:, 3], [0, 2, 3])]
        corner = np.concatenate([self.quads[faces][:, at] for faces, at in halves])
        return normals[np.concatenate([group[faces][:, at] for faces, at in halves])], corner


def _normals(points: NDArray[np.floating], quads: NDArray[np.int32]) -> NDArray[np.floating]:
    """Normals of faces, as long as twice their area [m^2], shape (face_count, 3)."""
    corner = points[quads]
    (ax, ay, az), (bx, by, bz) = (corner[:, 2] - corner[:, 0]).T, (corner[:, 3] - corner[:, 1]).T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def _units(vectors: NDArray) -> NDArray[np.floating]:
    length = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))[:, None]
    return vectors / np.maximum(length, np.finfo(np.float32).tiny)


def _corners_over_edges(quads: NDArray, count: NDArray, normal: NDArray) -> tuple[NDArray, NDArray]:
    """Pairs of corners, numbered 4 face + corner, that faces on both sides of a smooth edge have at its ends."""
    face, start = np.nonzero(np.arange(4) < count[:, None])
    end = (start + 1) % count[face]
    ends = np.stack([quads[face, start], quads[face, end]], axis=1)
    turned = ends[:, 0] > ends[:, 1]
    key = np.sort(ends, axis=1)
    corner = np.stack([4 * face + start, 4 * face + end], axis=1)
    corner[turned] = corner[turned][:, ::-1]
    order = np.lexsort((key[:, 1], key[:, 0]))
    key, corner, face = key[order], corner[order], face[order]
    smooth = (key[1:] == key[:-1]).all(axis=1)
    smooth &= np.einsum("ij,ij->i", normal[face[1:]], normal[face[:-1]]) > CREASE
    return corner[:-1][smooth].ravel(), corner[1:][smooth].ravel()
