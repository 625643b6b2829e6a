"""Owns how the impact phase is divided: time steps, searches for contact, check records and output intervals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

CHECK_TIME, CHECK_STEPS = 1e-6, 20  # between two check records at most, whichever is longer: [s], steps


@dataclass(frozen=True)
class Part:
    """Steps that follow each other without a look from outside.

    Attributes:
        count: of steps.
        begins_search: whether a search for contact comes first.
        begins_check: whether the first step writes a record.
    """

    count: int
    begins_search: bool
    begins_check: bool


@dataclass(frozen=True)
class Steps:
    """How an output interval is divided.

    The energy balance and the guards take a check record at least every 1 µs or, if that is longer, every 20 steps,
    whatever the output interval; the first of each output interval is a row of the history too. A record costs about as
    much as a step, so that checks take a twentieth of the time at most. How long a contact lasts is not known
    beforehand: a stress wave, which ends it at the earliest, takes a step or more for each element on its way through
    the body and back, 2 n steps where the body is n elements long. Where 20 steps are longer than 1 µs they are thus
    10 / n of a contact at most. Strain, speed and normal force do not depend on it: kernels take those of every step.

    Attributes:
        dt: time step [s].
        per_search: steps between two searches for contact.
        searches: searches in an output interval.
        intervals: output intervals in the run.
        intervals_per_search: output intervals between two searches, where there is one in an interval at most.
        spare: whether what a search lists holds for one step more than until the next search.
    """

    dt: float
    per_search: int
    searches: int
    intervals: int
    intervals_per_search: int = 1
    spare: bool = False

    @property
    def per_interval(self) -> int:
        """Steps of an output interval."""
        return self.per_search * self.searches

    @property
    def interval(self) -> float:
        """Output interval [s]."""
        return self.dt * self.per_interval

    @property
    def count(self) -> int:
        """Steps of the whole run."""
        return self.per_interval * self.intervals

    @cached_property
    def most(self) -> int:
        """Steps between two check records at most."""
        return max(CHECK_STEPS, int(CHECK_TIME / self.dt * (1.0 + 1e-9)))

    @cached_property
    def per_check(self) -> int:
        """Steps between two check records; fewer before the next search or output interval, where they do not fit."""
        if self.per_search > self.most:
            return _fewest(self.per_search, self.most)
        return self.per_search * _fewest(self.searches, self.most // self.per_search)

    @cached_property
    def checks(self) -> int:
        """Check records of an output interval."""
        if self.per_check > self.per_search:
            return -(-self.per_interval // self.per_check)
        return self.searches * -(-self.per_search // self.per_check)

    def time(self, record: int) -> float:
        """Time of a check record, counted from 0 at the start [s]."""
        interval, check = divmod(record, self.checks)
        return self.interval * interval + self.dt * self._first(check)

    def _first(self, check: int) -> int:
        """First step of a check record of an output interval."""
        if self.per_check > self.per_search:
            return self.per_check * check
        search, k = divmod(check, -(-self.per_search // self.per_check))
        return self.per_search * search + self.per_check * k

    def parts(self, interval: int) -> Iterator[Part]:
        """The parts of an output interval, which has this number, in their order."""
        size = min(self.per_search, self.per_check)
        due = interval % self.intervals_per_search == 0
        for search in range(self.searches):
            checked = search * self.per_search % self.per_check == 0 or size < self.per_search
            for first in range(0, self.per_search, size):
                yield Part(min(size, self.per_search - first), due and first == 0, checked)


def _fewest(count: int, most: int) -> int:
    """The size of parts of `count` that are as few as `most` allows, and about equal."""
    parts = -(-count // most)
    return -(-count // parts)
