"""Owns how deep two bodies lie in each other, from their skins alone: edges of one that cross faces of the other.

Bodies that overlap have skins that cross, whether or not a node of one lies in the other, unless one lies in the other
as a whole. The corners of the common part of two polyhedra are places where edges cross faces, and nodes within the
other body. Along a line through the common part each body takes an interval, (a0, a1) and (b0, b1): the bodies come
apart along it by min(a1 - b0, b1 - a0). The depth is the least of these over lines in many directions, and the greatest
over places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.random_scenes.placing import edges_of, near

Array = NDArray[np.float64]
Index = NDArray[np.integer]
PLACES, DIRECTIONS = 8, 24  # of lines that are looked at, drawn by lot where there are more
SAMPLES = 60  # triangles of a skin whose middles lines go through, evenly spread
LINES = 500_000  # lines times triangles at a time
NODES = 60  # within the other body that are looked for, by lot
SEEN = 0.8  # share of lines through a place that must find it in both bodies: on a surface rounding decides
SLIVER = 1e-12  # share of the square of an edge below which a triangle or an angle has no direction


@dataclass(frozen=True)
class Skin:
    """A closed surface.

    Attributes:
        x: nodes [m], shape (node_count, 3), float64.
        triangle: counter-clockwise from outside, shape (triangle_count, 3), int32.
        edge: shape (edge_count, 2), int32.
    """

    x: Array
    triangle: Index
    edge: Index

    @classmethod
    def of(cls, x: Array, triangle: Index) -> Skin:
        """The skin with these triangles; those with two equal corners are left out."""
        whole = triangle[(triangle != np.roll(triangle, 1, axis=1)).all(axis=1)]
        return cls(np.asarray(x, dtype=np.float64), whole, edges_of(whole))

    @property
    def normals(self) -> Array:
        """Of the triangles, times twice their area [m^2], shape (triangle_count, 3)."""
        a, b, c = (self.x[self.triangle[:, k]] for k in range(3))
        return np.cross(b - a, c - a)


def crossings(one: Skin, other: Skin) -> tuple[Array, Index, Index]:
    """Where edges of the one cross faces of the other: places [m], edges, triangles."""
    ends, corners = one.x[one.edge], other.x[other.triangle]
    low, high = np.maximum(one.x.min(axis=0), other.x.min(axis=0)), np.minimum(one.x.max(axis=0), other.x.max(axis=0))
    mine = np.flatnonzero(((ends.min(axis=1) <= high) & (ends.max(axis=1) >= low)).all(axis=1))
    theirs = np.flatnonzero(((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1))
    if not (len(mine) and len(theirs)):
        return np.zeros((0, 3)), mine[:0], theirs[:0]
    boxes = [(item.min(axis=1), item.max(axis=1)) for item in (ends[mine], corners[theirs])]
    k, t = near(boxes[0], boxes[1])
    k, t = mine[k], theirs[t]
    start, way = ends[k, 0], ends[k, 1] - ends[k, 0]
    s, inside = _hits(start, way, corners[t])
    inside &= (s >= 0.0) & (s <= 1.0)
    return (start + s[:, None] * way)[inside], k[inside], t[inside]


def _hits(start: Array, way: Array, corners: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Share of the way at which lines meet triangles, and whether they do (Möller and Trumbore, 1997)."""
    u, v = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    p, t = np.cross(way, v), start - corners[..., 0, :]
    det, q = (u * p).sum(axis=-1), np.cross(t, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b, s = (t * p).sum(axis=-1) / det, (way * q).sum(axis=-1) / det, (v * q).sum(axis=-1) / det
        return s, (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0) & np.isfinite(s)


def intervals(skin: Skin, origins: Array, directions: Array) -> Array:
    """Around each origin the part of a line that lies in the body, from a place before it to one behind it [m].

    Nan where the origin lies outside. Shape (origin_count, 2).

    Args:
        skin: of the body.
        origins, directions: [m] and of unit length, each shape (origin_count, 3).
    """
    normal, found = skin.normals, np.full((len(origins), 2), np.nan)
    corners = skin.x[skin.triangle]
    rows = max(1, LINES // len(corners))
    for first in range(0, len(origins), rows):
        part = slice(first, first + rows)
        s, inside = _hits(origins[part, None], directions[part, None], corners[None])
        leaves = directions[part] @ normal.T > 0.0
        ahead, behind = np.where(inside & (s > 0.0), s, np.inf), np.where(inside & (s <= 0.0), s, -np.inf)
        k, m, row = ahead.argmin(axis=1), behind.argmax(axis=1), np.arange(len(s))
        ends = np.column_stack([behind[row, m], ahead[row, k]])
        within = leaves[row, k] & ~leaves[row, m] & np.isfinite(ends).all(axis=1)
        found[part][within] = ends[within]
    return found


def depth(one: Skin, other: Skin, direction: Array, rng: np.random.Generator) -> tuple[float, Array]:
    """How deep the bodies lie in each other, and where [m]; 0 and nan where their skins do not cross.

    Args:
        one, other: their skins.
        direction: along which they approached each other, of unit length, shape (3,).
        rng: draws places and directions where there are many.
    """
    found = [crossings(one, other), crossings(other, one)]
    corners = np.concatenate([item[0] for item in found])
    if not len(corners):
        return 0.0, np.full(3, np.nan)
    directions = _directions(one, other, found, direction, rng)
    corners = np.concatenate([corners, _within(one, other, found[0][1], rng), _within(other, one, found[1][1], rng)])
    places = _places(corners, rng)
    origins, ways = np.repeat(places, len(directions), axis=0), np.tile(directions, (len(places), 1))
    a, b = intervals(one, origins, ways), intervals(other, origins, ways)
    apart = np.minimum(a[:, 1] - b[:, 0], b[:, 1] - a[:, 0]).reshape(len(places), -1)
    inside = np.isfinite(apart).mean(axis=1) > SEEN
    if not inside.any():  # a common part so flat that its middle lies in neither
        return 0.0, corners[0]
    least = np.nanmin(apart[inside], axis=1)
    return float(least.max()), places[inside][int(least.argmax())]


def _places(corners: Array, rng: np.random.Generator) -> Array:
    """Places in the common part: the middle of its corners, and of some of them."""
    threes, fives = (rng.integers(len(corners), size=(PLACES, count)) for count in (3, 5))
    return np.concatenate([corners.mean(axis=0)[None], corners[threes].mean(axis=1), corners[fives].mean(axis=1)])


def _within(one: Skin, other: Skin, edge: Index, rng: np.random.Generator) -> Array:
    """Nodes of the one that lie in the other: ends of edges that cross its faces, and some of all [m]."""
    low, high = other.x.min(axis=0), other.x.max(axis=0)
    amid = np.flatnonzero(((one.x > low) & (one.x < high)).all(axis=1))
    nodes = np.concatenate([rng.permutation(np.unique(one.edge[edge]))[:NODES], rng.permutation(amid)[:NODES]])
    points = one.x[np.unique(nodes)]
    way = np.array([0.36, 0.48, 0.8])
    return points[np.isfinite(intervals(other, points, np.tile(way, (len(points), 1)))).all(axis=1)]


def _directions(
    one: Skin, other: Skin, found: list[tuple[Array, Index, Index]], direction: Array, rng: np.random.Generator
) -> Array:
    """Directions in which the bodies may come apart: that of approach, normals of faces, and across pairs of edges."""
    edge_of = [skin.x[skin.edge[:, 1]] - skin.x[skin.edge[:, 0]] for skin in (one, other)]
    normals = [skin.normals[np.unique(item[2])] for skin, item in ((other, found[0]), (one, found[1]))]
    ways = [edge_of[k][np.unique(found[k][1])] for k in range(2)]
    some = [way[rng.permutation(len(way))[:DIRECTIONS]] for way in ways]
    across = np.cross(some[0][:, None], some[1][None]).reshape(-1, 3) if all(map(len, some)) else np.zeros((0, 3))
    chosen = [item[rng.permutation(len(item))[:DIRECTIONS]] for item in (*normals, across)]
    every = np.concatenate([direction[None], *chosen])
    size = np.linalg.norm(every, axis=1)
    return every[size > SLIVER * size.max()] / size[size > SLIVER * size.max(), None]


def reversed_share(one: Skin, other: Skin, direction: Array) -> float:
    """Share of lines along `direction` through both bodies on which the other has got ahead of the one; 0 without any.

    Before they meet, the one lies ahead on all of them.
    """
    shares = []
    for skin in (one, other):
        start = skin.x[skin.triangle].mean(axis=1)
        start = start[:: max(1, len(start) // SAMPLES)]
        order = [_middle(body, start, direction) for body in (one, other)]
        both = np.isfinite(order[0]) & np.isfinite(order[1])
        shares.append((order[1] > order[0])[both])
    found = np.concatenate(shares)
    return float(found.mean()) if len(found) else 0.0


def _middle(skin: Skin, start: Array, direction: Array) -> Array:
    """Middle of what a body takes of lines along a direction, from their starts [m]; nan where they miss it."""
    s, inside = _hits(start[:, None], direction, skin.x[skin.triangle][None])
    first, last = np.where(inside, s, np.inf).min(axis=1), np.where(inside, s, -np.inf).max(axis=1)
    return np.where(inside.any(axis=1), 0.5 * (first + np.where(np.isfinite(last), last, 0.0)), np.nan)
