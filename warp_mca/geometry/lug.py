"""Owns the cells of a lug, the fork or the eye at the end of a round rod, with a shaft hole along z at the origin.

A lug is cut out of a rod that ends in a hemisphere around the hinge: between two planes z = const for the eye, outside
of them for the fork, whose tongues end in the rod's own surface. Its cells go on from those of a rod's section: the
lines of cells across the section become straight layers over a short length; in a plan each layer is a ring of cells
around the hole, a square around these, and the ring of the section bent around the end.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.geometry.edit import compact, mirror
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.rings import CORE_BULGE, CORE_RADIUS

# All in radii of the rod, counted from the hinge axis.
ROOT = 1.45  # where the section of the rod begins: 18.8 mm for 13 mm, the middle hinge of the paper's Fig. 11
SHOULDER = 1.03  # where the lug begins; the ends of both lugs have the radius 1
HOLE = 0.3  # radius of the shaft hole
EYE = 0.36  # half the thickness of the eye
SLOT = 0.38  # half the width of the fork's slot
_SQUARE = 0.4  # half the side of the square around the hole
_TOP = 0.5  # height of the core's upper corners
_BEND = 0.5  # where the ring of the section begins to bend around the end
_CORNER = math.radians(45.0)  # angle of the section's corners on the rim

WELD = 1e-6  # distance within which nodes coincide


@dataclass(frozen=True)
class Counts:
    """Numbers of cells of a lug.

    Attributes:
        section, ring: as in `Rod`.
        layers: of half the section's core in the eye; the others are in the fork.
        around: along a quarter of the hole, but for the one that faces the rod, which has `section`.
        wall: from the hole to the square around it.
        neck: from that square to the shoulder.
        root: from the shoulder to the rod.
    """

    section: int
    ring: int
    layers: int
    around: int
    wall: int
    neck: int
    root: int

    @staticmethod
    def of(section: int, ring: int) -> Counts:
        """Those that go with a rod's section, of 4 cells or more."""
        half = section // 2
        return Counts(
            section=section,
            ring=ring,
            layers=min(half - 1, max(1, round(0.66 * half))),
            around=max(4, 2 * round(section / 4)),
            wall=max(2, round(0.5 * ring)),
            neck=max(2, round(section / 4)),
            root=max(1, round(section / 7)),
        )


@dataclass(frozen=True)
class _Section:
    """Nodes of the half (z >= 0) of a section, (y, z) [radius].

    Attributes:
        core: shape (section + 1, half + 1, 2), by y and z.
        side: from the core's side towards +y to the rim, shape (ring + 1, half + 1, 2).
        top: from the core's top to the rim, shape (ring + 1, section + 1, 2).
    """

    core: Array
    side: Array
    top: Array

    def patches(self) -> tuple[Array, Array, Array, Array]:
        """Core, side towards +y, side towards -y, top."""
        return self.core, self.side, self.side * [-1.0, 1.0], self.top


def _steps(count: int) -> Array:
    return np.linspace(0.0, 1.0, count + 1)


def _between(a: Array, b: Array, count: int) -> Array:
    """Points on straight lines from `a` to `b`, along a new first axis of count + 1."""
    s = _steps(count).reshape(-1, *[1] * a.ndim)
    return (1.0 - s) * a + s * b


def _plain_section(counts: Counts) -> _Section:
    """The section of a `Rod`, as `rings.disc` makes it and gmsh divides it."""
    half = counts.section // 2
    c = CORE_RADIUS * math.sqrt(0.5)
    reach, bend = c / math.sin(CORE_BULGE), c / math.tan(CORE_BULGE)  # radius of the edges, and where their centre is
    angle = CORE_BULGE * np.linspace(-1.0, 1.0, counts.section + 1)
    along, out = reach * np.sin(angle), c - bend + reach * np.cos(angle)
    top = np.stack([along, out], axis=-1)
    right = np.stack([out, along], axis=-1)[half:]
    left, bottom = right * [-1.0, 1.0], np.stack([np.linspace(-right[0, 0], right[0, 0], counts.section + 1)] * 2, -1)
    bottom[:, 1] = 0.0
    u, v = _steps(counts.section)[:, None, None], _steps(half)[None, :, None]
    core = (1 - v) * bottom[:, None] + v * top[:, None] + (1 - u) * left[None] + u * right[None]
    core -= (1 - u) * ((1 - v) * left[0] + v * left[-1]) + u * ((1 - v) * right[0] + v * right[-1])
    return _Section(
        core,
        _between(right, _rim(np.linspace(0.0, _CORNER, half + 1)), counts.ring),
        _between(top, _rim(np.linspace(math.pi - _CORNER, _CORNER, counts.section + 1)), counts.ring),
    )


def _rim(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _layered_section(counts: Counts, flat: float) -> _Section:
    """The section at the shoulder, whose layer number `layers` ends in the plane z = flat."""
    half, layers = counts.section // 2, counts.layers
    y = _SQUARE * np.linspace(-1.0, 1.0, counts.section + 1)
    z = np.concatenate([np.linspace(0.0, flat, layers + 1), np.linspace(flat, _TOP, half - layers + 1)[1:]])
    core = np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1)
    angle = np.concatenate(
        [np.arcsin(z[: layers + 1]), np.linspace(math.asin(flat), _CORNER, half - layers + 1)[1:]],
    )
    return _Section(
        core,
        _between(core[-1], _rim(angle), counts.ring),
        _between(core[:, -1], _rim(np.linspace(math.pi - _CORNER, _CORNER, counts.section + 1)), counts.ring),
    )


def _above(plan: Array) -> Array:
    """Points of the rod's upper surface over places (x, y)."""
    x, y = np.minimum(plan[..., 0], 0.0), plan[..., 1]
    return np.concatenate([plan, np.sqrt(1.0 - x**2 - y**2)[..., None]], axis=-1)


class _Lug:
    """Blocks of cells of the half with z >= 0, in radii, the rod towards +x."""

    def __init__(self, kind: Literal["fork", "eye"], counts: Counts) -> None:
        self.kind, self.counts = kind, counts
        self.shoulder = _layered_section(counts, EYE if kind == "eye" else SLOT)
        self.layers = slice(0, counts.layers + 1) if kind == "eye" else slice(counts.layers, None)
        self.heights = self.shoulder.core[0, :, 1]
        self.blocks: list[Array] = []

    def build(self, plain: _Section) -> list[Array]:
        """Nodes of each block, shape (a + 1, b + 1, c + 1, 3), from a rod with this section on."""
        for low, high in zip(plain.patches(), self.shoulder.patches(), strict=True):
            section = _between(low, high, self.counts.root)
            x = np.broadcast_to(np.linspace(ROOT, SHOULDER, self.counts.root + 1)[:, None, None, None], section.shape)
            self.blocks.append(np.concatenate([x[..., :1], section], axis=-1))
        for block in self.blocks[1:]:
            block[:, -1, :, 1:] /= np.linalg.norm(block[:, -1, :, 1:], axis=-1, keepdims=True)
        core, *sides, top = self.shoulder.patches()
        self._neck(core[:, self.layers], np.full(core.shape[0], _SQUARE)[:, None])
        x = np.linspace(_SQUARE, _BEND, self.counts.ring + 1)[:, None]
        for side in sides:
            self._neck(side[:, self.layers], x)
        if self.kind == "fork":
            self._neck(top, x)
        self._head()
        return self.blocks

    def _neck(self, section: Array, x: Array) -> None:
        """Part of the shoulder's section, drawn out to the places x."""
        away = np.broadcast_to(x, section.shape[:2])[..., None]
        ends = [np.concatenate([at, section], axis=-1) for at in (np.full_like(away, SHOULDER), away)]
        self.blocks.append(_between(ends[0], ends[1], self.counts.neck))

    def _head(self) -> None:
        """What is around the hole: four quarters, the end that goes around three of them, and the fork's top."""
        counts, z = self.counts, self.heights[self.layers]
        turn = np.array([1.0, -1.0, 1.0])
        middle = np.linspace(-1.0, 1.0, counts.section + 1)
        beside = np.linspace(1.0, -1.0, counts.around + 1)
        outer = self.shoulder.side[-1, self.layers, 1]  # heights of the layers on the rod's surface
        # Square, angle of the hole's nodes and outline of the quarters that face the rod, +y, -y, -x.
        east = np.stack([np.full_like(middle, _SQUARE), _SQUARE * middle], axis=-1)
        north = np.stack([_SQUARE * beside, np.full_like(beside, _SQUARE)], axis=-1)
        west = np.stack([np.full_like(beside, -_SQUARE), _SQUARE * beside], axis=-1)
        quarter = 0.25 * math.pi
        facing = np.concatenate([np.full((counts.section + 1, 1), _BEND), self.shoulder.top[-1]], axis=-1)
        for square, angle, mirrored, outline in (
            (east, quarter * middle, 1.0, None),
            (north, quarter * (2.0 - beside), 1.0, self._north),
            (north, quarter * (2.0 - beside), turn, self._north),
            (west, quarter * (4.0 - beside), 1.0, self._west),
        ):
            hole = HOLE * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
            plan = _between(hole, square, counts.wall)
            levels = [np.concatenate([plan, np.full((*plan.shape[:2], 1), height)], axis=-1) for height in z]
            self.blocks.append(np.stack(levels, axis=2) * mirrored)
            if self.kind == "fork":
                rim = facing if outline is None else outline(outer[-1])
                over = _above(_between(hole, rim[:, :2], counts.wall))
                self.blocks.append(np.moveaxis(_between(levels[-1], over, counts.ring), 0, 2) * mirrored)
            if outline is not None:
                inner = np.stack([level[-1] for level in levels], axis=1)
                around = np.stack([outline(height) for height in outer], axis=1)
                self.blocks.append(_between(inner, around, counts.ring) * mirrored)

    def _north(self, z: float) -> Array:
        """Nodes of the end's outline at a height, beside the hole and around to 45 degrees behind it."""
        w = math.sqrt(1.0 - z * z)
        way = _steps(self.counts.around) * (_BEND + 0.25 * math.pi * w)
        angle = 0.5 * math.pi + np.maximum(way - _BEND, 0.0) / w
        x = np.where(way < _BEND, _BEND - way, w * np.cos(angle))
        return np.stack([x, w * np.sin(angle), np.full_like(x, z)], axis=-1)

    def _west(self, z: float) -> Array:
        """The same behind the hole."""
        w = math.sqrt(1.0 - z * z)
        angle = math.pi * np.linspace(0.75, 1.25, self.counts.around + 1)
        return np.stack([w * np.cos(angle), w * np.sin(angle), np.full_like(angle, z)], axis=-1)


def _hexahedra(block: Array, first: int) -> NDArray[np.int32]:
    """Cells of a block whose nodes are counted from `first`, right-handed."""
    index = first + np.arange(np.prod(block.shape[:3])).reshape(block.shape[:3])
    sides = [(0, 0), (1, 0), (1, 1), (0, 1)]
    a, b, c = block.shape[:3]
    corners = [index[i : a - 1 + i, j : b - 1 + j, k : c - 1 + k] for k in (0, 1) for i, j in sides]
    cells = np.stack(corners, axis=-1).reshape(-1, 8).astype(np.int32)
    p = block.reshape(-1, 3)[cells[0] - first]
    if np.linalg.det([p[1] - p[0], p[3] - p[0], p[4] - p[0]]) < 0.0:
        cells = np.roll(cells, 4, axis=1)
    return cells


def _welded(points: Array, cells: NDArray[np.int32]) -> Mesh:
    """The mesh in which nodes of neighbouring blocks that coincide are one, the first of them."""
    from scipy.spatial import KDTree

    same = np.arange(len(points), dtype=np.int32)
    pairs = np.sort(KDTree(points).query_pairs(WELD, output_type="ndarray"), axis=1)
    for low, high in pairs[np.lexsort((pairs[:, 0], pairs[:, 1]))]:
        same[high] = min(same[high], same[low])
    return compact(Mesh(points, same[cells].astype(np.int32)))


def lug(kind: Literal["fork", "eye"], section: int, ring: int) -> Mesh:
    """A lug in radii of its rod, with the node sets root (x = `ROOT`) and hole."""
    counts = Counts.of(section, ring)
    blocks = _Lug(kind, counts).build(_plain_section(counts))
    first = np.cumsum([0, *(block[..., 0].size for block in blocks)])
    points = np.concatenate([block.reshape(-1, 3) for block in blocks])
    cells = np.concatenate([_hexahedra(block, start) for block, start in zip(blocks, first, strict=False)])
    mesh = mirror(_welded(points, cells), 2)
    x, y = mesh.points[:, 0], mesh.points[:, 1]
    sets = {"root": x > ROOT - WELD, "hole": np.hypot(x, y) < HOLE + WELD}
    return Mesh(mesh.points, mesh.hexahedra, {name: np.flatnonzero(it).astype(np.int32) for name, it in sets.items()})


def lug_volume(kind: Literal["fork", "eye"]) -> float:
    """Volume of a lug whose cells are infinitely small, without units of length: in cubes of the rod's radius.

    The rod's end between the planes z = -a and a, with w^2 = 1 - z^2: half a disc of radius w, a rectangle 2 w wide up
    to the shoulder, less the hole. The fork is what the eye would leave of the whole end.
    """

    def between(a: float) -> float:
        rectangle = SHOULDER * 2.0 * (a * math.sqrt(1.0 - a * a) + math.asin(a))
        return math.pi * (a - a**3 / 3.0) + rectangle - 2.0 * math.pi * HOLE**2 * a

    root = math.pi * (ROOT - SHOULDER)
    if kind == "eye":
        return root + between(EYE)
    behind = 2.0 / 3.0 * math.pi * (1.0 - (1.0 - HOLE**2) ** 1.5)  # of the hole, in the ball
    angle = math.pi * (np.arange(64) + 0.5) / 64  # y = HOLE cos(angle): a smooth periodic integrand
    beside = math.pi * HOLE**2 * float(np.mean(2.0 * np.sin(angle) ** 2 * np.sqrt(1.0 - (HOLE * np.cos(angle)) ** 2)))
    return root + math.pi * (2.0 / 3.0 + SHOULDER) - behind - beside - between(SLOT)
