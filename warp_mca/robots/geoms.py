"""Owns the surfaces of geoms: closed surfaces of triangles in the geom's frame."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh
from warp_mca.robots.filling import cells_behind
from warp_mca.robots.skins import Skin

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine
    from warp_mca.robots.touching import Side

AROUND = 48  # faces around a round geom, which then lies at most 0.2 % of its radius inside
NEAR = 0.9  # of the distance of the nodes around a round geom, within which one is near another
ON_RIM = 1e-6  # share of a radius within which a point lies on the rim of a cylinder
MOST_RINGS = 64  # of nodes along the side of a capsule, which are a radius apart
_BOX = np.array([list(map(int, face)) for face in "032 021 456 467 015 054 126 165 237 276 304 347".split()], np.int32)
_CORNERS = np.array(
    [[-1, -1, -1], [1, -1, -1], [1, 1, -1], [-1, 1, -1], [-1, -1, 1], [1, -1, 1], [1, 1, 1], [-1, 1, 1]], dtype=float
)


def geom_side(mj: Any, machine: Machine, side: Side) -> Side:
    """The side of a geom with its skin."""
    assert side.geom is not None
    points, faces = geom_surface(mj, machine, side.geom, side.name)
    return replace(side, skin=Skin(points, faces))


def geom_surface(mj: Any, machine: Machine, geom: int, name: str, around: int = AROUND) -> tuple[Array, Index]:
    """Nodes [m], shape (count, 3), and triangles of the surface of a geom, in the geom's frame.

    A round one has `around` faces around its axis.

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
        return _turned(np.array([[0.0, -b], [a, -b], [a, b], [0.0, b]]), around)
    angle = np.linspace(-0.5 * np.pi, 0.5 * np.pi, around // 2 + 1)
    outline = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if known[kind] == "CAPSULE":
        low, high = a * outline[: around // 4 + 1] - (0.0, b), a * outline[around // 4 :] + (0.0, b)
        rings = np.linspace(-b, b, 1 + min(max(math.ceil(2.0 * b / a), 1), MOST_RINGS))[1:-1]
        side = np.stack([np.full(len(rings), a), rings], axis=1)
        return _turned(np.concatenate([low, side, high]), around)
    points, faces = _turned(outline, around)
    return points * ((a, a, a) if known[kind] == "SPHERE" else (a, b, c)), faces


def _turned(outline: Array, around: int) -> tuple[Array, Index]:
    """The surface that an outline (radius, z), from the lower pole to the upper one, makes when it turns about z."""
    angle = 2.0 * np.pi * np.arange(around) / around
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    inner = outline[1:-1]
    sides = np.concatenate([np.concatenate([r * ring, np.full((around, 1), z)], axis=1) for r, z in inner])
    points = np.concatenate([sides, [[0.0, 0.0, outline[0, 1]], [0.0, 0.0, outline[-1, 1]]]])
    k = np.arange(around)
    nxt, faces = (k + 1) % around, []
    for row in range(len(inner) - 1):
        low, high = row * around, (row + 1) * around
        faces += [np.stack([low + k, low + nxt, high + nxt], axis=1), np.stack([low + k, high + nxt, high + k], axis=1)]
    last, bottom = (len(inner) - 1) * around, len(sides)
    faces += [np.stack([np.full(around, bottom), nxt, k], axis=1)]
    faces += [np.stack([last + k, last + nxt, np.full(around, bottom + 1)], axis=1)]
    return points, np.concatenate(faces).astype(np.int32)


def is_round(mj: Any, machine: Machine, geom: int, point: Array) -> bool:
    """Whether a geom is curved at a point in its frame [m]: boxes, meshes and ends of cylinders are not."""
    kinds = [int(getattr(mj.mjtGeom, f"mjGEOM_{key}")) for key in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER")]
    kind, radius = int(machine.model.geom_type[geom]), float(machine.model.geom_size[geom][0])
    return kind in kinds and (kind != kinds[3] or math.hypot(point[0], point[1]) > (1.0 - ON_RIM) * radius)


def is_long(machine: Machine, geom: int | None) -> bool:
    """Whether a geom is a capsule or a cylinder."""
    known = [int(getattr(machine.mj.mjtGeom, f"mjGEOM_{key}")) for key in ("CAPSULE", "CYLINDER")]
    return geom is not None and int(machine.model.geom_type[geom]) in known


def touching_at(
    mj: Any, machine: Machine, geom: int, surface: tuple[Array, Index], touch: tuple[Array, Array | None], around: int
) -> tuple[Array, Index]:
    """The surface of a round geom with a node where it touches [m], in place of all nodes that are near.

    Nodes are near up to the distance of those around the geom, so that one alone touches first. Surfaces of boxes and
    meshes stay: they touch with a corner, or are touched on a face. With a normal in `touch` the geom has a flat face
    there instead, for the node of another round geom: of two nodes that meet each would slide off the other's faces.
    """
    point, normal = touch
    if not is_round(mj, machine, geom, point):
        return surface
    sizes = machine.model.geom_size[geom]
    ellipsoid = int(machine.model.geom_type[geom]) == int(mj.mjtGeom.mjGEOM_ELLIPSOID)
    spacing = 2.0 * np.pi * float(sizes.min() if ellipsoid else sizes[0]) / around
    away = np.linalg.norm(surface[0] - point, axis=1)
    placed: Any = point[None]
    if normal is not None:
        side = is_long(machine, geom) and abs(point[2]) < float(sizes[1])
        one = np.cross(normal, np.eye(3)[2] if side else np.eye(3)[np.abs(normal).argmin()])
        one = 0.5 * spacing * one / np.linalg.norm(one)
        other = np.cross(normal, one)
        placed = point + np.array([one, other, -one, -other])
        if side:  # all along the straight part, whose nodes are at its ends
            ends = np.array([[point[0], point[1], sign * float(sizes[1])] for sign in (-1.0, 1.0)])
            placed = np.concatenate([ends + one, ends - one])
            away = np.linalg.norm(surface[0][:, :2] - point[:2], axis=1) + np.maximum(
                np.abs(surface[0][:, 2]) - float(sizes[1]), 0.0
            )
    return hull(np.asarray(np.vstack([surface[0][away > NEAR * spacing], placed]), dtype=np.float64))


def hull(points: Array) -> tuple[Array, Index]:
    """The surface of the convex hull of points [m], its triangles counterclockwise from outside."""
    from scipy.spatial import ConvexHull

    found = ConvexHull(points)
    faces = found.simplices.astype(np.int32)
    a, b, c = (points[faces[:, k]] for k in range(3))
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    used = np.unique(faces)
    place = np.zeros(len(points), dtype=np.int32)
    place[used] = np.arange(len(used))
    return points[used], place[faces]


def filled(name: str, surface: tuple[Array, Index], node_set: str) -> Mesh:
    """A mesh of tetrahedra in a closed surface, whose nodes come first; `node_set` names them.

    From the middle of the surface to its triangles where all of these face away from it, else a flat one behind each
    triangle: the mass of the body is that of the file.

    Raises:
        RequestError: the surface is open or faces inwards.
    """
    points, faces = surface
    middle = points[np.unique(faces)].mean(axis=0)
    a, b, c = (points[faces[:, k]] - middle for k in range(3))
    if (np.einsum("ij,ij->i", a, np.cross(b, c)) > 0.0).all():
        inner, corners = middle[None], np.concatenate([np.full((len(faces), 1), len(points)), faces], axis=1)
    else:
        inner, corners = cells_behind(name, points, faces)
    nodes = np.arange(len(points), dtype=np.int32)
    return Mesh(
        points=np.vstack([points, inner]),
        hexahedra=np.zeros((0, 8), np.int32),
        tetrahedra=corners.astype(np.int32),
        node_sets={node_set: nodes},
    )


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes of tetrahedra as one, with all their node sets."""
    start = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])[:-1]
    return Mesh(
        points=np.concatenate([mesh.points for mesh in meshes]),
        hexahedra=np.zeros((0, 8), np.int32),
        tetrahedra=np.concatenate([mesh.tetrahedra + k for mesh, k in zip(meshes, start, strict=True)]).astype(
            np.int32
        ),
        node_sets={
            name: (nodes + k).astype(np.int32)
            for mesh, k in zip(meshes, start, strict=True)
            for name, nodes in mesh.node_sets.items()
        },
    )


def merged(points: Array, faces: Index) -> tuple[Array, Index]:
    """A surface whose nodes at the same place are one, as STL files list them apart."""
    found, place = np.unique(np.round(points, 9), axis=0, return_inverse=True)
    corners = place.reshape(-1)[np.asarray(faces)]
    flat = (corners[:, 0] == corners[:, 1]) | (corners[:, 1] == corners[:, 2]) | (corners[:, 2] == corners[:, 0])
    return found, corners[~flat].astype(np.int32)
