"""Owns the graphs of a solver: what it launches for a state is captured at its first use, and replayed from then on."""

from __future__ import annotations

import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.step.early_launch import launch_early, launch_together
from warp_mca.system.threads import Pool, Program, Split

if TYPE_CHECKING:
    from warp_mca.system.state import State

MOST = 2000  # steps in one graph
FEW = 12  # where a GPU waits for it to be captured, or where few rows are alike


class Replay:
    """Graphs by state and name; those of a state go with it.

    Attributes:
        pool: threads of a CPU, or None on a GPU.
    """

    def __init__(self, device: str, threads: int) -> None:
        self.device, self.threads = device, threads
        self.pool = None if wp.get_device(device).is_cuda else Pool(threads)
        self._graphs: weakref.WeakKeyDictionary[State, dict[str, Any]] = weakref.WeakKeyDictionary()
        self._ahead: weakref.WeakSet[State] = weakref.WeakSet()

    def note_ahead(self, state: State) -> None:
        """Say that a GPU has work for longer than a graph of a whole row takes to be captured."""
        self._ahead.add(state)

    def most(self, state: State, count: int, substeps: int, needs: frozenset[str] = frozenset()) -> int:
        """How many of the `count` steps that follow, of so many substeps each, one graph may hold.

        Few at first, so that a GPU begins at once, and after a frame of `needs`.
        """
        if count * substeps <= 2 * FEW or not wp.get_device(self.device).is_cuda:
            return MOST
        return MOST if state in self._ahead and not needs else max(1, FEW // substeps)

    def forget(self, state: State) -> None:
        """Capture anew what is launched for a state."""
        self._graphs.pop(state, None)

    def graph(self, state: State, name: str, body: Callable[[], None]) -> None:
        """Replay the graph `name` of a state, captured from `body` at its first use."""
        with wp.ScopedDevice(self.device):
            graphs = self._graphs.setdefault(state, {})
            if name not in graphs:
                with wp.ScopedCapture() as capture:
                    body()
                launch_early(capture.graph)
                launch_together(capture.graph)
                graphs[name] = capture.graph
            wp.capture_launch(graphs[name])

    def program(self, state: State, name: str, body: Callable[[Split], None], count: int = 1) -> None:
        """Compute the program `name`, captured from `body` at its first use, `count` times with all threads of `pool`.

        Raises:
            RuntimeError: as in `Pool.run`.
        """
        assert self.pool is not None
        programs = self._graphs.setdefault(state, {})
        if name not in programs:
            with wp.ScopedDevice(self.device):
                programs[name] = Program(self.threads, body)
        if count:
            self.pool.run(programs[name], count)
