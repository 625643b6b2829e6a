"""Table 2, ours: `python -m benchmarks.pure_fem [SCENE] [--preset NAME] [--set KEY=VALUE] --out DIR`.

Runs a scene three ways to the same time after its release, and compares what comes of it and what it costs: finite
elements from the release on; rigid links until the touch, then finite elements; the same with an impact that ends when
its contacts have been open for a while, for several such times. Writes pure_fem.json; the run of finite elements alone
goes on in DIR/pure after an interruption.

    python -m benchmarks.pure_fem two_link --preset paper --set joint_nodes=axis --set penalty=1 --device cuda:0 --out t
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import warp_mca as mca
from warp_mca.base.files import write_atomically
from warp_mca.runs.checkpoint import METHOD
from warp_mca.scene.catalogue import parse_overrides
from warp_mca.scene.options import with_options

PAPER = {"F_n_first_peak": (3235.26, 3285.38), "configuration_error": 0.005, "cost_ratio": 0.00705}  # Table 2, 3.2
FIGURES = ("t_contact", "v_n", "v_t", "F_n_first_peak", "F_n_peaks", "F_n_max", "contact_duration", "contacts")
FACTS = ("n_elements", "n_steps", "dt", "simulated_time", "energy_error", "device", "precision", "version")


def row(result: mca.Result, scene: mca.Scene) -> dict[str, Any]:
    """Figures of a run of a scene, and what its phases cost [s]."""
    s = result.summary
    found = {key: s[key] for key in (*FIGURES, *FACTS)}
    found["impulse"] = float(result.F_n.sum()) * scene.impact.output_interval  # there is none in a swing's rows
    cost = {"before": s["wall"]["rigid"], "impact": s["wall"]["fe"]}
    if s.get("method") == METHOD:
        cost = {"before": s["phases"][0]["wall"], "impact": s["phases"][1]["wall"]}
    return {**found, "cost": {**cost, "total": sum(cost.values())}, "wall": s["wall"]}


def compared(first: dict[str, Any], second: dict[str, Any]) -> dict[str, float]:
    """Ratios of the first run over the second, and by how much the touch differs [s]."""
    keys = ("v_n", "v_t", "F_n_first_peak", "impulse", "contact_duration")
    found = {key: first[key] / second[key] for key in keys if first[key] is not None and second[key]}
    found |= {f"cost_{key}": first["cost"][key] / second["cost"][key] for key in ("before", "impact", "total")}
    return found | {"t_contact_difference": first["t_contact"] - second["t_contact"]}


def measure(
    scene: mca.Scene, end: float, open_times: Sequence[float], out: Path, settings: dict[str, Any]
) -> dict[str, Any]:
    """Run a scene all ways until `end` [s]."""
    meshes = mca.mesh(scene)
    kept = out / "pure"
    first = mca.run(scene, meshes=meshes, duration=2.0 * scene.impact.output_interval, **settings)  # compiles, and
    span = end - first.summary["t_contact"]  # says how long the impact may last
    if span <= 0.0:
        raise mca.RequestError(f"--end = {end:g}: links touch at {first.summary['t_contact']:g} s; give a later one")
    span = round(span / scene.impact.output_interval) * scene.impact.output_interval
    done = (kept / "summary.json").exists()
    pure = (
        mca.load(kept)
        if done
        else mca.run(scene, meshes=meshes, duration=span, method=METHOD, out=kept, checkpoint="30w", **settings)
    )
    found: dict[str, Any] = {"pure": row(pure, scene)}
    found["configuration_error"] = pure.summary["configuration_error"]
    found["configuration"] = pure.summary["configuration"]
    two = row(mca.run(scene, meshes=meshes, duration=span, **settings), scene)
    found["mca"] = {**two, "ratio": compared(two, found["pure"])}
    found["event"] = []
    for open_time in open_times:
        ended = replace(scene, t_end=end, impact=replace(scene.impact, open_time=open_time))
        result = mca.run(ended, meshes=meshes, duration=span, **settings)
        event = row(result, scene)
        event["phases"] = [{k: p[k] for k in ("kind", "start", "end", "ended_by")} for p in result.summary["phases"]]
        found["event"].append({"open_time": open_time, **event, "ratio": compared(event, found["pure"])})
    return found


def main() -> None:
    """Measure, write and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.pure_fem", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("scene", nargs="?", default="two_link")
    parser.add_argument("--preset", default=None)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--refine", type=float, default=None)
    parser.add_argument("--end", type=float, default=0.261, help="of the runs, from the release [s]")
    parser.add_argument("--open-time", type=float, nargs="+", default=[2.5e-4, 5e-4, 1e-3], help="ends an impact [s]")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--precision", default="float64", choices=["mixed", "float64"])
    parser.add_argument("--threads", type=int, default=None)
    parser.add_argument("--multi-rate", default=None, type=lambda text: int(text) if text.isdigit() else text)
    parser.add_argument("--out", type=Path, required=True)
    args = parser.parse_args()
    changes: dict[str, Any] = {"rigid_inertia": "mesh", **parse_overrides(args.set)}
    scene = with_options(mca.make_scene(args.scene, preset=args.preset, **changes), args.refine, None, None)
    settings = {key: getattr(args, key) for key in ("device", "precision", "threads", "multi_rate")}
    found = {"scene": args.scene, "preset": args.preset, "refine": args.refine, "set": changes, "paper": PAPER}
    args.out.mkdir(parents=True, exist_ok=True)
    found |= measure(scene, args.end, args.open_time, args.out, settings)
    text = json.dumps(found, indent=1) + "\n"
    write_atomically(args.out / "pure_fem.json", lambda file: file.write(text.encode()))
    print_table(found)


def print_table(found: dict[str, Any]) -> None:
    """A line for each figure: finite elements alone, multi-timescale, and with each open time."""
    columns = {METHOD: found["pure"], "mca": found["mca"]}
    columns |= {f"open {1e3 * item['open_time']:g} ms": item for item in found["event"]}
    print(f"{'':>18}" + "".join(f"{name:>14}" for name in columns))
    for key in ("t_contact", "v_n", "v_t", "F_n_first_peak", "impulse", "contact_duration", "n_steps"):
        print(f"{key:>18}" + "".join(f"{item[key] or 0.0:14.6g}" for item in columns.values()))
    for key in ("before", "impact", "total"):
        print(f"{f'cost {key} [s]':>18}" + "".join(f"{item['cost'][key]:14.4g}" for item in columns.values()))
    for key in ("F_n_first_peak", "cost_total"):
        ratios = [1.0, *(item["ratio"].get(key, 0.0) for item in (found["mca"], *found["event"]))]
        print(f"{f'ratio {key}':>18}"[:18] + "".join(f"{ratio:14.4%}" for ratio in ratios))
    print(f"configuration error before the touch: {found['configuration_error']:.2g} (paper: under 0.005)")


if __name__ == "__main__":
    main()
