"""Owns the arrays of absorbing boundaries."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, joinable, of


@joinable
@dataclass(frozen=True, kw_only=True)
class AbsorbingNodes:
    """Nodes of absorbing boundaries; none where a scene has none.

    Attributes:
        ENERGIES: entries of the energy ledger that their columns add to.
        node: sorted, shape (count,), int32.
        damping: matrix C of each node's dashpots [N s/m], symmetric, 0 for axes at rest, shape (count, 3, 3), float64.
        stiffness: matrix S of each node's springs [N/m], symmetric, 0 for axes at rest, shape (count, 3, 3), float64.
        velocity: of the body that each belongs to, relative to which they absorb [m/s], shape (count, 3), float64.
    """

    ENERGIES: ClassVar[tuple[str, ...]] = ("absorbed", "external_work")

    node: Index = field(metadata=of("nodes"))
    damping: Array = field(metadata=AS_IS)
    stiffness: Array = field(metadata=AS_IS)
    velocity: Array = field(metadata=AS_IS)

    @property
    def sprung(self) -> bool:
        """Whether there are springs."""
        return bool(self.stiffness.any())

    def eigenvalues(self, mass: Array) -> Array:
        """What the springs add at each node to the eigenvalue that bounds the stable step [1/s^2], shape (count,)."""
        return np.linalg.eigvalsh(self.stiffness)[:, -1] / mass[self.node]
