"""Owns phases of finite elements that one solver computes before an impact, and what they add to its history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from numpy.typing import NDArray

from warp_mca.phases.history_rows import Rows, phase_facts, rows_of
from warp_mca.step.records import SceneRecords
from warp_mca.step.steps import Steps
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
    """

    kind: str
    ended_by: str
    steps: Steps
    count: int
    records: SceneRecords

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
        return {"kind": self.kind, "ended_by": self.ended_by, "count": self.count, "steps": asdict(self.steps)}


def stretch_ended(impact: Impact, kind: str, ended_by: str, following: Steps) -> Stretch:
    """The phase that a solver has just finished; its rows begin anew, divided by the steps of the `following` one."""
    steps, count = impact.steps, impact.state.steps
    return Stretch(kind=kind, ended_by=ended_by, steps=steps, count=count, records=impact.divide_anew(following)[0])


def stored(stretches: Sequence[Stretch]) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """Stretches as a place in a run and arrays, see `Checkpoint.store`."""
    arrays = {f"{k}/{name}": a for k, item in enumerate(stretches) for name, a in item.records.arrays().items()}
    return ({"stretches": [item.facts() for item in stretches]} if stretches else {}), arrays


def restored(place: Mapping[str, Any], arrays: Mapping[str, NDArray]) -> list[Stretch]:
    """The inverse of `stored`.

    Raises:
        KeyError, TypeError, ValueError: a value is missing or of another type.
    """
    found = []
    for k, facts in enumerate(place.get("stretches", ())):
        own = {name.removeprefix(f"{k}/"): a for name, a in arrays.items() if name.startswith(f"{k}/")}
        found.append(Stretch(**{**facts, "steps": Steps(**facts["steps"]), "records": SceneRecords.of(own)}))
    return found


def rows_before(scene_run: SceneRun, stretches: Sequence[Stretch], origin: float = 0.0) -> list[Rows]:
    """Rows of the stretches before an impact; times count from `origin` [s] after its start."""
    found, start = [], 0.0
    for k, item in enumerate(stretches):
        ledger, end = item.ledger(scene_run), start + item.time
        facts = phase_facts(item.kind, start, end, item.ended_by, ledger.energy())
        before = sum(later.time for later in stretches[k:])
        found.append(rows_of(scene_run.ready, ledger, facts, before=before, origin=origin))
        start = end
    return found
