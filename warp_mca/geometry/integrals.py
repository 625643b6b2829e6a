"""Owns the table of modules with the integrals of each stored cell type: `determinants`, `volumes`, `gradients`."""

from __future__ import annotations

from types import ModuleType

from warp_mca.geometry import hexahedron, tetra10, tetrahedron
from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON, TETRA10, TETRAHEDRON, linear_type

INTEGRALS = {HEXAHEDRON.name: hexahedron, TETRAHEDRON.name: tetrahedron, TETRA10.name: tetra10}


def integrals_of(name: str) -> tuple[ModuleType, int]:
    """Module for a stored type, and how many of its nodes that takes: the corners of types without integrals."""
    own = CELL_TYPES[name] if name in INTEGRALS else linear_type(name)
    return INTEGRALS[own.name], own.corners
