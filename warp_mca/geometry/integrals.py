"""Owns the table of modules with the integrals of each stored cell type: `determinants`, `volumes`, `gradients`."""

from __future__ import annotations

from warp_mca.geometry import hexahedron, tetrahedron
from warp_mca.geometry.cell_types import HEXAHEDRON, TETRAHEDRON

INTEGRALS = {HEXAHEDRON.name: hexahedron, TETRAHEDRON.name: tetrahedron}
