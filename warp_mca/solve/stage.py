"""Owns what a stage of a time step is, and the order in which the stages of a step are launched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import warp as wp

from warp_mca.solve.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.solve.state import State

# streams of a GPU; a CPU runs stages one by one
MAIN, BESIDE, ASIDE, TOUCH, SUMS, SHOWN = "main", "beside", "aside", "touch", "sums", "shown"


@dataclass(frozen=True)
class Step:
    """What a stage is launched for: one step of a state.

    Attributes:
        state: to advance.
        split: how a launch is cut in ranges, which threads of a CPU compute side by side.
        records: whether the step also records the state at its start.
        is_row: whether the record is a row of the history, and not a check between two.
        needs: of recorders, that a frame of this step must hold.
        searches: whether the search for contact is one of its stages.
    """

    state: State
    split: Split = whole
    records: bool = False
    is_row: bool = False
    needs: frozenset[str] = frozenset()
    searches: bool = False


@dataclass(frozen=True)
class Stage:
    """Something that is launched in every step, or in those that record.

    Attributes:
        name: as docs/architecture.md lists it.
        launch: launches its kernels for a step.
        stream: MAIN; BESIDE or ASIDE others of its group; TOUCH, beside those of the next group too; SUMS or SHOWN, which
            nothing waits for before the end of the step.
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
        """On the current device."""
        self.streams: dict[str, Any] = dict.fromkeys((BESIDE, ASIDE, TOUCH, SUMS, SHOWN))
        if cuda:
            self.streams = {name: wp.Stream(priority=-1) for name in self.streams}

    def run(self, groups: Sequence[Group], step: Step) -> None:
        """Launch the stages of a step in their order."""
        before: set[str] = set()  # streams of the group before
        summing: set[str] = set()
        for group in groups:
            stages = [stage for stage in group if step.records or not stage.only_records]
            used = self._run_group(stages, step) if stages else set()
            self._join(used & {BESIDE, ASIDE} | before & {TOUCH})
            before, summing = used, summing | used & {SUMS, SHOWN}
        self._join(before & {TOUCH} | summing)

    def _run_group(self, stages: Group, step: Step) -> set[str]:
        """The streams beside the main one in which there is something."""
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
        return used

    def _join(self, names: set[str]) -> None:
        for name in (name for name in self.streams if name in names):
            wp.wait_stream(self.streams[name])
