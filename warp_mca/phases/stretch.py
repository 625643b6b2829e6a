"""Owns phases of finite elements that one solver computes before an impact, and what they add to its history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from warp_mca.phases.history_rows import Rows, phase_facts, rows_of
from warp_mca.step.steps import Steps
from warp_mca.system.records import SceneRecords
from warp_mca.watch.ledger import Ledger

if TYPE_CHECKING:
    from warp_mca.phases.impact import Impact
    from warp_mca.phases.scene_run import SceneRun


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """A phase of finite elements before an impact.

    Attributes:
        kind: of phase, as `summary.json` names it.
        ended_by: the event that ended it.
        steps: how its history is divided.
        count: steps that it took [-].
        records: what it has recorded.
        more: what else a result needs of it, as JSON can hold it.
    """

    kind: str
    ended_by: str
    steps: Steps
    count: int
    records: SceneRecords
    more: Mapping[str, Any] = field(default_factory=dict)

    @property
    def time(self) -> float:
        """That it lasted [s]."""
        return self.count * self.steps.dt

    def ledger(self, scene_run: SceneRun) -> Ledger:
        """Its rows and energies, of a scene."""
        ready, precision = scene_run.ready, scene_run.solver.precision
        return Ledger(ready.model, self.steps, ready.scene.impact.energy_tolerance, precision, self.records)

    def facts(self) -> dict[str, Any]:
        """All but its records, as JSON can hold it."""
        return {**{name: value for name, value in vars(self).items() if name != "records"}, "steps": asdict(self.steps)}

    @staticmethod
    def of(facts: Mapping[str, Any], records: Mapping[str, NDArray], dt: float) -> Stretch:
        """The stretch of a solver with a time step dt [s] that a file holds.

        Raises:
            KeyError, TypeError, ValueError: a value is missing, or of another type or range.
        """
        found = Stretch(**{**facts, "steps": steps_of(facts["steps"], dt), "records": SceneRecords.of(records)})
        if type(found.count) is not int or found.count < 0 or not isinstance(found.more, dict):
            raise ValueError(facts)
        return found


def stretch_ended(impact: Impact, kind: str, ended_by: str, following: Steps) -> Stretch:
    """The phase that a solver has just finished; its rows begin anew, divided by the steps of the `following` one."""
    steps, count = impact.steps, impact.state.steps
    return Stretch(kind=kind, ended_by=ended_by, steps=steps, count=count, records=impact.divide_anew(following)[0])


def steps_of(stored: Mapping[str, Any], dt: float) -> Steps:
    """The steps of a solver with a time step dt [s] that a file holds.

    Raises:
        TypeError, ValueError: a value is missing, or of another type or range.
    """
    steps = Steps(**stored)
    counts = (steps.per_search, steps.searches, steps.intervals, steps.intervals_per_search)
    if steps.dt != dt or not all(type(count) is int and count > 0 for count in counts):
        raise ValueError(stored)
    return steps


def rows_before(scene_run: SceneRun, stretches: Sequence[Stretch], origin: float = 0.0) -> list[Rows]:
    """Rows of the stretches before an impact; times count from `origin` [s] after its start."""
    found, start = [], 0.0
    ledgers = [*(item.ledger(scene_run) for item in stretches), scene_run.ledger]
    for k, item in enumerate(stretches):
        ledger, end = ledgers[k], start + item.time
        facts = phase_facts(item.kind, start, end, item.ended_by, _end_energy(ledger, ledgers[k + 1]))
        before = sum(later.time for later in stretches[k:])
        found.append(rows_of(scene_run.ready, ledger, facts, before=before, origin=origin))
        start = end
    return found


def _end_energy(ledger: Ledger, after: Ledger) -> dict[str, float]:
    """The ledger at the end of a phase [J]: the first row `after` it, without what bodies that waited gain there.

    Its own last row may be as long before its end as its rows are apart.
    """
    if not after.kept.sums:
        return ledger.energy()
    found = after.energy(0)
    given = after.initial_energy - ledger.initial_energy if ledger.kept.sums else 0.0
    return {**found, "initial": found["initial"] - given, "kinetic": found["kinetic"] - given}
