"""Owns `Recipe`: what every geometry recipe must offer, and the most elements that one may ask for."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Protocol

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.geometry.mesh import Mesh

LIMIT = 200_000_000  # elements; more exceed the memory of any machine


class Recipe(Protocol):
    """A frozen dataclass of plain numbers that can make its mesh; equal recipes make equal meshes.

    For `refine` it also has a method `refined(factor)`: the recipe of a mesh whose cells are `factor` times smaller
    everywhere. It may have an attribute `volume`, that of its shape [m^3], which a mesh of flat cells falls short of:
    `Body.exact_mass` gives the body the mass of that.
    """

    def build(self) -> Mesh:
        """The mesh in the body's own frame."""
        ...


def check_size(owner: str, divisions: Iterable[tuple[int, int, int]], /, **counts: int | tuple[int, ...]) -> None:
    """Refuses blocks of more than LIMIT elements before memory is taken for them, by the largest of the counts.

    Args:
        owner: the recipe, for the message.
        divisions: number of cells of each block along its edges.
        counts: the recipe's values that they follow from.
    """
    if sum(math.prod(map(int, block)) for block in divisions) > LIMIT:
        name = max(counts, key=lambda name: np.max(counts[name]))
        raise bad_value(f"{owner}.{name}", counts[name], f"more than {LIMIT:,} elements would result; lower it")
