"""Owns distances between closed surfaces of triangles: of the nodes of each from the faces of the other."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.geometry.mesh import Mesh

FEW = 200  # triangles of a skin up to which they are not cut
PIECES = 40  # of the size of a skin, the reach of the others' pieces


class Nearest(NamedTuple):
    """Where two surfaces are nearest to each other.

    Attributes:
        distance: below 0 where they overlap [m].
        first, second: the points of the one and the other [m], each shape (3,), float64.
    """

    distance: float
    first: Array
    second: Array


class Skin:
    """A closed surface of triangles in the frame of its body.

    Attributes:
        points: its nodes [m], shape (count, 3), float64.
        triangles: corners [m], seen from outside in counterclockwise order, shape (triangle_count, 3, 3), float64.
    """

    def __init__(self, points: Array, faces: Index) -> None:
        """Of nodes [m], shape (count, 3), and faces of three corners, shape (triangle_count, 3)."""
        used = np.unique(faces)
        corners = points[faces]
        area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
        self.points, self.triangles = points[used], corners[area > 0.0]

    @staticmethod
    def of(mesh: Mesh) -> Skin:
        """The skin of a mesh; faces of four corners are cut in two."""
        faces = mesh.boundary[0]
        whole = faces[~is_triangle(faces)]
        return Skin(mesh.points, np.concatenate([faces[:, :3], whole[:, [0, 2, 3]]]))

    @cached_property
    def _normals(self) -> Array:
        a, b, c = self.triangles.transpose(1, 0, 2)
        normal = np.cross(b - a, c - a)
        return normal / np.linalg.norm(normal, axis=1, keepdims=True)

    @cached_property
    def _tree(self) -> tuple[object, Index, float]:
        """Tree of the middles of pieces of triangles, the triangle of each, and the greatest reach of a piece [m].

        Triangles of a skin with more than FEW are cut into pieces, so that large ones among them are near nothing far.
        """
        from scipy.spatial import KDTree

        pieces, owner = self.triangles, np.arange(len(self.triangles), dtype=np.int32)
        reach = lambda cut: np.linalg.norm(cut - cut.mean(axis=1)[:, None], axis=2).max(axis=1)  # noqa: E731
        most = float(np.linalg.norm(np.ptp(self.points, axis=0))) / PIECES if len(pieces) > FEW else np.inf
        while (large := reach(pieces) > most).any():
            a, b, c = pieces[large].transpose(1, 0, 2)
            ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
            quarters = [np.stack(corners, axis=1) for corners in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))]
            pieces = np.concatenate([pieces[~large], *quarters])
            owner = np.concatenate([owner[~large], np.tile(owner[large], 4)])
        return KDTree(pieces.mean(axis=1)), owner, float(reach(pieces).max())

    def nearest(self, points: Array) -> tuple[float, int, Array]:
        """Least signed distance of points from the surface [m], the number of that point and its foot.

        Points are looked at from the one that is nearest to the box around the surface on, until none can be nearer.
        Where the foot lies on an edge or a corner, the triangle that faces the point most says the side.

        Args:
            points: [m], shape (count, 3), float64.
        """
        tree, owner, reach = self._tree
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        least = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        first = int(least.argmin())
        within = np.flatnonzero(least <= tree.query(points[first])[0] + reach)  # type: ignore[attr-defined]
        near = np.full(len(points), np.inf)
        near[within], _ = tree.query(points[within])  # type: ignore[attr-defined]
        least[within] = np.maximum(least[within], near[within] - reach)
        best, which, foot = np.inf, 0, points[0]
        for k in within[np.argsort(least[within], kind="stable")]:
            if least[k] > best:
                break
            pieces = tree.query_ball_point(points[k], near[k] + reach * (1.0 + 1e-9))  # type: ignore[attr-defined]
            candidates = np.unique(owner[pieces])
            feet = closest_points(points[k], self.triangles[candidates])
            away = points[k] - feet
            distance = np.linalg.norm(away, axis=1)
            height = np.einsum("ij,ij->i", away, self._normals[candidates])
            tied = np.flatnonzero(distance <= distance.min() * (1.0 + 1e-9) + 1e-15)
            chosen = tied[np.abs(height[tied]).argmax()]
            signed = float(np.copysign(distance[chosen], height[chosen]))
            if signed < best:
                best, which, foot = signed, int(k), feet[chosen]
        return best, which, foot


def closest_points(point: Array, triangles: Array) -> Array:
    """The point of each triangle that is nearest to a point [m], shape (triangle_count, 3), float64.

    Foot on the plane where it lies within, else the nearest of those on the three edges.

    Args:
        point: [m], shape (3,), float64.
        triangles: corners [m], shape (triangle_count, 3, 3), float64.
    """
    starts, ends = triangles, np.roll(triangles, -1, axis=1)
    edge = ends - starts
    share = np.einsum("tei,tei->te", point - starts, edge) / np.einsum("tei,tei->te", edge, edge)
    on_edge = starts + np.clip(share, 0.0, 1.0)[..., None] * edge
    chosen = np.linalg.norm(point - on_edge, axis=2).argmin(axis=1)
    found = on_edge[np.arange(len(triangles)), chosen]
    normal = np.cross(edge[:, 0], edge[:, 1])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    foot = point - np.einsum("ti,ti->t", point - starts[:, 0], normal)[:, None] * normal
    inside = (np.einsum("tei,ti->te", np.cross(edge, foot[:, None] - starts), normal) >= 0.0).all(axis=1)
    found[inside] = foot[inside]
    return found
