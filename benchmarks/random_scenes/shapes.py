"""Owns the bodies of random scenes: rods, boxes, blades, rings and balls, with cells of about a given size."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.geometry.cell_types import triangulated

Array = NDArray[np.float64]
KINDS = ("square rod", "round rod", "box", "blade", "ring", "ball")
GROWTH = 1.15  # of cells, until a body has few enough
CORE = 0.45  # half the side of the cube in the middle of a ball [radius]
AROUND = 8  # cells around a ring at least


@dataclass(frozen=True)
class Shape:
    """The mesh of a body around its middle, and its measures.

    Attributes:
        kind: one of KINDS.
        mesh: in the body's own frame.
        least: its least thickness [m]; of a blade that of its back.
        edges: whether some of its edges are sharp.
        long: direction in its frame along which it is longest, a ring's axis [-], shape (3,), float64.
        edge: direction into which a blade's edge looks, else of no meaning [-], shape (3,), float64.
    """

    kind: str
    mesh: mca.Mesh
    least: float
    edges: bool
    long: Array
    edge: Array

    @property
    def triangles(self) -> NDArray[np.int32]:
        """Of the skin, counter-clockwise from outside, shape (triangle_count, 3), int32."""
        return triangulated(self.mesh.boundary[0])


def shape(rng: np.random.Generator, kind: str, width: float, size: float, most: int) -> Shape:
    """A body of random proportions.

    Args:
        rng: from which they are drawn.
        kind: one of KINDS.
        width: across it; of a ring's section, of a ball's diameter [m].
        size: of its cells, as far as its shape allows [m].
        most: cells; they grow until it has so few.
    """
    draw = _MAKERS[kind](rng, width)
    while (found := draw(size)).mesh.cell_count > most:
        size *= GROWTH
    return found


def _count(length: float, size: float, least: int = 1) -> int:
    return max(least, round(length / size))


def _even(length: float, size: float) -> int:
    return max(2, 2 * round(0.5 * length / size))


def _bare(points: Array, hexahedra: NDArray[np.int32]) -> mca.Mesh:
    """The mesh with nodes at one place made one, around the middle of its box."""
    points = points - 0.5 * (points.max(axis=0) + points.min(axis=0))
    grid = np.floor(points / np.ptp(points, axis=0).max() * 1e7 + 0.1234).astype(np.int64)  # off round numbers
    _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
    return mca.Mesh(points[first], number.reshape(-1)[hexahedra].astype(np.int32))


def _made(kind: str, points: Array, hexahedra: NDArray[np.int32], least: float, edges: bool, long: int = 0) -> Shape:
    return Shape(kind, _bare(points, hexahedra), least, edges, np.eye(3)[long], np.array([-1.0, 0.0, 0.0]))


def _brick(size: tuple[float, float, float], cell: float) -> mca.Mesh:
    x, y, z = (_count(length, cell) for length in size)
    return mca.Box(size=size, divisions=(x, y, z)).build()


def _square_rod(rng: np.random.Generator, width: float):
    lengths = (width * rng.uniform(4.0, 9.0), width, width * rng.uniform(0.7, 1.4))

    def draw(size: float) -> Shape:
        mesh = _brick(lengths, size)
        return _made("square rod", mesh.points, mesh.hexahedra, min(lengths), True)

    return draw


def _rod_mesh(width: float, length: float, size: float, least: int = 1) -> mca.Mesh:
    section = _even(0.25 * math.pi * width, size)
    axial = _count(length, size, least)
    return mca.Rod(
        radius=0.5 * width, length=length, tip="flat", section=section, ring=max(1, section // 3), axial=axial
    ).build()


def _round_rod(rng: np.random.Generator, width: float):
    length = width * rng.uniform(4.0, 9.0)

    def draw(size: float) -> Shape:
        mesh = _rod_mesh(width, length, size)
        return _made("round rod", mesh.points, mesh.hexahedra, width, False)

    return draw


def _box(rng: np.random.Generator, width: float):
    lengths = (width, width * rng.uniform(0.6, 1.6), width * rng.uniform(0.6, 1.6))

    def draw(size: float) -> Shape:
        mesh = _brick(lengths, size)
        return _made("box", mesh.points, mesh.hexahedra, min(lengths), True, int(np.argmax(lengths)))

    return draw


def _blade(rng: np.random.Generator, width: float):
    """A plate or wedge whose edge at the least x is as thick as its back, thinner, or sharp."""
    back = width * rng.uniform(0.25, 0.6)
    lengths = (width * rng.uniform(1.0, 2.5), back, width * rng.uniform(2.0, 5.0))
    edge = float(rng.choice([0.0, 1.0, rng.uniform(0.1, 0.5)]))

    def draw(size: float) -> Shape:
        counts = [_count(length, size) for length in lengths]
        counts[1] = counts[1] if edge == 1.0 else 1  # more would be thin at the edge
        mesh = mca.Box(size=lengths, divisions=(counts[0], counts[1], counts[2])).build()
        points = mesh.points - [0.0, 0.5 * back, 0.0]
        points[:, 1] *= edge + (1.0 - edge) * points[:, 0] / lengths[0]
        return _made("blade", points, mesh.hexahedra, back, True, 2)

    return draw


def _ring(rng: np.random.Generator, width: float):
    """A square or round section swept around the axis z."""
    radius, square = width * rng.uniform(1.5, 3.0), bool(rng.random() < 0.5)
    height = width * rng.uniform(0.7, 1.5)

    def draw(size: float) -> Shape:
        around = 2.0 * math.pi * radius
        count = _count(around, size, AROUND)
        if square:
            sides = (_count(width, size), _count(height, size))
            mesh = mca.Box(
                size=(1.0, width, height), divisions=(count, *sides), origin=(0.0, -0.5 * width, 0.0)
            ).build()
            points = mesh.points
        else:
            mesh = _rod_mesh(width, around, size, AROUND)
            points = mesh.points / [around, 1.0, 1.0]
        angle, r = 2.0 * math.pi * points[:, 0], radius - points[:, 1]
        swept = np.column_stack([r * np.cos(angle), r * np.sin(angle), points[:, 2]])
        return _made("ring", swept, mesh.hexahedra, min(width, height) if square else width, square, 2)

    return draw


def _ball(rng: np.random.Generator, width: float):
    """A cube within six blocks, whose outer faces lie on the sphere."""
    radius = 0.5 * width

    def draw(size: float) -> Shape:
        count = _even(0.25 * math.pi * width, size)
        layers = max(1, round(0.5 * count))
        core = mca.Box(size=(2.0, 2.0, 2.0), divisions=(count, count, count), origin=(-1.0, -1.0, -1.0)).build()
        block = mca.Box(size=(2.0, 2.0, 1.0), divisions=(count, count, layers), origin=(-1.0, -1.0, 0.0)).build()
        u, v, w = block.points.T[:, :, None]
        outer = np.hstack([np.tan(0.25 * math.pi * u), np.tan(0.25 * math.pi * v), np.ones_like(u)])
        outer *= radius / np.linalg.norm(outer, axis=1, keepdims=True)
        side = (1.0 - w) * CORE * radius * np.hstack([u, v, np.ones_like(u)]) + w * outer
        points, cells = [CORE * radius * core.points], [core.hexahedra]
        for axis in range(3):
            for sign in (1.0, -1.0):
                turned = np.roll(side * [sign, 1.0, sign], axis, axis=1)
                cells.append(block.hexahedra + sum(map(len, points)))
                points.append(turned)
        return _made("ball", np.concatenate(points), np.concatenate(cells), width, False)

    return draw


_MAKERS = {
    "square rod": _square_rod,
    "round rod": _round_rod,
    "box": _box,
    "blade": _blade,
    "ring": _ring,
    "ball": _ball,
}


def finer(mesh: mca.Mesh, times: int) -> mca.Mesh:
    """The same mesh with each hexahedron cut into `times`^3: its shape stays, as long as its faces are flat."""
    steps = np.arange(times + 1) / times
    z, y, x = (item.ravel() for item in np.meshgrid(steps, steps, steps, indexing="ij"))
    signs = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]])
    weight = np.prod([np.where(signs[:, k], w[:, None], 1.0 - w[:, None]) for k, w in enumerate((x, y, z))], axis=0)
    points = (weight @ mesh.points[mesh.hexahedra]).reshape(-1, 3)
    cells = mca.Box(size=(1.0, 1.0, 1.0), divisions=(times, times, times)).build().hexahedra
    start = len(x) * np.arange(len(mesh.hexahedra))
    middle = 0.5 * (mesh.points.max(axis=0) + mesh.points.min(axis=0))
    found = _bare(points, (start[:, None, None] + cells).reshape(-1, 8))
    return mca.Mesh(found.points + middle, found.hexahedra)
