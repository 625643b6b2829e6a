"""Owns what damping and general contact cost: a step with bulk viscosity, and one of contacts="all", in turns.

python -m benchmarks.contact_costs --preset paper --device cuda:0
"""

from __future__ import annotations

import argparse
from itertools import combinations
from statistics import median

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
SPEED, GAP, EDGE = 5.0, 1e-5, 0.01
BOXES = 20


def struck(preset: str, viscosity: float, duration: float) -> mca.Scene:
    """The arm that strikes a plate."""
    return mca.make_scene("two_link", preset=preset, bulk_viscosity=viscosity, duration=duration)


def row_of(bodies: int, cells: int, listed: bool, duration: float) -> mca.Scene:
    """Boxes in a row, the first of which flies at the others, with contact of each pair or of all."""
    box = mca.Box(size=(EDGE, EDGE, EDGE), divisions=(cells, cells, cells))
    boxes = tuple(
        mca.Body(
            name=f"box{k}",
            geometry=box,
            material=STEEL,
            position=(k * (EDGE + GAP), 0.0, 0.0),
            velocity=(0.0 if k else SPEED, 0.0, 0.0),
        )
        for k in range(bodies)
    )
    skins = [mca.Surface(body=body.name, nodes="boundary") for body in boxes]
    pairs = tuple(mca.Contact(slave=a, master=b, two_way=True) for a, b in combinations(skins, 2))
    impact = mca.ImpactPhase(duration=duration, output_interval=duration / 100.0)
    return mca.Scene(name="row", bodies=boxes, contacts=pairs if listed else "all", impact=impact)


def measure(scenes: dict[str, mca.Scene], device: str, turns: int) -> dict[str, tuple[float, int]]:
    """Of each scene the median time of a step [s], of runs in turns after one that compiles, and its steps."""
    seconds: dict[str, list[float]] = {name: [] for name in scenes}
    steps = {}
    for turn in range(turns + 1):
        for name, scene in scenes.items():
            summary = mca.run(scene, device=device).summary
            steps[name] = summary["n_steps"]
            if turn:
                seconds[name].append(summary["wall"]["fe"] / summary["n_steps"])
    return {name: (median(seconds[name]), steps[name]) for name in scenes}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.contact_costs", description="Damping, general contact.")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--preset", default="quick")
    parser.add_argument("--cells", type=int, default=4, help="of a box along an edge")
    parser.add_argument("--duration", type=float, default=3e-4, help="of two_link [s]; of boxes a tenth")
    parser.add_argument("--turns", type=int, default=3)
    args = parser.parse_args()
    for scenes in (
        {f"c1 = {c}": struck(args.preset, c, args.duration) for c in (0.0, 0.06)},
        {name: row_of(BOXES, args.cells, name == "pairs", 0.1 * args.duration) for name in ("pairs", "all")},
    ):
        found = measure(scenes, args.device, args.turns)
        (first, second), (before, after) = found, found.values()
        print(f"{first}: {1e6 * before[0]:.1f} us a step, {before[1]} steps")
        print(f"{second}: {after[0] / before[0]:.3f} of that, {after[1] / before[1]:.3f} of the steps")


if __name__ == "__main__":
    main()
