"""Owns `Recipe`: what every geometry recipe must offer."""

from __future__ import annotations

from typing import Protocol

from warp_mca.geometry.mesh import Mesh


class Recipe(Protocol):
    """A frozen dataclass of plain numbers that can make its mesh; equal recipes make equal meshes."""

    def build(self) -> Mesh:
        """The mesh in the body's own frame."""
        ...
