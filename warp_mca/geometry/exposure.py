"""Owns the surface of a mesh some of whose cells have gone: faces between them and those that are left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Index
from warp_mca.geometry.boundary import faces_between
from warp_mca.geometry.mesh import Mesh


class Exposure:
    """Faces that a mesh may ever have on its surface.

    Attributes:
        mesh: that they belong to.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self._inner = faces_between(mesh.cells)

    def bare(self, alive: NDArray[np.bool_]) -> tuple[Index, Index]:
        """Inner faces that only one cell is left at, seen from its outside: as `surface`."""
        node, owner, other = self._inner
        kept = alive[owner] & ~alive[other]
        return node[kept], owner[kept]

    def surface(self, name: str, alive: NDArray[np.bool_]) -> tuple[Index, Index]:
        """Faces of the set `name`, as `Mesh.surface` gives them, whose cells are left, and bare inner faces.

        Args:
            name: of the set of nodes.
            alive: whether each cell is left, shape (cell_count,), bool.

        Returns:
            Nodes of each face, shape (face_count, 4), int32, and its cell, shape (face_count,), int32.
        """
        node, owner = self.mesh.surface(name)
        kept, (more, behind) = alive[owner], self.bare(alive)
        return np.concatenate([node[kept], more]), np.concatenate([owner[kept], behind])

    def skin(self, alive: NDArray[np.bool_]) -> tuple[Index, Index]:
        """As `surface`, of the whole boundary."""
        node, owner = self.mesh.boundary
        kept, (more, behind) = alive[owner], self.bare(alive)
        return np.concatenate([node[kept], more]), np.concatenate([owner[kept], behind])

    def possible(self) -> tuple[Index, Index]:
        """All faces of the boundary and inner ones, both sides of each: nodes, shape (face_count, 4), int32, the cell
        that each bounds and the one on its other side, or -1, shape (face_count, 2), int32."""
        node, owner = self.mesh.boundary
        outer = np.column_stack([owner, np.full(len(owner), -1, np.int32)])
        inner = np.column_stack(self._inner[1:])
        return np.concatenate([node, self._inner[0]]), np.concatenate([outer, inner]).astype(np.int32)

    def all_faces(self, name: str) -> tuple[Index, Index]:
        """Faces of the set `name` and all inner ones, both sides of each, as `surface`."""
        node, owner = self.mesh.surface(name)
        return np.concatenate([node, self._inner[0]]), np.concatenate([owner, self._inner[1]])
