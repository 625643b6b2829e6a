"""Owns the element formulations. A new one is a file here, its kernels in `kernels/`, and a line in the table below."""

from __future__ import annotations

from warp_mca.physics.elements.element import Element
from warp_mca.physics.elements.hex8 import Hex8
from warp_mca.physics.elements.hex8r import Hex8r
from warp_mca.physics.elements.tet4 import Tet4

# The first element of a cell type computes the cells of that type in bodies whose own element takes another type.
ELEMENTS: dict[str, Element] = {element.name: element for element in (Hex8(), Hex8r(), Tet4())}

__all__ = ["ELEMENTS", "Element", "default_element"]


def default_element(cell: str) -> Element:
    """The element that computes cells of a type where nothing else is asked for: the first in `ELEMENTS`."""
    return next(element for element in ELEMENTS.values() if element.cell == cell)
