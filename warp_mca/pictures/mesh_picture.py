"""Owns the picture of a mesh: skins with the edges of their faces, a colour for each body, drawn without a display."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import is_triangle
from warp_mca.pictures.raster import rasterise
from warp_mca.pictures.setting import PlaneMesh, eye_axes
from warp_mca.pictures.snapshot import AMBIENT, LIGHT, PLANE_DARK, PLANE_LIGHT

Array = NDArray[np.floating]

COLOURS = ((0.42, 0.64, 0.83), (0.93, 0.66, 0.40), (0.45, 0.75, 0.62), (0.82, 0.62, 0.76), (0.90, 0.85, 0.45))
PIXELS = 720  # along the longer side
MARGIN = 0.04  # around the bodies, as a share of their size
LEAST = 5.0  # pixels across a face, on the average, below which edges would hide the faces
EDGE = 0.55  # brightness of an edge


def mesh_png(
    skins: Mapping[str, tuple[Array, NDArray[np.int32]]],
    *,
    up: Array,
    planes: Sequence[PlaneMesh] = (),
    around: Array | None = None,
) -> bytes:
    """The picture as the bytes of a PNG file.

    Args:
        skins: by body, points [m], shape (point_count, 3), and corners of each face, shape (face_count, 4), int32.
        up: unit vector upwards [-], shape (3,).
        planes: rigid planes.
        around: points that are to be seen [m], shape (count, 3); those of all skins if None.
    """
    from PIL import Image

    points = np.concatenate([points for points, _ in skins.values()]) if around is None else around
    eye = eye_axes(up, np.ptp(points, axis=0))
    flat = points @ eye[:2].T
    margin = MARGIN * float(np.ptp(flat, axis=0).max())
    low, high = flat.min(axis=0) - margin, flat.max(axis=0) + margin
    scale = PIXELS / float((high - low).max())
    width, height = np.maximum(np.round(scale * (high - low)).astype(int), 1).tolist()
    corners, face, colour = _triangles(skins, planes)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    front = normal @ eye[2] > 0.0
    corners, normal, face, colour = corners[front], normal[front], face[front], colour[front]
    shown = corners @ eye.T
    shown[:, :, 0] = scale * (shown[:, :, 0] - low[0])
    shown[:, :, 1] = scale * (high[1] - shown[:, :, 1])
    seen = rasterise(shown, width, height)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1), np.finfo(float).tiny)[:, None]
    bright = AMBIENT + (1.0 - AMBIENT) * np.clip(normal @ (LIGHT / np.linalg.norm(LIGHT) @ eye), 0.0, 1.0)
    picture = np.full((height * width, 3), 255, dtype=np.uint8)
    picture[seen.pixel] = np.round(255.0 * colour * bright[:, None]).astype(np.uint8)[seen.triangle]
    number = np.full(height * width, -1)
    number[seen.pixel] = face[seen.triangle]
    picture = picture.reshape(height, width, 3)
    edges = _edges(number.reshape(height, width))
    picture[edges] = (EDGE * picture[edges]).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(picture).save(stream, format="png")
    return stream.getvalue()


def _triangles(
    skins: Mapping[str, tuple[Array, NDArray[np.int32]]], planes: Sequence[PlaneMesh]
) -> tuple[Array, NDArray[np.int64], Array]:
    """Corners [m], shape (count, 3, 3); number of the face of each, -1 of planes; its colour, shape (count, 3)."""
    parts, faces, colours, first = [], [], [], 0
    for k, (points, quads) in enumerate(skins.values()):
        halves = np.concatenate([np.arange(len(quads)), np.flatnonzero(~is_triangle(quads))])
        corner = np.concatenate([quads[:, [0, 1, 2]], quads[~is_triangle(quads)][:, [0, 2, 3]]])
        parts.append(np.asarray(points, dtype=float)[corner])
        faces.append(first + halves)
        colours.append(np.broadcast_to(COLOURS[k % len(COLOURS)], (len(corner), 3)))
        first += len(quads)
    for plane in planes:
        parts.append(plane.points[np.concatenate([plane.quads[:, [0, 1, 2]], plane.quads[:, [0, 2, 3]]])])
        faces.append(np.full(len(parts[-1]), -1))
        colours.append(np.where(np.tile(plane.dark, 2)[:, None], PLANE_DARK, PLANE_LIGHT))
    return np.concatenate(parts), np.concatenate(faces), np.concatenate(colours)


def _edges(number: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Pixels at the edge of a face, of the number of the face at each, shape (height, width); none on small faces."""
    pixels = np.bincount(number[number >= 0])
    if pixels.sum() < LEAST**2 * np.count_nonzero(pixels):
        return np.zeros(number.shape, dtype=bool)
    found = np.zeros(number.shape, dtype=bool)
    found[:, 1:] |= number[:, 1:] != number[:, :-1]
    found[1:] |= number[1:] != number[:-1]
    beside = np.zeros(number.shape, dtype=bool)  # squares of planes have no edges, but bodies before them have
    beside[:, 1:] |= number[:, :-1] >= 0
    beside[1:] |= number[:-1] >= 0
    return found & (beside | (number >= 0))
