"""Owns distances between closed surfaces of triangles: of the nodes of each from the faces of the other."""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.geometry.cell_types import is_triangle
from warp_mca.geometry.mesh import Mesh

PIECES = 40  # the size of a skin over the reach of its pieces
SAME = 1.0 + 1e-9  # ratio of distances below which two triangles are equally near


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
    def _tree(self) -> tuple[Any, Index, float]:
        """Tree of the middles of pieces of triangles, the triangle of each, and the greatest reach of a piece [m].

        Triangles are halved across their longest edge into pieces, so that a large one is near nothing far.
        """
        from scipy.spatial import KDTree

        pieces, owner = self.triangles, np.arange(len(self.triangles), dtype=np.int32)
        reach = lambda cut: np.linalg.norm(cut - cut.mean(axis=1)[:, None], axis=2).max(axis=1)  # noqa: E731
        most = float(np.linalg.norm(np.ptp(self.points, axis=0))) / PIECES
        while (large := reach(pieces) > most).any():
            cut = pieces[large]
            longest = np.linalg.norm(np.roll(cut, -1, axis=1) - cut, axis=2).argmax(axis=1)
            order = (longest[:, None] + np.arange(3)) % 3
            a, b, c = np.take_along_axis(cut, order[..., None], axis=1).transpose(1, 0, 2)
            halves = [np.stack(corners, axis=1) for corners in ((a, 0.5 * (a + b), c), (0.5 * (a + b), b, c))]
            pieces = np.concatenate([pieces[~large], *halves])
            owner = np.concatenate([owner[~large], np.tile(owner[large], 2)])
        return KDTree(pieces.mean(axis=1)), owner, float(reach(pieces).max())

    def nearest(self, points: Array) -> tuple[float, int, Array]:
        """Least signed distance of points from the surface [m], the number of that point and its foot.

        Points in the box around the surface may lie inside, and the deepest one counts. Of others those count that may
        be the nearest one. Where the foot lies on an edge or a corner, the triangle that faces the point most says the
        side.

        Args:
            points: [m], shape (count, 3), float64.
        """
        tree, owner, reach = self._tree
        boxed = ((points >= self.points.min(axis=0)) & (points <= self.points.max(axis=0))).all(axis=1)
        near, piece = tree.query(points)
        some = np.flatnonzero(boxed | (near - reach <= near.min()))
        feet = closest_points(points[some], self.triangles[owner[piece[some]]])
        bound = np.linalg.norm(points[some] - feet, axis=1)
        bound = np.where(boxed[some], bound, bound.min()) * SAME + np.finfo(float).tiny
        chosen, bound = (item[boxed[some] | (near[some] - reach <= bound)] for item in (some, bound))
        found = tree.query_ball_point(points[chosen], bound + reach, return_sorted=False)
        which = np.repeat(chosen, [len(item) for item in found])
        pairs = np.unique(which * len(self.triangles) + owner[np.concatenate(found).astype(np.int64)])
        which, triangle = np.divmod(pairs, len(self.triangles))
        feet = closest_points(points[which], self.triangles[triangle])
        away = points[which] - feet
        distance, height = np.linalg.norm(away, axis=1), np.einsum("ij,ij->i", away, self._normals[triangle])
        starts = np.flatnonzero(np.diff(which, prepend=-1))
        smallest = np.repeat(np.minimum.reduceat(distance, starts), np.diff(starts, append=len(which)))
        tied = np.flatnonzero(distance <= smallest * SAME + 1e-15)
        order = tied[np.lexsort((-np.abs(height[tied]), which[tied]))]
        order = order[np.diff(which[order], prepend=-1) > 0]  # the first triangle of each point
        signed = np.where(boxed[which[order]], np.copysign(distance[order], height[order]), distance[order])
        k = order[signed.argmin()]
        return float(signed.min()), int(which[k]), feet[k]


def closest_points(points: Array, triangles: Array) -> Array:
    """The point of each triangle that is nearest to a point [m], shape (triangle_count, 3), float64.

    Foot on the plane where it lies within, else the nearest of those on the three edges.

    Args:
        points: of each triangle, or one for all [m], shape (triangle_count, 3) or (3,), float64.
        triangles: corners [m], shape (triangle_count, 3, 3), float64.
    """
    starts, edge = triangles, triangles[:, [1, 2, 0]] - triangles
    arm = np.reshape(points, (-1, 1, 3)) - starts
    share = np.einsum("tei,tei->te", arm, edge) / np.einsum("tei,tei->te", edge, edge)
    off_edge = arm - np.clip(share, 0.0, 1.0)[..., None] * edge
    chosen = np.einsum("tei,tei->te", off_edge, off_edge).argmin(axis=1)
    found = points - off_edge[np.arange(len(triangles)), chosen]
    normal = _cross(edge[:, 0], edge[:, 1])
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    foot = points - np.einsum("ti,ti->t", arm[:, 0], normal)[:, None] * normal
    inside = (np.einsum("tei,ti->te", _cross(edge, foot[:, None] - starts), normal) >= 0.0).all(axis=1)
    found[inside] = foot[inside]
    return found


def _cross(a: Array, b: Array) -> Array:
    """Cross products, without what `np.cross` takes to find axes."""
    ax, ay, az, bx, by, bz = (item[..., k] for item in (a, b) for k in range(3))
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=-1)
