"""Owns `NestedPlate`: a plate of boxes within boxes, each of coarser cells than the one inside it, to be tied."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.geometry.blocks import growth
from warp_mca.geometry.box import Box
from warp_mca.geometry.edit import compact
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.parts import Part, Parts
from warp_mca.geometry.recipe import check_size
from warp_mca.geometry.refinement import refined_count
from warp_mca.geometry.shape_volume import with_volumes

Axes = tuple[Array, Array, Array]


@dataclass(frozen=True, kw_only=True)
class NestedPlate:
    """A plate like `Plate`, made of boxes around each other whose cells grow by a whole ratio.

    A box of fine cells lies in a larger one of coarser cells, and so on, out to the plate's faces. Boxes share no
    nodes: tie each pair of `tied`, for which the boxes' divisions are chosen such that no fine face crosses the edge of
    a coarse one.

    Node sets: top, bottom, xmin, xmax, zmin, zmax, contact as in `Plate`, and those of `tied`. Cell set: body.

    Attributes:
        length, width, height: extent along x, z, y [m].
        core: number of fine cells along x and z, multiples of `ratio`, of twice an even one.
        core_depth: number of fine cells downwards, a multiple of `ratio`.
        core_size: edge of the fine cells [m].
        ratio: of the edges of cells from box to box.
        shell: least number of cells around a box in the next one.
        extension: number of cells along x from the outermost box to each end of the plate.
    """

    length: float
    width: float
    height: float
    core: tuple[int, int] = (6, 6)
    core_depth: int = 3
    core_size: float = 0.6e-3
    ratio: int = 3
    shell: int = 2
    extension: int = 8

    def __post_init__(self) -> None:
        validate.plain(self)
        name = "NestedPlate"
        validate.positive(name, length=self.length, width=self.width, height=self.height, core_size=self.core_size)
        validate.entries(name, 2, validate.counts, core=self.core)
        validate.counts(name, core_depth=self.core_depth, ratio=self.ratio, shell=self.shell, extension=self.extension)
        if self.ratio < 2:
            raise bad_value(f"{name}.ratio", self.ratio, "give 2 or more")
        for field, value, unit in (("core", self.core, self._unit), ("core_depth", (self.core_depth,), self.ratio)):
            if any(n % unit for n in value):
                remedy = f"give multiples of {unit}, with ratio = {self.ratio}"
                raise bad_value(f"{name}.{field}", getattr(self, field), remedy)
        extents = (self.core[0], self.length), (self.core_depth, self.height), (self.core[1], self.width)
        if any(n * self.core_size >= size for n, size in extents):
            raise bad_value(f"{name}.core_size", self.core_size, "the core must fit inside the plate; make it smaller")
        check_size(name, [tuple(len(axis) for axis in axes) for axes in self._boxes()], core=self.core)  # type: ignore[misc]

    def refined(self, factor: float) -> NestedPlate:
        """The plate with cells about `factor` times smaller; its boxes can still be tied."""
        unit = self._unit
        core = tuple(unit * refined_count(n, factor / unit) for n in self.core)
        depth = self.ratio * refined_count(self.core_depth, factor / self.ratio)
        wider = max(core[0] / self.core[0], core[1] / self.core[1], depth / self.core_depth)
        return replace(
            self,
            core=(core[0], core[1]),
            core_depth=depth,
            core_size=self.core_size / max(factor, wider),  # no wider than it was
            extension=refined_count(self.extension, factor),
        )

    @property
    def tied(self) -> tuple[tuple[str, str], ...]:
        """Node sets to tie to each other, slave and master: outside of each box, hole of the next one."""
        return tuple((f"outside{k}", f"hole{k}") for k in range(len(self._boxes()) - 1))

    @property
    def _unit(self) -> int:
        """What cells across a box come in: cells are added on both sides, which keeps an odd number odd."""
        return self.ratio if self.ratio % 2 else 2 * self.ratio

    def _boxes(self) -> list[Axes]:
        """Coordinates of the cells' corners along x, y, z of each box, from the core outwards."""
        h = self.core_size
        ends = 0.5 * self.length, self.height, 0.5 * self.width
        counts = self.core[0], self.core_depth, self.core[1]
        axes: list[Array] = [
            h * (np.arange(n + 1, dtype=np.float64) - (n if k == 1 else 0.5 * n)) for k, n in enumerate(counts)
        ]
        found: list[Axes] = [(axes[0], axes[1], axes[2])]
        size = h
        while not all(np.isclose(-axis[0], end) for axis, end in zip(axes, ends, strict=True)):
            size *= self.ratio
            axes = [self._wider(self._coarser(axes[k]), size, ends[k], k == 1) for k in range(3)]
            if all(np.isclose(-axes[k][0], ends[k]) for k in (1, 2)):
                axes[0] = self._extended(self._coarser(found[-1][0]), size, ends[0])
            found.append((axes[0], axes[1], axes[2]))
        return found

    def _coarser(self, axis: Array) -> Array:
        """Every so many of its places; all of them where the plate's ends leave another number."""
        return axis if (len(axis) - 1) % self.ratio else axis[:: self.ratio]

    def _wider(self, hole: Array, size: float, end: float, down: bool) -> Array:
        """A line through a hole and `shell` cells or more on either side of it, down to the plate's face at most.

        The number of cells is one that can be divided again. Downwards, the line goes on one way only.
        """
        left = end + hole[0]
        if left < 1e-9 * end:
            return hole
        cells, sides, unit = len(hole) - 1, 1 if down else 2, self.ratio if down else self._unit
        count = self.shell
        while (cells + sides * count) % unit:
            count += 1
        if (count + 1) * size >= left:  # less than a cell would be left beyond
            count = max(1, math.ceil(left / size - 1e-9))
            before = hole[0] - left / count * np.arange(count, 0, -1)
            before[0] = -end
        else:
            before = hole[0] - size * np.arange(count, 0, -1)
        return np.concatenate([before, hole] if down else [before, hole, -before[::-1]])

    def _extended(self, hole: Array, size: float, end: float) -> Array:
        """A line through a hole to both ends of the plate, with cells that grow."""
        left = end + hole[0]
        if left < 1e-9 * end:
            return hole
        factor = growth(left, self.extension, size)
        steps = factor ** np.arange(self.extension)
        before = hole[0] - left * (np.cumsum(steps) / steps.sum())[::-1]
        before[0] = -end
        return np.concatenate([before, hole, -before[::-1]])

    @property
    def volume(self) -> float:
        """Of the plate [m^3]."""
        return self.length * self.width * self.height

    def build(self) -> Mesh:
        """The mesh: the boxes one after the other, from the core outwards."""
        boxes = self._boxes()
        parts = []
        for k, axes in enumerate(boxes):
            hole = boxes[k - 1] if k else None
            mesh = _grid(axes, hole)
            sets = {"hole" + str(k - 1): _on_box(mesh.points, hole, self.height)} if hole else {}
            if k + 1 < len(boxes):
                sets[f"outside{k}"] = _on_box(mesh.points, axes, self.height)
            parts.append(Part(name=f"box{k}", geometry=Mesh(mesh.points, mesh.hexahedra, sets, mesh.cell_sets)))
        whole = Parts(parts=tuple(parts)).build()
        x, y, z = whole.points.T
        reach = 2.0 * self.core_size * max(self.core)
        places = {
            "top": y == 0.0,
            "bottom": np.isclose(y, -self.height),
            "xmin": np.isclose(x, -0.5 * self.length),
            "xmax": np.isclose(x, 0.5 * self.length),
            "zmin": np.isclose(z, -0.5 * self.width),
            "zmax": np.isclose(z, 0.5 * self.width),
            "contact": (y == 0.0) & (np.maximum(np.abs(x), np.abs(z)) <= reach * (1.0 + 1e-9)),
        }
        tied = {name for pair in self.tied for name in pair}
        node_sets = {name: nodes for name, nodes in whole.node_sets.items() if name in tied}
        node_sets |= {name: np.flatnonzero(where).astype(np.int32) for name, where in places.items()}
        mesh = Mesh(whole.points, whole.hexahedra, node_sets, {"body": whole.cell_sets["body"]})
        return with_volumes(mesh, self.volume)


def _grid(axes: Axes, hole: Axes | None) -> Mesh:
    """Bricks between the coordinates, but for those inside a hole."""
    divisions = tuple(len(axis) - 1 for axis in axes)
    brick = Box(size=(1.0, 1.0, 1.0), divisions=divisions).build()  # type: ignore[arg-type]
    index = np.rint(brick.points * divisions).astype(int)
    points = np.stack([axis[index[:, k]] for k, axis in enumerate(axes)], axis=1)
    middle = points[brick.hexahedra].mean(axis=1)
    kept = np.ones(len(middle), dtype=bool)
    if hole is not None:
        inside = [(middle[:, k] > axis[0]) & (middle[:, k] < axis[-1]) for k, axis in enumerate(hole)]
        kept = ~np.logical_and.reduce(inside)
    cells = np.arange(kept.sum(), dtype=np.int32)
    return compact(Mesh(points, brick.hexahedra[kept], {}, {"body": cells}))


def _on_box(points: Array, axes: Axes, height: float) -> NDArray[np.int32]:
    """Nodes on the sides and the bottom of a box, but for sides on the plate's own faces, where no other box lies."""
    slack = 1e-9 * height
    within = np.ones(len(points), dtype=bool)
    for k, axis in enumerate(axes):
        within &= (points[:, k] > axis[0] - slack) & (points[:, k] < axis[-1] + slack)
    on = np.zeros(len(points), dtype=bool)
    for k, axis in enumerate(axes):
        on |= np.abs(points[:, k] - axis[0]) < slack
        on |= (np.abs(points[:, k] - axis[-1]) < slack) if k != 1 else False
    return np.flatnonzero(within & on).astype(np.int32)
