"""Owns what a frame of a run can hold, by name, and the skins of bodies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from warp_mca.base.arrays import Index
from warp_mca.geometry.cell_types import is_triangle, triangulated

# What a frame can hold. Only what a recorder of the run asks for is computed and copied.
SURFACE, CONTACT, PATHS, VOLUME = NEEDS = "surface", "contact", "paths", "volume"


@dataclass(frozen=True)
class SurfaceMesh:
    """The skin of a body.

    Attributes:
        nodes: model node of each vertex, shape (vertex_count,), int32.
        quads: vertices of each face, counter-clockwise from outside, shape (face_count, 4), int32; triangles have
            their last one twice.
    """

    nodes: Index
    quads: Index

    @cached_property
    def triangles(self) -> Index:
        """The faces, quadrilaterals cut in two, shape (triangle_count, 3), int32."""
        return triangulated(self.quads)

    @property
    def corner_counts(self) -> Index:
        """Corners of each face: 4, or 3 for triangles, shape (face_count,), int32."""
        return np.where(is_triangle(self.quads), 3, 4).astype(np.int32)
