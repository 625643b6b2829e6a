"""Owns what a cycle of phases adds up to: one history, one ledger, one summary."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from warp_mca.phases.cycle_rows import STORED, Story
from warp_mca.phases.history_rows import joined
from warp_mca.phases.prepare import Setup
from warp_mca.results.contact_history import ContactHistory
from warp_mca.results.result import Result, summarise
from warp_mca.results.sensor_history import sensor_figures
from warp_mca.watch.mass_report import body_report
from warp_mca.watch.peaks import greatest_peaks

NOTHING = "no phase of the run touched anything: give a later t_end, or check positions and speeds"
TOGETHER: dict[str, Callable[[Iterator[Any]], Any]] = {  # how figures of all impacts are made of those of each
    **dict.fromkeys(("contact_duration", "n_steps", "simulated_time"), sum),
    **dict.fromkeys(("max_plastic_strain", "F_n_max", "F_t_max", "max_strain", "max_penetration"), max),
    "F_t_min": min,
    **dict.fromkeys(("touched", "F_t_reverses"), any),
}


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
    summary = results[0].summary if results else summarise(found["history"], _without_impact(setup), found["contacts"])
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
        "simulated_time": 0.0,
        "max_plastic_strain": 0.0,
        "joint_impulse": {},
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
    phases, wall = [rows.facts for rows in story.rows], setup.request.clock.wall
    last = phases[-1]["energy"]
    found: dict[str, Any] = {
        "phases": phases,
        "energy": {**last, "error": story.totals.error(sum(last[k] for k in STORED))},
        "energy_error": story.error / story.scale if story.scale > 0.0 else 0.0,
        "wall": dict(wall),
    }
    if not summaries:
        return found
    found |= {key: how(summary[key] for summary in summaries) for key, how in TOGETHER.items()}
    found |= {key: list(_shifted(summaries, offsets, key)) for key in ("contacts", "F_n_peaks", "sticks")}
    pairs = ([summary["contacts_by_pair"][k] for summary in summaries] for k in range(len(contacts)))
    joints, elements, fe = [summary["joint_impulse"] for summary in summaries], summaries[0]["n_elements"], wall["fe"]
    return found | {
        "contacts_by_pair": [_pair(contact, own, offsets) for contact, own in zip(contacts, pairs, strict=True)],
        "contact_open_at_end": summaries[-1]["contact_open_at_end"],
        "joint_impulse": {name: np.sum([j[name] for j in joints], axis=0).tolist() for name in joints[0]},
        "element_steps_per_s": elements * found["n_steps"] / fe if fe > 0.0 and found["n_steps"] else None,
        "bodies": greatest_peaks([summary["bodies"] for summary in summaries], offsets),
        "extremes": _extremes([summary["extremes"] for summary in summaries]),
    }


def _extremes(items: Sequence[Mapping[str, float]]) -> dict[str, float]:
    return {key: (min if key == "min_jacobian" else max)(item[key] for item in items) for key in items[0]}


def _shifted(summaries: Sequence[Mapping[str, Any]], offsets: Sequence[float], key: str) -> Iterator[list[float]]:
    """Spans, or times and values, of each impact at the time of the run [s]."""
    for summary, offset in zip(summaries, offsets, strict=True):
        for first, second in summary[key]:
            yield [first + offset, second if key == "F_n_peaks" else second + offset]


def _pair(pair: ContactHistory, found: Sequence[Mapping[str, Any]], offsets: Sequence[float]) -> dict[str, Any]:
    """What the summary says of a contact, from what it says of it in each impact."""
    spans = [(offset, span) for item, offset in zip(found, offsets, strict=True) for span in item["intervals"]]
    return {
        "name": pair.name,
        "intervals": [[start + offset, end + offset] for offset, (start, end) in spans],
        "contact_open_at_end": found[-1]["contact_open_at_end"],
        "F_max": max((item["F_max"] for item in found), key=lambda force: float(np.linalg.norm(force))),
        "impulse": np.sum([item["impulse"] for item in found], axis=0).tolist(),
        "normal": None if pair.normal is None else pair.normal.tolist(),
    }
