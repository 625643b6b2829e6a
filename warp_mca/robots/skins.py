"""Owns distances between closed surfaces of triangles: of the nodes of each from the faces of the other."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.geometry.mesh import Mesh


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
    def _tree(self) -> tuple[object, float]:
        """Tree of the triangles' middles, and the greatest distance of a corner from its middle [m]."""
        from scipy.spatial import KDTree

        middle = self.triangles.mean(axis=1)
        return KDTree(middle), float(np.linalg.norm(self.triangles - middle[:, None], axis=2).max())

    def nearest(self, points: Array) -> tuple[float, int, Array]:
        """Least signed distance of points from the surface [m], the number of that point and its foot.

        Points are looked at from the one that is nearest to the box around the surface on, until none can be nearer.
        Where the foot lies on an edge or a corner, the triangle that faces the point most says the side.

        Args:
            points: [m], shape (count, 3), float64.
        """
        tree, reach = self._tree
        near, _ = tree.query(points)  # type: ignore[attr-defined]
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        beyond = np.linalg.norm(points - np.clip(points, low, high), axis=1)
        least = np.maximum(beyond, near - reach)
        best, which, foot = np.inf, 0, points[0]
        for k in np.argsort(least, kind="stable"):
            if least[k] > best:
                break
            candidates = tree.query_ball_point(points[k], near[k] + reach * (1.0 + 1e-9))  # type: ignore[attr-defined]
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
