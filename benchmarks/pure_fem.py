"""Table 2, ours: `python -m benchmarks.pure_fem [SCENE] [--preset NAME] [--set KEY=VALUE] --out DIR`.

Runs a scene both ways, finite elements from the release on and rigid links until the touch, as
`warp-mca paper --pure-fem` does, and prints what comes of it and what it costs. Writes pure_fem.json; the same command
goes on after an interruption.

    python -m benchmarks.pure_fem two_link --preset paper --set joint_nodes=axis --set penalty=1 --device cuda:0 --out t
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import warp_mca as mca
from warp_mca.paper.table_2 import HEAD, OPEN_TIMES, compare, table_rows
from warp_mca.scene.catalogue import parse_overrides
from warp_mca.scene.options import with_options


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pure_fem", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="?", default="two_link")
    parser.add_argument("--preset", default=None)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--refine", type=float, default=None)
    parser.add_argument("--duration", type=float, default=5e-3, help="of the runs, after the touch [s]")
    parser.add_argument("--open-time", type=float, nargs="+", default=OPEN_TIMES, help="ends an impact [s]")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--precision", default="float64", choices=["mixed", "float64"])
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--multi-rate", default=None, type=lambda text: int(text) if text.isdigit() else text)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    changes: dict[str, Any] = {"rigid_inertia": "mesh", "duration": args.duration, **parse_overrides(args.set)}
    scene = with_options(mca.make_scene(args.scene, preset=args.preset, **changes), args.refine, None, None)
    settings = {key: getattr(args, key) for key in ("device", "precision", "threads", "multi_rate")}
    found = compare(scene, args.out, open_times=args.open_time, **settings)
    for cells in (HEAD, *table_rows(found)):
        print(f"{cells[0]:<42}" + "".join(f"{cell:>20}" for cell in cells[1:]))
    print(f"configuration error before the touch: {found['configuration_error']:.2g} of the links' length")


if __name__ == "__main__":
    main()
