"""Owns the element formulations. A new one is a file here, its kernels in `kernels/`, and an entry in the table."""

from __future__ import annotations

from warp_mca.geometry.cell_types import CELL_TYPES, HEXAHEDRON
from warp_mca.physics.elements.element import Element
from warp_mca.physics.elements.hex8 import Hex8
from warp_mca.physics.elements.hex8i import Hex8i
from warp_mca.physics.elements.hex8r import Hex8r
from warp_mca.physics.elements.hex8w import Hex8w
from warp_mca.physics.elements.tet4 import Tet4
from warp_mca.physics.elements.tet10 import Tet10
from warp_mca.physics.elements.wedge6 import Wedge6
from warp_mca.scene.elements import ELEMENTS

_HEXAHEDRA = (Hex8i(), Hex8(), Hex8r(), Hex8w("hex8w", 16), Hex8w("hex8w3", 24))
_ALL = (*_HEXAHEDRA, Tet4(), Tet10(), Tet10(mean=True), Wedge6())
ELEMENTS |= {element.name: element for element in _ALL}

__all__ = ["ELEMENTS", "Element", "default_element", "of_hexahedra"]


def default_element(cell: str) -> Element:
    """The element that computes cells of a type where nothing else is asked for: the first in `ELEMENTS`."""
    return next(element for element in ELEMENTS.values() if element.cell == cell)


def of_hexahedra() -> list[str]:
    """Names of the elements that compute any mesh of hexahedra, cut to their own cells if need be."""
    cells = {name: CELL_TYPES[element.cell] for name, element in ELEMENTS.items()}
    return [name for name, cell in cells.items() if HEXAHEDRON.name in (cell.name, *cell.cut_from)]
