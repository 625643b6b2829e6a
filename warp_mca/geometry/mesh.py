"""Owns `Mesh`: points, cells and named sets of one body in its own frame."""

from __future__ import annotations

from collections.abc import Hashable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.kept import this_run
from warp_mca.geometry.boundary import boundary_faces
from warp_mca.geometry.cell_types import stored_types
from warp_mca.geometry.integrals import gauss_jacobians


@dataclass(frozen=True)
class Mesh:
    """A volume mesh in the frame of its body; cells are counted over hexahedra, tetrahedra, then others.

    Attributes:
        points: node positions [m], shape (node_count, 3), float64.
        hexahedra: node indices in VTK order, shape (hexahedron_count, 8), int32. Wedges and pyramids are hexahedra
            whose corners coincide, see `warp_mca.geometry.degenerate`.
        node_sets: named node indices, each shape (count,), int32.
        cell_sets: named cell indices, each shape (count,), int32.
        tetrahedra: node indices in VTK order, shape (tetrahedron_count, 4), int32.
        notes: what the reader of its file left out, a sentence each; a run has them among its warnings.
        volume_ratio: volume of the shape that the mesh stands for over that of its cells [-], shape (cell_count,), or
            (1,) where it is one for all cells, float64; empty where nothing is known of a shape but its cells.
        others: node indices of cells of further types by the type's name, each shape (cell_count, corners), int32:
            "tetra10", and types from outside the package.
    """

    points: NDArray[np.float64]
    hexahedra: NDArray[np.int32]
    node_sets: dict[str, NDArray[np.int32]] = field(default_factory=dict)
    cell_sets: dict[str, NDArray[np.int32]] = field(default_factory=dict)
    tetrahedra: NDArray[np.int32] = field(default_factory=lambda: np.zeros((0, 4), dtype=np.int32))
    notes: tuple[str, ...] = ()
    volume_ratio: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    others: dict[str, NDArray[np.int32]] = field(default_factory=dict)

    @property
    def cells(self) -> dict[str, NDArray[np.int32]]:
        """Nodes of the cells of each stored type, by its name, in the order in which cells are counted."""
        none = {name: np.zeros((0, cell.corners), np.int32) for name, cell in stored_types().items()}
        own = {name: getattr(self, cell.field) for name, cell in stored_types().items() if cell.field}
        return none | own | self.others

    @property
    def cell_count(self) -> int:
        """Number of cells."""
        return sum(map(len, self.cells.values()))

    def cell(self, index: int) -> NDArray[np.int32]:
        """Nodes of one cell."""
        for cells in self.cells.values():
            if index < len(cells):
                return cells[index]
            index -= len(cells)
        raise IndexError(index)

    @property
    def boundary(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Faces that belong to one cell only, oriented outwards: nodes (face_count, 4), cell (face_count,).

        Triangles have their last corner twice.
        """
        return self._faces[:2]

    @property
    def overlapping(self) -> NDArray[np.int32]:
        """The first two cells that lie on the same side of a face, shape (2,), int32; as it should be, none, (0,)."""
        return self._faces[2]

    @cached_property
    def _faces(self) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        return boundary_faces(self.cells, len(self.points))

    @property
    def cell_volumes(self) -> Array:
        """Volume of each cell [m^3], shape (cell_count,), float64; not to be written to."""
        return self._integrals[1]

    @property
    def least_jacobians(self) -> Array:
        """Least Jacobian determinant times weight at the Gauss points of each cell [m^3], shape (cell_count,)."""
        return self._integrals[0]

    @property
    def _integrals(self) -> tuple[Array, Array]:
        known = self.known
        if "integrals" not in known:
            parts = gauss_jacobians(self.points, self.cells)
            found = np.concatenate([p.min(axis=1) for p in parts]), np.concatenate([p.sum(axis=1) for p in parts])
            for values in found:
                values.setflags(write=False)
            known["integrals"] = found
        return known["integrals"]

    @property
    def known(self) -> dict[Hashable, Any]:
        """What was computed of its nodes and cells as they are: empty where one of them was changed since.

        They are compared at each look, in a run at the first one.
        """
        state, found, seen = vars(self).get("_known", (None, {}, None))
        if seen is None or seen is not this_run():
            now = self._as_it_is()
            vars(self)["_known"] = now, (found := found if now == state else {}), this_run()
        return found

    def _as_it_is(self) -> tuple[int, ...]:
        """What tells nodes and cells from others, in this process."""
        return tuple(hash(values.tobytes()) for values in (self.points, *self.cells.values()))

    def __getstate__(self) -> dict[str, Any]:
        """For another process, with what is known of nodes and cells as they are now."""
        return vars(self) | ({"_known": self.known} if "_known" in vars(self) else {})

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Keep what was known there."""
        vars(self).update(state)
        if "_known" in state:
            vars(self)["_known"] = self._as_it_is(), state["_known"], None

    def look_again(self) -> None:
        """Compare nodes and cells at the next look, in a run too: code of the user's own had the mesh."""
        if "_known" in vars(self):
            vars(self)["_known"] = *vars(self)["_known"][:2], None

    def with_ratio(self, ratio: Array) -> Mesh:
        """The mesh with another `volume_ratio`, and with what is known of it."""
        made = replace(self, volume_ratio=ratio)
        vars(made).update({name: vars(self)[name] for name in ("_faces", "_known") if name in vars(self)})
        return made

    def share_faces(self, others: Iterable[Mesh]) -> None:
        """Take the boundary from one of the other meshes that has the same cells, in place of finding it again."""
        for other in others:
            own, its = self.cells, other.cells
            alike = "_faces" in vars(other) and len(self.points) == len(other.points) and own.keys() == its.keys()
            if alike and all(np.array_equal(cells, its[name]) for name, cells in own.items()):
                vars(self)["_faces"] = other._faces
                return

    def surface(self, name: str) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Boundary faces whose nodes all lie in the node set `name` ("boundary", unless there is one: all of them).

        Returns:
            Nodes of each face, shape (face_count, 4), int32, and its element, shape (face_count,), int32.

        Raises:
            RequestError: the set is unknown or holds no whole face.
        """
        faces, elements = self.boundary
        member = np.zeros(len(self.points), dtype=bool)
        member[self.nodes(name)] = True
        whole = member[faces].all(axis=1)
        if not whole.any():
            raise bad_value("node set", name, "it holds no whole face of the mesh; name a set that covers a surface")
        return faces[whole], elements[whole]

    def nodes(self, name: str) -> NDArray[np.int32]:
        """Node indices of the set `name`, shape (count,), int32; "boundary" is the whole skin, unless it is a set.

        Raises:
            RequestError: there is no such set, or no node in it.
        """
        if name == "boundary" and name not in self.node_sets:
            return np.unique(self.boundary[0]).astype(np.int32)
        if name not in self.node_sets:
            raise bad_value("node set", name, f"the mesh has {', '.join(sorted(self.node_sets)) or 'no sets'}")
        if not len(self.node_sets[name]):
            raise bad_value("node set", name, "no cell has a node of it; name a set of nodes that cells have")
        return self.node_sets[name]
