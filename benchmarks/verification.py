"""Owns verification.md of docs/measurements/: runs the full level in several processes, and writes what it gave.

    python -m benchmarks.verification --device cuda:0 --processes 20    run, write verification.json and the page
    python -m benchmarks.verification chain_mujoco                      run these cases only, on a CPU
    python -m benchmarks.verification --missing                         what is not stored
    python -m benchmarks.verification --render                          write the page from verification.json again

Outcomes replace those of the same case, element and precision, and are stored as they come; a case that is skipped,
because a module is missing, leaves the one that is stored. The text above the tables is verification.template.md.
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

from benchmarks.deliberate import notes
from benchmarks.measurements import FOLDER, measured, note

PRECISIONS = ("mixed", "float64")
Task = tuple[str, str, str, str, str]  # case, element, precision, device, level


def measure(task: Task) -> dict[str, Any] | None:
    """What a case gave, as it is stored; None if it was skipped."""
    import warp as wp

    from warp_mca.verify import cases
    from warp_mca.verify.case import Setup
    from warp_mca.verify.report import lines
    from warp_mca.verify.runner import outcome

    wp.config.quiet = True
    name, element, precision, device, level = task
    done = outcome(cases([name])[0], Setup(device=device, precision=precision, element=element, level=level))  # type: ignore[arg-type]
    print("\n".join(lines(done)[: 1 if done.met else None]), flush=True)
    found = {"case": name, "element": element, "precision": precision, "device": device, "level": level}
    found |= {"failure": done.failure, "wall": round(done.wall, 1), "rows": [asdict(row) for row in done.rows]}
    return None if done.skipped else found


def tasks(names: Iterable[str], device: str, level: str) -> list[Task]:
    """Every case with each element and precision that it takes, in the order of the page."""
    from warp_mca.verify import cases

    return [
        (case.name, element, precision, device, level)
        for case in cases(list(names))
        for element in case.taken()
        for precision in (PRECISIONS[:1] if case.needs else PRECISIONS)
    ]


def key(found: dict[str, Any]) -> tuple[str, ...]:
    """What an outcome is of."""
    return found["case"], found["element"], found["precision"]


def run(todo: list[Task], stored: list[dict[str, Any]], processes: int) -> Iterator[list[dict[str, Any]]]:
    """Outcomes after each of `todo`: it in place of one stored, others dropped; cases that took longest begin first."""
    wanted = [task[:3] for task in tasks((), "", "")]
    wall: dict[str, float] = {}
    for item in stored:
        wall[item["case"]] = max(item["wall"], wall.get(item["case"], 0.0))
    order = sorted(todo, key=lambda task: -wall.get(task[0], math.inf))
    found = {key(item): item for item in stored}
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        for new in filter(None, pool.imap_unordered(measure, order)):
            found[key(new)] = new
            yield [found[item] for item in wanted if item in found]


def write_page(stored: list[dict[str, Any]], folder: Path) -> None:
    """verification.md and its figure in `folder`, of the stored outcomes in the order of the page."""
    from warp_mca.verify import cases
    from warp_mca.verify.case import Row, Setup
    from warp_mca.verify.report import Outcome, write

    known, found = {case.name: case for case in cases()}, {key(item): item for item in stored}
    outcomes = []
    for name, element, precision, *_ in tasks((), "", ""):
        if item := found.get((name, element, precision)):
            rows = [Row(**row | {k: tuple(row[k]) for k in ("measured", "sizes")}) for row in item["rows"]]
            setup = Setup(device=item["device"], precision=precision, element=element, level=item["level"])
            outcome = Outcome(
                case=known[name], setup=setup, rows=tuple(rows), failure=item["failure"], wall=item["wall"]
            )
            outcomes.append(outcome)
    header = (FOLDER / "verification.template.md").read_text(encoding="utf-8").rstrip()
    for name in ("verification", "mutations"):
        header = header.replace(f"{{{name}}}", measured(name))
    write(folder, outcomes, header, notes())


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.verification", description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", help="cases or groups (default: all)")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--level", default="full", choices=("quick", "full"))
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--missing", action="store_true", help="only what is not stored")
    parser.add_argument("--data", type=Path, default=FOLDER / "verification.json", help="where outcomes are kept")
    parser.add_argument("--render", action="store_true", help="only write the page from the outcomes kept")
    args = parser.parse_args()
    stored = json.loads(args.data.read_text(encoding="utf-8")) if args.data.exists() else []
    if not args.render:
        known = {key(item) for item in stored if args.missing}
        todo = [task for task in tasks(args.cases, args.device, args.level) if task[:3] not in known]
        for found in run(todo, stored, args.processes):
            stored = found
            args.data.write_text(json.dumps(stored, indent=1) + "\n", encoding="utf-8")
        if not args.cases:  # the page names the device of most rows
            note(args.data, args.device)
    write_page(stored, FOLDER)


if __name__ == "__main__":
    main()
