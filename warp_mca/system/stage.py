"""Owns what a stage of a time step is, and the order in which the stages of a step are launched."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import warp as wp

from warp_mca.system.threads import Split, whole

if TYPE_CHECKING:
    from warp_mca.system.state import State

# Streams of a GPU; a CPU runs stages one by one. The main one waits for BESIDE and ASIDE at the end of their group, for
# BEYOND at the end of the next, for SUMS, SHOWN, SPRINGS and LISTS at the end of the step, for LAST at the end of the
# steps that are launched together.
MAIN, BESIDE, ASIDE, BEYOND = "main", "beside", "aside", "beyond"
SUMS, SHOWN, SPRINGS, LISTS, LAST = "sums", "shown", "springs", "lists", "last"
_WITHIN, _ENDS = {BESIDE, ASIDE}, {SUMS, SHOWN, SPRINGS, LISTS}

Search = Literal["", "before", "after"]


@dataclass(frozen=True)
class Step:
    """What a stage is launched for: one step of a state.

    Attributes:
        state: to advance.
        split: how a launch is cut in ranges, which threads of a CPU compute side by side.
        records: whether the step also records the state at its start.
        is_row: whether the record is a row of the history, and not a check between two.
        needs: of recorders, that a frame of this step must hold.
        search: of contact as one of its stages: "" for none, else before the contact of this step or after it.
    """

    state: State
    split: Split = whole
    records: bool = False
    is_row: bool = False
    needs: frozenset[str] = frozenset()
    search: Search = ""


@dataclass(frozen=True)
class Stage:
    """Something that is launched in every step, or in those that record.

    Attributes:
        place: in a step, as `step.step_groups.STEP` lists them.
        name: as docs/architecture.md lists it.
        launch: launches its kernels for a step.
        stream: MAIN, or what else stands at the head of this module.
        only_records: whether it is launched only in steps that record.
        after: streams of which it waits for what is in them so far.
    """

    place: str
    name: str
    launch: Callable[[Step], None]
    stream: str = MAIN
    only_records: bool = False
    after: tuple[str, ...] = ()


Group = Sequence[Stage]


class Streams:
    """Launches groups of stages: those of a group may overlap on a GPU, one group follows the other."""

    def __init__(self, cuda: bool) -> None:
        """On the current device."""
        self.streams: dict[str, Any] = dict.fromkeys((*sorted(_WITHIN), BEYOND, *sorted(_ENDS), LAST))
        self._open: set[str] = set()
        if cuda:
            self.streams = {name: wp.Stream() for name in self.streams}

    def run(self, groups: Sequence[Group], step: Step) -> None:
        """Launch the stages of a step in their order; `finish` follows steps that record."""
        before: set[str] = set()  # streams of the group before
        for group in groups:
            stages = [stage for stage in group if step.records or not stage.only_records]
            used = self._run_group(stages, step) if stages else set()
            self._join(used & _WITHIN | before & {BEYOND})
            before = used
        self._join(self._open - {LAST})

    def finish(self) -> None:
        """Wait for all that is under way."""
        self._join(self._open)

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
                if before is not None and stage.stream not in entered:
                    wp.wait_event(before)
                    entered.add(stage.stream)
                for name in (name for name in stage.after if name in self._open):
                    wp.wait_stream(self.streams[name])
                stage.launch(step)
                self._open.add(stage.stream)
        return used

    def _join(self, names: set[str]) -> None:
        for name in sorted(names & self._open):
            wp.wait_stream(self.streams[name])
        self._open -= names
