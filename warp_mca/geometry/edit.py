"""Owns changes to finished meshes: mirroring, dropping unused nodes, moving single nodes to exact places."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from warp_mca.base.errors import bad_value
from warp_mca.geometry.cell_types import HEXAHEDRON, TETRAHEDRON
from warp_mca.geometry.mesh import Mesh

_ROUNDING = 1e-7  # share of the mesh's extent within which places count as equal: gmsh divides arcs to about 1e-9


def mirror(mesh: Mesh, axis: int) -> Mesh:
    """The mesh and its reflection, joined at the plane where coordinate `axis` is 0.

    Args:
        mesh: hexahedra on one side of the plane; what touches it within gmsh's rounding is put exactly on it.
        axis: 0, 1 or 2.
    """
    points = snapped(mesh.points, axis, 0.0)
    image = np.arange(len(points), dtype=np.int32)
    off = np.flatnonzero(points[:, axis] != 0.0)
    image[off] = len(points) + np.arange(len(off), dtype=np.int32)
    reflected = points[off].copy()
    reflected[:, axis] *= -1.0

    node_sets = {name: np.unique(np.append(nodes, image[nodes])) for name, nodes in mesh.node_sets.items()}
    cell_sets = {name: np.append(cells, cells + len(mesh.hexahedra)) for name, cells in mesh.cell_sets.items()}
    return Mesh(
        np.concatenate([points, reflected]),
        np.concatenate([mesh.hexahedra, image[mesh.hexahedra][:, list(HEXAHEDRON.mirrored)]]),
        node_sets,
        {name: cells.astype(np.int32) for name, cells in cell_sets.items()},
    )


def halved(mesh: Mesh, axis: int) -> Mesh:
    """The half of the mesh on the positive side of the plane where coordinate `axis` is 0, which no cell crosses."""
    points = snapped(mesh.points, axis, 0.0)
    keep = points[mesh.hexahedra].mean(axis=1)[:, axis] > 0.0
    index = np.cumsum(keep) - 1
    cell_sets = {name: index[cells[keep[cells]]].astype(np.int32) for name, cells in mesh.cell_sets.items()}
    return compact(Mesh(points, mesh.hexahedra[keep], mesh.node_sets, cell_sets))


def snapped(points: np.ndarray, axis: int, value: float) -> np.ndarray:
    """Copy of `points` (count, 3) whose coordinates `axis` within gmsh's rounding of `value` [m] equal it exactly."""
    points = points.copy()
    tolerance = _ROUNDING * np.ptp(points, axis=0).max()
    points[np.abs(points[:, axis] - value) < tolerance, axis] = value
    return points


def pinned(points: np.ndarray, place: ArrayLike) -> np.ndarray:
    """Copy of `points` (count, 3) whose node within gmsh's rounding of `place` [m] lies exactly there.

    Raises:
        RequestError: no node lies there.
    """
    points = points.copy()
    distance = np.linalg.norm(points - np.asarray(place, dtype=np.float64), axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] > _ROUNDING * np.ptp(points, axis=0).max():
        raise bad_value("place", np.asarray(place).tolist(), "no node of the mesh lies there; use even divisions")
    points[nearest] = place
    return points


def only_cells(mesh: Mesh, name: str) -> Mesh:
    """The part of a mesh that a cell set is, with what its sets have there.

    Raises:
        RequestError: there is no such set, or no cell in it.
    """
    if not len(mesh.cell_sets.get(name, ())):
        raise bad_value("cell set", name, f"the mesh has {', '.join(sorted(mesh.cell_sets)) or 'no cell sets'}")
    keep = np.zeros(mesh.cell_count, dtype=bool)
    keep[mesh.cell_sets[name]] = True
    index = np.cumsum(keep) - 1
    kept, start = {}, 0
    for kind, cells in mesh.cells.items():
        kept[kind] = cells[keep[start : start + len(cells)]]
        start += len(cells)
    sets = {key: index[cells[keep[cells]]].astype(np.int32) for key, cells in mesh.cell_sets.items()}
    return compact(
        replace(
            mesh,
            hexahedra=kept.pop(HEXAHEDRON.name),
            tetrahedra=kept.pop(TETRAHEDRON.name),
            others={kind: cells for kind, cells in kept.items() if len(cells)},
            cell_sets={key: cells for key, cells in sets.items() if len(cells)},
        )
    )


def compact(mesh: Mesh) -> Mesh:
    """The mesh without the nodes that no element uses; sets keep the nodes that are left."""
    used = np.unique(np.concatenate([cells.ravel() for cells in mesh.cells.values()]))
    if len(used) == len(mesh.points):
        return mesh
    index = np.full(len(mesh.points), -1, dtype=np.int32)
    index[used] = np.arange(len(used), dtype=np.int32)
    node_sets = {name: index[nodes][index[nodes] >= 0] for name, nodes in mesh.node_sets.items()}
    return replace(
        mesh,
        points=mesh.points[used],
        hexahedra=index[mesh.hexahedra],
        node_sets=node_sets,
        tetrahedra=index[mesh.tetrahedra],
        others={name: index[cells] for name, cells in mesh.others.items()},
    )
