"""Owns the element formulations. A new one is a file here, its kernels in `kernels/`, and a line in the table below."""

from __future__ import annotations

from warp_mca.elements.element import Element
from warp_mca.elements.hex8 import Hex8
from warp_mca.elements.hex8r import Hex8r
from warp_mca.elements.tet4 import Tet4

ELEMENTS: dict[str, Element] = {element.name: element for element in (Hex8(), Hex8r(), Tet4())}

__all__ = ["ELEMENTS", "Element"]
