"""What a batch saves: `python -m benchmarks.batch [--device cuda:0] [--scenes 1,2,4,8,16] [--models DIR] [-o FILE]`.

Runs the two-link impact with as many speeds of the plate as scenes, one after the other and then in batches of them,
and prints the wall time of both. Models come from `--models DIR` as in `benchmarks.results` where gmsh is not. On a
CPU a batch saves nothing: one scene keeps the cores busy.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path

import numpy as np

import warp_mca as mca
from warp_mca.geometry.mesh import Mesh
from warp_mca.scene import model_file as scene_file

Sweep = tuple[list[mca.Scene], list[Mapping[str, Mesh]]]


def sweep(preset: str, count: int, models: Path | None) -> Sweep:
    """Scenes whose plates move at 0, 0.1, 0.2, … m/s, and the meshes that they share."""
    speeds = [0.1 * k for k in range(count)]
    if models:
        stored = scene_file.load(models / f"{preset}.mca")
        scenes = [scene_file.changed(stored, {"v_plate": v}).scene for v in speeds]
        return scenes, [stored.meshes] * count
    scenes = [mca.make_scene("two_link", preset=preset, v_plate=v) for v in speeds]
    return scenes, [mca.mesh(scenes[0])] * count


def alone(scenes: Sweep, options: Mapping) -> list[tuple[float, float, mca.Result]]:
    """Wall time of the impact phase and of the whole run [s] of each scene, and its result."""
    found = []
    for scene, meshes in zip(*scenes, strict=True):
        begun = time.perf_counter()
        result = mca.run(scene, meshes=meshes, **options)
        found.append((result.summary["wall"]["fe"], time.perf_counter() - begun, result))
    return found


def measure(scenes: Sweep, counts: list[int], options: Mapping) -> list[dict[str, object]]:
    """A row for each number of scenes."""
    mca.run(scenes[0][0], meshes=scenes[1][0], **options)  # compiles
    single = alone(scenes, options)
    rows = []
    for count in counts:
        part = [items[:count] for items in scenes]
        mca.run_batch(part[0], meshes=part[1], **{**options, "duration": 1e-6})  # compiles
        begun = time.perf_counter()
        results = mca.run_batch(part[0], meshes=part[1], **options)
        whole = time.perf_counter() - begun
        pairs = list(zip(results, (result for _, _, result in single), strict=False))
        row: dict[str, object] = {
            "scenes": count,
            "elements": sum(result.summary["n_elements"] for result in results),
            "steps": results[0].summary["n_steps"],
            "impact_alone": sum(fe for fe, _, _ in single[:count]),
            "impact_batch": results[0].summary["wall"]["fe"],
            "whole_alone": sum(all_ for _, all_, _ in single[:count]),
            "whole_batch": whole,
            "same": all(np.array_equal(a[c], b[c], equal_nan=True) for a, b in pairs for c in a.history),
        }
        rows.append(row)
        print(line(row), flush=True)
    return rows


HEAD = (
    "| scenes | elements | impact phase, one by one [s] | in a batch [s] | ratio | whole runs, one by one [s] "
    "| in a batch [s] | ratio | same histories |\n|---|---|---|---|---|---|---|---|---|"
)


def line(row: Mapping) -> str:
    """Of the table."""
    cells = [f"{row['scenes']}", f"{row['elements']:,}"]
    for part in ("impact", "whole"):
        one, batch = row[f"{part}_alone"], row[f"{part}_batch"]
        cells += [f"{one:.2f}", f"{batch:.2f}", f"{one / batch:.2f}"]
    return f"| {' | '.join(cells)} | {'bit for bit' if row['same'] else 'no'} |"


def main(words: list[str] | None = None) -> list[dict[str, object]]:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.batch", description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--scenes", default="1,2,4,8,16", help="numbers of scenes, separated by commas")
    parser.add_argument("--preset", default="quick")
    parser.add_argument("--precision", default="mixed", choices=("mixed", "float64"))
    parser.add_argument("--duration", type=float, help="of the impact phase [s]")
    parser.add_argument("--models", type=Path, help="folder of built models, one for each preset")
    parser.add_argument("-o", "--output", type=Path, help="JSON file for the rows")
    args = parser.parse_args(words)
    counts = [int(word) for word in args.scenes.split(",")]
    print(HEAD)
    options = {"device": args.device, "precision": args.precision, "duration": args.duration}
    rows = measure(sweep(args.preset, max(counts), args.models), counts, options)
    if args.output:
        args.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return rows


if __name__ == "__main__":
    main()
