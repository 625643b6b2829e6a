"""Owns the lengths of a skin at the start: its faces and edges, its thin parts, and how far its faces are apart."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np
import warp as wp

from warp_mca.base.arrays import Array, Index
from warp_mca.base.kept import Kept
from warp_mca.kernels.contact import crossing

THIN = 0.05  # quantile of distances through a body that counts as its thickness: at sharp edges it has none
RAYS = 2048  # through a body and away from it, evenly spread over its triangles


@dataclass(frozen=True)
class SkinShape:
    """Lengths of a skin [m].

    Attributes:
        width: of a face, median.
        longest: longest edge.
        shortest: of the edges at each node, shape (node_count,), float64.
        extents: of the body along its principal axes, from the least to the greatest, shape (3,), float64.
        thickness: of the thin parts of the body.
        gap: least distance over which its faces see others of it from outside; inf where they see none.
    """

    width: float
    longest: float
    shortest: Array
    extents: Array
    thickness: float
    gap: float


_KEPT: Kept[SkinShape] = Kept(500_000)  # nodes of skins of this process, 4 MB of memory


def shape_of(x: Array, triangle: Index, edge: Index) -> SkinShape:
    """The shape of nodes at x [m], shape (node_count, 3), float64; found once for equal ones.

    Args:
        x: as above.
        triangle: of the skin, shape (triangle_count, 3), int32.
        edge: of these, each once, shape (edge_count, 2), int32.
    """
    key = hashlib.sha256(x.tobytes() + triangle.tobytes()).digest()
    if (found := _KEPT.get(key)) is None:
        found = _shape(x, triangle, edge)
        _KEPT.put(key, found, len(x))
    return found


def _shape(x: Array, triangle: Index, edge: Index) -> SkinShape:
    length = np.linalg.norm(x[edge[:, 0]] - x[edge[:, 1]], axis=1)
    shortest = np.full(len(x), np.inf)
    np.minimum.at(shortest, edge.ravel(), np.repeat(length, 2))
    a, b, c = (x[triangle[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    size = np.linalg.norm(normal, axis=1)
    centred = x - x.mean(axis=0)
    extents = np.sort(np.ptp(centred @ np.linalg.eigh(centred.T @ centred)[1], axis=0))
    some, reach = slice(None, None, -(-len(normal) // RAYS)), float(np.linalg.norm(extents))
    middle, unit = ((a + b + c) / 3.0 - x.mean(axis=0))[some], normal[some] / size[some, None]
    inward, outward = _ray_lengths(centred, triangle, middle, unit, reach)
    gap = float(outward.min())
    return SkinShape(
        width=float(np.sqrt(np.median(size))),
        longest=float(length.max()),
        shortest=shortest,
        extents=extents,
        thickness=min(float(np.quantile(inward, THIN)), extents[0]),
        gap=gap if gap < 0.99 * reach else np.inf,  # in float32
    )


def _ray_lengths(x: Array, triangle: Index, middle: Array, unit: Array, reach: float) -> list[Array]:
    """Lengths of rays from the middles of triangles against their normals and along them, `reach` [m] at most."""
    nodes = wp.array(x.astype(np.float32), dtype=wp.vec3f, device="cpu")
    mesh = wp.Mesh(nodes, wp.array(triangle.ravel(), dtype=wp.int32, device="cpu"))
    found = []
    for sign in (-1.0, 1.0):
        origin = (middle + 1e-5 * reach * sign * unit).astype(np.float32)
        start = wp.array(origin, dtype=wp.vec3f, device="cpu")
        direction = wp.array((sign * unit).astype(np.float32), dtype=wp.vec3f, device="cpu")
        length = wp.zeros(len(middle), dtype=wp.float32, device="cpu")
        inputs = [mesh.id, start, direction, reach]
        wp.launch(crossing.ray_lengths, len(middle), inputs=inputs, outputs=[length], device="cpu")
        found.append(length.numpy().astype(float))
    return found
