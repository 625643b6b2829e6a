"""Owns the element formulations. A new one is a file here, its kernels in `kernels/`, and an entry in the table."""

from __future__ import annotations

from warp_mca.physics.elements.element import Element
from warp_mca.physics.elements.hex8 import Hex8
from warp_mca.physics.elements.hex8i import Hex8i
from warp_mca.physics.elements.hex8r import Hex8r
from warp_mca.physics.elements.hex8w import Hex8w
from warp_mca.physics.elements.tet4 import Tet4
from warp_mca.scene.elements import ELEMENTS

ELEMENTS |= {
    element.name: element for element in (Hex8(), Hex8i(), Hex8r(), Hex8w("hex8w", 16), Hex8w("hex8w3", 24), Tet4())
}

__all__ = ["ELEMENTS", "Element", "default_element"]


def default_element(cell: str) -> Element:
    """The element that computes cells of a type where nothing else is asked for: the first in `ELEMENTS`."""
    return next(element for element in ELEMENTS.values() if element.cell == cell)
