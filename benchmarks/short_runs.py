"""Short runs, batches and second runs: `python -m benchmarks.short_runs [--before CHECKOUT] [--parts batch] [-o FILE]`.

`python -m benchmarks.short_runs --parts many --scenes 256 --device cuda:0` takes the wall time of one whole batch.

What a run takes besides its steps, as processor time, because machines are shared: of whole commands, of a batch of
variants of `two_link` of which no two swings are equal, and of the second run in one process up to its first step. With
`--before`, a folder or a revision, that checkout is measured in turns with this one. Kernels are compiled before.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

from benchmarks.histories import ROOT, checkout
from benchmarks.measurements import note, processor_name

COMMAND = ("run", "two_link", "--set", "duration=2e-5", "--force", "--out")
SCENES = 8
VARIANTS = """
import json, sys, time
import numpy as np
import warp_mca as mca

def variants(count, seed):
    draw = np.random.default_rng(seed).uniform
    return [mca.make_scene("two_link", joint_nodes="pin", penalty=1.0, theta_OA=draw(85.0, 95.0),
            theta_AB=draw(85.0, 95.0), length=draw(0.205, 0.215), mu=draw(0.3, 0.6), v_plate=draw(-1.0, 1.0))
            for _ in range(count)]
"""
SCRIPT = f"""{VARIANTS}
def batch(scenes):
    begun = time.process_time()
    mca.run_batch(scenes, refine=2 / 3, duration=1e-6)
    return (time.process_time() - begun) / len(scenes)

def to_first_step(scene):
    first, begun = [], time.process_time()
    def told(stage, share):
        if stage == "impact":
            first.append(time.process_time())
    mca.run(scene, duration=2e-6, progress=told)
    return first[0] - begun

batch(variants(2, 0))
by_scene = batch(variants({SCENES}, 1))
one, other = (mca.make_scene("two_link", theta_OA=angle) for angle in (90.0, 91.0))
to_first_step(one)
known = min(to_first_step(one) for _ in range(3))
print(json.dumps(dict(batch=by_scene, known=known, new=to_first_step(other))))
"""
MANY = f"""{VARIANTS}
count, device = int(sys.argv[1]), sys.argv[2]
mca.run_batch(variants(count, 0), refine=2 / 3, duration=2e-6, device=device)  # loads kernels, begins helpers
scenes = variants(count, 1)
begun = time.perf_counter()
mca.run_batch(scenes, refine=2 / 3, device=device)
print(json.dumps(dict(many=(time.perf_counter() - begun) / count)))
"""
WHAT = {
    "figures": "command `two_link`, `quick`, 20 µs of impact",
    "none": "the same with `--figures none`",
    "batch": f"scene in a batch of {SCENES}, impact of 1 µs included",
    "new": "second run in a process to its first step, another swing",
    "known": "the same, the swing known, least of three",
    "many": "wall time of a scene of one batch, whole impact",
}
PARTS = ("batch", "commands", "many")
Times = dict[str, float]


def command(folder: Path, *more: str) -> float:
    """Processor time of a whole command of a checkout [s]."""
    with tempfile.TemporaryDirectory() as out:
        before = os.times()
        run(folder, ["-m", "warp_mca", *COMMAND, f"{out}/it", *more])
        after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def run(folder: Path, words: Sequence[str]) -> str:
    """What Python prints with these words, `warp_mca` being that of a checkout.

    Raises:
        SystemExit: it fails; says why.
    """
    env = {**os.environ, "PYTHONPATH": str(folder)}
    done = subprocess.run([sys.executable, "-P", *words], cwd=folder, env=env, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{folder}: {done.stderr}")
    return done.stdout


def once(folder: Path, parts: Sequence[str], many: Sequence[str]) -> Times:
    """Times of a checkout, measured once [s]; `many`: number of scenes and device of that part."""
    found: Times = {}
    if "batch" in parts:
        found |= json.loads(run(folder, ["-c", SCRIPT]).splitlines()[-1])
    if "commands" in parts:
        found |= {"figures": command(folder), "none": command(folder, "--figures", "none")}
    if "many" in parts:
        found |= json.loads(run(folder, ["-c", MANY, *many]).splitlines()[-1])
    return found


def lines(data: dict) -> list[list[str]]:
    """Of the table: what was measured, medians [s], and their ratio where there are two."""
    found = []
    measured = next(iter(data["short"].values()))[0]
    for key, what in ((key, what) for key, what in WHAT.items() if key in measured):
        medians = [statistics.median(row[key] for row in data["short"][name]) for name in data["short"]]
        ratio = [f"{medians[-1] / medians[0]:.2f}"] if len(medians) > 1 else []
        found.append([what, *(f"{1e3 * value:,.0f}" for value in medians), *ratio])
    return found


def head(data: dict) -> list[str]:
    """Of the table."""
    names = list(data["short"])
    return ["ms", *names, *(["ratio"] if len(names) > 1 else [])]


def main(words: list[str] | None = None) -> dict:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.short_runs", description=__doc__.splitlines()[0])
    parser.add_argument("--before", help="folder of a checkout, or a revision, to measure in turns with this one")
    parser.add_argument("--repeats", type=int, default=4)
    parser.add_argument("--parts", nargs="+", default=list(PARTS[:2]), choices=PARTS)
    parser.add_argument("--scenes", type=int, default=256, help="of the part many (default: %(default)s)")
    parser.add_argument("--device", default="cpu", help="of the part many (default: %(default)s)")
    parser.add_argument("-o", "--output", type=Path, help="JSON file for the times")
    args = parser.parse_args(words)
    names = {"before": args.before, "after": str(ROOT)} if args.before else {"now": str(ROOT)}
    times: dict[str, list[Times]] = {name: [] for name in names}
    data = {"name": processor_name(), "scenes": SCENES, "short": times}
    with ExitStack() as stack:
        folders = {name: stack.enter_context(checkout(place)) for name, place in names.items()}
        for _ in range(args.repeats):
            for name, folder in folders.items():
                times[name].append(once(folder, args.parts, (str(args.scenes), args.device)))
            for line in [head(data), *lines(data)]:
                print(" | ".join(line), flush=True)
            if args.output:
                args.output.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
                note(args.output, "cpu")
    return data


if __name__ == "__main__":
    main()
