"""Owns how the tetrahedra in gmsh's model of a CAD file are mended and become a `Mesh`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.cad_drawing import entity_name
from warp_mca.geometry.cell_types import GMSH_ORDER, TETRA10, TETRAHEDRON
from warp_mca.geometry.degenerate import stored
from warp_mca.geometry.edit import compact
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quadratic import straightened
from warp_mca.geometry.quality import volumes
from warp_mca.geometry.shape_volume import with_ratios

# Quality of a tetrahedron (three times the radius of its inscribed ball over that of its circumscribed one) below which
# it is a sliver [-]: HXT left one in a plate whose others have 0.3 and more, for which the stable step was 14 times
# shorter. Netgen's optimizer, which takes twice the time of HXT, gave that plate the step of the others.
_SLIVER = 0.1


def mend_slivers(mesh: Any) -> None:
    """Change cells in gmsh's mesh of linear tetrahedra if some are slivers; nodes on its faces stay."""
    tags = mesh.getElementsByType(TETRAHEDRON.gmsh)[0]
    if len(tags) and np.min(mesh.getElementQualities(tags, "gamma")) < _SLIVER:
        mesh.optimize("Netgen")


def read_cells(model: Any, scale: float, exact: NDArray, names: Mapping[int, str]) -> Mesh:
    """The mesh of gmsh's model, with sets of faces and of solids; nodes that no tetrahedron uses are left out.

    Args:
        model: gmsh's, whose solids are meshed by tetrahedra of ten nodes.
        scale: metres for one unit of it.
        exact: volumes of its solids [m^3], shape (solid_count,) or (0,).
        names: of solids by tag; others have the name in the file, or "solid_1", ....
    """
    solids = [tag for _, tag in model.getEntities(3)]
    blocks = [model.mesh.getElementsByType(TETRA10.gmsh, tag)[1].reshape(-1, TETRA10.corners) for tag in solids]
    tags, coordinates, _ = model.mesh.getNodes()
    order = np.argsort(tags)
    tags, points = tags[order], scale * coordinates.reshape(-1, 3)[order]
    node_sets: dict[str, np.ndarray] = {}
    for k, (_, tag) in enumerate(model.getEntities(2)):
        nodes = np.searchsorted(tags, model.mesh.getNodes(2, tag, includeBoundary=True)[0])
        name = entity_name(model, 2, tag) or f"face_{k + 1}"  # several faces may have one name
        node_sets[name] = np.union1d(node_sets.get(name, np.zeros(0)), nodes).astype(np.int32)
    cell_sets: dict[str, np.ndarray] = {}
    first = 0
    for k, (tag, block) in enumerate(zip(solids, blocks, strict=True)):
        name = names.get(tag) or entity_name(model, 3, tag) or f"solid_{k + 1}"
        more = np.arange(first, first + len(block))
        cell_sets[name] = np.append(cell_sets.get(name, np.zeros(0)), more).astype(np.int32)
        first += len(block)
    cells = np.searchsorted(tags, np.concatenate(blocks)[:, list(GMSH_ORDER)]).astype(np.int32)
    cells = stored(points, cells, TETRA10.name)
    points = straightened(points, cells)
    mesh = compact(Mesh(points, np.zeros((0, 8), np.int32), node_sets, cell_sets, others={TETRA10.name: cells}))
    if not len(exact):
        return mesh
    counts = list(map(len, blocks))
    own = np.add.reduceat(volumes(mesh), np.cumsum([0, *counts[:-1]]))
    return with_ratios(mesh, np.repeat(exact / own, counts))
