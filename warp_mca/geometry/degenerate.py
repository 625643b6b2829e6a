"""Owns conversions between cell types: wedges and pyramids as hexahedra with coinciding corners, cuts to tetrahedra."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, MAX_CORNERS, PYRAMID, TETRA10, TETRAHEDRON, WEDGE
from warp_mca.geometry.edit import compact
from warp_mca.geometry.integrals import integrals_of
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quadratic import edges_of
from warp_mca.geometry.shape_volume import divided

Cells = NDArray[np.int32]


def stored(points: NDArray[np.float64], cells: Cells, name: str) -> Cells:
    """Cells as a mesh stores those of their type, shape (cell_count, corners of the stored type), int32.

    Wedges, pyramids and tetrahedra that are numbered the other way round, so that their volume is negative, are
    mirrored; hexahedra stay as they are, so that checks find those that are inverted.

    Args:
        points: node positions [m], shape (node_count, 3), float64.
        cells: nodes of the cells, shape (cell_count, corners).
        name: their type, out of CELL_TYPES.
    """
    cell = CELL_TYPES[name]
    corners = list(cell.stored_corners)
    upright = cells.copy()
    if cell is not HEXAHEDRON:
        integrals, count = integrals_of(cell.linear or cell.stored_as)
        negative = integrals.volumes(points[cells[:, corners[:count]]]) < 0.0
        upright[negative] = cells[negative][:, list(cell.mirrored)]
    return upright[:, corners].astype(np.int32)


def cell_names(nodes: NDArray[np.integer]) -> NDArray[np.str_]:
    """Type of each cell, shape (cell_count,), out of CELL_TYPES.

    A hexahedron collapsed in any other way than a stored wedge or pyramid counts as a hexahedron.

    Args:
        nodes: of each cell, shape (cell_count, MAX_CORNERS), -1 beyond its last corner.
    """
    names = np.full(len(nodes), HEXAHEDRON.name, dtype=f"<U{max(map(len, CELL_TYPES))}")
    different = 1 + (np.diff(np.sort(nodes, axis=1), axis=1) != 0).sum(axis=1)
    for cell in (WEDGE, PYRAMID):
        first = [cell.own_corners[corner] for corner in cell.stored_corners]
        names[(nodes == nodes[:, first]).all(axis=1) & (different == cell.corners)] = cell.name
    names[(nodes[:, TETRAHEDRON.corners : MAX_CORNERS] < 0).all(axis=1)] = TETRAHEDRON.name
    return names


def among(cells: Cells, name: str) -> NDArray[np.bool_]:
    """Which cells of a stored type are of the type `name` that is stored so, shape (cell_count,); all of its own type.

    Args:
        cells: nodes, shape (cell_count, corners of the stored type).
        name: the type, out of CELL_TYPES.
    """
    if CELL_TYPES[name].stored_as == name:
        return np.ones(len(cells), dtype=bool)
    found = cells[:, 6] == cells[:, 7]  # a quick first look
    found[found] = cell_names(cells[found]) == name
    return found


def cut_to(mesh: Mesh, name: str) -> Mesh:
    """The mesh with cells that can be cut to those of the type `name`, or made into them, cut so; others stay."""
    cell = CELL_TYPES[name]
    made = cell.made or {TETRAHEDRON.name: tetrahedral, TETRA10.name: with_middles}.get(name)
    return made(mesh) if made and any(len(mesh.cells[other]) for other in cell.cut_from) else mesh


def tetrahedral(mesh: Mesh) -> Mesh:
    """The mesh with all its cells as tetrahedra of four nodes; sets keep what they hold."""
    if not (len(mesh.hexahedra) or len(mesh.cells[TETRA10.name])):
        return mesh
    tetrahedra, owner = _cut(mesh)
    others = {name: cells for name, cells in mesh.others.items() if name != TETRA10.name}
    return compact(_parted(mesh, owner, tetrahedra=tetrahedra, others=others))


def with_middles(mesh: Mesh) -> Mesh:
    """The mesh with all its cells as tetrahedra of ten nodes, edges straight where it gives no node within them.

    Node sets take the middles of edges whose ends they have.
    """
    tetrahedra, owner = _cut(mesh)
    quadratic = mesh.cells[TETRA10.name]
    edge, number = edges_of(tetrahedra)
    middle = np.full(len(edge), -1, dtype=np.int32)
    middle[number[len(number) - len(quadratic) :]] = quadratic[:, TETRAHEDRON.corners :]
    new = np.flatnonzero(middle < 0)
    middle[new] = len(mesh.points) + np.arange(len(new), dtype=np.int32)
    sets = {
        name: np.append(nodes, middle[new][np.isin(edge[new], nodes).all(axis=1)]).astype(np.int32)
        for name, nodes in mesh.node_sets.items()
    }
    points = np.concatenate([mesh.points, mesh.points[edge[new]].mean(axis=1)])
    cells = np.column_stack([tetrahedra, middle[number]]).astype(np.int32)
    none = np.zeros((0, TETRAHEDRON.corners), dtype=np.int32)
    others = mesh.others | {TETRA10.name: cells}
    return _parted(replace(mesh, points=points, node_sets=sets), owner, tetrahedra=none, others=others)


def _parted(mesh: Mesh, owner: NDArray[np.integer], **cells: Any) -> Mesh:
    """The mesh with other cells in place of its own, in the order of these, of which they are parts."""
    cell_sets = {
        name: np.flatnonzero(np.isin(owner, np.arange(mesh.cell_count)[own])).astype(np.int32)
        for name, own in mesh.cell_sets.items()
    }
    none = np.zeros((0, HEXAHEDRON.corners), dtype=np.int32)
    return divided(replace(mesh, hexahedra=none, cell_sets=cell_sets, **cells), mesh, owner)


def _cut(mesh: Mesh) -> tuple[Cells, NDArray[np.integer]]:
    """Corners of tetrahedra, and the cell of the mesh that each one is or is a part of, in rising order.

    Every quadrilateral is cut from its lowest-numbered corner, so that neighbours agree (Dompierre and others, Proc.
    8th International Meshing Roundtable, 1999).
    """
    quadratic = mesh.cells[TETRA10.name][:, : TETRAHEDRON.corners]
    whole = np.concatenate([mesh.tetrahedra, quadratic]).astype(np.int32)
    owner = np.arange(len(mesh.hexahedra) + len(whole), dtype=np.int32)
    if not len(mesh.hexahedra):
        return whole, owner
    apex = mesh.hexahedra.min(axis=1)
    faces = mesh.hexahedra[:, HEXAHEDRON.quads]
    low = faces.argmin(axis=2)
    faces = np.take_along_axis(faces, (low[..., None] + np.arange(4)) % 4, axis=2)
    corners = np.stack([faces[..., [0, 1, 2]], faces[..., [0, 2, 3]]], axis=2).reshape(-1, 3)
    cell = np.repeat(np.arange(len(mesh.hexahedra)), 2 * len(HEXAHEDRON.faces))
    # cones from the apex over the triangles of the faces without it; collapsed triangles have no volume
    real = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    used = real & (corners != apex[cell][:, None]).all(axis=1)
    used[used] = (faces.reshape(-1, 4)[np.flatnonzero(used) // 2] != apex[cell[used]][:, None]).all(axis=1)
    cut = np.column_stack([apex[cell[used]], corners[used]])
    return np.concatenate([cut, whole]).astype(np.int32), np.append(cell[used], owner[len(mesh.hexahedra) :])
