"""Owns the reading of mesh files by gmsh: Ideas universal files and Nastran bulk data."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.geometry.cell_types import CELL_TYPES, QUADRATIC
from warp_mca.geometry.gmsh_session import gmsh_session

if TYPE_CHECKING:
    import meshio

GMSH_SUFFIXES = (".unv", ".bdf", ".nas")
_SURFACES = {2: ("triangle", 3), 3: ("quad", 4), 9: ("triangle", 3), 16: ("quad", 4), 10: ("quad", 4)}
_VOLUMES = {cell.gmsh: (cell.meshio, cell.corners) for cell in CELL_TYPES.values()}
_QUADRATIC = {code: (name, 0) for name, (code, *_) in QUADRATIC.items()}
_TYPES = _SURFACES | _VOLUMES | _QUADRATIC  # by gmsh's code: meshio's name, nodes that are kept (0: all)


def read_by_gmsh(path: Path) -> meshio.Mesh:
    """The faces and cells of a file with its groups as cell sets; without groups, properties are called "part_N".

    Raises:
        RequestError: gmsh is missing.
        Exception: it cannot read the file.
    """
    import meshio

    with gmsh_session() as gmsh:
        gmsh.merge(str(path))
        model = gmsh.model
        tags, coordinates, _ = model.mesh.getNodes()
        order = np.argsort(tags)
        owners: list[tuple[int, int]] = []
        cells: list[Any] = []
        for entity in [*model.getEntities(2), *model.getEntities(3)]:
            for kind, nodes in _cells(model, entity):
                if not np.isin(nodes, tags).all():
                    raise ValueError("its cells have nodes that it does not give")
                owners.append(entity)
                cells.append((kind, np.searchsorted(tags[order], nodes)))
        groups: dict[str, list[tuple[int, int]]] = {}
        for dim, tag in model.getPhysicalGroups():  # a surface and a volume may share a name
            name = model.getPhysicalName(dim, tag) or f"physical_{tag}"
            groups.setdefault(name, []).extend((dim, int(e)) for e in model.getEntitiesForPhysicalGroup(dim, tag))
        groups = groups or {f"part_{tag}": [(dim, tag)] for dim, tag in model.getEntities(3)}
        none = np.zeros(0, dtype=np.int64)
        sets: dict[str, Any] = {
            name: [
                np.arange(len(data)) if owner in members else none
                for owner, (_, data) in zip(owners, cells, strict=True)
            ]
            for name, members in groups.items()
        }
        return meshio.Mesh(coordinates.reshape(-1, 3)[order], cells, cell_sets=sets)


def _cells(model: ModuleType, entity: tuple[int, int]) -> list[tuple[str, np.ndarray]]:
    """Types by meshio's names, and gmsh's nodes of each cell, in one of gmsh's entities."""
    found = []
    for code, elements, nodes in zip(*model.mesh.getElements(*entity), strict=True):
        if int(code) not in _TYPES:
            name = model.mesh.getElementProperties(code)[0]
            raise ValueError(f"it holds cells of the type {name}; save it with linear cells")
        name, corners = _TYPES[int(code)]
        table = np.asarray(nodes, dtype=np.int64).reshape(len(elements), -1)
        found.append((name, table[:, :corners] if corners else table))
    return found
