"""Owns the surfaces of geoms: closed surfaces of triangles in the geom's frame."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.robots.skins import Skin

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.touching import Side

AROUND = 48  # faces around a round geom, which then lies at most 0.2 % of its radius inside
_BOX = np.array([list(map(int, face)) for face in "032 021 456 467 015 054 126 165 237 276 304 347".split()], np.int32)
_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)


def geom_side(mj: Any, machine: Machine, side: Side) -> Side:
    """The side of a geom with its skin."""
    assert side.geom is not None
    points, faces = geom_surface(mj, machine, side.geom, side.name)
    return replace(side, skin=Skin(points, faces))


def geom_surface(mj: Any, machine: Machine, geom: int, name: str) -> tuple[Array, Index]:
    """Nodes [m], shape (count, 3), and triangles of the surface of a geom, in the geom's frame.

    Raises:
        RequestError: the kind of the geom has none.
    """
    model = machine.model
    kind, (a, b, c) = int(model.geom_type[geom]), (float(size) for size in model.geom_size[geom])
    known = {int(getattr(mj.mjtGeom, f"mjGEOM_{key}")): key for key in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER")}
    if kind == int(mj.mjtGeom.mjGEOM_BOX):
        return _CORNERS * (a, b, c), _BOX
    if kind == int(mj.mjtGeom.mjGEOM_MESH):
        data = int(model.geom_dataid[geom])
        first, count = int(model.mesh_vertadr[data]), int(model.mesh_vertnum[data])
        start, faces = int(model.mesh_faceadr[data]), int(model.mesh_facenum[data])
        return merged(
            np.array(model.mesh_vert[first : first + count], dtype=float), model.mesh_face[start : start + faces]
        )
    if kind not in known:
        remedy = "its kind has no closed surface for a flexible body or a mesh to touch; take a box or a mesh"
        raise bad_value("Robot: geom", name, remedy)
    if known[kind] == "CYLINDER":
        return _turned(np.array([[0.0, -b], [a, -b], [a, b], [0.0, b]]))
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, AROUND // 2 + 1)
    outline = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if known[kind] == "CAPSULE":
        low, high = outline[: AROUND // 4 + 1], outline[AROUND // 4 :]
        return _turned(np.concatenate([a * low - (0.0, b), a * high + (0.0, b)]))
    points, faces = _turned(outline)
    return points * ((a, a, a) if known[kind] == "SPHERE" else (a, b, c)), faces


def _turned(outline: Array) -> tuple[Array, Index]:
    """The surface that an outline (radius, z), from the lower pole to the upper one, makes when it turns about z."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = outline[1:-1]
    sides = np.concatenate([np.concatenate([r * ring, np.full((AROUND, 1), z)], axis=1) for r, z in inner])
    points = np.concatenate([sides, [[0.0, 0.0, outline[0, 1]], [0.0, 0.0, outline[-1, 1]]]])
    k = np.arange(AROUND)
    nxt, faces = (k + 1) % AROUND, []
    for row in range(len(inner) - 1):
        low, high = row * AROUND, (row + 1) * AROUND
        faces += [np.stack([low + k, low + nxt, high + nxt], axis=1), np.stack([low + k, high + nxt, high + k], axis=1)]
    last, bottom = (len(inner) - 1) * AROUND, len(sides)
    faces += [np.stack([np.full(AROUND, bottom), nxt, k], axis=1)]
    faces += [np.stack([last + k, last + nxt, np.full(AROUND, bottom + 1)], axis=1)]
    return points, np.concatenate(faces).astype(np.int32)


def merged(points: Array, faces: Index) -> tuple[Array, Index]:
    """A surface whose nodes at the same place are one, as STL files list them apart."""
    found, place = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    corners = place.reshape(-1)[np.asarray(faces)]
    flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2]) | (corners[:, 2] == corners[:, 0])
    return found, corners[~flat].astype(np.int32)
