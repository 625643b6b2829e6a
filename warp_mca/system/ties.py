"""Owns the arrays of nodes tied to faces; `physics/ties/nodes.py` makes them and has the equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.joining import AS_IS, joinable, of


@joinable
@dataclass(frozen=True, kw_only=True)
class TiedNodes:
    """Slave nodes and the corners of the faces that carry them.

    Attributes:
        slave: shape (slave_count,), int32.
        master: corners of the face of each, shape (slave_count, 4), int32; a triangle has its last corner twice.
        weight: shape functions of these corners at the slave [-], shape (slave_count, 4), float64; their sum is 1.
        facts: of each tie, for the summary.
    """

    slave: Index = field(metadata=of("nodes"))
    master: Index = field(metadata=of("nodes"))
    weight: Array = field(metadata=AS_IS)
    facts: tuple[Mapping[str, object], ...] = field(default=(), metadata=AS_IS)

    def __len__(self) -> int:
        return len(self.slave)

    @property
    def carriers(self) -> Index:
        """Nodes that carry slaves, each once."""
        return np.unique(self.master[self.weight != 0.0])

    def place(self, field: Array) -> Array:
        """A field's value at the slaves by the shape functions, shape (slave_count, 3), of (node_count, 3)."""
        return np.einsum("sk,ski->si", self.weight, field[self.master])

    def follow(self, field: Array) -> Array:
        """A copy of a field, shape (node_count, 3), whose slaves have the value at their place."""
        found = field.copy()
        found[self.slave] = self.place(field)
        return found

    def carried(self, value: Array) -> Array:
        """What nodes have, shape (node_count, ...), with that of the slaves given to the masters."""
        if not len(self):
            return value
        found, own = value.copy(), value[self.slave]
        for k in range(4):
            share = self.weight[:, k].reshape(-1, *[1] * (own.ndim - 1))
            np.add.at(found, self.master[:, k], share * own)
        found[self.slave] = 0.0
        return found

    def relief(self, mass: Array) -> Array | None:
        """Divisor of each node's mass in the elements' eigenvalues [-], shape (node_count,); None where it is 1.

        For N >= 0 the bound by elements holds as it is: (sum_k N_k v_k)^2 <= sum_k N_k v_k^2, so that
        v^T T^T K T v <= max_e(lambda_e) (T v)^T m (T v) <= max_e(lambda_e) v^T M v. Where slaves lie beyond an edge and
        some N are negative, (sum_k N_k v_k)^2 <= S sum_k |N_k| v_k^2 with S = sum_k |N_k|: the share of M_k that the
        bound may count on shrinks by m_k + sum_s S_s |N_sk| m_s over M_k.
        """
        if not len(self) or self.weight.min() >= 0.0:
            return None
        size = np.abs(self.weight)
        total = self.carried(mass)
        counted = mass.copy()
        for k in range(4):
            np.add.at(counted, self.master[:, k], size[:, k] * size.sum(axis=1) * mass[self.slave])
        found = np.ones(len(mass))
        found[self.carriers] = np.maximum(1.0, (counted / np.where(total > 0.0, total, 1.0))[self.carriers])
        found[self.slave] = np.where(self.weight != 0.0, found[self.master], 1.0).max(axis=1)
        return found

    def shared(self, added: Array, mass: Array) -> Array:
        """What contact springs add to the eigenvalue at each node [1/s^2], those on slaves given to the masters.

        A spring k on a slave is k (sum_k N_k v_k)^2 <= S k sum_k |N_k| v_k^2, against the masters' mass, which is
        larger than the slave's own. Slaves have the greatest value of their masters, whose mass they are a part of.
        """
        if not len(self):
            return added
        size, stiffness, found = np.abs(self.weight), added * mass, added.copy()
        total = stiffness.copy()
        for k in range(4):
            np.add.at(total, self.master[:, k], size[:, k] * size.sum(axis=1) * stiffness[self.slave])
        carriers = self.carriers
        found[carriers] = total[carriers] / self.carried(mass)[carriers]
        found[self.slave] = np.where(self.weight != 0.0, found[self.master], 0.0).max(axis=1)
        return found

    def title(self, which: NDArray[np.bool_]) -> str:
        """The tie that has the first of `which` slaves, for errors; shape (slave_count,)."""
        ends = np.cumsum([fact["nodes"] for fact in self.facts])  # pyright: ignore
        fact = self.facts[int(np.searchsorted(ends, int(which.argmax()), side="right"))]
        return f"Tie {fact['slave']}–{fact['master']}"
