"""Owns `Mesh`: points, cells and named sets of one body in its own frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from warp_mca.errors import bad_value

# Faces of a hexahedron in VTK/gmsh node order, each listed counter-clockwise seen from outside.
HEX_FACES = np.array(
    [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]], dtype=np.int32
)


@dataclass(frozen=True)
class Mesh:
    """A volume mesh in the frame of its body.

    Attributes:
        points: node positions [m], shape (node_count, 3), float64.
        hexahedra: node indices in VTK order, shape (element_count, 8), int32.
        node_sets: named node indices, each shape (count,), int32.
        cell_sets: named element indices, each shape (count,), int32.
    """

    points: NDArray[np.float64]
    hexahedra: NDArray[np.int32]
    node_sets: dict[str, NDArray[np.int32]] = field(default_factory=dict)
    cell_sets: dict[str, NDArray[np.int32]] = field(default_factory=dict)

    @cached_property
    def boundary(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Faces that belong to one element only, oriented outwards: nodes (face_count, 4), element (face_count,)."""
        faces = self.hexahedra[:, HEX_FACES].reshape(-1, 4)
        _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
        own = np.sort(first[count == 1])
        return faces[own], (own // len(HEX_FACES)).astype(np.int32)

    def surface(self, name: str) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Boundary faces whose nodes all lie in the node set `name` ("boundary": all of them).

        Returns:
            Nodes of each face, shape (face_count, 4), int32, and its element, shape (face_count,), int32.

        Raises:
            RequestError: the set is unknown or holds no whole face.
        """
        faces, elements = self.boundary
        if name == "boundary":
            return faces, elements
        member = np.zeros(len(self.points), dtype=bool)
        member[self.nodes(name)] = True
        whole = member[faces].all(axis=1)
        if not whole.any():
            raise bad_value("node set", name, "it holds no whole face of the mesh; name a set that covers a surface")
        return faces[whole], elements[whole]

    def nodes(self, name: str) -> NDArray[np.int32]:
        """Node indices of the set `name`, shape (count,), int32.

        Raises:
            RequestError: there is no such set.
        """
        if name not in self.node_sets:
            raise bad_value("node set", name, f"the mesh has {', '.join(sorted(self.node_sets)) or 'no sets'}")
        return self.node_sets[name]
