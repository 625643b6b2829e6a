"""Owns what a cycle of phases adds up to: one history, one ledger, one summary."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from warp_mca.phases.cycle_rows import STORED, Story
from warp_mca.phases.history_rows import joined
from warp_mca.phases.prepare import Setup
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.result import Result, summarise
from warp_mca.results.sensor_history import sensor_figures
from warp_mca.watch.mass_report import body_report

NOTHING = "no phase of the run touched anything: give a later t_end, or check positions and speeds"


def cycle_result(setup: Setup, story: Story, said: Sequence[str] = ()) -> Result:
    """What came of a cycle that is over, with what recorders `said`."""
    impacts = [part.impact for part in story.impacts]
    results = [impact.scene_runs[0].result(setup.request.clock.wall) for impact in impacts]
    found = joined(setup.scene, impacts[0].ready[0].probes if impacts else None, story.rows)
    common = set.intersection(*(set(result.warnings) for result in results)) if results else set()
    warnings = [w for w in results[0].warnings if w in common] if results else [NOTHING]
    for k, result in enumerate(results, 1):
        warnings += [f"impact {k}: {w}" for w in result.warnings if w not in common]
    stopped = [part.stopped for part in story.parts if part.stopped]
    summary = results[0].summary if results else summarise(found["history"], _without_impact(setup))
    summary = {**summary, **_of_all(setup, story, [result.summary for result in results], found["contacts"])}
    summary |= sensor_figures(found["probes"], found["sections"], found["history"])
    return Result(summary=summary, warnings=(*warnings, *stopped, *said), **found)


def _without_impact(setup: Setup) -> dict[str, Any]:
    """Facts of a run that touched nothing."""
    start, scene, meshes = setup.start, setup.scene, setup.meshes
    return {
        "scene": scene.name,
        "n_elements": sum(item.cell_count for item in meshes.values()),
        "n_nodes": sum(len(item.points) for item in meshes.values()),
        "dt": 0.0,
        "n_steps": 0,
        "wall": setup.request.clock.wall,
        "device": setup.request.settings.device,
        "precision": setup.request.settings.precision,
        "element": " ".join(sorted({body.element for body in scene.bodies})),
        "parameters": dict(scene.parameters),
        "theta": start.theta.tolist(),
        "theta_dot": start.theta_dot.tolist(),
        "energy_drift_rigid": start.energy_drift,
        "refine": scene.refine,
        "bodies": body_report(scene.bodies, meshes),
    }


def _of_all(
    setup: Setup, story: Story, summaries: Sequence[Mapping[str, Any]], contacts: Sequence[ContactHistory]
) -> dict[str, Any]:
    """What the summary says of all phases, in place of what it says of the first impact."""
    offsets = [part.start - story.origin for part in story.impacts]

    def spans(key: str) -> list[list[float]]:
        return list(_shifted(summaries, offsets, key))

    def greatest(key: str) -> float:
        return max((summary[key] for summary in summaries), default=0.0)

    phases = [rows.facts for rows in story.rows]
    last = phases[-1]["energy"]
    steps = sum(summary["n_steps"] for summary in summaries)
    fe, elements = setup.request.clock.wall["fe"], summaries[0]["n_elements"] if summaries else 0
    pairs = [
        _pair(pair, [summary["contacts_by_pair"][k] for summary in summaries], offsets)
        for k, pair in enumerate(contacts)
    ]
    joints = [summary["joint_impulse"] for summary in summaries]
    found: dict[str, Any] = {
        "phases": phases,
        **{key: spans(key) for key in ("contacts", "F_n_peaks", "sticks")},
        "contact_duration": sum(summary["contact_duration"] for summary in summaries),
        "contacts_by_pair": pairs,
        "touched": any(summary["touched"] for summary in summaries),
        "contact_open_at_end": bool(summaries) and summaries[-1]["contact_open_at_end"],
        "n_steps": steps,
        "simulated_time": sum((summary["simulated_time"] for summary in summaries), 0.0),
        "energy": {**last, "error": story.totals.error(sum(last[k] for k in STORED))},
        "energy_error": story.error / story.scale if story.scale > 0.0 else 0.0,
        **{key: greatest(key) for key in ("max_plastic_strain", "F_n_max", "F_t_max")},
        "F_t_min": min((summary["F_t_min"] for summary in summaries), default=0.0),
        "F_t_reverses": any(summary["F_t_reverses"] for summary in summaries),
        "joint_impulse": {name: np.sum([j[name] for j in joints], axis=0).tolist() for name in (joints or [{}])[0]},
        "element_steps_per_s": elements * steps / fe if fe > 0.0 and steps else None,
        "wall": dict(setup.request.clock.wall),
    }
    if summaries:
        found["extremes"] = _extremes([summary["extremes"] for summary in summaries])
        found |= {key: greatest(key) for key in ("max_strain", "max_penetration")}
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
