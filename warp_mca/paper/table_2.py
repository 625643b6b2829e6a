"""Owns Table 2: finite elements from the release on, beside rigid links until the touch: what both give, and cost.

An impact ends when its contacts have been open for a while. What that costs is measured by runs that last so long and
no longer: neither the way back to rigid bodies nor what follows is in it, as neither is in the paper's.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import warp_mca as mca
from warp_mca.base.errors import bad_value
from warp_mca.base.files import check_folder, write_atomically
from warp_mca.phases.arguments import Progress
from warp_mca.phases.every import METHOD
from warp_mca.scene import Scene

OPEN_TIMES = (2.5e-4, 5e-4, 1e-3)  # after which an impact has ended [s]
RESULTS, REQUEST = "pure_fem.json", "request.json"
PURE, MCA = "pure", "mca"  # folders of the two runs
EVERY = "30w"  # how often the state of the run of finite elements alone is stored
FIGURES = ("t_contact", "v_n", "v_t", "F_n_first_peak", "F_n_peaks", "F_n_max", "contact_duration", "contacts")
FACTS = ("n_elements", "n_steps", "dt", "simulated_time", "energy_error", "device", "precision", "version")
RATIOS = ("v_n", "v_t", "F_n_first_peak", "impulse", "contact_duration", "n_steps")

HEAD = (
    "run",
    "first contact [s]",
    "first peak [kN]",
    "contact [ms]",
    "steps",
    "before contact [s]",
    "impact [s]",
    "total [s]",
    "of the first",
)

Entry = dict[str, Any]


def compare(
    scene: Scene,
    out: Path,
    *,
    open_times: Sequence[float] = OPEN_TIMES,
    force: bool = False,
    progress: Progress | None = None,
    **settings: Any,
) -> Entry:
    """Run a scene both ways, for its duration after the touch; the same call goes on with what `out` holds.

    Args:
        scene: of one impact, with a rigid phase whose inertia is that of the mesh.
        out: folder of both runs, and of `pure_fem.json`, which has what is returned.
        open_times: after which an impact has ended [s].
        force: start again.
        progress: of the run of finite elements alone.
        settings: device, precision, threads and multi_rate, as in `warp_mca.run`.

    Returns:
        `pure`, `mca`, and for each open time an entry of `event`: figures, cost [s] and their ratios to `pure`;
        `configuration` and `configuration_error` before the touch.

    Raises:
        RequestError: `out` holds something else, or a run cannot be carried out.
        GuardError: a run lost its footing.
        McaError: a file cannot be written.
    """
    _check_request(out, scene, settings, force)
    if not force and (found := stored(out)) is not None:
        return found
    meshes = mca.mesh(scene)
    own = {"method": METHOD, "checkpoint": EVERY, "progress": progress}
    pure = _kept(scene, out / PURE, force, meshes=meshes, **own, **settings)
    interval = scene.impact.output_interval
    mca.run(scene, meshes=meshes, duration=2.0 * interval, **settings)  # loads and captures what the next one takes
    two = _kept(scene, out / MCA, force, meshes=meshes, **settings)
    alone = figures(pure, interval)
    found = {"pure": alone, "mca": _beside(figures(two, interval), alone), "event": []}
    found |= {key: pure.summary[key] for key in ("configuration", "configuration_error")}
    for open_time in open_times:
        end = event_end(two.summary["contacts"], open_time)
        if end > float(two.time[-1]):
            continue
        ended = figures(mca.run(scene, meshes=meshes, duration=end, **settings), interval)
        later = sum(start > end for start, _ in pure.summary["contacts"])
        found["event"].append({"open_time": open_time, "end": end, "later_contacts": later, **_beside(ended, alone)})
    _write(out / RESULTS, found)
    return found


def stored(out: Path) -> Entry | None:
    """What `compare` wrote in this folder, if it is there."""
    try:
        return json.loads((out / RESULTS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def figures(result: mca.Result, interval: float) -> Entry:
    """Figures of a run with rows of this `interval` [s] in its impact, and what its phases cost [s]."""
    summary = result.summary
    found: Entry = {key: summary[key] for key in (*FIGURES, *FACTS)}
    found["impulse"] = float(result.F_n.sum()) * interval  # there is none in a swing's rows
    cost = {"before": summary["wall"]["rigid"], "impact": summary["wall"]["fe"]}
    if summary.get("method") == METHOD:
        cost = {"before": summary["phases"][0]["wall"], "impact": summary["phases"][1]["wall"]}
    return {**found, "cost": {**cost, "total": sum(cost.values())}, "wall": summary["wall"]}


def event_end(contacts: Sequence[Sequence[float]], open_time: float) -> float:
    """When all contacts, of these intervals [s], have first been open for this time [s]."""
    starts = [start for start, _ in contacts[1:]] + [math.inf]
    return next(end + open_time for (_, end), start in zip(contacts, starts, strict=True) if start - end >= open_time)


def enough(found: Mapping[str, Any]) -> Entry | None:
    """The first of the open times after which finite elements alone see no further contact."""
    return next((event for event in found["event"] if event["later_contacts"] == 0), None)


def table_rows(found: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Cells under HEAD: finite elements alone, and rigid links first, of the whole time and with each open time."""
    span = 1e3 * (found["mca"]["simulated_time"])
    named = [("finite elements alone", found["pure"]), (f"rigid links first, {span:.3g} ms of impact", found["mca"])]
    named += [(f"its impact ends after {1e3 * event['open_time']:g} ms open", event) for event in found["event"]]
    return [_cells(name, run, found["pure"]["cost"]["total"]) for name, run in named]


def _cells(name: str, run: Entry, whole: float) -> tuple[str, ...]:
    cost = run["cost"]
    figures = (f"{run['t_contact']:.6f}", f"{1e-3 * run['F_n_first_peak']:.4f}", f"{1e3 * run['contact_duration']:.3f}")
    seconds = (f"{cost[key]:.3g}" for key in ("before", "impact", "total"))
    return name, *figures, f"{run['n_steps']:,}", *seconds, f"{100 * cost['total'] / whole:.3f} %"


def _beside(run: Entry, pure: Entry) -> Entry:
    """A run with its ratios to that of finite elements alone, and by how much its touch is later [s]."""
    ratio = {key: run[key] / pure[key] for key in RATIOS if run[key] is not None and pure[key]}
    ratio |= {f"cost_{key}": run["cost"][key] / pure["cost"][key] for key in ("before", "impact", "total")}
    return {**run, "ratio": ratio | {"t_contact_difference": run["t_contact"] - pure["t_contact"]}}


def _kept(scene: Scene, folder: Path, force: bool, **options: Any) -> mca.Result:
    """The result in a folder, of a run that is carried out if it is not there."""
    if not force and (folder / "summary.json").exists():
        return mca.load(folder)
    return mca.run(scene, out=folder, force=force, **options)


def _check_request(out: Path, scene: Scene, settings: Mapping[str, Any], force: bool) -> None:
    """Say in the folder what its runs are of.

    Raises:
        RequestError: it has runs of something else.
    """
    check_folder("out", out)
    request = {
        "scene": scene.name,
        "parameters": {key: repr(value) for key, value in scene.parameters.items()},
        "refine": scene.refine,
        "duration": scene.impact.duration,
        **{key: value for key, value in settings.items() if key != "threads"},
    }
    path = out / REQUEST
    if not force and path.exists() and json.loads(path.read_text(encoding="utf-8")) != request:
        remedy = "it holds runs of another scene, device or precision; name another folder, or use --force (force=True)"
        raise bad_value("out", str(out), remedy)
    out.mkdir(parents=True, exist_ok=True)
    if force:
        (out / RESULTS).unlink(missing_ok=True)
    _write(path, request)


def _write(path: Path, entries: Entry) -> None:
    text = json.dumps(entries, indent=1) + "\n"
    write_atomically(path, lambda file: file.write(text.encode()))
