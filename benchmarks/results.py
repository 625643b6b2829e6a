"""Owns results.md of docs/measurements/: runs each case of its tables, with the command that makes it.

    python -m benchmarks.results --device cuda:0            run all cases, then write results.json and results.md
    python -m benchmarks.results --render                   write results.md from results.json again

Models come from `--models DIR` (built with `warp-mca build two_link --preset NAME -o DIR/NAME.mca`) where gmsh is not.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import warp_mca as mca
from benchmarks.measurements import FOLDER, measured, note

PRESETS = ("quick", "standard", "paper")
KEPT = (
    "t_contact v_n v_t F_n_first_peak F_n_peaks F_t_min F_t_max F_t_reverses contacts contact_duration energy_error "
    "max_plastic_strain max_penetration n_elements n_nodes n_steps dt device precision version wall element_steps_per_s"
).split()


@dataclass(frozen=True)
class Case:
    """One run: its table, preset, precision and parameters."""

    group: str
    preset: str
    settings: dict[str, object] = field(default_factory=dict)
    precision: str = "mixed"
    duration: float | None = None

    @property
    def command(self) -> str:
        """The command line that makes this run."""
        text = f"warp-mca run two_link --preset {self.preset}"
        text += "".join(f" --set {key}={value}" for key, value in self.settings.items())
        text += f" --duration {self.duration:g}" if self.duration else ""
        return text + (f" --precision {self.precision}" if self.precision != "mixed" else "")


def cases() -> Iterator[Case]:
    """Every case, in the order of the tables."""
    for preset in PRESETS:
        yield Case("presets", preset)
    for preset in PRESETS:
        yield Case("precision", preset, precision="float64")
    for preset in PRESETS:
        for mu in (0.1, 0.3, 0.47, 1.5):
            yield Case("mu", preset, {"mu": mu})
    for preset in PRESETS:
        for v in (0.4, 0.6, 0.8, 1.0, 2.0, 4.0):
            yield Case("v_plate", preset, {"v_plate": v})
    for preset in PRESETS:
        for penalty in (0.03, 0.1, 0.3, 1.0, 3.0):
            yield Case("penalty", preset, {"penalty": penalty})
    for preset in PRESETS:
        yield Case("model", preset, {"rigid_inertia": "mesh"})
        yield Case("model", preset, {"joint_nodes": "axis"})
        yield Case("model", preset, {"two_way": "true"})
        yield Case("model", preset, {"beta": 1.0})
        yield Case("model", preset, {"plastic": "false"})
    for parts in (("tip",), ("body",), ("tip", "body")):
        for E in (0.7e9, 7e9, 700e9, 7000e9):
            moduli = {f"E_{part}": E for part in parts} | {f"E_t_{part}": round(E * 27.0 / 70.0) for part in parts}
            yield Case("compliance", "standard", {"penalty": 1.0} | moduli, duration=2e-3 if E < 70e9 else None)


def run_case(case: Case, device: str, models: Path | None) -> dict[str, Any]:
    """Run one case twice; keep its figures and whether both histories are the same."""
    if models is None:
        scene, meshes = mca.make_scene("two_link", preset=case.preset, **case.settings), None
    else:
        from warp_mca.scene import model_file as scene_file

        stored = scene_file.changed(scene_file.load(models / f"{case.preset}.mca"), case.settings)
        scene, meshes = stored.scene, stored.meshes
    options = {"device": device, "precision": case.precision, "duration": case.duration, "meshes": meshes}
    row: dict[str, Any] = {"group": case.group, "preset": case.preset, "command": case.command}
    try:
        result = mca.run(scene, **options)
    except mca.McaError as error:
        return row | {"failed": str(error)}
    row |= {key: result.summary[key] for key in KEPT}
    if case.group == "presets":
        again = mca.run(scene, **options)
        row["repeats"] = all(np.array_equal(result[key], again[key], equal_nan=True) for key in result.history)
        row["wall"] = again.summary["wall"]  # kernels compiled and loaded
        row["element_steps_per_s"] = again.summary["element_steps_per_s"]
    return row


HEAD = "| command | elements | first peak F_n [kN] | peaks | contact [ms] | F_t [kN] | reverses | energy error |"
RULE = "|---|---|---|---|---|---|---|---|"


def table_row(row: dict[str, Any]) -> str:
    """One line of a table."""
    if "failed" in row:
        return f"| `{row['command']}` | | stopped: {row['failed']} | | | | | |"
    contacts = f"{1e3 * row['contact_duration']:.3f}" + (f" in {n}" if (n := len(row["contacts"])) > 1 else "")
    first = "–" if row["F_n_first_peak"] is None else f"{row['F_n_first_peak'] / 1e3:.3f}"
    return (
        f"| `{row['command']}` | {row['n_elements']:,} | {first} | {len(row['F_n_peaks'])} "
        f"| {contacts} | {row['F_t_min'] / 1e3:.3f} … {row['F_t_max'] / 1e3:.3f} "
        f"| {'yes' if row['F_t_reverses'] else 'no'} | {100 * row['energy_error']:.3f} % |"
    )


def render(rows: list[dict[str, Any]]) -> str:
    """The page: its text with the tables in place of {group} marks."""
    text = (FOLDER / "results.template.md").read_text(encoding="utf-8")
    for group in dict.fromkeys(row["group"] for row in rows):
        lines = [HEAD, RULE, *(table_row(row) for row in rows if row["group"] == group)]
        text = text.replace(f"{{{group}}}", "\n".join(lines))
    base = {row["preset"]: row for row in rows if row["group"] == "presets"}
    for name, value in claims(rows, base).items():
        text = text.replace(f"{{{name}}}", value)
    return text


def claims(rows: list[dict[str, Any]], base: dict[str, dict[str, Any]]) -> dict[str, str]:
    """Figures that the text quotes, by the name of their mark."""
    double = {row["preset"]: row for row in rows if row["group"] == "precision"}
    apart = {p: abs(double[p]["F_n_first_peak"] / base[p]["F_n_first_peak"] - 1.0) for p in PRESETS}
    paper = base["paper"]
    found = {f"{p}_to_paper": f"{100 * (base[p]['F_n_first_peak'] / paper['F_n_first_peak'] - 1):+.1f} %" for p in base}
    found |= {f"{p}_first": f"{base[p]['F_n_first_peak'] / 1e3:.3f} kN" for p in base}
    found |= {f"{p}_duration": f"{1e3 * base[p]['contact_duration']:.3f} ms" for p in base}
    found |= {f"{p}_precision": f"{apart[p]:.1e}" for p in PRESETS}
    found |= {f"{p}_steps": f"{base[p]['n_steps']:,}" for p in base}
    found |= {f"{p}_rate": f"{base[p]['element_steps_per_s'] / 1e9:.2f} G" for p in base}
    found |= {f"{p}_wall": f"{base[p]['wall']['fe']:.2f} s" for p in base}
    mesh = next(
        r for r in rows if r["group"] == "model" and "rigid_inertia=mesh" in r["command"] and r["preset"] == "paper"
    )
    for key, row in (("slender", paper), ("mesh", mesh)):
        found |= {
            f"{key}_t": f"{row['t_contact']:.6f}",
            f"{key}_v_n": f"{row['v_n']:.4f}",
            f"{key}_v_t": f"{row['v_t']:.4f}",
        }
    found["repeats"] = "yes" if all(base[p]["repeats"] for p in base) else "no"
    found["worst_energy"] = f"{100 * max(r['energy_error'] for r in rows if 'failed' not in r):.3f} %"
    found["paper_error"] = f"{100 * (paper['F_n_first_peak'] / 3235.26 - 1):+.1f} %"
    stiff = next(
        r for r in rows if r["group"] == "penalty" and r["preset"] == "paper" and "penalty=3.0" in r["command"]
    )
    found["stiff_first"] = f"{stiff['F_n_first_peak'] / 1e3:.3f} kN"
    found["version"], found["measured"] = paper["version"], measured("results")
    return found


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.results", description=__doc__.splitlines()[0])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--models", type=Path, help="folder of built models, one for each preset")
    parser.add_argument("--data", type=Path, default=FOLDER / "results.json", help="where the figures are kept")
    parser.add_argument("--render", action="store_true", help="only write results.md from the figures kept")
    args = parser.parse_args()
    if not args.render:
        rows = []
        for case in cases():
            rows.append(run_case(case, args.device, args.models))
            print(table_row(rows[-1]), flush=True)
            args.data.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
        note(args.data, args.device)
    rows = json.loads(args.data.read_text(encoding="utf-8"))
    (FOLDER / "results.md").write_text(render(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
