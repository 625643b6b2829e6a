"""Owns the sizes of cells in a CAD part from the thickness of its walls and from its curvature.

The thickness below a point of the surface is the length of the ray along the inner normal up to the other side. Each
face has that which a fifth of its area falls short of; each vertex of the part has the least of its faces, and gmsh
grades the sizes between vertices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.chunks import chunks
from warp_mca.geometry.cad_drawing import diagonal

LEAST_ACROSS, MOST_ACROSS = 0.25, 64.0  # cells over a wall that may be asked for [-]
GREATEST = 6.0  # cells along the diagonal of a part, for each one over a wall, at least [-]
ROUND, FEWEST = 5.0, 8.0  # cells around a full circle, for each one over a wall and at least [-]
SMALLEST = 0.5  # of the size in the thinnest wall: curvature makes no smaller cells [-]
_SHARE = 0.2  # of a face's area that may be thinner than its thickness [-]
_RAYS, _LEAST, _MOST = 3000, 3, 40  # of a part, of a face at least and at most
_FINE = 40.0  # triangles of the trial mesh along the diagonal, about [-]
_PAIRS = 200_000  # of rays and triangles at a time
_TRIANGLE = 2  # number of the linear triangle in gmsh


def set_sizes(gmsh: Any, across: float, *, drawn: bool) -> float:
    """Set the sizes of cells of gmsh's model by its walls; the least of them, in the model's unit.

    Args:
        gmsh: with the model.
        across: number of cells over a wall [-].
        drawn: whether the model has curves and faces of its own; else triangles (STL), which get one size.
    """
    length = diagonal(gmsh)
    if drawn:
        for name, value in (("Max", length / _FINE), ("Min", 0.02 * length / _FINE), ("FromCurvature", 12.0)):
            gmsh.option.setNumber(f"Mesh.MeshSize{name}", value)
        gmsh.model.mesh.generate(2)
    thickness = face_thickness(gmsh.model)
    greatest = length / (GREATEST * across)
    size = {face: min(wall / across, greatest) for face, wall in thickness.items()}
    least = min(size.values(), default=greatest)
    gmsh.option.setNumber("Mesh.MeshSizeMax", greatest if drawn else least)
    gmsh.option.setNumber("Mesh.MeshSizeMin", SMALLEST * least if drawn else least)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", max(FEWEST, ROUND * across) if drawn else 0.0)
    if drawn:
        gmsh.model.mesh.clear()
        at: dict[int, float] = {}
        for face, own in size.items():
            for _, vertex in gmsh.model.getBoundary([(2, face)], combined=False, recursive=True):
                at[vertex] = min(own, at.get(vertex, own))
        for own in set(at.values()):
            gmsh.model.mesh.setSize([(0, vertex) for vertex, value in at.items() if value == own], own)
    return least


def face_thickness(model: Any) -> dict[int, float]:
    """Thickness of the solid behind each face of gmsh's model by the face's tag, in its unit; the faces are meshed.

    A face between two solids has the lesser one. Faces whose rays leave through an edge have none.
    """
    tags, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    points, tags = coordinates.reshape(-1, 3)[order], tags[order]
    corners: dict[int, Array] = {}
    for _, face in model.getEntities(2):
        nodes = model.mesh.getElementsByType(_TRIANGLE, face)[1].reshape(-1, 3)
        corners[face] = points[np.searchsorted(tags, nodes)]
    found: dict[int, float] = {}
    count = int(np.clip(_RAYS / max(len(corners), 1), _LEAST, _MOST))
    for _, solid in model.getEntities(3):
        faces = [abs(face) for _, face in model.getBoundary([(3, solid)], oriented=False)]
        skin = np.concatenate([corners[face] for face in faces])
        for face in faces:
            if len(lengths := _through(_samples(corners[face], count), skin)):
                own = float(np.quantile(lengths, _SHARE))
                found[face] = min(own, found.get(face, own))
    return found


def _samples(triangles: Array, count: int) -> Array:
    """Some triangles of a face, each as often as its area says, the same each time, shape (at most count, 3, 3)."""
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    share = np.cumsum(area)
    if not len(area) or share[-1] == 0.0:
        return triangles[:0]
    return triangles[np.unique(np.searchsorted(share, share[-1] * (np.arange(count) + 0.5) / count))]


def _through(samples: Array, skin: Array) -> Array:
    """Lengths within a closed skin of the rays from the middles of triangles, along the normal that leads inside.

    A ray that starts inside leaves through an odd number of triangles, one that starts outside meets an even number.

    Args:
        samples, skin: corners of triangles, shape (count, 3, 3).
    """
    middle = samples.mean(axis=1)
    normal = np.cross(samples[:, 1] - samples[:, 0], samples[:, 2] - samples[:, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    (ahead, odd), (behind, odd_behind) = _nearest(middle, normal, skin)
    return np.concatenate([ahead[odd & ~odd_behind], behind[odd_behind & ~odd]])


def _nearest(start: Array, direction: Array, skin: Array) -> list[tuple[Array, NDArray[np.bool_]]]:
    """Distance of the nearest triangle along each ray, and whether the ray meets an odd number; then backwards.

    Moeller and Trumbore, J. Graphics Tools 2 (1997) 21, of the triangles whose sphere the ray's line meets.
    """
    least = 1e-7 * float(np.ptp(skin.reshape(-1, 3), axis=0).max())
    ray, triangle = _near_lines(start, direction, skin)
    first, a, b = skin[triangle, 0], skin[triangle, 1] - skin[triangle, 0], skin[triangle, 2] - skin[triangle, 0]
    d, s = direction[ray], start[ray] - first
    p, q = np.cross(d, b), np.cross(s, a)
    with np.errstate(divide="ignore", invalid="ignore"):
        det = (a * p).sum(axis=1)
        u, v, t = ((x * y).sum(axis=1) / det for x, y in ((s, p), (d, q), (b, q)))
        within = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    found = []
    for along in (t, -t):
        hit = within & (along > least)
        distance = np.full(len(start), np.inf)
        np.minimum.at(distance, ray[hit], along[hit])
        found.append((distance, np.bincount(ray[hit], minlength=len(start)) % 2 == 1))
    return found


def _near_lines(start: Array, direction: Array, skin: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs of a ray and a triangle so near to its line that they may meet: indices, each shape (pair_count,).

    |c - s|^2 - (d . (c - s))^2 of the triangle's middle c is at most the square of its radius, in matrix products.
    """
    origin = skin.reshape(-1, 3).mean(axis=0)
    middle = skin.mean(axis=1)
    radius = np.linalg.norm(skin - middle[:, None], axis=2).max(axis=1)
    c, s = middle - origin, start - origin
    reach = radius**2 + 1e-12 * float((c**2).sum(axis=1).max()) - (c**2).sum(axis=1)
    found = [(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp))]
    for part in chunks(len(start), max(1, _PAIRS // len(skin))):
        along = direction[part] @ c.T - (direction[part] * s[part]).sum(axis=1)[:, None]
        apart = (s[part] ** 2).sum(axis=1)[:, None] - 2.0 * (s[part] @ c.T) - along**2
        ray, triangle = np.nonzero(apart <= reach)
        found.append((ray + part.start, triangle))
    rays, triangles = zip(*found, strict=True)
    return np.concatenate(rays), np.concatenate(triangles)
