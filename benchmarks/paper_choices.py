"""What the choices that the paper leaves open do to its figures: `python -m benchmarks.paper_choices --help`.

Runs `two_link` with other hinges, meshes, penalty factors, contact sides, elements and materials, and prints tables of
the first and the second peak of F_n, impulse, duration, F_t, and what of the waves passes the middle hinge.

    python -m benchmarks.paper_choices --group hinges converged plate choices --device cuda:0 --jobs 6 -o rows.json
    python -m benchmarks.paper_choices --rows rows.json     # only prints the tables of these rows
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

import warp_mca as mca

HINGES: dict[str, dict[str, Any]] = {
    "ends": {"joint_nodes": "ends"},
    "axis": {"joint_nodes": "axis"},
    "pin": {"joint_nodes": "pin"},
    "lug": {"hinge": "lug"},
}
FINER = {
    "section": 28,
    "ring": 9,
    "axial_OA": 85,
    "axial_AB": 80,
    "focus_size": 0.14e-3,
    "focus_layers": 14,
    "plate_core_x": 40,
    "plate_core_z": 28,
    "plate_core_depth": 11,
    "plate_layers": 21,
    "plate_extension": 40,
}
FILTERS = (5, 10, 20)  # means over so many microseconds


@dataclass(frozen=True)
class Case:
    """A run.

    Attributes:
        group: table that it belongs to.
        preset: of `two_link`, or "finer".
        changes: values of its parameters.
        element: of all bodies.
        refine: as `Scene.refine`.
    """

    group: str
    preset: str
    changes: dict[str, Any] = field(default_factory=dict)
    element: str = "hex8"
    refine: float = 1.0

    @property
    def label(self) -> str:
        """The options that make it."""
        words = [f"{key}={value}" for key, value in self.changes.items()]
        words += [f"element={self.element}"] if self.element != "hex8" else []
        return " ".join(words + ([f"--refine {self.refine:g}"] if self.refine != 1.0 else []))

    def scene(self) -> mca.Scene:
        """The scene."""
        finer = self.preset == "finer"
        changes = (FINER if finer else {}) | self.changes
        scene = mca.make_scene("two_link", preset="paper" if finer else self.preset, **changes)
        bodies = tuple(replace(body, element=self.element) for body in scene.bodies)  # pyright: ignore[reportArgumentType]
        return replace(scene, bodies=bodies, refine=self.refine)


def cases(presets: Sequence[str], finest: str) -> Iterator[Case]:
    """All runs on these presets; `finest` for hinges that have a limit."""
    stiff = {"penalty": 1.0}
    for preset in presets:
        for hinge in HINGES.values():
            yield Case("hinges", preset, hinge | stiff)
    for name in ("pin", "lug"):
        yield Case("converged", finest, HINGES[name] | stiff)
    for preset in presets:
        for hinge in HINGES.values():
            for penalty in (0.1, 1.0):
                for v_plate in (0.4, 0.6, 0.8, 1.0):
                    yield Case("plate", preset, hinge | {"penalty": penalty, "v_plate": v_plate})
        soft = {"penalty": 0.1}
        for hinge in HINGES.values():
            yield Case("choices", preset, hinge | soft)
        lug = HINGES["lug"]
        for change in (
            {"penalty": 0.05},
            {"penalty": 0.2},
            {"penalty": 0.3},
            {"penalty": 0.1, "two_way": True},
            {"penalty": 0.2, "two_way": True},
            {"penalty": 1.0, "two_way": True},
            {"penalty": 0.1, "rigid_inertia": "mesh"},
            {"penalty": 0.1, "beta": 1.0},
            {"penalty": 0.1, "plastic": False},
            {"penalty": 0.1, "mu": 0.1},
            {"penalty": 0.1, "mu": 1.5},
        ):
            yield Case("choices", preset, lug | change)
        yield Case("choices", preset, lug | soft, element="hex8r")
        yield Case("choices", preset, lug | soft, refine=0.86)


def _windowed(force: np.ndarray, count: int) -> float:
    """Greatest mean of `count` successive values."""
    sums = np.concatenate([[0.0], np.cumsum(force)])
    return float((sums[count:] - sums[:-count]).max() / count)


def _waves(result: mca.Result) -> dict[str, float]:
    """Greatest stress until 110 us, before the ground hinge answers, on either side of the middle hinge [MPa].

    Axial on the rods' axes, of bending half the difference of upper and lower side, both along the rods.
    """
    rows = result.time <= 110e-6
    upper, middle, lower = result.paths
    position, found = middle.position, {}
    for name, place, angle in (
        ("AB, middle", 0.105, result.summary["theta"][1]),
        ("AB, at A", 0.19, result.summary["theta"][1]),
        ("OA, at A", 0.23, result.summary["theta"][0]),
    ):
        along = np.array([-np.sin(angle), -np.cos(angle)])
        k = int(np.abs(position - place).argmin())

        def stress(path: mca.Path) -> np.ndarray:
            xx, yy, _, xy = np.moveaxis(path.stress[rows, k, :4], -1, 0)  # noqa: B023
            return xx * along[0] ** 2 + yy * along[1] ** 2 + 2.0 * xy * along[0] * along[1]  # noqa: B023

        found[f"axial {name}"] = float(np.abs(stress(middle)).max()) / 1e6
        found[f"bending {name}"] = float(np.abs(stress(upper) - stress(lower)).max()) / 2e6
    return found


def run(case: Case, device: str) -> dict[str, Any]:
    """Run a case and take its figures."""
    began = time.perf_counter()
    row: dict[str, Any] = {"group": case.group, "preset": case.preset, "label": case.label}
    row |= {"changes": case.changes, "element": case.element, "refine": case.refine}
    try:
        result = mca.run(case.scene(), device=device)
    except (mca.RequestError, mca.GuardError) as error:
        return row | {"stopped": str(error)}
    summary, force = result.summary, result["F_n_N"]
    return row | {
        "elements": summary["n_elements"],
        "steps": summary["n_steps"],
        "peaks": [[round(t * 1e6), round(value, 1)] for t, value in summary["F_n_peaks"]],
        "filtered": [round(_windowed(force, count), 1) for count in FILTERS],
        "impulse": round(float(force.sum()) * 1e-6, 6),
        "duration": summary["contact_duration"],
        "contacts": len(summary["contacts"]),
        "F_t": [round(float(result["F_t_N"].min()), 1), round(float(result["F_t_N"].max()), 1)],
        "strain": summary["max_plastic_strain"],
        "energy_error": summary["energy_error"],
        "waves": {name: round(value, 2) for name, value in _waves(result).items()},
        "force": [round(float(value), 1) for value in force],
        "wall": round(time.perf_counter() - began, 1),
    }


def table(rows: Sequence[dict[str, Any]]) -> str:
    """Rows as a Markdown table."""
    lines = [
        "| preset | `--set` | elements | F_n peaks [N] | at [us] | contact [ms] | impulse [N s] | F_t [N] | strain |"
    ]
    lines += ["|---|---|---|---|---|---|---|---|---|"]
    for row in rows:
        if "stopped" in row:
            lines += [f"| {row['preset']} | `{row['label']}` | {row['stopped']} | | | | | | |"]
            continue
        peaks, times = (", ".join(f"{peak[i]:.0f}" for peak in row["peaks"]) for i in (1, 0))
        F_t = f"{row['F_t'][0]:.0f} … {row['F_t'][1]:.0f}"
        lines += [
            f"| {row['preset']} | `{row['label']}` | {row['elements']:,} | {peaks} | {times} "
            f"| {1e3 * row['duration']:.3f} | {row['impulse']:.4f} | {F_t} | {row['strain']:.3f} |"
        ]
    return "\n".join(lines)


def main() -> None:
    """Run, print and store."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.paper_choices", description=__doc__.splitlines()[0])
    parser.add_argument("--group", nargs="+", default=["hinges"], help="hinges, converged, plate, choices")
    parser.add_argument("--preset", nargs="+", default=["quick"])
    parser.add_argument("--finest", default="paper", help="preset of the group converged, or finer")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="runs at a time")
    parser.add_argument("-o", "--output", type=Path, help="JSON lines are added to this file")
    parser.add_argument("--rows", type=Path, help="only print the tables of such a file")
    args = parser.parse_args()
    if args.rows:
        rows = [json.loads(line) for line in args.rows.read_text(encoding="utf-8").splitlines()]
        for group in dict.fromkeys(row["group"] for row in rows):
            print(f"\n{group}\n\n{table([row for row in rows if row['group'] == group])}")
        return
    wanted = [case for case in cases(args.preset, args.finest) if case.group in args.group]
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(args.jobs, mp_context=context) as pool:
        for done in as_completed([pool.submit(run, case, args.device) for case in wanted]):
            row = done.result()
            print(table([row]).splitlines()[-1], flush=True)
            if args.output:
                with args.output.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
