"""Owns the cells behind closed surfaces that do not face away from their middle everywhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh

DEPTH = 0.3  # of a cell behind a triangle, over the square root of its area


def cells_behind(name: str, points: Array, faces: Index) -> tuple[Array, Index]:
    """A tetrahedron behind each triangle of a closed surface, with a node of its own, as contact needs no more.

    No volume is filled, so that surfaces that cross or touch themselves, as published meshes do, need no repair.

    Args:
        name: of the geom, for messages.
        points: nodes of the surface [m], shape (node_count, 3), float64.
        faces: its triangles, counterclockwise from outside, shape (triangle_count, 3), int32.

    Returns:
        The nodes behind [m], shape (triangle_count, 3), float64; and cells that count the nodes of the surface first,
        shape (triangle_count, 4), int32.

    Raises:
        RequestError: the surface is open or faces inwards.
    """
    edges = np.concatenate([faces[:, [k, (k + 1) % 3]] for k in range(3)]).astype(np.int64)
    one, other = (np.sort(edges @ order) for order in ((len(points), 1), (1, len(points))))
    if not np.array_equal(one, other):
        lone = len(np.setxor1d(one, other)) // 2
        raise bad_value("Robot: geom", name, f"its surface is open ({lone} open edges); close it")
    a, b, c = (points[faces[:, k]] for k in range(3))
    if np.einsum("ij,ij->i", a - points[0], np.cross(b - points[0], c - points[0])).sum() <= 0.0:
        raise bad_value("Robot: geom", name, "its surface faces inwards; turn its triangles over")
    across = np.cross(b - a, c - a)
    twice = np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-300)
    behind = (a + b + c) / 3.0 - DEPTH * np.sqrt(0.5 / twice) * across
    apexes = np.arange(len(points), len(points) + len(faces), dtype=np.int32)
    return behind, np.concatenate([apexes[:, None], faces], axis=1).astype(np.int32)


def held_mass(mesh: Mesh, density: float) -> dict[str, Any]:
    """Mass, centre and inertia of a body of the world with such cells, as of the box around it; {} where cells fill it.

    Args:
        mesh: of the body.
        density: [kg/m^3].
    """
    if len(np.unique(mesh.tetrahedra[:, 0])) == 1:
        return {}
    low, high = mesh.points.min(axis=0), mesh.points.max(axis=0)
    square = (high - low) ** 2
    mass = density * float(np.prod(high - low))
    inertia = tuple(float(v) for v in mass / 12.0 * (square.sum() - square))
    return {"mass": mass, "centre": tuple(float(v) for v in 0.5 * (low + high)), "inertia": inertia}
