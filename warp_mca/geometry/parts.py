"""Owns `Parts`: one mesh of several that share no node, for parts that are tied to each other."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.geometry.cell_types import stored_types
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.refinement import refined
from warp_mca.geometry.shape_volume import built, of_cells, with_ratios

if TYPE_CHECKING:
    from warp_mca.geometry.recipe import Recipe


@dataclass(frozen=True, kw_only=True)
class Part:
    """A mesh in a body of several.

    Attributes:
        name: unique in the body.
        geometry: a recipe or a finished mesh.
        at: where its origin lies in the body's frame [m].
    """

    name: str
    geometry: Recipe | Mesh
    at: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.texts("Part", name=self.name)
        if isinstance(self.geometry, type) or not (hasattr(self.geometry, "build") or hasattr(self.geometry, "points")):
            raise bad_value(f"Part {self.name}.geometry", self.geometry, "give a recipe, as Box(...), or a Mesh")
        validate.vectors(f"Part {self.name}", at=self.at)


@dataclass(frozen=True, kw_only=True)
class Parts:
    """Several meshes as the mesh of one body; a `Tie` of two of their surfaces holds them together.

    Node set and cell set S of part P are called "P.S"; S alone is what the parts that have it hold together.

    Attributes:
        parts: at least one.
    """

    parts: tuple[Part, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.members("Parts", Part, parts=self.parts)
        names = [part.name for part in self.parts]
        if not names or len(set(names)) < len(names):
            raise bad_value("Parts.parts", names, "give at least one part, each with a name of its own")

    def refined(self, factor: float) -> Parts:
        """The parts with cells about `factor` times smaller.

        Raises:
            RequestError: a part is a finished mesh, or a recipe without a method `refined(factor)`.
        """
        parts = [replace(part, geometry=refined(f"part {part.name}", part.geometry, factor)) for part in self.parts]
        return replace(self, parts=tuple(parts))

    def build(self) -> Mesh:
        """The mesh: nodes of the parts one after the other; of the cells first all hexahedra, then all tetrahedra of
        four nodes, then others."""
        meshes = [
            part.geometry if isinstance(part.geometry, Mesh) else built(f"Part {part.name}.geometry", part.geometry)
            for part in self.parts
        ]
        nodes = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
        counts = np.array([[len(mesh.cells[name]) for mesh in meshes] for name in stored_types()])  # by type and part
        first = np.cumsum(counts).reshape(counts.shape) - counts
        own = np.cumsum(counts, axis=0)  # where the cells of each type end in their part
        node_sets: dict[str, list] = {}
        cell_sets: dict[str, list] = {}
        for k, (part, mesh) in enumerate(zip(self.parts, meshes, strict=True)):
            for name, members in mesh.node_sets.items():
                for key in (f"{part.name}.{name}", name):
                    node_sets.setdefault(key, []).append(members + nodes[k])
            for name, members in mesh.cell_sets.items():
                kind = np.searchsorted(own[:, k], members, side="right")
                moved = members + (first - own + counts)[kind, k]
                for key in (f"{part.name}.{name}", name):
                    cell_sets.setdefault(key, []).append(moved)
        cells: dict[str, Any] = {
            name: np.concatenate([mesh.cells[name] + nodes[k] for k, mesh in enumerate(meshes)]).astype(np.int32)
            for name in stored_types()
        }
        whole = Mesh(
            np.concatenate([mesh.points + np.asarray(p.at) for p, mesh in zip(self.parts, meshes, strict=True)]),
            node_sets={name: np.concatenate(items).astype(np.int32) for name, items in node_sets.items()},
            cell_sets={name: np.concatenate(items).astype(np.int32) for name, items in cell_sets.items()},
            **{kind.field: cells.pop(name) for name, kind in stored_types().items() if kind.field},
            others={name: found for name, found in cells.items() if len(found)},
            notes=tuple(dict.fromkeys(note for mesh in meshes for note in mesh.notes)),
        )
        if not any(len(mesh.volume_ratio) for mesh in meshes):
            return whole
        split = [np.split(of_cells(mesh), own[:-1, k]) for k, mesh in enumerate(meshes)]
        return with_ratios(whole, np.concatenate([part[kind] for kind in range(len(own)) for part in split]))
