"""Owns what a cycle of phases adds up to: one history, one ledger, one summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.phases.cycle_rows import STORED, Columns, Story, tell_story
from warp_mca.phases.cycle_sensors import cycle_records
from warp_mca.phases.cycle_setup import Setup
from warp_mca.phases.parts import ImpactPart, Part
from warp_mca.results.contact_history import ContactHistory, contact_names
from warp_mca.results.paths import PathHistory
from warp_mca.results.result import Result, RunFacts, summarise
from warp_mca.results.sensor_history import sensor_figures, sensor_histories
from warp_mca.watch.mass_report import body_report

Array = NDArray[np.float64]

NOTHING = "no phase of the run touched anything: give a later t_end, or check positions and speeds"


def cycle_result(setup: Setup, parts: Sequence[Part], said: Sequence[str] = ()) -> Result:
    """What came of a cycle that is over, with what recorders `said`."""
    story = tell_story(setup, parts)
    impacts = [part for part in parts if isinstance(part, ImpactPart)]
    wall = setup.clock.wall
    results = [part.impact.scene_runs[0].result(wall) for part in impacts]
    t_contact = impacts[0].start if impacts else 0.0
    names = list(dict.fromkeys(name for rows in story.rows for name in rows))
    history = {name: np.concatenate([rows[name] for rows in story.rows]) for name in names}
    history = {"time_s": history.pop("t") - t_contact, **history}
    contacts = _contacts(setup, results, story)
    warnings = [NOTHING] if not impacts else []
    common = set.intersection(*(set(result.warnings) for result in results)) if results else set()
    warnings += [w for w in results[0].warnings if w in common] if results else []
    for k, result in enumerate(results, 1):
        warnings += [f"impact {k}: {w}" for w in result.warnings if w not in common]
    stopped = [part.stopped for part in parts if part.stopped]
    summary = results[0].summary if results else _without_impact(setup, history)
    summary = {**summary, **_of_all(setup, impacts, story, results, contacts, t_contact)}
    probes, sections = sensor_histories(setup.scene, history["time_s"], cycle_records(setup, parts))
    summary |= sensor_figures(probes, sections, history)
    own = {"contacts": contacts, "probes": probes, "sections": sections}
    return Result(summary, history, None, (*warnings, *stopped, *said), _paths(results, story), **own)


def _contacts(setup: Setup, results: Sequence[Result], story: Story) -> tuple[ContactHistory, ...]:
    """Forces of each contact over all phases; none act in rigid ones."""
    found = []
    for k, name in enumerate(contact_names(setup.scene.contacts)):
        own = iter([result.contacts[k] for result in results])
        parts = [
            next(own) if phase["kind"] == "impact" else _open(name, len(rows["t"]))
            for phase, rows in zip(story.phases, story.rows, strict=True)
        ]
        joined = {
            f: np.concatenate([getattr(part, f) for part in parts])
            for f in ("force", "pressure", "normal_force", "closing_speed")
        }
        found.append(ContactHistory(name=name, **joined))
    return tuple(found)


def _open(name: str, rows: int) -> ContactHistory:
    return ContactHistory(
        name=name,
        force=np.zeros((rows, 3)),
        pressure=np.zeros(rows),
        normal_force=np.zeros((rows, 3)),
        closing_speed=np.full(rows, np.nan),
    )


def _paths(results: Sequence[Result], story: Story) -> tuple[PathHistory, ...]:
    """Stress along the paths; rigid phases have none, which is nan."""
    if not results:
        return ()
    found = []
    for k, path in enumerate(results[0].paths):
        own = iter([result.paths[k].stress for result in results])
        parts = [
            next(own) if phase["kind"] == "impact" else np.full((len(rows["t"]), *path.stress.shape[1:]), np.nan)
            for phase, rows in zip(story.phases, story.rows, strict=True)
        ]
        found.append(replace(path, stress=np.concatenate(parts).astype(np.float32)))
    return tuple(found)


def _without_impact(setup: Setup, history: Columns) -> dict[str, Any]:
    """The summary of a run that touched nothing."""
    start, scene = setup.start, setup.scene
    facts = RunFacts(
        scene=scene.name,
        n_elements=sum(item.cell_count for item in setup.meshes.values()),
        n_nodes=sum(len(item.points) for item in setup.meshes.values()),
        dt=0.0,
        n_steps=0,
        simulated_time=0.0,
        wall=setup.clock.wall,
        device=setup.settings.device,
        precision=setup.settings.precision,
        element=" ".join(sorted({body.element for body in scene.bodies})),
        energy_error=0.0,
        energy={},
        max_plastic_strain=0.0,
        parameters=scene.parameters,
        theta=tuple(float(x) for x in start.theta),
        theta_dot=tuple(float(x) for x in start.theta_dot),
        more={
            "energy_drift_rigid": start.energy_drift,
            "refine": scene.refine,
            "bodies": body_report(scene.bodies, setup.meshes),
        },
    )
    return summarise(history, facts)


def _of_all(
    setup: Setup,
    impacts: Sequence[ImpactPart],
    story: Story,
    results: Sequence[Result],
    contacts: Sequence[ContactHistory],
    t_contact: float,
) -> dict[str, Any]:
    """What the summary says of all phases, in place of what it says of the first impact."""
    offsets = [part.start - t_contact for part in impacts]
    summaries = [result.summary for result in results]

    def spans(key: str) -> list[list[float]]:
        return list(_shifted(summaries, offsets, key))

    def greatest(key: str) -> float:
        return max((summary[key] for summary in summaries), default=0.0)

    last = story.phases[-1]["energy"]
    totals = story.totals
    energy = {**last, "error": totals.error(sum(last[k] for k in STORED))}
    steps = sum(summary["n_steps"] for summary in summaries)
    fe, elements = setup.clock.wall["fe"], summaries[0]["n_elements"] if summaries else 0
    pairs = [
        _pair(pair, [summary["contacts_by_pair"][k] for summary in summaries], offsets)
        for k, pair in enumerate(contacts)
    ]
    joints = [summary["joint_impulse"] for summary in summaries]
    found: dict[str, Any] = {
        "phases": story.phases,
        "contacts": spans("contacts"),
        "F_n_peaks": spans("F_n_peaks"),
        "sticks": spans("sticks"),
        "contact_duration": sum(summary["contact_duration"] for summary in summaries),
        "contacts_by_pair": pairs,
        "touched": any(summary["touched"] for summary in summaries),
        "contact_open_at_end": bool(summaries) and summaries[-1]["contact_open_at_end"],
        "n_steps": steps,
        "simulated_time": sum(summary["simulated_time"] for summary in summaries),
        "energy": energy,
        "energy_error": story.error / story.scale if story.scale > 0.0 else 0.0,
        "max_plastic_strain": greatest("max_plastic_strain"),
        "joint_impulse": {name: np.sum([j[name] for j in joints], axis=0).tolist() for name in (joints or [{}])[0]},
        "element_steps_per_s": elements * steps / fe if fe > 0.0 and steps else None,
        "wall": dict(setup.clock.wall),
    }
    for key in ("F_n_max", "F_t_max"):
        found[key] = greatest(key)
    found["F_t_min"] = min((summary["F_t_min"] for summary in summaries), default=0.0)
    found["F_t_reverses"] = any(summary["F_t_reverses"] for summary in summaries)
    if summaries:
        found["extremes"] = _extremes([summary["extremes"] for summary in summaries])
        found["max_strain"], found["max_penetration"] = greatest("max_strain"), greatest("max_penetration")
    return found


def _extremes(items: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: (min if key == "min_jacobian" else max)(item[key] for item in items) for key in items[0]}


def _shifted(summaries: Sequence[Mapping[str, Any]], offsets: Sequence[float], key: str) -> Iterator[list[float]]:
    """Spans, or times and values, of each impact at the time of the run [s]."""
    for summary, offset in zip(summaries, offsets, strict=True):
        for first, second in summary[key]:
            yield [first + offset, second if key == "F_n_peaks" else second + offset]


def _pair(pair: ContactHistory, found: Sequence[Mapping[str, Any]], offsets: Sequence[float]) -> dict[str, Any]:
    """What the summary says of a contact, from what it says of it in each impact."""
    forces = [item["F_max"] for item in found] or [[0.0, 0.0, 0.0]]
    spans = [(offset, span) for item, offset in zip(found, offsets, strict=True) for span in item["intervals"]]
    return {
        "name": pair.name,
        "intervals": [[start + offset, end + offset] for offset, (start, end) in spans],
        "contact_open_at_end": bool(found) and found[-1]["contact_open_at_end"],
        "F_max": max(forces, key=lambda force: float(np.linalg.norm(force))),
        "impulse": np.sum([[0.0, 0.0, 0.0], *(item["impulse"] for item in found)], axis=0).tolist(),
        "normal": None if pair.normal is None else pair.normal.tolist(),
    }
