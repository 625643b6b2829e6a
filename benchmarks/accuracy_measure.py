"""Owns measurements for the store of accuracies: variants and references of many scenes, in batches and processes.

Each process takes jobs in turn: a reference alone, or a variant of some scenes of equal duration in one batch.
"""

from __future__ import annotations

import math
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, wait
from dataclasses import dataclass, replace
from itertools import groupby, zip_longest
from typing import Any

import warp_mca as mca
from benchmarks.accuracy_families import FAMILIES, Family, Reference, Values
from warp_mca.accuracy.convergence import STEADY, Limit, limit_of
from warp_mca.accuracy.figures import BOUND, figures_of
from warp_mca.accuracy.plan import lighter
from warp_mca.accuracy.prediction import INTERVAL
from warp_mca.accuracy.variant import Variant
from warp_mca.studies.sweep_job import check_device_after
from warp_mca.studies.sweep_workers import Workers
from warp_mca.studies.worker_process import WorkerDied

BATCH = 8  # scenes side by side at most
WORK = {
    "hex8r": 0.65
}  # processor time of an element over that of hex8 with plasticity (measurements/performance.md) [-]
COMPUTED = 0.4  # share of the elements that a step computes on a CPU with several rates, where it was not measured
FINE = -1  # number of the reference among the variants

Row = dict[str, Any]  # figures, elements, steps, refine, computed, work, open
Table = dict[int, Row]  # by number of the variant
FAMILY = {family.scene: family for family in FAMILIES}


@dataclass(frozen=True)
class Job:
    """One variant of some scenes.

    Attributes:
        family: name of its scene.
        variant: number, or FINE.
        scenes: numbers of the scenes.
        values: parameters of each.
        device: to run on.
        scale: of the reference's refine [-]; below 1 to try the benchmark with less.
    """

    family: str
    variant: int
    scenes: tuple[int, ...]
    values: tuple[Values, ...]
    device: str
    scale: float

    @property
    def name(self) -> str:
        """What it is."""
        return f"{self.family}, variant {self.variant}, scenes {list(self.scenes)}"

    def on(self, device: str) -> Job:
        """The same job on a device."""
        return replace(self, device=device)


def variant_of(family: Family, number: int, scale: float = 1.0) -> Variant:
    """A variant with all parameters of the mesh, as the store has them."""
    found = family.variants[number] if number != FINE else _reference(family).fine
    if number == FINE and scale != 1.0:
        assert found.refine is not None
        axial = {name: round(value / scale) for name, value in found.parameters.items() if name.startswith("axial")}
        found = replace(found, refine=found.refine * scale, parameters={**found.parameters, **axial})
    return replace(found, parameters={**family.base(), **found.parameters})


def _reference(family: Family) -> Reference:
    assert isinstance(family.limits, Reference), "limits in closed form need no runs"
    return family.limits


def sampled(family: Family, seed: int, count: int) -> list[Values]:
    """Parameters of random scenes; equal seeds give equal scenes."""
    rng = random.Random(f"{family.scene} {seed}")
    return [{**family.fixed, **family.sample(rng)} for _ in range(count)]


def row_of(result: mca.Result, element: str | None) -> Row:
    """What is kept of a run with these elements, the scene's own if None."""
    summary = result.summary
    groups = summary.get("rate_groups")
    shortest = groups[0]["step"] if groups else 0.9 * summary["stable_dt"]
    steps = summary["simulated_time"] / shortest
    work = sum(item["elements"] * shortest / item["step"] for item in groups) if groups else None
    figures = figures_of(result)
    return {
        "figures": [figures[name] for name in BOUND],
        "elements": summary["n_elements"],
        "steps": round(steps),
        "refine": summary["refine"],
        "computed": work / summary["n_elements"] if work else None,
        "work": WORK.get(element or "", 1.0),
        "open": bool(summary["contact_open_at_end"]),
    }


def measured(job: Job) -> list[tuple[str, int, int, Row]]:
    """Rows of a job: family, scene, variant, row; scenes that fail are left out."""
    family = FAMILY[job.family]
    variant = variant_of(family, job.variant, job.scale)
    scenes = [variant.applied(mca.make_scene(job.family, **values)) for values in job.values]
    options = {"device": job.device, "threads": 1}
    results: list[mca.Result | None] = []
    if len(scenes) > 1:
        try:
            results = [item if item.stopped is None else None for item in mca.run_batch(scenes, **options)]
        except mca.McaError:
            results = []
    if not results:
        results = [_alone(scene, variant, options) for scene in scenes]
    pairs = zip(job.scenes, results, strict=True)
    return [
        (job.family, scene, job.variant, row_of(result, variant.element))
        for scene, result in pairs
        if result is not None
    ]


def _alone(scene: mca.Scene, variant: Variant, options: Mapping[str, Any]) -> mca.Result | None:
    try:
        return mca.run(scene, **{**options, **variant.options})
    except mca.McaError as error:
        less = lighter(variant, error) if isinstance(error, mca.RequestError) else None
        if less is not None:  # as runs with an accuracy do
            impact = replace(scene.impact, mass_scaling=less.mass_scaling)
            return _alone(replace(scene, impact=impact), less, options)
        print(f"left out: {scene.name}: {error}", flush=True)
        return None


def jobs_of(
    families: Sequence[Family],
    scenes: Mapping[str, Sequence[Values]],
    device: str,
    scale: float,
    wanted: Callable[[str, int, int], bool] = lambda family, scene, variant: True,
) -> list[Job]:
    """Jobs of some scenes of each family in turn, then of the next ones: those that a deadline leaves out are the last.

    Scenes that last longest come first, so that no process has one of them to itself in the end.

    On a GPU scenes of `two_link` of equal duration share a batch; references are alone. `wanted` tells whether a
    variant of a scene is measured; the reference, its partner and the one between always are, and come first.
    """
    rounds = zip_longest(*([(f, part) for part in _parts(f, scenes[f.scene], device)] for f in families))
    jobs = []
    for family, part in (item for found in rounds for item in found if item is not None):
        how = family.limits
        always = (how.partner, how.between) if isinstance(how, Reference) else ()
        others = [number for number in range(len(family.variants)) if number not in always]
        references = [(FINE, [k]) for k in part if always]
        pieces = references + [(number, part) for number in always]
        pieces += [(number, [k for k in part if wanted(family.scene, k, number)]) for number in others]
        known = scenes[family.scene]
        jobs += [
            Job(family.scene, number, tuple(piece), tuple(known[k] for k in piece), device, scale)
            for number, piece in pieces
            if piece
        ]
    return jobs


def _parts(family: Family, scenes: Sequence[Values], device: str) -> list[list[int]]:
    """Numbers of scenes that share batches, those of one duration cut into equal parts; most steps come first."""
    together = BATCH if device != "cpu" and family.scene == "two_link" else 1
    order = sorted(range(len(scenes)), key=lambda k: (scenes[k].get("duration", 0.0), _stiffness(scenes[k])))
    parts: list[list[int]] = []
    for _, group in groupby(order, key=lambda k: scenes[k].get("duration")):
        members = list(group)
        count = math.ceil(len(members) / together)
        size = math.ceil(len(members) / count)
        parts += [members[i : i + size] for i in range(0, len(members), size)]
    return sorted(parts, key=lambda part: max(_steps(scenes[k]) for k in part), reverse=True)


def _stiffness(values: Values) -> float:
    """Greatest modulus of a scene [Pa]: scenes of a batch take the shortest step of all."""
    return max((values[name] for name in ("E_tip", "E_body") if name in values), default=70e9)


def _steps(values: Values) -> float:
    """Steps of a scene on a mesh over those of another one on the same [-]."""
    return values.get("duration", 1.0) * math.sqrt(max(_stiffness(values), 70e9))


def attempted(job: Job) -> list[tuple[str, int, int, Row]]:
    """As `measured`; a job that breaks, for lack of memory say, has no rows and does not end the others.

    Raises:
        DeviceLost: the device takes no more work of this process.
    """
    try:
        return measured(job)
    except Exception as error:
        print(f"left out: {job.name}: {type(error).__name__}: {error}", flush=True)
        check_device_after(error, job.device)
        return []


def carried_out(function: Callable[[Any], Any], jobs: Sequence[Any], workers: int, until: float) -> Iterator[Any]:
    """Answers to jobs, which have `on(device)`, `device` and `name`, as they come.

    Until all are there or the clock (`time.monotonic`) says `until`. A job whose worker dies is tried once more. The
    workers share out the devices of the jobs, which have commas between them.
    """
    if workers < 2 or not jobs:
        for job in jobs:
            if time.monotonic() > until:
                return
            yield function(job)
        return
    devices = jobs[0].device.split(",")
    with Workers([devices[k % len(devices)] for k in range(workers)]) as pool:
        running = {pool.submit(function, job): job for job in jobs}
        again = set()
        while running:
            done = wait(running, max(until - time.monotonic(), 0.01), return_when=FIRST_COMPLETED).done
            if not done:
                return
            for future in done:
                job = running.pop(future)
                try:
                    yield future.result()
                except WorkerDied as error:
                    print(f"worker ended in {job.name}: {error}", flush=True)
                    if job.name not in again:
                        again.add(job.name)
                        running[pool.submit(function, job)] = job


def truth_of(family: Family, values: Values, table: Table) -> list[Limit] | None:
    """Limits of the figures of a scene, extrapolated from the reference and its partner; None without one of the two.

    f0 = f + (f - f_c) h^p / (h_c^p - h^p) with the order p of the family. Figures whose differences from mesh to mesh
    grow, by the mesh between, have no limit, nor, without that mesh, those that move by more than STEADY. What may be
    left is that of the three meshes, or all that two of them differ by. Limits in closed form need none of it.
    """
    how = family.limits
    if not isinstance(how, Reference):
        return [Limit(value, None if value is None else 0.0) for value in how(values)] if table else None
    if FINE not in table or how.partner not in table:
        return None
    rows = [table[number] for number in (how.partner, how.between, FINE) if number in table]
    sizes = [1.0 / row["refine"] for row in rows]
    if sizes[0] <= 1.1 * sizes[-1]:
        return _so_far(family, table[FINE], [Limit(value) for value in table[FINE]["figures"]], Limit(None))
    series = zip(*(row["figures"] for row in rows), strict=True)
    found = [extrapolated(how.order, sizes, figures) for figures in series]
    return _so_far(family, table[FINE], found, Limit(None))


def extrapolated(order: float, sizes: Sequence[float], values: Sequence[float | None]) -> Limit:
    """The limit of a figure of two or three meshes, as in `truth_of`."""
    coarse, fine = values[0], values[-1]
    if not fine or coarse is None:
        return Limit(fine)
    if len(values) == 3 and values[1] is not None:
        found = limit_of(sizes, values, INTERVAL * abs(fine))
        left = None if found.value is None else found.left
    else:
        moved = abs(coarse / fine - 1.0)
        left = moved + INTERVAL if moved <= STEADY else None
    factor = 1.0 / ((sizes[0] / sizes[-1]) ** order - 1.0)
    return Limit(None) if left is None else Limit(fine + factor * (fine - coarse), left)


def errors_of(family: Family, row: Row, truth: Sequence[Limit]) -> list[float | None]:
    """Signed errors of a run [-]."""
    pairs = zip(row["figures"], truth, strict=True)
    shares = [None if f is None or not limit.value else f / limit.value - 1.0 for f, limit in pairs]
    return _so_far(family, row, shares, None)


def _so_far(family: Family, row: Row, values: list[Any], none: Any) -> list[Any]:
    """Values of the figures; the impulse of a contact still open, where contacts end, depends on when the run does."""
    ends = row["open"] and "contact_duration" not in family.no_limit
    return [none if ends and name == "impulse" else value for name, value in zip(BOUND, values, strict=True)]


def stored(family: Family, scenes: Sequence[Values], tables: Mapping[int, Table]) -> dict[str, Any]:
    """The family as the store has it; scenes whose limits are not known are left out."""
    entries = []
    for k, values in enumerate(scenes):
        table = tables.get(k, {})
        truth = truth_of(family, values, table)
        if truth is None:
            continue
        runs = [_run(family, number, row, truth) for number, row in sorted(table.items()) if number != FINE]
        left = [None if limit.left is None else round(limit.left, 5) for limit in truth]
        entries.append({"parameters": values, "truth": [limit.value for limit in truth], "left": left, "runs": runs})
    return {
        "features": dict(family.features),
        "mesh": family.base(),
        "any_value": list(family.any_value),
        "no_limit": dict(family.no_limit),
        "variants": [_plain(item) for item in family.variants],
        "scenes": entries,
    }


def _run(family: Family, number: int, row: Row, truth: Sequence[Limit]) -> dict[str, Any]:
    """A run as the store has it."""
    work = WORK.get(family.variants[number].element or "", 1.0)
    return {
        "variant": number,
        "errors": [None if e is None else round(e, 5) for e in errors_of(family, row, truth)],
        "elements": row["elements"],
        "steps": row["steps"],
        "computed": round((row["computed"] or COMPUTED) * work, 3),
    }


def lacking(families: Sequence[Family], known: Mapping[str, Any], device: str) -> list[Job]:
    """Jobs of the variants that scenes of the store have not been run with; their limits are known."""
    have = {
        (family.scene, k): {run["variant"] for run in item["runs"]}
        for family in families
        for k, item in enumerate(known[family.scene]["scenes"])
    }
    scenes = {family.scene: [item["parameters"] for item in known[family.scene]["scenes"]] for family in families}
    jobs = jobs_of(families, scenes, device, 1.0, lambda name, scene, number: number not in have[name, scene])
    return [
        job
        for job in jobs
        if job.variant != FINE and any(job.variant not in have[job.family, scene] for scene in job.scenes)
    ]


def completed(family: Family, before: Mapping[str, Any], tables: Mapping[int, Table]) -> dict[str, Any]:
    """A family of the store with runs of variants that its scenes lacked; new variants come after those it has."""
    variants = [_plain(item) for item in family.variants]
    assert variants[: len(before["variants"])] == before["variants"], "variants of the store have changed"
    scenes = []
    for k, item in enumerate(before["scenes"]):
        runs = {run["variant"]: run for run in item["runs"]}
        truth = [Limit(value) for value in item["truth"]]
        runs |= {number: _run(family, number, row, truth) for number, row in tables.get(k, {}).items()}
        scenes.append({**item, "runs": [runs[number] for number in sorted(runs)]})
    kept = {key: value for key, value in before.items() if key != "processes"}  # fitted to fewer runs
    return {**kept, "variants": variants, "scenes": scenes}


def added(before: Mapping[str, Any] | None, found: Mapping[str, Any]) -> dict[str, Any]:
    """A family of the store with the scenes that it had; those of other variants or features are dropped."""
    same = before is not None and all(before[key] == found[key] for key in ("variants", "features", "mesh"))
    kept = before["scenes"] if before is not None and same else []
    new = [item["parameters"] for item in found["scenes"]]
    return {**found, "scenes": [item for item in kept if item["parameters"] not in new] + found["scenes"]}


def _plain(variant: Variant) -> dict[str, Any]:
    own = {key: value for key, value in variant.knobs.items() if key not in variant.parameters and key != "multi_rate"}
    return {**own, "parameters": dict(variant.parameters)}
