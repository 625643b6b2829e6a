"""Owns the exact volume of the solids in a CAD file: OpenCASCADE's, or that within the triangles of an STL file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.geometry.cad_drawing import merge

_TRIANGLE = 2  # number of the linear triangle in gmsh


def solid_volumes(gmsh: Any, path: str) -> Array:
    """Volume of each solid of the model that gmsh has drawn from a file, in the file's unit; empty if not known."""
    if Path(path).suffix.lower() != ".stl":
        found = np.abs([gmsh.model.occ.getMass(3, tag) for _, tag in gmsh.model.getEntities(3)])
        return found if (np.isfinite(found) & (found > 0.0)).all() else np.zeros(0)
    before = gmsh.model.getCurrent()
    gmsh.model.add("warp_mca_stl")  # the drawn model no longer has the file's own triangles
    try:
        merge(gmsh, path)
        triangles = gmsh.model.mesh.getElementsByType(_TRIANGLE)[1].reshape(-1, 3)
        tags, coordinates, _ = gmsh.model.mesh.getNodes()
    finally:
        gmsh.model.remove()
        gmsh.model.setCurrent(before)
    order = np.argsort(tags)
    volume = enclosed_volume(coordinates.reshape(-1, 3)[order], np.searchsorted(tags[order], triangles))
    return np.zeros(0) if volume is None else np.array([volume])


def divided(pieces: Array, names: Sequence[str], whole: Mapping[str, float]) -> Array:
    """Volumes of pieces of solids, scaled to those of the whole solids by name; empty if these are not known."""
    if not whole or not len(pieces):
        return np.zeros(0)
    total = {name: float(pieces[[own == name for own in names]].sum()) for name in names}
    return np.array([piece * whole[name] / total[name] for piece, name in zip(pieces, names, strict=True)])


def enclosed_volume(points: Array, triangles: NDArray[np.integer]) -> float | None:
    """Volume within a closed surface [m^3], less that of the voids in it; None where triangles are not turned alike.

    V = 1/6 sum of a . (b x c), by the divergence theorem, for each surface that hangs together. The largest one bounds
    the solid, the others its voids, whichever way they are turned.

    Args:
        points: [m], shape (node_count, 3). triangles: nodes of each, shape (count, 3).
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    sides = sides[sides[:, 0] != sides[:, 1]]
    count = len(points)
    there, back = (np.sort(sides[:, i] * count + sides[:, 1 - i]) for i in (0, 1))
    if not np.array_equal(there, back):
        return None
    shape = (count, count)
    label = connected_components(coo_array((np.ones(len(sides)), tuple(sides.T)), shape=shape), directed=False)[1]
    a, b, c = np.moveaxis((points - points.mean(axis=0))[triangles], 1, 0)
    parts = np.einsum("ei,ei->e", a, np.cross(b, c)) / 6.0
    found = np.abs(np.bincount(label[triangles[:, 0]], parts))
    return float(2.0 * found.max() - found.sum())
