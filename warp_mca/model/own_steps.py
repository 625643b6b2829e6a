"""Owns the stable step that each element has by itself: bounds at first, exact where a bound is too far off to say."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.chunks import chunks
from warp_mca.model.stable_step import BATCH, KEY, Elements, step_of

if TYPE_CHECKING:
    from warp_mca.model.assembly import Assembly


ALIKE = 1e-6  # of its extent, within which elements are of one shape
MARGIN = 1e-3  # share by which elements of one shape may differ in their step, up to an aspect ratio of 1 / 1000
LOOSENESS = 1.25  # of a bound's step: an exact one is hardly ever greater


class OwnSteps:
    """Stable steps of single elements, contact springs included.

    Attributes:
        step: lower bound of each element's step, in the order of the concatenated meshes [s], shape (element_count,),
            float64.
    """

    def __init__(self, parts: Assembly, added: Array, share: float = 1.0) -> None:
        """Bounds of all elements; `added` is what contact springs add to the eigenvalue at each node [1/s^2].

        `share` is what dashpots leave of the steps [-].
        """
        self.share = share
        self.step = parts.element_steps(added)
        self._exact = np.zeros(len(self.step), dtype=bool)
        self._parts = list(parts.computed(added))

    def levels(self, base: float, highest: int) -> NDArray[np.int64]:
        """Level of each element: the greatest k <= highest with 2^k base <= its step, shape (element_count,).

        Args:
            base: time step of level 0 [s]; elements whose bound is shorter are on level 0.
            highest: level.
        """
        base = base / self.share
        likely = self._levels(LOOSENESS * self.step, base, highest)
        self._find_exact((likely > self._levels(self.step, base, highest)) & ~self._exact)
        return self._levels(self.step, base, highest)

    def _levels(self, step: Array, base: float, highest: int) -> NDArray[np.int64]:
        return np.clip(np.floor(np.log2(step / base)), 0, highest).astype(np.int64)

    def _find_exact(self, wanted: NDArray[np.bool_]) -> None:
        """Replace bounds of the `wanted` elements by exact steps; those of one shape have one of them."""
        for part in self._parts:
            mine = np.flatnonzero(wanted[part.index])
            first, lot = _shapes(part, mine)
            step = np.empty(len(first))
            for some in chunks(len(first), BATCH):
                k = mine[first[some]]
                step[some] = step_of(part.exact(k), part.contact[k])
            chosen = part.index[mine]
            self.step[chosen] = np.maximum(self.step[chosen], (1.0 - MARGIN) * step[lot])
        self._exact |= wanted


def _shapes(part: Elements, chosen: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First of the chosen elements of each shape, and the number of each one's shape: same size, moduli, springs."""
    if not len(chosen):
        return chosen, chosen
    corners = part.X[part.conn[chosen]]
    edges = (corners[:, 1:] - corners[:, :1]).reshape(len(chosen), -1)
    size = np.abs(edges).max(axis=1)
    values = (size, part.K[chosen], part.G[chosen], 1.0 + part.contact[chosen], part.mass[chosen].sum(axis=1))
    rows = np.column_stack([edges / size[:, None], *(np.log(value) for value in values)])
    digits = np.rint(rows / ALIKE).astype(np.int64)
    weight = np.resize(KEY, digits.shape[1]) * (1 + 2 * (np.arange(digits.shape[1]) // len(KEY)))
    _, first, lot = np.unique((digits * weight).sum(axis=1), return_index=True, return_inverse=True)
    odd = np.flatnonzero((digits != digits[first[lot]]).any(axis=1))  # they agree in the key alone
    lot[odd] = len(first) + np.arange(len(odd))
    return np.append(first, odd), lot
