"""Owns when a GPU may leave contact out of substeps: no face was near at the search before the last, nodes are slow.

Substeps of few elements wait for the two launches of contact even where nothing is near. What a search finds reaches
the host while the device takes the steps that follow, so that it decides on those after the next search, and the device
waits for nobody. Every run decides alike, and the same state comes of it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import warp as wp

from warp_mca.kernels.contact import watch
from warp_mca.solve.transfer import Transfer

if TYPE_CHECKING:
    from warp_mca.solve.solver import Solver
    from warp_mca.solve.state import State


class ContactWatch:
    """Searches of one state, in intervals that follow each other."""

    def __init__(self, solver: Solver, state: State) -> None:
        """Allocate on the solver's device; contacts are those of surfaces, of one scene."""
        self.solver, self.state, self.count = solver, state, 0
        with wp.ScopedDevice(solver.device):
            self.hint = wp.array([0] + [1] * (watch.HINTS - 1), dtype=wp.int32)
        self.transfer = Transfer({"hint": self.hint}, solver.device)

    def search(self) -> bool:
        """Search for contact; whether it must be computed until the next search."""
        near = True
        if self.transfer.pending:
            number, found = self.transfer.receive()
            near = bool(found["hint"][number % watch.HINTS])
        state = self.state
        with wp.ScopedDevice(self.solver.device):
            for stage in self.solver.contacts:
                own = state.contacts[stage.index]
                for nodes in (stage.slave, stage.master):
                    inputs = [self.count, state.u, own.u_search, nodes, stage.margin]
                    wp.launch(watch.watch_nodes, len(nodes), inputs=inputs, outputs=[self.hint, state.flag])
            self.solver.search(state)
            for stage in self.solver.contacts:
                own = state.contacts[stage.index]
                inputs = [self.count, own.count, own.spring]
                wp.launch(watch.watch_springs, len(own.count), inputs=inputs, outputs=[self.hint])
            self.transfer.send(self.count)
        self.count += 1
        return near


def contact_watch(solver: Solver, state: State) -> ContactWatch | None:
    """The watch over a state's searches, where a GPU takes substeps and all contacts are of surfaces."""
    if not solver.chains or not solver.contacts or any(stage.on_plane for stage in solver.contacts):
        return None
    return ContactWatch(solver, state)
