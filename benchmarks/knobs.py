"""Owns the table of what options save and what they cost: runs of `two_link` with and without each of them.

python -m benchmarks.knobs --device cuda:0 --preset paper -o docs/measurements/performance.cuda.json

Each row is one run, compared with the first: wall time of its impact phase, and the change of each figure. Runs take
turns with the first one on one device, which should do nothing else. Rows of a preset replace its earlier ones.
"""

from __future__ import annotations

import argparse
import json
import statistics
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import warp_mca as mca
from benchmarks.measurements import note
from warp_mca.scene.catalogue import load_source
from warp_mca.scene.options import with_options

# Springs and hinges whose answers converge with the mesh, of which every row differs by one option.
BASE: dict[str, Any] = {"penalty": 1.0, "joint_nodes": "pin"}
FIGURES = ("first peak", "second peak", "impulse", "contact")


@dataclass(frozen=True)
class Knob:
    """What a row changes.

    Attributes:
        name: in the table.
        values: parameters of the scene.
        refine, mass_scaling: as in `Scene` and `ImpactPhase`.
        options: of `warp_mca.run`.
    """

    name: str
    values: Mapping[str, Any] = field(default_factory=dict)
    refine: float | None = None
    mass_scaling: float | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


COARSE_LINK = {"axial_OA": 8}
CUT = {"plate_absorbs": "ends", "plate_length": 0.1, "plate_extension": 3}
# Cells across and at the contact as in `quick`; along the rods as many as pins need.
BY_HAND = {
    "section": 6,
    "ring": 3,
    "axial_OA": 41,
    "axial_AB": 38,
    "focus_size": 0.45e-3,
    "focus_layers": 5,
    "plate_core_x": 10,
    "plate_core_z": 6,
    "plate_core_depth": 3,
    "plate_layers": 8,
    "plate_extension": 14,
}
FINEST = {
    "section": 36,
    "ring": 12,
    "axial_OA": 110,
    "axial_AB": 104,
    "focus_size": 0.1e-3,
    "focus_layers": 18,
    "plate_core_x": 52,
    "plate_core_z": 36,
    "plate_core_depth": 15,
    "plate_layers": 27,
    "plate_extension": 52,
}
# Fewer cells along the rods than pins of this radius resolve; then fewer across them and at the contact, too.
SMALL = {**BY_HAND, "axial_OA": 24, "axial_AB": 22}
SMALLEST = {**SMALL, "section": 4, "ring": 2, "focus_size": 0.6e-3, "focus_layers": 4}
CHEAP = {**BY_HAND, **CUT, "fine_length": 0.027, "rod_section": 4, "rod_ring": 2}
KNOBS = (
    Knob("none of them"),
    Knob("`--refine 0.7`", refine=0.7),
    Knob("`--mass-scaling 1.5`", mass_scaling=1.5),
    Knob("`--mass-scaling 2`", mass_scaling=2.0),
    Knob("`--multi-rate auto`", options={"multi_rate": "auto"}),
    Knob("`--multi-rate auto --mass-scaling 1.5`", mass_scaling=1.5, options={"multi_rate": "auto"}),
    Knob("far link coarser, `axial_OA=8`", COARSE_LINK),
    Knob("far link rigid, `rigid_bodies=OA`", {"rigid_bodies": "OA"}),
    Knob("plate of 0.1 m with absorbing ends", CUT),
    Knob("fine end of 27 mm tied to coarse rods", {"fine_length": 0.027, "rod_section": 6, "rod_ring": 3}),
    Knob("hinge, `joint_nodes=ends`", {"joint_nodes": "ends"}),
    Knob("hinge, `joint_nodes=axis`", {"joint_nodes": "axis"}),
    Knob("softer springs, `penalty=0.1`", {"penalty": 0.1}),
    Knob("springs chosen, `penalty=auto`", {"penalty": "auto"}),
    Knob("mesh by hand", BY_HAND),
    Knob("mesh by hand, `--multi-rate auto`", BY_HAND, options={"multi_rate": "auto"}),
    Knob("mesh by hand, `--mass-scaling 2`", BY_HAND, mass_scaling=2.0),
    Knob("small mesh, `--mass-scaling 2`", SMALL, mass_scaling=2.0),
    Knob("small mesh, `--multi-rate auto --mass-scaling 2`", SMALL, None, 2.0, {"multi_rate": "auto"}),
    Knob("smallest mesh, `--mass-scaling 2`", SMALLEST, mass_scaling=2.0),
    Knob("smallest mesh, `--multi-rate auto --mass-scaling 2`", SMALLEST, None, 2.0, {"multi_rate": "auto"}),
    Knob("mesh by hand, tied coarse rods, short plate", CHEAP),
    Knob("mesh by hand, tied coarse rods, short plate, `--multi-rate auto`", CHEAP, options={"multi_rate": "auto"}),
)


def measure(knob: Knob, preset: str, device: str, duration: float, repeats: int) -> dict[str, Any]:
    """Figures of a knob's run, and the median wall time of its impact phase [s]."""
    source = load_source("two_link")
    values = {**source.resolve(preset), **BASE, "duration": duration, **knob.values}
    scene = with_options(source.build(values), knob.refine, knob.mass_scaling, None)
    meshes = mca.mesh(scene)
    wall, result = [], None
    for _ in range(repeats):
        result = mca.run(scene, device=device, threads=1, meshes=meshes, **knob.options)
        wall.append(result.summary["wall"]["fe"])
    assert result is not None
    summary = result.summary
    peaks = [peak for _, peak in summary["F_n_peaks"]]
    interval = scene.impact.output_interval
    return {
        "knob": knob.name,
        "preset": preset,
        "duration": duration,
        "wall": statistics.median(wall),
        "elements": summary["n_elements"],
        "steps": summary["n_steps"],
        "rate_groups": summary.get("rate_groups"),
        "first peak": peaks[0] if peaks else 0.0,
        "second peak": peaks[1] if len(peaks) > 1 else None,
        "impulse": float(result.history["F_n_N"].sum() * interval),
        "contact": summary["contact_duration"],
        "max_plastic_strain": summary["max_plastic_strain"],
        "energy_error": summary["energy_error"],
    }


def _change(row: Mapping[str, Any], first: Mapping[str, Any], name: str) -> str:
    if not row[name] or not first[name]:
        return "none"
    return f"{100.0 * (row[name] / first[name] - 1.0):+.1f} %"


def lines(rows: list[dict[str, Any]]) -> list[list[str]]:
    """Cells of the table of one device, preset by preset; the first row of each has absolute figures."""
    found = []
    for preset in dict.fromkeys(row["preset"] for row in rows):
        mine = [row for row in rows if row["preset"] == preset]
        first = mine[0]
        absolute = [f"{first['first peak']:,.0f} N", f"{first['second peak'] or 0.0:,.0f} N"]
        absolute += [f"{first['impulse']:.4f} N s", f"{1e3 * first['contact']:.3f} ms"]
        for row in mine:
            changes = absolute if row is first else [_change(row, first, name) for name in FIGURES]
            cells = [preset, row["knob"], f"{row['elements']:,}", f"{row['steps']:,}", f"{row['wall']:.3g}"]
            cells += [f"{first['wall'] / row['wall']:.2f}", *changes]
            found.append([*cells, f"{row['max_plastic_strain']:.3f}", f"{row['energy_error']:.1e}"])
    return found


HEAD = ["preset", "option", "elements", "steps", "time [s]", "times faster", *FIGURES, "plastic strain", "energy error"]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.knobs", description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--preset", default="quick")
    parser.add_argument("--duration", type=float, default=0.6e-3, help="of the impact phase [s]")
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--only", nargs="+", default=[], help="parts of names of options; the first row is always run")
    parser.add_argument("-o", "--output", type=Path, help="JSON file that rows are added to")
    parser.add_argument("--finest", action="store_true", help="compare with the finest mesh, of 978,000 elements")
    args = parser.parse_args()
    rows = []
    for knob in [Knob("none, finest mesh", FINEST), *KNOBS] if args.finest else KNOBS:
        if not rows or not args.only or any(part in knob.name for part in args.only):
            rows.append(measure(knob, args.preset, args.device, args.duration, args.repeats))
            print(" | ".join(lines(rows)[-1]), flush=True)
            if args.output:
                data = json.loads(args.output.read_text(encoding="utf-8")) if args.output.exists() else {}
                others = [row for row in data.get("knobs", []) if row["preset"] != args.preset]
                data["knobs"] = others + rows
                args.output.write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")
                note(args.output, args.device)


if __name__ == "__main__":
    main()
