"""Owns the reading of Ideas universal files by gmsh."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.geometry.cell_types import CELL_TYPES, GMSH_ORDER, QUADRATIC, TETRA10
from warp_mca.geometry.deck import ELEMENTS, integer, left_out_notes, linear, quadratic_notes, real
from warp_mca.geometry.gmsh_session import gmsh_session
from warp_mca.geometry.meshio_file import stray_notes

if TYPE_CHECKING:
    import meshio

UNIVERSAL_SUFFIXES = (".unv",)
_CURVES = {1: ("line", 2), 8: ("line", 2)}
_SURFACES = {2: ("triangle", 3), 3: ("quad", 4), 9: ("triangle", 3), 16: ("quad", 4), 10: ("quad", 4)}
_VOLUMES = {cell.gmsh: (cell.meshio, cell.corners) for cell in CELL_TYPES.values()}
_QUADRATIC = {code: (name, 0) for name, (code, *_) in QUADRATIC.items()}
_TYPES = _CURVES | _SURFACES | _VOLUMES | _QUADRATIC  # by gmsh's code: meshio's name, nodes that are kept (0: all)
_NODES, _ELEMENTS, _GROUPS = ("2411", "781"), ("2412",), ("2435", "2452", "2467", "2477")  # numbers of sections
# Types of elements by their number in universal files: solids, beams, and what gmsh reads besides.
_SOLIDS = (111, 112, 113, 114, 115, 116, 117, 118)
_BEAMS = (11, 21, 22, 23, 24)
_READ = (*_SOLIDS, *_BEAMS, *range(41, 100))


def read_universal(path: Path) -> tuple[meshio.Mesh, list[str]]:
    """The edges, faces and cells of a file with its groups as cell sets, and sentences about what is left out.

    Without groups, properties are called "part_N".

    Raises:
        RequestError: gmsh is missing.
        ValueError: a number is given twice, or gmsh finds other solids than the file has.
        Exception: gmsh cannot read the file.
    """
    kinds = _kinds(path)
    read = _read(path)
    quadratic = linear(read)
    solids = sum(len(block.data) for block in read.cells if block.dim == 3)
    if solids != (count := sum(kinds[kind] for kind in _SOLIDS)):
        raise ValueError(f"gmsh finds {solids} of its {count} solids")
    left = Counter({(ELEMENTS, f"of the type {kind}"): n for kind, n in kinds.items() if kind not in _READ})
    return read, quadratic_notes(path, quadratic) + stray_notes(path, read) + left_out_notes(path, left)


def _kinds(path: Path) -> Counter[int]:
    """Number of elements of each type, by its number in the format.

    Raises:
        ValueError: a number is given twice, or a group has an element that is not given, which crashes gmsh.
    """
    kinds: dict[int, int] = {}
    places: dict[int, tuple[float, ...]] = {}
    grouped: set[int] = set()
    with path.open(errors="replace") as file:
        lines = iter(file)
        for line in lines:
            if line.strip() != "-1":
                continue
            dataset = next(lines, "").strip()
            for record in lines:
                fields = record.split()
                if fields == ["-1"]:
                    break
                if dataset in _NODES:
                    place = tuple(map(real, next(lines, "").split()))
                    if places.setdefault(integer(fields[0]), place) != place:
                        raise ValueError(f"node {fields[0]} is given twice")
                elif dataset in _ELEMENTS:
                    number, kind, *_, count = map(integer, fields)
                    if number in kinds:
                        raise ValueError(f"element {number} is given twice")
                    kinds[number] = kind
                    for _ in range((count + 7) // 8 + (kind in _BEAMS)):
                        next(lines, "")
                elif dataset in _GROUPS:
                    next(lines, "")  # its name
                    for _ in range((integer(fields[-1]) + 1) // 2):
                        members = list(map(integer, next(lines, "").split()))
                        grouped.update(n for kind, n in zip(members[::4], members[1::4], strict=False) if kind == 8)
    if missing := grouped - kinds.keys():
        raise ValueError(f"a group has element {min(missing)}, which is not given")
    return Counter(kinds.values())


def _read(path: Path) -> meshio.Mesh:
    """What gmsh finds in a file."""
    import meshio

    with gmsh_session() as gmsh:
        gmsh.merge(str(path))
        model = gmsh.model
        tags, coordinates, _ = model.mesh.getNodes()
        order = np.argsort(tags)
        owners: list[tuple[int, int]] = []
        cells: list[Any] = []
        for entity in [*model.getEntities(1), *model.getEntities(2), *model.getEntities(3)]:
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
        if name == TETRA10.meshio:
            table = table[:, list(GMSH_ORDER)]
        found.append((name, table[:, :corners] if corners else table))
    return found
