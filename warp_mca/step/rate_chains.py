"""Owns how a GPU takes the substeps of `warp_mca.model.rates`: nodes of each level are a chain of launches of its own.

A chain computes the elements whose least node it has, then moves its nodes; that of level k does so once in 2^k
substeps. It waits for others only where elements of one touch nodes of another, so that slow elements, which are most
of them, are computed beside several substeps of the fast ones, which alone would leave most of a GPU at rest.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import warp as wp

from warp_mca.step.step_groups import chain_groups
from warp_mca.system.stage import Group, Step, Streams

if TYPE_CHECKING:
    from warp_mca.step.solver import Solver


@dataclass(frozen=True)
class Task:
    """Forces of one chain, or the motion of its nodes, in one substep.

    Attributes:
        chain: level of its nodes.
        level: up to which elements are computed in the substep.
        moves: whether nodes move.
        after: numbers of the tasks that it waits for, each of another chain or the one before it in its own.
    """

    chain: int
    level: int
    moves: bool
    after: tuple[int, ...]


def tasks(top: int, first: int, end: int) -> Iterator[Task]:
    """Tasks of the substeps from `first` to `end`, all before which has been done; 2^top substeps are a step.

    Elements of a chain reach up to the level of the substep: they wait until nodes of all these levels have moved,
    which also have read what they now overwrite. Nodes of a level wait for elements of their chain and of faster ones,
    which also have read where they were.
    """
    moved: dict[int, int] = {}
    number = 0
    for j in range(first, end):
        level = min((j & -j).bit_length() - 1, top) if j else top
        forced = []
        for chain in range(level + 1):
            yield Task(chain, level, False, tuple(moved[m] for m in range(chain, level + 1) if m in moved))
            forced.append(number)
            number += 1
        for chain in range(level + 1):
            yield Task(chain, level, True, tuple(forced[: chain + 1]))
            moved[chain] = number
            number += 1


class Chains:
    """Launches substeps chain by chain, in streams of a GPU that wait for each other; one by one on a CPU.

    Attributes:
        top: highest level.
        substeps: of a step.
        groups: stages of each kind of task, by chain, level and whether nodes move.
    """

    def __init__(self, solver: Solver) -> None:
        """On the current device."""
        assert solver.model.rates
        self.top, self.substeps = solver.model.rates.top, solver.model.rates.substeps
        self.groups: dict[tuple[int, int, bool], list[Group]] = {}
        for level in range(self.top + 1):
            for chain in range(level + 1):
                forces, motion = chain_groups(solver.actors, solver.model, level, chain)
                self.groups[chain, level, False], self.groups[chain, level, True] = forces, motion
        cuda = wp.get_device().is_cuda
        self._launcher = Streams(cuda)
        self._streams = [wp.Stream() for _ in range(self.top + 1)] if cuda else []

    def run(self, step: Step, first: int, end: int) -> None:
        """Launch the substeps from `first` to `end` of steps in a row; they record nothing."""
        if not self._streams:
            for task in tasks(self.top, first, end):
                self.launch(task, step)
            return
        begin, ends = wp.record_event(), []
        for stream in self._streams:
            stream.wait_event(begin)
        found = list(tasks(self.top, first, end))
        for task in found:
            with wp.ScopedStream(self._streams[task.chain], sync_enter=False):
                for number in task.after:
                    if found[number].chain != task.chain:
                        wp.wait_event(ends[number])
                self.launch(task, step)
                ends.append(wp.record_event())
        for stream in self._streams:
            wp.wait_stream(stream)

    def launch(self, task: Task, step: Step) -> None:
        """Launch one task."""
        self._launcher.run(self.groups[task.chain, task.level, task.moves], step)
