"""Owns what a stage of a time step is, and the order in which the stages of a step are launched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.solve.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.solve.state import State

MAIN, BESIDE, ASIDE, SUMS = "main", "beside", "aside", "sums"  # streams of a GPU; a CPU runs stages one by one


@dataclass(frozen=True)
class Step:
    """What a stage is launched for: one step of a state.

    Attributes:
        state: to advance.
        split: how a launch is cut in ranges, which threads of a CPU compute side by side.
        records: whether the step also records the state at its start.
        is_row: whether the record is a row of the history, and not a check between two.
        needs: of recorders, that a frame of this step must hold.
    """

    state: State
    split: Split = whole
    records: bool = False
    is_row: bool = False
    needs: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Stage:
    """Something that is launched in every step, or in those that record.

    Attributes:
        name: as docs/architecture.md lists it.
        launch: launches its kernels for a step.
        stream: MAIN; BESIDE or ASIDE others of its group; SUMS, which nothing waits for before the end of the step.
        only_records: whether it is launched only in steps that record.
    """

    name: str
    launch: Callable[[Step], None]
    stream: str = MAIN
    only_records: bool = False


Group = Sequence[Stage]


class Streams:
    """Launches groups of stages: those of a group may overlap on a GPU, one group follows the other."""

    def __init__(self, cuda: bool) -> None:
        """On the current device. Streams beside the main one have few threads and wait long for memory: they take what
        room there is first."""
        self.streams: dict[str, Any] = {BESIDE: None, ASIDE: None, SUMS: None}
        if cuda:
            self.streams = {name: wp.Stream(priority=-1) for name in self.streams}

    def run(self, groups: Sequence[Group], step: Step) -> None:
        """Launch the stages of a step in their order."""
        summing = False
        for group in groups:
            stages = [stage for stage in group if step.records or not stage.only_records]
            if stages:
                summing = summing or any(stage.stream == SUMS for stage in stages)
                self._run_group(stages, step)
        if summing and self.streams[SUMS]:
            wp.wait_stream(self.streams[SUMS])

    def _run_group(self, stages: Group, step: Step) -> None:
        used = {stage.stream for stage in stages if stage.stream != MAIN and self.streams[stage.stream]}
        before = wp.record_event() if used else None
        entered: set[str] = set()
        for stage in stages:
            if stage.stream not in used:
                stage.launch(step)
                continue
            with wp.ScopedStream(self.streams[stage.stream], sync_enter=False):
                if before and stage.stream not in entered:
                    wp.wait_event(before)
                    entered.add(stage.stream)
                stage.launch(step)
        for name in (BESIDE, ASIDE):
            if name in used:
                wp.wait_stream(self.streams[name])
