"""Owns `Plate`: a rectangular plate whose mesh is graded towards the middle of its top face."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.blocks import Blocks, growth
from warp_mca.geometry.edit import mirror, snapped
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.refinement import refined_count
from warp_mca.geometry.shape_volume import with_volumes

_FIRST_STEP = 1.5  # growth starts from this many fine edges; 1 costs a tenth of the stable step in fine meshes


@dataclass(frozen=True, kw_only=True)
class Plate:
    """A plate in -height <= y <= 0 with the origin at the middle of its top face; symmetric about x = 0 and z = 0.

    A fine core under the origin is surrounded by five blocks that radiate to a local box of the plate's whole height,
    and the box is extended along x, and along z where it is narrower than the plate.

    Node sets: top, bottom, xmin, xmax, zmin, zmax, contact (top nodes within `contact` of the origin in x and z).
    Cell set: body.

    Attributes:
        length, width, height: extent along x, z, y [m].
        core: number of fine cells along x and z, both even.
        core_depth: number of fine cells downwards.
        core_size: edge of the fine cells [m].
        layers: number of cells from the core to the local box.
        box: half the extent of the local box along x and z [m]; None: the largest that is no wider than high.
        extension: number of cells along x from the box to each end of the plate.
        extension_z: the same along z; unused where the box is as wide as the plate.
        contact: half the extent of the node set contact [m]; None: four times the core's.
        part: "whole"; or "quarter", with x >= 0 and z >= 0, whose cut faces are xmin and zmin.
    """

    length: float
    width: float
    height: float
    core: tuple[int, int] = (6, 6)
    core_depth: int = 3
    core_size: float = 0.6e-3
    layers: int = 10
    box: float | None = None
    extension: int = 20
    extension_z: int = 4
    contact: float | None = None
    part: Literal["whole", "quarter"] = "whole"

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.positive("Plate", length=self.length, width=self.width, height=self.height, core_size=self.core_size)
        validate.entries("Plate", 2, validate.even_counts, core=self.core)
        validate.counts("Plate", core_depth=self.core_depth, layers=self.layers)
        validate.counts("Plate", extension=self.extension, extension_z=self.extension_z)
        for name in ("box", "contact"):
            if getattr(self, name) is not None:
                validate.positive("Plate", **{name: getattr(self, name)})
        validate.choice("Plate", ("whole", "quarter"), part=self.part)
        half = self._half_box
        if 2.0 * half > min(self.length, self.width) * (1.0 + 1e-12):
            raise bad_value("Plate.box", self.box, "it must fit the plate: at most half its length and width")
        extents = (0.5 * self.core[0], half), (0.5 * self.core[1], half), (self.core_depth, self.height)
        if any(count * self.core_size >= room for count, room in extents):
            raise bad_value(
                "Plate.core_size", self.core_size, "the core must fit inside the local box; make it smaller"
            )

    def refined(self, factor: float) -> Plate:
        """The plate with cells `factor` times smaller: counts times it, `core_size` over it.

        The node set contact keeps its extent. Counts that are rounded up make the core grow to half the room at most,
        or to what it had.
        """
        core = tuple(refined_count(n, factor, even=True) for n in self.core)
        depth = refined_count(self.core_depth, factor)
        half, size = self._half_box, self.core_size
        rooms = (0.5 * self.core[0], half), (0.5 * self.core[1], half), (self.core_depth, self.height)
        counts = 0.5 * core[0], 0.5 * core[1], depth
        largest = min(max(0.5 * room, old * size) / new for (old, room), new in zip(rooms, counts, strict=True))
        return replace(
            self,
            core=core,
            core_depth=depth,
            core_size=min(size / factor, largest),
            layers=refined_count(self.layers, factor),
            extension=refined_count(self.extension, factor),
            extension_z=refined_count(self.extension_z, factor),
            contact=self._contact,
        )

    @property
    def _contact(self) -> float:
        """Half the extent of the node set contact [m]."""
        return 2.0 * self.core_size * max(self.core) if self.contact is None else self.contact

    @property
    def _half_box(self) -> float:
        return min(0.5 * self.length, 0.5 * self.width, self.height) if self.box is None else self.box

    @property
    def volume(self) -> float:
        """Of the plate, or of its part [m^3]."""
        return self.length * self.width * self.height * (1.0 if self.part == "whole" else 0.25)

    def build(self) -> Mesh:
        """The mesh: one quarter by gmsh, mirrored twice for the whole."""
        mesh = self._quarter()
        whole = self.part == "whole"
        if whole:
            mesh = mirror(mirror(mesh, 0), 2)
        points = mesh.points
        ends = {"x": 0.5 * self.length, "z": 0.5 * self.width}
        planes = {"top": (1, 0.0), "bottom": (1, -self.height)}
        for name, end in ends.items():
            axis = "xyz".index(name)
            planes |= {f"{name}min": (axis, -end if whole else 0.0), f"{name}max": (axis, end)}
        for axis, value in planes.values():
            points = snapped(points, axis, value)
        sets = {name: np.flatnonzero(points[:, axis] == value) for name, (axis, value) in planes.items()}
        near = np.abs(points[:, [0, 2]]).max(axis=1) <= self._contact * (1.0 + 1e-9)
        sets["contact"] = np.flatnonzero((points[:, 1] == 0.0) & near)
        node_sets = {name: nodes.astype(np.int32) for name, nodes in sets.items()}
        return with_volumes(Mesh(points, mesh.hexahedra, node_sets, mesh.cell_sets), self.volume)

    def _quarter(self) -> Mesh:
        """The part with x >= 0 and z >= 0; corners are indexed by their place along x, down and along z."""
        blocks = Blocks(
            "Plate",
            core=self.core,
            core_depth=self.core_depth,
            layers=self.layers,
            extension=self.extension,
            extension_z=self.extension_z,
        )
        nx, nz = self.core[0] // 2, self.core[1] // 2
        ny, layers, half = self.core_depth, self.layers, self._half_box
        core = _grid(blocks, [nx * self.core_size], [ny * self.core_size], [nz * self.core_size])
        xs = [half] if 2.0 * half >= self.length else [half, 0.5 * self.length]
        zs = [half] if 2.0 * half >= self.width else [half, 0.5 * self.width]
        outer = _grid(blocks, xs, [self.height], zs)

        blocks.block(_corners(core), (nx, ny, nz), "body")
        for axis, divisions in enumerate(((ny, nz), (nx, nz), (nx, ny))):
            faces = [grid[:2, :2, :2].take(1, axis=axis) for grid in (core, outer)]
            blocks.block(_corners(np.stack(faces, axis=-1)), (*divisions, layers), "body")
        for index in np.ndindex(2, 2, 2):
            if any(index):
                directions = sum(index)
                a, b = int(core[index]), int(outer[index])
                length = float(np.linalg.norm(blocks.position(b) - blocks.position(a)))
                factor = growth(length, layers, _FIRST_STEP * self.core_size * math.sqrt(directions))
                blocks.grow(a, b, factor)
        self._extend(blocks, outer, (xs, zs), (nx, ny, nz))
        return blocks.mesh()

    def _extend(self, blocks: Blocks, outer: np.ndarray, ends: tuple[list, list], core: tuple[int, int, int]) -> None:
        """Adds the blocks beyond the local box, whose cells go on growing from its outermost ones."""
        for i, k in np.ndindex(*(len(end) for end in ends)):
            if i or k:
                corners = _corners(outer[i : i + 2, :, k : k + 2])
                divisions = (self.extension if i else core[0], core[1], self.extension_z if k else core[2])
                blocks.block(corners, divisions, "body")
        for axis, count in ((0, self.extension), (2, self.extension_z)):
            if outer.shape[axis] < 3:
                continue
            lines = np.moveaxis(outer, axis, 0).reshape(3, -1)
            inner = core[axis] * self.core_size
            box, end = (float(blocks.position(line)[axis]) for line in lines[1:, 0])
            first = _FIRST_STEP * self.core_size
            last = first * growth(box - inner, self.layers, first) ** self.layers
            for a, b in lines[1:].T:
                blocks.grow(a, b, growth(end - box, count, last))


def _grid(blocks: Blocks, xs: list[float], depths: list[float], zs: list[float]) -> np.ndarray:
    """Handles of the points at 0 and the given places along x, down and along z, indexed in this order."""
    x, depth, z = ([0.0, *values] for values in (xs, depths, zs))
    handles = np.empty((len(x), len(depth), len(z)), dtype=int)
    for i, j, k in np.ndindex(handles.shape):
        handles[i, j, k] = blocks.point((x[i], -depth[j], z[k]))
    return handles


def _corners(grid: np.ndarray) -> list[int]:
    """Corners of a 2 x 2 x 2 grid of handles in the order of a VTK hexahedron."""
    return [int(grid[i, j, k]) for k in (0, 1) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))]
