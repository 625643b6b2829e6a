"""What recording costs: `python -m benchmarks.recording [--device cuda:0] [--preset paper] [--models DIR] [--pairs N]`.

Runs the two-link impact in pairs, with and without 100 frames to rerun and USD, and prints the ratios of wall times and
of processor times; the latter depend less on what else the machine does.
"""

from __future__ import annotations

import argparse
import json
import statistics
import tempfile
import time
from pathlib import Path

import warp_mca as mca
from warp_mca.recorders import Cadence, RerunStream, UsdFile, VtkHdfFile
from warp_mca.scene import model_file as scene_file

KINDS = {
    "rerun": lambda folder, cadence: [RerunStream(folder / "a.rrd", cadence=cadence)],
    "usd": lambda folder, cadence: [UsdFile(folder / "a.usdc", cadence=cadence)],
    "rerun+usd": lambda folder, cadence: [
        RerunStream(folder / "a.rrd", cadence=cadence),
        UsdFile(folder / "a.usdc", cadence=cadence),
    ],
    "vtkhdf": lambda folder, cadence: [VtkHdfFile(folder / "a.vtkhdf", cadence=cadence)],
}


def run(
    scene: mca.Scene, meshes: dict[str, mca.Mesh], device: str, recorders: list, duration: float | None = None
) -> tuple[float, float, mca.Result]:
    """Wall time of the impact phase and of closing the recorders, processor time of the run [s], and the result."""
    begun = time.process_time()
    result = mca.run(scene, device=device, meshes=meshes, recorders=recorders, duration=duration)
    wall = result.summary["wall"]
    return wall["fe"] + wall["output"], time.process_time() - begun, result


def measure(args: argparse.Namespace) -> dict[str, object]:
    """Ratios of paired runs for each kind of recording."""
    if args.models:
        stored = scene_file.load(args.models / f"{args.preset}.mca")
        scene, meshes = stored.scene, stored.meshes
    else:
        scene = mca.make_scene("two_link", preset=args.preset)
        meshes = mca.mesh(scene)
    table: dict[str, object] = {}
    for name in args.kinds:
        with tempfile.TemporaryDirectory() as folder:  # fills the kernel cache and imports what recorders need
            run(scene, meshes, args.device, KINDS[name](Path(folder), Cadence(frames=2)), args.duration)
        ratios, shares, plain, sizes = [], [], [], {}
        for _ in range(args.pairs):
            with tempfile.TemporaryDirectory() as folder:
                before, cpu_before, one = run(scene, meshes, args.device, [], args.duration)
                recorders = KINDS[name](Path(folder), Cadence(frames=args.frames))
                after, cpu_after, other = run(scene, meshes, args.device, recorders, args.duration)
                assert all((one[c] == other[c])[1:].all() for c in ("F_n_N", "F_t_N", "E_kinetic"))
                assert not [w for w in other.warnings if "recording" in w], other.warnings
                ratios.append(after / before)
                shares.append(cpu_after / cpu_before)
                plain.append(before)
                sizes = {file.suffix: file.stat().st_size / args.frames for file in Path(folder).iterdir()}
        table[name] = {
            "ratio": statistics.median(ratios),
            "ratios": ratios,
            "processor_ratio": statistics.median(shares),
            "processor_ratios": shares,
            "wall_without_s": statistics.median(plain),
            "bytes_per_frame": sizes,
        }
        print(name, json.dumps(table[name]), flush=True)
    return table


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--preset", default="quick")
    parser.add_argument("--models", type=Path, help="folder of PRESET.mca, where there is no gmsh")
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--duration", type=float, help="of the impact phase [s]")
    parser.add_argument("--kinds", nargs="+", default=["rerun+usd"], choices=list(KINDS))
    args = parser.parse_args()
    begun = time.perf_counter()
    measure(args)
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
