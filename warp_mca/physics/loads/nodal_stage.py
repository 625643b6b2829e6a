"""Owns the device side of loads on nodes: forces that they add to those of a step, and sums of their energies."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warp_mca.base.arrays import Array
from warp_mca.base.joining import offsets
from warp_mca.kernels.records.entries import list_entries, sum_entries
from warp_mca.system.actor import Actor, When
from warp_mca.system.columns import added_columns
from warp_mca.system.stage import BEYOND, Stage, Step

if TYPE_CHECKING:
    from warp_mca.system.actor import System
    from warp_mca.system.state import State


class NodalLoad(Actor):
    """All loads of one kind. A subclass computes forces in `push`; its part of the State is `State.parts[name]`.

    Attributes:
        name: of the kind.
        items: the loads, those of each scene in turn.
        column: of a record, the first that they add.
        count: numbers that hold the energies of all.
        place, stream: of the stage of its forces: by default in the stream of contact, which adds to the same ones.
    """

    place: ClassVar[str] = "forces"
    stream: ClassVar[str] = BEYOND

    def __init__(self, solver: System, name: str) -> None:
        """Allocate on the current device."""
        self.solver, self.name, self.work = solver, name, solver.work
        self.items: Sequence[Any] = solver.model.loads[name]
        self.column = added_columns(solver.model)[name].first
        counts = self.counts()
        self.count, self.most = int(counts.sum()), int(counts.max())
        self.first = wp.array(offsets(counts.tolist()), dtype=wp.int32)
        own = np.bincount([item.scene for item in self.items], minlength=solver.layout.count)
        self.first_item, self.most_items = wp.array(offsets(own.tolist()), dtype=wp.int32), int(own.max())

    def entries(self, item: Any) -> int:
        """How many numbers hold the energies of a load."""
        return len(item.node)

    def counts(self) -> NDArray[np.int32]:
        """How many numbers hold the energies of the loads of each scene, shape (scene_count,), int32."""
        counts = np.zeros(self.solver.layout.count, dtype=np.int32)
        np.add.at(counts, [item.scene for item in self.items], [self.entries(item) for item in self.items])
        return counts

    def push(self, step: Step, start: bool = False) -> None:
        """Add forces [N] at u(n), v(n-1/2) to `work.nodal_force`, and count energies up to t(n).

        `start`: at t = 0, for the half step before it; the State stays as it is.
        """
        raise NotImplementedError

    def energies_of(self, state: State) -> Sequence[wp.array]:
        """Of each of `Load.energies` at t(n) [J], shape (count,), float64: `entries` of each load in turn."""
        raise NotImplementedError

    def readings_of(self, state: State) -> Sequence[wp.array]:
        """Of each of `Load.readings` at t(n), an entry for each load, shape (len(items),), float64."""
        return []

    def settle(self, on: bool) -> float:
        """A phase before the impact begins to let bodies settle, or has done so; how long preloads take to come [s]."""
        return 0.0

    def feel(self, state: State, ahead: State, way: Array) -> None:
        """Count the energy over a way [m] of each node, shape (node_count, 3), that a change of velocities hid.

        The next step counts what nodes moved by the new velocities, though the old ones had moved them: by the mean of
        the forces of the latest step, in `state`, and of the next one, in `ahead`.
        """

    def record_kernels(self) -> list[Any]:
        """That of the sums, and of what is read off each load."""
        return [sum_entries]

    def start_forces(self, state: State) -> None:
        """Forces that act at t = 0 already."""
        self.push(Step(state), start=True)

    def stages(self, when: When) -> Iterable[Stage]:
        """Forces; energies of each scene."""
        if when.common:
            yield Stage(self.place, f"loads: {self.name}", self.push, self.stream)
        yield Stage("works", f"energies: {self.name}", self._sum, only_records=True)

    def _sum(self, step: Step) -> None:
        for k, entry in enumerate(self.energies_of(step.state)):
            self.solver.records.sum_runs(sum_entries, self.most, [self.column + k, self.first, entry])
        column = self.column + len(self.energies_of(step.state))
        for entry in self.readings_of(step.state):
            inputs = [self.work.row, column, self.first_item, entry]
            wp.launch(list_entries, len(entry), inputs=inputs, outputs=[self.work.partial])
            column += self.most_items
