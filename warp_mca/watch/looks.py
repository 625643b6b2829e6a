"""Owns the looks at the shape of bodies in an impact phase: when they are due, and how shapes come to the host."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import warp as wp

from warp_mca.step.transfer import Transfer
from warp_mca.watch.bending import LOOKS

if TYPE_CHECKING:
    from warp_mca.phases.scene_run import SceneRun
    from warp_mca.step.solver import Solver
    from warp_mca.step.state import State


class Looks:
    """Looks of one call of `Impact.advance`; the device goes on meanwhile."""

    def __init__(self, solver: Solver, state: State, scene_runs: Sequence[SceneRun]) -> None:
        """Prepare the way of what is looked at."""
        self.state, self.scene_runs = state, scene_runs
        looked_at = any(item.samples for item in scene_runs)
        self._shape = Transfer({"u": state.u}, solver.device) if looked_at else None
        self._watch, self._watched, self._due = None, [], []
        watched = [(item, int(solver.layout.nodes[item.index])) for item in scene_runs if item.watch.cases]
        if not watched:
            return
        self._ends = np.cumsum([len(item.watch.nodes) for item, _ in watched])
        self._watched = [item for item, _ in watched]
        with wp.ScopedDevice(solver.device):
            nodes = wp.array(np.concatenate([item.watch.nodes + first for item, first in watched]), dtype=wp.int32)
            self._gathered: Any = wp.indexedarray(state.u, [nodes])
            self._skins = wp.zeros(len(nodes), dtype=wp.vec3d)
        springs = {str(stage.index): state.contacts[stage.index].spring.depth for stage in solver.contacts}
        sources = {"u": self._skins, "speed_square": state.speed_square} | springs
        self._watch = Transfer(sources, solver.device)

    def row(self, interval: int, intervals: int) -> None:
        """Look at the bending of bodies, once in a while, where this output interval begins."""
        if self._shape and interval and interval % max(1, intervals // LOOKS) == 0:
            self._see_shape()
            self._shape.send(0)

    def until(self, count: int, whole: int) -> int:
        """How many of the next `count` steps can be taken at once, of a part that has so many as a `whole`.

        Parts are cut only for looks that follow each other faster than parts do.
        """
        kept = [item.ledger.kept for item in self._watched]
        return min([count, *(k.due - self.state.steps for k in kept if k.wait < whole)])

    def watch(self, whole: int = 0, last: bool = False) -> None:
        """Look for bodies in each other if that is due; what the look before saw tells when the next one is.

        Args:
            whole: steps of the part that goes on; 0 between two.
            last: whether the phase is over, so that a look is due.
        """
        kept = [item.ledger.kept for item in self._watched]
        due = [k for k in kept if last or (k.due <= self.state.steps and not k.wait >= whole > 0)]
        if not due:
            return
        self._see_skins()
        assert self._watch
        wp.copy(self._skins, self._gathered)
        self._watch.send(self.state.steps)
        self._due = [item for item in self._watched if item.ledger.kept in due]
        if any(not k.apart for k in due):
            self._see_skins()  # the first look tells when the second is due
        for k in due:
            k.wait, k.due = k.apart, self.state.steps + k.apart

    def finish(self) -> None:
        """Take in what is on its way."""
        self._see_shape()
        self._see_skins()

    def _see_shape(self) -> None:
        while self._shape and self._shape.pending:
            _, shape = self._shape.receive()
            for item in self.scene_runs:
                item.ledger.kept.stiffened = item.bent(shape["u"])

    def _see_skins(self) -> None:
        while self._watch and self._watch.pending:
            steps, found = self._watch.receive()
            for item, u in zip(self._watched, np.split(found["u"], self._ends[:-1]), strict=True):
                if item in self._due:
                    item.look_for_passing(steps, u, found)
