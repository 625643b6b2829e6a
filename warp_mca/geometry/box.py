"""Owns `Box`: a brick of equal cells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from warp_mca.base import validate
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.recipe import check_size
from warp_mca.geometry.refinement import refined_count


@dataclass(frozen=True, kw_only=True)
class Box:
    """A brick with edges along the axes; node sets xmin, xmax, ymin, ymax, zmin, zmax, cell set body.

    Attributes:
        size: lengths along x, y, z [m].
        divisions: number of cells along x, y, z.
        origin: corner of least x, y, z [m].
    """

    size: tuple[float, float, float]
    divisions: tuple[int, int, int]
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.entries("Box", 3, validate.positive, size=self.size)
        validate.entries("Box", 3, validate.counts, divisions=self.divisions)
        check_size("Box", [self.divisions], divisions=self.divisions)
        validate.entries("Box", 3, validate.finite, origin=self.origin)

    def refined(self, factor: float) -> Box:
        """The brick with `factor` times as many cells along each edge; even numbers stay even, for a middle plane."""
        return replace(self, divisions=tuple(refined_count(n, factor, even=n % 2 == 0) for n in self.divisions))

    @property
    def volume(self) -> float:
        """Of the brick [m^3]."""
        return math.prod(self.size)

    def build(self) -> Mesh:
        """The mesh, numbered with x running fastest, then y, then z."""
        nx, ny, nz = self.divisions
        axes = [o + s * np.arange(n + 1) / n for o, s, n in zip(self.origin, self.size, self.divisions, strict=True)]
        z, y, x = np.meshgrid(*axes[::-1], indexing="ij")
        index = np.arange(x.size, dtype=np.int32).reshape(nz + 1, ny + 1, nx + 1)
        first = index[:-1, :-1, :-1].reshape(-1, 1)
        dy, dz = nx + 1, (nx + 1) * (ny + 1)
        hexahedra = first + np.array([0, 1, dy + 1, dy, dz, dz + 1, dz + dy + 1, dz + dy], dtype=np.int32)
        node_sets = {}
        for axis, name in enumerate("zyx"):
            for side, where in (("min", 0), ("max", -1)):
                node_sets[name + side] = index.take(where, axis=axis).ravel()
        points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        cells = np.arange(len(hexahedra), dtype=np.int32)
        return Mesh(points, hexahedra, node_sets, {"body": cells}, volume_ratio=np.ones(1))
