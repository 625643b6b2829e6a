"""Command line of the random scenes.

    python -m benchmarks.random_scenes                                          all families; writes random_scenes.*
    python -m benchmarks.random_scenes --family crossing --count 60             these only; they join what is stored
    python -m benchmarks.random_scenes --seed 7000 --count 500 --data new.json  other seeds, elsewhere
    python -m benchmarks.random_scenes --processes 16 --missing --seconds 500   those that begin in time; again: more
    python -m benchmarks.random_scenes --drawn --device cuda:0 --processes 16   those with finer cells, on a GPU
    python -m benchmarks.random_scenes --family crossing --show 17              a picture of one, and its script
    python -m benchmarks.random_scenes --render                                 write the page from what is stored

A scene follows from its family and seed alone. Every tenth scene is small, and is run with cells three times finer too
(`--finer`, on by default on a GPU).
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import time
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from benchmarks.measurements import FOLDER, note
from benchmarks.random_scenes.crossing import FAMILIES, LOT
from benchmarks.random_scenes.measure import Row, Task, in_time
from benchmarks.random_scenes.page import line, tables, write_page
from benchmarks.random_scenes.show import show

COUNTS = dict.fromkeys(FAMILIES, 100) | {"crossing": 500, "default": 300}
DATA = FOLDER / "random_scenes.json"


def rows_of(tasks: list[Task], processes: int, seconds: float = math.inf) -> Iterator[Row]:
    """Rows of the tasks that begin within so many seconds, as they come."""
    begun = partial(in_time, time.time() + seconds)
    if processes == 1:
        yield from filter(None, map(begun, tasks))
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from filter(None, pool.imap_unordered(begun, tasks))


def is_known(row: Row, finer: bool) -> bool:
    """Whether a row holds all that a run would give."""
    drawn = finer and row["family"] in FAMILIES and row["seed"] % LOT == 0 and row["status"] == "finished"
    return "fine_status" in row or not drawn


def merged(stored: Iterable[Row], new: Iterable[Row]) -> list[Row]:
    """Rows by family and seed, new ones in place of those that they repeat."""
    found = {(row["family"], row["seed"]): row for row in (*stored, *new)}
    order = list(COUNTS)
    return [found[key] for key in sorted(found, key=lambda key: (order.index(key[0]), key[1]))]


def write(rows: Iterable[Row], file: Path) -> None:
    """Store rows, one a line."""
    file.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n", encoding="utf-8")


def main(words: list[str] | None = None) -> None:
    """Read the command line and do what it asks for."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.random_scenes",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--family", nargs="+", default=list(COUNTS), choices=list(COUNTS))
    parser.add_argument("--seed", type=int, default=0, help="the first one")
    parser.add_argument("--count", type=int, help=f"of scenes of each family (default: {COUNTS})")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--finer", action=argparse.BooleanOptionalAction, help="run every tenth with finer cells too")
    parser.add_argument("--drawn", action="store_true", help="only the tenth of two bodies that may have finer cells")
    parser.add_argument("--missing", action="store_true", help="only scenes that are not stored")
    parser.add_argument("--seconds", type=float, default=math.inf, help="after which no scene begins")
    parser.add_argument("--data", type=Path, default=DATA, help="where rows are kept")
    parser.add_argument("--render", action="store_true", help="only write the page")
    parser.add_argument("--show", type=int, metavar="SEED", help="write the picture and the script of a scene")
    parser.add_argument("--folder", type=Path, default=Path(), help="for --show")
    args = parser.parse_args(words)
    if args.show is not None:
        print(show(args.family[0], args.show, args.folder, args.device))
        return
    stored: list[Row] = json.loads(args.data.read_text(encoding="utf-8")) if args.data.exists() else []
    if not args.render:
        finer = args.device != "cpu" if args.finer is None else args.finer
        known = {(row["family"], row["seed"]) for row in stored if args.missing and is_known(row, finer)}
        tasks = [
            (family, seed, args.device, finer)
            for family in args.family
            for seed in range(args.seed, args.seed + (args.count or COUNTS[family]))
            if (family, seed) not in known and not (args.drawn and (family not in FAMILIES or seed % LOT))
        ]
        new: list[Row] = []
        for row in rows_of(tasks, args.processes, args.seconds):
            print(line(row), flush=True)
            new.append(row)
            write(merged(stored, new), args.data)
        stored = merged(stored, new)
        note(args.data, args.device)
    if args.data == DATA:
        write_page(stored, FOLDER / "random_scenes.md")
    print(tables(stored))


if __name__ == "__main__":
    main()
