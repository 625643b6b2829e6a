"""Owns what makes a recipe's mesh finer or coarser with its grading: counts of cells times a factor, sizes over it."""

from __future__ import annotations

import math
from typing import Any

from warp_mca.base import validate
from warp_mca.base.errors import bad_value


def refined_count(count: int, factor: float, *, even: bool = False) -> int:
    """`count * factor` cells, rounded to the nearest count above 0, an even one if `even`; halves are rounded up."""
    step = 2 if even else 1
    wanted = min(count * factor / step, float(validate.MAX_COUNT))  # what is above is refused as any such count
    return step * max(1, math.floor(wanted + 0.5))


def refined(owner: str, geometry: Any, factor: float) -> Any:
    """The recipe of the mesh of its owner, as "body AB", whose cells are about `factor` times smaller everywhere.

    Raises:
        RequestError: the geometry is a finished mesh, or a recipe without a method `refined(factor)`.
    """
    if not hasattr(geometry, "refined"):
        what = type(geometry).__name__
        remedy = (
            f"{owner} is a {what}, whose cells cannot be made smaller or larger; give it a recipe such as "
            "warp_mca.Rod, or one of your own with a method refined(factor), or leave refine out"
        )
        raise bad_value("refine", factor, remedy)
    field = f"geometry of {owner}"
    made = validate.call(field, type(geometry).__name__, "refined()", lambda: geometry.refined(factor))
    if not hasattr(made, "build"):
        raise bad_value(f"{field}.refined()", validate.brief(made), "return a recipe")
    return made
