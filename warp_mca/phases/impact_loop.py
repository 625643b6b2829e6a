"""Owns the loop over the steps of an impact phase: searches, records, looks, and records on their way to the host."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import warp as wp

from warp_mca.base.errors import GuardError
from warp_mca.step.steps import Part
from warp_mca.step.transfer import Transfer
from warp_mca.system.stage import Search
from warp_mca.system.workspace import ROWS
from warp_mca.watch.looks import Looks, SceneLooks

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.system.state import State


class Loop:
    """One call of `Impact.advance`: launches, and records on their way to the host."""

    def __init__(self, impact: Impact, told: Callable[[], None], ended: Callable[[], bool] | None) -> None:
        self.impact, self.told, self.ended = impact, told, ended
        self.solver, self.state, self.steps = impact.solver, impact.state, impact.steps
        with wp.ScopedDevice(self.solver.device):
            self.solver.work.row.fill_(ROWS - 1)
        rings, (transfer, looks) = self.solver.rings(self.state), impact.ways or (None, None)
        self.transfer = transfer if transfer and transfer.carries(rings) else Transfer(rings, self.solver.device)
        self.looks = looks if looks and looks.serve(*self._looked_at()) else self._looks()
        impact.ways = self.transfer, self.looks
        self.written = 0
        if ended:  # each part of the ring is waited for
            self.solver.replay.note_ahead(self.state)

    def run(self, until: int | None) -> None:
        """As `Impact.advance`."""
        last = self.steps.count if until is None else min(until, self.steps.count)
        interval = self.state.steps // self.steps.per_interval
        while self.state.steps < last and not self._ends(interval):
            self._interval(interval, last)
            interval += 1
        if until is None or self.state.steps >= self.steps.count:
            if self.written == ROWS:
                self._send()
            self.looks.watch(last=True)
            self._record(1, self.state.steps // self.steps.per_interval, True)
        self.looks.finish()
        if self.written:
            self._send()
        if self.impact.recording:
            self.impact.recording.catch_up(self._receive_arrived)
        while self.transfer.pending:
            self._receive()
        self.impact.read_rest()
        self.told()

    def _ends(self, interval: int) -> bool:
        """Whether the phase ends with this row, by what the rows before it say."""
        if self.ended is None or self.state.steps != interval * self.steps.per_interval:
            return False
        return self.ended()

    def _interval(self, interval: int, last: int) -> None:
        """The steps of an output interval that are not done yet, up to step `last`."""
        first = interval * self.steps.per_interval
        if self.state.steps == first:
            self.looks.row(interval, self.steps.intervals)
            self.impact.controls.ask(interval, interval * self.steps.interval)
        for number, part in enumerate(self.steps.parts(interval)):
            end = first + part.count
            if self.state.steps < min(end, last):
                self._part(part, first, min(end, last), interval if number == 0 else None)
            first = end

    def _part(self, part: Part, first: int, end: int, row: int | None) -> None:
        """Steps that follow each other without a look from outside, from the present one to `end`."""
        if self.state.steps == first:  # not interrupted in between
            self._renew()
            self.looks.watch()
            if part.begins_check and self.written == ROWS:
                self._send()
            count = self.looks.until(end - first, part.count)
            if part.begins_check:
                self._record(count, row, part.begins_search)
            elif part.begins_search:
                self.solver.search(self.state)
        while self.state.steps < end:
            if self.state.steps > first:
                self._renew()
                self.looks.watch(part.count)
            self.solver.step(self.state, self.looks.until(end - self.state.steps, part.count))

    def _renew(self) -> None:
        """Let contact and looks follow the surface of elements that failed since the last time."""
        exposed = self.impact.exposed
        try:
            skins = exposed.renew() if exposed else None
        except GuardError as error:
            self.impact.stopped[0] = str(error)
            raise
        if exposed and skins is not None:
            self.looks.finish()
            looks, kept = self.impact.scene_runs[0].looks, self.state.scenes[0]
            kept.passed = looks.watch.renew(skins, exposed.passes, kept.passed)
            self.looks = self._looks()
            self.impact.ways = self.transfer, self.looks

    def _looks(self) -> Looks:
        return Looks(self.solver, *self._looked_at(), lambda: self.impact.together)

    def _looked_at(self) -> tuple[State, list[SceneLooks], float]:
        return self.state, [item.looks for item in self.impact.scene_runs], self.impact.span

    def _record(self, count: int, row: int | None, searches: bool = False) -> None:
        """Record and step; `row` is the number of the row of the history that the record gives, if it gives one."""
        recording = self.impact.recording
        needs: frozenset[str] = recording.needs(row) if recording and row is not None else frozenset()
        search: Search = ("after" if self.steps.spare else "before") if searches else ""
        self.solver.record_and_step(self.state, count, needs, row is not None, search)
        self.written += 1
        if recording and row is not None:
            recording.take(row, needs)

    def _send(self) -> None:
        if self.transfer.full:
            if self.impact.recording:
                self.impact.recording.work(lambda: self.transfer.arrived)
            if not self.transfer.arrived:  # the device has two parts more to compute
                self.solver.replay.note_ahead(self.state)
            self._receive()
        self.transfer.send(self.written, rows=dict.fromkeys(self.transfer.source.keys() - {"flag"}, self.written))
        self.written = 0
        self._receive_arrived()

    def _receive_arrived(self) -> None:
        while self.transfer.arrived or (self.ended and self.transfer.pending):
            self._receive()

    def _receive(self) -> None:
        self.impact.read(*self.transfer.receive())
        self.told()
