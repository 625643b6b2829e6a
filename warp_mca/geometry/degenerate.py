"""Owns conversions between cell types: wedges and pyramids as hexahedra with coinciding corners, cuts to tetrahedra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, MAX_CORNERS, PYRAMID, TETRAHEDRON, WEDGE
from warp_mca.geometry.integrals import INTEGRALS
from warp_mca.geometry.mesh import Mesh
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
        negative = INTEGRALS[cell.stored_as].volumes(points[cells[:, corners]]) < 0.0
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
    if name == TETRAHEDRON.name:
        return tetrahedral(mesh)
    cell = CELL_TYPES[name]
    return cell.made(mesh) if cell.made and any(len(mesh.cells[other]) for other in cell.cut_from) else mesh


def tetrahedral(mesh: Mesh) -> Mesh:
    """The mesh with its hexahedra, wedges and pyramids cut to tetrahedra; sets keep what they hold.

    Every quadrilateral is cut from its lowest-numbered corner, so that neighbours agree (Dompierre and others, Proc.
    8th International Meshing Roundtable, 1999).
    """
    if not len(mesh.hexahedra):
        return mesh
    apex = mesh.hexahedra.min(axis=1)
    faces = mesh.hexahedra[:, HEXAHEDRON.quads]
    low = faces.argmin(axis=2)
    faces = np.take_along_axis(faces, (low[..., None] + np.arange(4)) % 4, axis=2)
    corners = np.stack([faces[..., [0, 1, 2]], faces[..., [0, 2, 3]]], axis=2).reshape(-1, 3)
    owner = np.repeat(np.arange(len(mesh.hexahedra)), 2 * len(HEXAHEDRON.faces))
    # cones from the apex over the triangles of the faces without it; collapsed triangles have no volume
    real = (corners[:, 0] != corners[:, 1]) & (corners[:, 1] != corners[:, 2]) & (corners[:, 2] != corners[:, 0])
    used = real & (corners != apex[owner][:, None]).all(axis=1)
    used[used] = (faces.reshape(-1, 4)[np.flatnonzero(used) // 2] != apex[owner[used]][:, None]).all(axis=1)
    cut = np.column_stack([apex[owner[used]], corners[used]])
    owner = np.append(owner[used], len(mesh.hexahedra) + np.arange(len(mesh.tetrahedra)))
    order = np.argsort(owner, kind="stable")
    cell_sets = {
        name: np.flatnonzero(np.isin(np.sort(owner), np.arange(mesh.cell_count)[cells])).astype(np.int32)
        for name, cells in mesh.cell_sets.items()
    }
    none = np.zeros((0, HEXAHEDRON.corners), dtype=np.int32)
    tetrahedra = np.concatenate([cut, mesh.tetrahedra])[order].astype(np.int32)
    return divided(replace(mesh, hexahedra=none, cell_sets=cell_sets, tetrahedra=tetrahedra), mesh, np.sort(owner))
