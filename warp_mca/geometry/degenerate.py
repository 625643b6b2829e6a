"""Owns cells other than bricks: wedges and pyramids as hexahedra with coinciding corners, cuts into tetrahedra."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warp_mca.elements import hexahedron, tet4
from warp_mca.geometry.boundary import HEX_FACES
from warp_mca.geometry.mesh import Mesh

Cells = NDArray[np.int32]

AS_HEXAHEDRON = {"wedge": [0, 1, 2, 2, 3, 4, 5, 5], "pyramid": [0, 1, 2, 3, 4, 4, 4, 4]}  # VTK's corner orders
_MIRRORED = {"wedge": [0, 2, 1, 3, 5, 4], "pyramid": [0, 3, 2, 1, 4], "tetra": [0, 2, 1, 3]}


def oriented(points: NDArray[np.float64], cells: Cells, kind: str) -> Cells:
    """Wedges, pyramids or tetrahedra with the corners of those that are numbered the other way round exchanged."""
    if kind == "tetra":
        volume = tet4.volumes(points[cells])
    else:
        volume = hexahedron.volumes(points[cells[:, AS_HEXAHEDRON[kind]]])
    turned = cells.copy()
    turned[volume < 0.0] = cells[volume < 0.0][:, _MIRRORED[kind]]
    return turned.astype(np.int32)


CORNERS_OF = {
    "hexahedron": list(range(8)),
    "wedge": [0, 1, 2, 4, 5, 6],
    "pyramid": [0, 1, 2, 3, 4],
    "tetra": [0, 1, 2, 3],
}  # of each kind, out of the eight of a padded cell


def cell_kinds(nodes: NDArray[np.integer]) -> NDArray[np.str_]:
    """Kind of each cell, shape (cell_count,), from its nodes, shape (cell_count, 8), -1 beyond a tetrahedron's four.

    A hexahedron that collapsed in another way than AS_HEXAHEDRON stays a hexahedron.
    """
    kinds = np.full(len(nodes), "hexahedron", dtype="<U10")
    different = 1 + (np.diff(np.sort(nodes, axis=1), axis=1) != 0).sum(axis=1)
    kinds[(nodes[:, 2] == nodes[:, 3]) & (nodes[:, 6] == nodes[:, 7]) & (different == 6)] = "wedge"
    kinds[(nodes[:, 4:] == nodes[:, 4:5]).all(axis=1) & (different == 5)] = "pyramid"
    kinds[nodes[:, 4] < 0] = "tetra"
    return kinds


def tetrahedral(mesh: Mesh) -> Mesh:
    """The mesh with its hexahedra, wedges and pyramids cut to tetrahedra; sets keep what they hold.

    Every quadrilateral is cut from its lowest-numbered corner, so that neighbours agree (Dompierre and others, Proc.
    8th International Meshing Roundtable, 1999).
    """
    if not len(mesh.hexahedra):
        return mesh
    apex = mesh.hexahedra.min(axis=1)
    faces = mesh.hexahedra[:, HEX_FACES]
    low = faces.argmin(axis=2)
    faces = np.take_along_axis(faces, (low[..., None] + np.arange(4)) % 4, axis=2)
    corners = np.stack([faces[..., [0, 1, 2]], faces[..., [0, 2, 3]]], axis=2).reshape(-1, 3)
    owner = np.repeat(np.arange(len(mesh.hexahedra)), 2 * len(HEX_FACES))
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
    none = np.zeros((0, 8), dtype=np.int32)
    tetrahedra = np.concatenate([cut, mesh.tetrahedra])[order].astype(np.int32)
    return Mesh(mesh.points, none, mesh.node_sets, cell_sets, tetrahedra)
