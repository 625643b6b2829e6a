"""Owns the table of modules with the integrals of each stored cell type: `determinants`, `volumes`, `gradients`."""

from __future__ import annotations

from collections.abc import Mapping
from types import ModuleType

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.chunks import CHUNK, chunks
from warp_mca.geometry import hexahedron, tetra10, tetrahedron
from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, TETRA10, TETRAHEDRON, linear_type

INTEGRALS = {HEXAHEDRON.name: hexahedron, TETRAHEDRON.name: tetrahedron, TETRA10.name: tetra10}


def integrals_of(name: str) -> tuple[ModuleType, int]:
    """Module for a stored type, and how many of its nodes that takes: the corners of types without integrals."""
    own = CELL_TYPES[name] if name in INTEGRALS else linear_type(name)
    return INTEGRALS[own.name], own.corners


def gauss_jacobians(points: Array, cells: Mapping[str, Index]) -> list[Array]:
    """Jacobian determinants times weights [m^3] of the cells of each stored type, shape (cell_count, point_count).

    Hexahedra have 2 x 2 x 2 Gauss points, tetrahedra one point, those of ten nodes four.

    Args:
        points: positions of the nodes [m], shape (node_count, 3), float64.
        cells: nodes of the cells of each type, as `Mesh.cells`.
    """
    found = []
    for name, nodes in cells.items():
        integrals, corners = integrals_of(name)
        conn = nodes[:, :corners]
        parts = [integrals.determinants(points[conn[part]]) for part in chunks(len(conn), CHUNK)]
        found.append(np.concatenate(parts) if parts else np.zeros((0, 1)))
    return found
