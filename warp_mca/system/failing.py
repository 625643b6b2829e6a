"""Owns which elements of a model may fail, and the parameters of their criteria."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base import validate
from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.scene.failure import Failure
from warp_mca.scene.materials import Material


@dataclass(frozen=True)
class Failing:
    """How the elements of a block fail.

    Attributes:
        law: module of their criterion, as `Failure.law`.
        parameter: factor on strains at failure [-], then the parameters of the criterion, of each element, shape
            (1 + parameter_count, element_count), float64.
    """

    law: str
    parameter: Array

    def part(self, element: NDArray[np.intp]) -> Failing:
        """Of some of the elements."""
        return replace(self, parameter=self.parameter[:, element])


def criterion_of(material: Material) -> str:
    """Module of the criterion of a material, or "" for none."""
    return material.failure.law if material.failure else ""


def failing_of(law: str, materials: Sequence[Material], material: Index, volume: Array) -> Failing | None:
    """Of elements with the criterion in the module `law`; None without.

    Args:
        law: as `criterion_of`.
        materials: of the scene.
        material: of each element among them, shape (element_count,), int32.
        volume: of each element [m^3], shape (element_count,), float64.

    Raises:
        RequestError: parameters are not finite numbers.
    """
    if not law:
        return None
    rows = []
    for item in materials:
        found = item.failure.parameters if item.failure and item.failure.law == law else ()
        if not all(validate.is_number(entry) for entry in found):
            raise bad_value(f"{type(item.failure).__name__}.parameters", found, "give a tuple of finite numbers")
        rows.append(found)
    width = max(map(len, rows))
    table = np.array([(*row, *[0.0] * (width - len(row))) for row in rows])
    scale, length = np.ones(len(volume)), np.cbrt(volume)
    for k, item in enumerate(materials):
        mine = material == k
        if item.failure and mine.any():
            scale[mine] = _scale(item.failure, length[mine])
    return Failing(law, np.vstack([scale, table[material].T]))


def _scale(failure: Failure, length: Array) -> Array:
    """Factors on strains at failure in cells of these lengths [m], shape (cell_count,), float64.

    Raises:
        RequestError: they are none.
    """
    kind = type(failure).__name__
    found = np.asarray(validate.call(f"{kind}.law", failure.law, "scale()", failure.scale, length), dtype=np.float64)
    if found.shape != length.shape or not (np.isfinite(found) & (found > 0.0)).all():
        raise bad_value(f"{kind}.scale()", validate.brief(found), "give a number above 0 for each cell")
    return found


def joined(parts: Sequence[Failing | None]) -> Failing | None:
    """Of the elements of several blocks of one kind, one after the other."""
    some = [part for part in parts if part is not None]
    return replace(some[0], parameter=np.concatenate([part.parameter for part in some], axis=1)) if some else None
