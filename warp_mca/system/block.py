"""Owns the blocks of a model: elements that run the same kernels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.kernels.elements.viscosity import HEATED, VISCOUS
from warp_mca.system.failing import Failing


@dataclass(frozen=True, kw_only=True)
class Block:
    """Elements that run the same kernels.

    Attributes:
        element: name of their formulation.
        law: module of the law by which they flow, as `Elastic.law`; empty where they keep no plastic history.
        finite: whether strains may be large.
        conn: nodes of each element, shape (corners, element_count), int32.
        material: row of `Model.law`, shape (element_count,), int32.
        first: index of the first element in the model.
        ends: where the elements of each scene of a batch end in the block; empty for one scene.
        part_ends: where elements end that have one level of `Model.rates` and one chain, the least level of their
            nodes: levels one after the other, in each of them chains; empty with one rate.
        viscosity: c1 rho c h [Pa s] and c2^2 rho h^2 [Pa s^2] of each, see `kernels.elements.viscosity`, shape (2,
            element_count), float64; None without bulk viscosity. Heated elements have it, of 0 if no other.
        thermal: number of each element's thermal strain among those of `Model.loads`, -1 without, and volume [m^3],
            shape (2, element_count), float64; None where no element has one.
        failing: how they fail, or None where they never do.
    """

    element: str
    law: str
    finite: bool
    conn: Index
    material: Index
    first: int
    ends: tuple[int, ...] = ()
    part_ends: tuple[int, ...] = ()
    viscosity: Array | None = None
    thermal: Array | None = None
    failing: Failing | None = None

    def part(self, element: NDArray[np.intp]) -> Block:
        """A block of some of the elements by themselves."""
        viscosity = None if self.viscosity is None else self.viscosity[:, element]
        thermal = None if self.thermal is None else self.thermal[:, element]
        conn, material = np.ascontiguousarray(self.conn[:, element]), self.material[element]
        more = {"viscosity": viscosity, "thermal": thermal}
        found = replace(self, conn=conn, material=material, **more, first=0, ends=(), part_ends=())
        return replace(found, failing=self.failing and self.failing.part(element))

    def without_viscosity(self) -> Block:
        """The block with coefficients of zero, if it has any: its kernels and its `kind` stay."""
        return self if self.viscosity is None else replace(self, viscosity=0.0 * self.viscosity)

    @property
    def viscous(self) -> bool:
        """Whether they have bulk viscosity."""
        return self.viscosity is not None

    @property
    def heated(self) -> bool:
        """Whether any of them has a thermal strain."""
        return self.thermal is not None

    @property
    def joining(self) -> int:
        """What joins their pressure, as `kernels.elements.viscosity` lists it; 0 for nothing."""
        return HEATED if self.heated else VISCOUS if self.viscous else 0

    @property
    def level_ends(self) -> tuple[int, ...]:
        """Where the elements of each level of `Model.rates` end in the block; empty with one rate."""
        levels = math.isqrt(len(self.part_ends))
        return self.part_ends[levels - 1 :: levels] if levels else ()

    @property
    def plastic(self) -> bool:
        """Whether they keep a plastic history."""
        return bool(self.law)

    @property
    def kind(self) -> tuple[bool, str, str, bool, int, str]:
        """Key of the block: (not plastic, law, element, finite, joining, criterion of failure). Blocks of a model are
        sorted by it."""
        failure = self.failing.law if self.failing else ""
        return not self.plastic, self.law, self.element, self.finite, self.joining, failure
