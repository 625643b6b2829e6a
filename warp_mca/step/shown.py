"""Owns what a frame of a run can hold, by name, and the skins of bodies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

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
            their last one twice. Of a body whose elements may fail, all that may come to the surface.
        between: of such a body, the element that each face bounds and the one on its other side, or -1, as counted in
            the concatenated meshes, shape (face_count, 2), int32; None of others.
    """

    nodes: Index
    quads: Index
    between: Index | None = None

    def seen(self, failed: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which faces are at the surface, of a body whose elements may fail, shape (face_count,); `failed` says so of
        each element of the concatenated meshes."""
        assert self.between is not None
        own, other = self.between.T
        return ~failed[own] & ((other < 0) | failed[other])

    def part(self, seen: NDArray[np.bool_]) -> SurfaceMesh:
        """Some of the faces, with all vertices."""
        return replace(self, quads=self.quads[seen], between=None)

    @cached_property
    def triangles(self) -> Index:
        """The faces, quadrilaterals cut in two, shape (triangle_count, 3), int32."""
        return triangulated(self.quads)

    @property
    def corner_counts(self) -> Index:
        """Corners of each face: 4, or 3 for triangles, shape (face_count,), int32."""
        return np.where(is_triangle(self.quads), 3, 4).astype(np.int32)
