"""What the choices that the paper leaves open do to its figures: `python -m benchmarks.paper_choices --help`.

Runs `two_link` with other hinges, meshes, penalty factors, contact sides, elements and materials, and prints tables of
the first and the second peak of F_n, impulse, duration, F_t and plastic strain; JSON also has the peak of means of F_n
over 5, 10 and 20 us.

    python -m benchmarks.paper_choices --group hinges plate choices --mesh paper --device cuda:0 --jobs 6 -o rows.json
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
MESHES: dict[str, tuple[str, dict[str, Any]]] = {  # preset and changes
    "quick": ("quick", {}),
    "0.45mm": ("quick", {"section": 8, "axial_OA": 20, "axial_AB": 20, "focus_size": 0.45e-3, "focus_layers": 5}),
    "standard": ("standard", {}),
    "paper": ("paper", {}),
    "finer": (
        "paper",
        {
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
        },
    ),
}
FILTERS = (5, 10, 20)  # means over so many microseconds


@dataclass(frozen=True)
class Case:
    """A run.

    Attributes:
        group: table that it belongs to.
        mesh: name of one of MESHES.
        changes: values of its parameters.
        element: of all bodies.
        refine: as `Scene.refine`.
    """

    group: str
    mesh: str
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
        preset, cells = MESHES[self.mesh]
        scene = mca.make_scene("two_link", preset=preset, **cells | self.changes)
        bodies = tuple(replace(body, element=self.element) for body in scene.bodies)  # pyright: ignore[reportArgumentType]
        return replace(scene, bodies=bodies, refine=self.refine)


def cases(mesh: str) -> Iterator[Case]:
    """All runs on a mesh."""
    soft, both = {"penalty": 0.1}, {"penalty": 0.2, "two_way": True}
    for hinge in HINGES.values():
        yield Case("hinges", mesh, hinge | {"penalty": 1.0})
        for v_plate in (0.4, 0.6, 0.8, 1.0):
            yield Case("plate", mesh, hinge | {"penalty": 1.0, "v_plate": v_plate})
        for springs in (soft, both):
            yield Case("choices", mesh, hinge | springs)
            for change in ({"v_plate": 0.4}, {"v_plate": 0.8}, {"mu": 0.1}, {"mu": 1.5}):
                yield Case("choices", mesh, hinge | springs | change)
    lug = HINGES["lug"] | soft
    for change in ({"two_way": True}, {"rigid_inertia": "mesh"}, {"beta": 1.0}, {"plastic": False}):
        yield Case("others", mesh, lug | change)
    yield Case("others", mesh, lug, element="hex8r")
    yield Case("others", mesh, lug, refine=0.86)


def _windowed(force: np.ndarray, count: int) -> float:
    """Greatest mean of `count` successive values."""
    sums = np.concatenate([[0.0], np.cumsum(force)])
    return float((sums[count:] - sums[:-count]).max() / count)


def run(case: Case, device: str) -> dict[str, Any]:
    """Run a case and take its figures."""
    began = time.perf_counter()
    row: dict[str, Any] = {"group": case.group, "mesh": case.mesh, "label": case.label}
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
            lines += [f"| {row['mesh']} | `{row['label']}` | {row['stopped']} | | | | | | |"]
            continue
        peaks, times = (", ".join(f"{peak[i]:.0f}" for peak in row["peaks"]) for i in (1, 0))
        F_t = f"{row['F_t'][0]:.0f} … {row['F_t'][1]:.0f}"
        lines += [
            f"| {row['mesh']} | `{row['label']}` | {row['elements']:,} | {peaks} | {times} "
            f"| {1e3 * row['duration']:.3f} | {row['impulse']:.4f} | {F_t} | {row['strain']:.3f} |"
        ]
    return "\n".join(lines)


def main() -> None:
    """Run, print and store."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.paper_choices", description="Choices that the paper leaves open."
    )
    parser.add_argument("--group", nargs="+", default=["hinges"], choices=["hinges", "plate", "choices", "others"])
    parser.add_argument("--mesh", nargs="+", default=["quick"], choices=list(MESHES))
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
    wanted = [case for mesh in args.mesh for case in cases(mesh) if case.group in args.group]
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
