"""Owns the meshes of hollow round bodies for verification: a quarter of a ring, an eighth of a hollow sphere."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.mesh import Mesh

Array = NDArray[np.float64]


def quarter_ring(inner: float, outer: float, radial: int, around: int, height: float) -> Mesh:
    """One layer of cells along z, from x = 0 to y = 0 around the z axis.

    Node sets: x0, y0 and z0 on the planes of symmetry, z1 on top, inner and outer.
    """
    r = np.linspace(inner, outer, radial + 1)
    angle = np.linspace(0.0, 0.5 * np.pi, around + 1)
    R, A, Z = np.meshgrid(r, angle, [0.0, height], indexing="ij")
    points = np.stack([R * np.cos(A), R * np.sin(A), Z], axis=-1).reshape(-1, 3)
    points[np.abs(points) < 1e-12 * outer] = 0.0
    cells = _bricks(np.arange(len(points)).reshape(R.shape))
    sets = {"z1": points[:, 2] == height, "z0": points[:, 2] == 0.0, **_planes(points)}
    return _mesh(points, cells, sets, inner, outer, 2)


def hollow_octant(inner: float, outer: float, radial: int, around: int) -> Mesh:
    """An eighth of a hollow sphere, three blocks of `around` squared cells in a layer.

    Node sets: x0, y0, z0 on the planes of symmetry, inner and outer.
    """
    t = np.tan(np.linspace(0.0, 0.25 * np.pi, around + 1))
    r = np.linspace(inner, outer, radial + 1)
    rows, cells, first = [], [], 0
    for axis in range(3):
        S, T, R = np.meshgrid(t, t, r, indexing="ij")
        way = np.roll(np.stack([np.ones_like(S), S, T], axis=-1), axis, axis=-1)
        rows.append((R[..., None] * way / np.linalg.norm(way, axis=-1, keepdims=True)).reshape(-1, 3))
        cells.append(first + _bricks(np.arange(S.size).reshape(S.shape)))
        first += S.size
    points = np.concatenate(rows)
    points[np.abs(points) < 1e-12 * outer] = 0.0
    _, kept, place = np.unique(np.round(points / outer, 9), axis=0, return_index=True, return_inverse=True)
    points, conn = points[kept], place.ravel()[np.concatenate(cells)]
    return _mesh(points, conn, {"z0": points[:, 2] == 0.0, **_planes(points)}, inner, outer, 3)


def _bricks(number: NDArray) -> NDArray:
    """Hexahedra of a grid of nodes in VTK order, shape (cell_count, 8); right-handed or not as the grid is."""
    low, high = slice(None, -1), slice(1, None)
    corners = [(low, low), (high, low), (high, high), (low, high)]
    found = [number[(*c, z)].ravel() for z in (low, high) for c in corners]
    return np.stack(found, axis=1)


def _planes(points: Array) -> dict[str, NDArray[np.bool_]]:
    return {"x0": points[:, 0] == 0.0, "y0": points[:, 1] == 0.0}


def _mesh(points: Array, cells: NDArray, sets: dict, inner: float, outer: float, dimensions: int) -> Mesh:
    radius = np.linalg.norm(points[:, :dimensions], axis=1)
    sets = {**sets, "inner": radius < inner * (1.0 + 1e-9), "outer": radius > outer * (1.0 - 1e-9)}
    named = {name: np.flatnonzero(found).astype(np.int32) for name, found in sets.items()}
    return Mesh(points=points, hexahedra=cells.astype(np.int32), node_sets=named)
