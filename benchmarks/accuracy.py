"""Owns the measurements behind `--accuracy`: the store that choices are made from, and how good the choices are.

python -m benchmarks.accuracy learn --device cuda:0 --scenes 30 --workers 10 --deadline 300
python -m benchmarks.accuracy learn --device cuda:0 --families two_link --add 1 3 --workers 10 --deadline 300
python -m benchmarks.accuracy learn --device cuda:0 --families two_link --lacking --workers 10 --deadline 300
python -m benchmarks.accuracy validate --device cuda:0,cuda:1 --scenes 20 --workers 30 --deadline 500
python -m benchmarks.accuracy render
python -m benchmarks.accuracy fit

`learn` measures all variants of the families of `accuracy_families` on random scenes and writes the package's store,
with `--add` beside the scenes that it has, which are not run again (seeds of other scenes); with `--lacking` it runs
these with variants that they lack. `validate` runs `--accuracy 2%` and `5%` on other random scenes, compares with
references, and writes accuracy.json of docs/measurements/ as it goes; `both` does the one and the other; `render`
puts the tables into accuracy.md beside it; `fit` repeats the part of `learn` that runs nothing.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

import warp_mca as mca
from benchmarks.accuracy_families import FAMILIES, Family, Values
from benchmarks.accuracy_judge import judged, no_dearer, render
from benchmarks.accuracy_left_out import left_out
from benchmarks.accuracy_measure import (
    Job,
    Table,
    added,
    attempted,
    carried_out,
    completed,
    jobs_of,
    lacking,
    row_of,
    sampled,
    stored,
    truth_of,
)
from benchmarks.measurements import FOLDER, note
from warp_mca.accuracy.prediction import processes_of
from warp_mca.accuracy.store import OWN, family_from
from warp_mca.studies.sweep_job import check_device_after

JSON = FOLDER / "accuracy.json"
PAGE = FOLDER / "accuracy.md"
ASKED = (0.02, 0.05)
LEARN, HELD_OUT = 1, (16, 17)  # seeds: choices are never tried on scenes that they were learnt from
LEARNING = 0.45  # share of the time of `both` that is spent on the store
GALLERY = 6  # scenes of each other family to learn from; one of each is tried


def main() -> None:
    """Carry out the command."""
    parser = argparse.ArgumentParser(description="Measure the choices of --accuracy.")
    parser.add_argument("command", choices=("learn", "validate", "both", "render", "fit"))
    parser.add_argument("--device", default="cpu", help="one, or several with commas between them")
    parser.add_argument("--scenes", type=int, default=20, help="of two_link, of each seed")
    parser.add_argument("--gallery", type=int, help="scenes of each other family (default: 6 to learn from, 1 to try)")
    parser.add_argument("--workers", type=int, default=1, help="processes that share the devices")
    parser.add_argument("--deadline", type=float, default=1e9, metavar="SECONDS", help="stop measuring after this")
    parser.add_argument("--reference", type=float, default=1.0, metavar="SCALE", help="refine of references times this")
    parser.add_argument("--families", help="names with commas between them (default: all)")
    parser.add_argument(
        "--add", type=int, nargs="+", metavar="SEED", help="learn other scenes, beside those of the store"
    )
    parser.add_argument("--lacking", action="store_true", help="learn variants that scenes of the store lack")
    parser.add_argument("-o", "--output", type=Path)
    args = parser.parse_args()
    if args.command == "render":
        data = json.loads(JSON.read_text(encoding="utf-8"))
        known = json.loads(OWN.read_text(encoding="utf-8"))["families"]
        data["left_out"] = [entry for name, item in known.items() for entry in left_out(name, item)]
        JSON.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
        PAGE.write_text(render(PAGE.read_text(encoding="utf-8"), data))
        return
    if args.command == "fit":
        fit(args.output or OWN, json.loads((args.output or OWN).read_text(encoding="utf-8"))["families"])
        return
    until = time.monotonic() + args.deadline
    wanted = args.families.split(",") if args.families else [family.scene for family in FAMILIES]
    families = [family for family in FAMILIES if family.scene in wanted]
    if args.command in ("learn", "both"):
        share = LEARNING if args.command == "both" else 1.0
        learn(args, families, until - (1.0 - share) * args.deadline)
    if args.command in ("validate", "both"):
        validate(args, families, until)


def _scenes(args: argparse.Namespace, family: Family, seed: int, others: int) -> list[Values]:
    count = args.scenes if family.scene == "two_link" else others if args.gallery is None else args.gallery
    return sampled(family, seed, count)


def _tables(jobs: Sequence[Job], workers: int, until: float) -> Iterable[dict[str, dict[int, Table]]]:
    """All rows so far, by family, scene and variant, after each few runs."""
    tables: dict[str, dict[int, Table]] = {job.family: {} for job in jobs}
    rows = chain.from_iterable(carried_out(attempted, jobs, workers, until))
    for count, (name, scene, variant, row) in enumerate(rows, 1):
        tables[name].setdefault(scene, {})[variant] = row
        if count % 20 == 0:
            print(f"{count} runs, {until - time.monotonic():.0f} s left", flush=True)
            yield tables
    yield tables


def learn(args: argparse.Namespace, families: list[Family], until: float) -> None:
    """Write the store; families that were not measured stay as they are in it."""
    target = args.output if args.output and args.command == "learn" else OWN
    before = json.loads(target.read_text(encoding="utf-8"))["families"] if target.exists() else {}
    measured = _completed if args.lacking else _sampled
    found: dict[str, Any] = {}
    for item in measured(args, families, before, until):
        found = item
        target.write_text(json.dumps({"families": {**before, **found}}) + "\n", encoding="utf-8")
    fit(target, list(found))
    print({name: len(item["scenes"]) for name, item in found.items()})


def fit(target: Path, names: Iterable[str]) -> None:
    """Keep in a store what its scenes tell as a whole, so that no run has to find it out."""
    known = json.loads(target.read_text(encoding="utf-8"))["families"]
    for name in names:
        family = family_from(name, {key: value for key, value in known[name].items() if key != "processes"})
        known[name]["processes"] = {
            figure: [None if item is None else [round(item.length, 4), round(item.core, 3)] for item in items]
            for figure, items in processes_of(family).items()
        }
    target.write_text(json.dumps({"families": known}) + "\n", encoding="utf-8")


def _sampled(
    args: argparse.Namespace, families: list[Family], before: Mapping[str, Any], until: float
) -> Iterable[dict[str, Any]]:
    """Families with random scenes, as far as these are measured."""
    seeds = args.add or [LEARN]
    assert not {*HELD_OUT} & {*seeds}, "these scenes are those that choices are tried on"
    scenes = {f.scene: [item for seed in seeds for item in _scenes(args, f, seed, GALLERY)] for f in families}
    if args.add is not None:
        kept = {name: [entry["parameters"] for entry in item["scenes"]] for name, item in before.items()}
        scenes = {name: [item for item in new if item not in kept.get(name, [])] for name, new in scenes.items()}
    for tables in _tables(jobs_of(families, scenes, args.device, args.reference), args.workers, until):
        found = {f.scene: stored(f, scenes[f.scene], tables.get(f.scene, {})) for f in families}
        found = {name: item for name, item in found.items() if item["scenes"]}
        if args.add is not None:
            found = {name: added(before.get(name), item) for name, item in found.items()}
        yield found


def _completed(
    args: argparse.Namespace, families: list[Family], before: Mapping[str, Any], until: float
) -> Iterable[dict[str, Any]]:
    """Families of the store with the variants that their scenes lack, as far as these are measured."""
    known = [family for family in families if family.scene in before]
    for tables in _tables(lacking(known, before, args.device), args.workers, until):
        yield {f.scene: completed(f, before[f.scene], tables.get(f.scene, {})) for f in known}


def validate(args: argparse.Namespace, families: list[Family], until: float) -> None:
    """Try the accuracies on scenes that were not learnt from."""
    target = args.output or JSON
    scenes = {f.scene: [item for seed in HELD_OUT for item in _scenes(args, f, seed, 1)] for f in families}
    begin = time.monotonic()
    runs = _accurate_runs(args, scenes, until - 0.5 * (until - begin))
    print(f"{len(runs)} runs with an accuracy in {time.monotonic() - begin:.0f} s", flush=True)
    found: list[dict[str, Any]] = []
    jobs = jobs_of(families, scenes, args.device, args.reference, no_dearer(runs, args.device))
    for tables in _tables(jobs, args.workers, until):
        found = []
        for family in families:
            for k, values in enumerate(scenes[family.scene]):
                table = tables.get(family.scene, {}).get(k, {})
                truth = truth_of(family, values, table)
                own = [run for run in runs if (run["scene"], run["number"]) == (family.scene, k)]
                if truth is not None and own:
                    found.append(judged(family, values, table, truth, own, args.device))
        data = {"device": args.device, "version": mca.__version__, "reference": args.reference, "scenes": found}
        target.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
    note(target, args.device)
    print(f"{len(found)} scenes judged")


def _accurate_runs(args: argparse.Namespace, scenes: Mapping[str, list[Values]], until: float) -> list[dict[str, Any]]:
    tasks = [
        Asking(name, k, values, asked, args.device)
        for name, items in scenes.items()
        for k, values in enumerate(items)
        for asked in ASKED
    ]
    return list(carried_out(accurate_run, tasks, args.workers, until))


@dataclass(frozen=True)
class Asking:
    """A run with an accuracy: its family, the number and parameters of the scene, the share, the device."""

    scene: str
    number: int
    values: Values
    asked: float
    device: str

    @property
    def name(self) -> str:
        """What it is."""
        return f"{self.scene}, scene {self.number}, accuracy {self.asked:g}"

    def on(self, device: str) -> Asking:
        """The same on a device."""
        return replace(self, device=device)


def accurate_run(task: Asking) -> dict[str, Any]:
    """One run with an accuracy: its figures, estimates, and what deciding took of its time.

    Raises:
        DeviceLost: the device takes no more work of this process.
    """
    begin = time.perf_counter()
    entry = {"scene": task.scene, "number": task.number, "asked": task.asked}
    try:
        scene = mca.make_scene(task.scene, **task.values)
        result = mca.run(scene, accuracy=task.asked, device=task.device, threads=1)
    except Exception as error:  # which must not end the runs of others
        check_device_after(error, task.device)
        return {**entry, "refused": f"{type(error).__name__}: {error}"}
    wall = time.perf_counter() - begin
    accuracy = result.summary["accuracy"]
    return {
        **entry,
        **row_of(result, accuracy["chosen"].get("element")),
        "estimate": accuracy["estimate"],
        "chosen": accuracy["chosen"],
        "why": accuracy["why"],
        "deciding": accuracy["deciding"] / wall,
        "wall": wall,
        "fe": result.summary["wall"]["fe"],
    }


if __name__ == "__main__":
    main()
