"""Owns phases of finite elements that one solver computes before an impact, and what they add to its result."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.history_rows import contact_histories, history_columns
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.paths import path_histories
from warp_mca.results.result import Result
from warp_mca.results.sensor_history import sensor_figures, sensor_histories
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


def joined(found: Result, scene_run: SceneRun, stretches: Sequence[Stretch], origin: float = 0.0) -> Result:
    """The result of an impact, with the rows of the stretches before it; times count from `origin` [s] after its start.

    The summary's figures are those of the impact, but for the probes and sections.
    """
    if not stretches:
        return found
    ready, names = scene_run.ready, [contact.name for contact in found.contacts]
    ledgers = [item.ledger(scene_run) for item in stretches]
    tables = [history_columns(ledger) for ledger in ledgers]
    for k, table in enumerate(tables):
        table["time_s"] = table["time_s"] - sum(item.time for item in stretches[k:]) - origin
    tables.append(dict(found.history))
    history = {name: np.concatenate([table[name] for table in tables]) for name in found.history}
    contacts = [*(contact_histories(ledger, names) for ledger in ledgers), found.contacts]
    paths = [*(path_histories(ready.probes, item.records.path_stress) for item in stretches if item.records.count)]
    records = [row for item in (*(s.records for s in stretches), scene_run.ledger.kept) for row in item.sensors]
    phases, start = [], 0.0
    for item, ledger, after in zip(stretches, ledgers, [*ledgers[1:], scene_run.ledger], strict=True):
        phases.append(phase_facts(item.kind, start, start + item.time, item.ended_by, _end_energy(ledger, after)))
        start += item.time
    end = start + found.summary["simulated_time"]
    phases.append(phase_facts("impact", start, end, "duration", scene_run.ledger.energy()))
    probes, sections = sensor_histories(ready.scene, history["time_s"], records)
    return replace(
        found,
        summary={**found.summary, **sensor_figures(probes, sections, history), "phases": phases},
        history=history,
        contacts=tuple(_one_contact(parts) for parts in zip(*contacts, strict=True)),
        paths=tuple(
            replace(parts[-1], stress=np.concatenate([part.stress for part in parts]))
            for parts in zip(*paths, found.paths, strict=True)
        ),
        probes=probes,
        sections=sections,
    )


def _end_energy(ledger: Ledger, after: Ledger) -> dict[str, float]:
    """The ledger at the end of a phase [J]: the first row `after` it, without what bodies that waited gain there.

    Its own last row may be as long before its end as its rows are apart.
    """
    if not after.kept.sums:
        return ledger.energy()
    found = after.energy(0)
    given = after.initial_energy - ledger.initial_energy if ledger.kept.sums else 0.0
    return {**found, "initial": found["initial"] - given, "kinetic": found["kinetic"] - given}


def _one_contact(parts: Sequence[ContactHistory]) -> ContactHistory:
    """A contact over all phases."""
    names = ("force", "pressure", "normal_force", "closing_speed")
    columns = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return ContactHistory(name=parts[-1].name, **columns)


def phase_facts(kind: str, start: float, end: float, ended_by: str, energy: Mapping[str, float]) -> dict[str, Any]:
    """What `summary.json` says of a phase: its ledger at the end."""
    return {"kind": kind, "start": start, "end": end, "ended_by": ended_by, "energy": dict(energy), "lost": 0.0}
