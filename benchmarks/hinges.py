"""How the answer hangs on hinges and meshes: `python -m benchmarks.hinges SCENE [--preset NAME ...] [--set KEY=VALUE]`.

Prints a row for each preset: peaks of F_n, impulse, contact, plastic strain, and the plastic work of all elements whose
middle lies within `--distance` of a hinge's axis. `--model FILE.mca` takes a stored model in place of the scene's mesh.

    python -m benchmarks.hinges two_link --preset paper --set joint_nodes=pin --set penalty=1 --device cuda:0
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.carry_out import begin
from warp_mca.phases.prepare import Request, prepare
from warp_mca.phases.settings import Settings
from warp_mca.scene import model_file
from warp_mca.scene.catalogue import parse_overrides
from warp_mca.step.solver import Solver
from warp_mca.system.model import Model
from warp_mca.system.state import State

Array = NDArray[np.float64]


def plastic_work(solver: Solver, state: State) -> Array:
    """Plastic work of each element of the concatenated meshes [J], shape (element_count,), float64."""
    solver.forces(state)
    for stage in solver.elements:
        stage.energies(solver.work, state)
    computed = solver.model.element_of[: solver.model.element_count]  # those of rigid bodies follow
    found = np.zeros(len(solver.model.element_of))
    found[computed] = solver.work.energy.numpy()[1]
    return found


def work_near(model: Model, meshes: Mapping[str, Mesh], joint: mca.Revolute, work: Array, distance: float) -> float:
    """Part of the plastic work [J] in elements whose middle was within a distance [m] of a hinge's axis."""
    axis, total = np.asarray(joint.axis) / np.linalg.norm(joint.axis), 0.0
    for body, at in ((joint.body, joint.at), (joint.other, joint.other_at)):
        if body is not None:
            middle = meshes[body].points[meshes[body].hexahedra].mean(axis=1) - np.asarray(at)
            away = np.linalg.norm(middle - np.outer(middle @ axis, axis), axis=1)
            own = work[model.element_start[body] :][: len(middle)]
            total += float(own[away <= distance].sum())
    return total


def measure(
    scene: mca.Scene, meshes: Mapping[str, Mesh], distance: float, device: str, precision: str
) -> dict[str, Any]:
    """Run a scene of hexahedra and say what came of it."""
    request = Request(span=scene.impact.duration, settings=Settings(device, precision, 1))
    ready, begun = prepare(scene, meshes, request), time.perf_counter()
    impact = begin([ready], request)
    impact.advance()
    if impact.stopped[0] is not None:
        raise mca.GuardError(impact.stopped[0])
    result = impact.scene_runs[0].result(request.clock.wall, (), None)
    summary = result.summary
    work = plastic_work(impact.solver, impact.state)
    hinges = [joint for joint in scene.joints if isinstance(joint, mca.Revolute)]
    peaks = [round(value, 2) for _, value in summary["F_n_peaks"]]
    return {
        "elements": impact.solver.model.element_count,
        "steps": impact.state.steps,
        "F_n_peaks": peaks,
        "impulse": float(result["F_n_N"].sum()) * scene.impact.output_interval,
        "contact_duration": summary["contact_duration"],
        "max_plastic_strain": summary["max_plastic_strain"],
        "plastic_work": float(work.sum()),
        "plastic_work_near": {h.name: work_near(ready.model, meshes, h, work, distance) for h in hinges},
        "energy_error": summary["energy_error"],
        "wall": round(time.perf_counter() - begun, 1),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hinges", description=__doc__.splitlines()[0])
    parser.add_argument("scene", nargs="?", default="two_link")
    parser.add_argument("--preset", nargs="+", default=["quick"])
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--model", type=Path, help="stored model, whose parameters --set changes")
    parser.add_argument("--distance", type=float, default=0.013, help="from the axis of a hinge [m]")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--precision", default="mixed", choices=["mixed", "float64"])
    parser.add_argument("-o", "--output", type=Path, help="JSON lines are added to this file")
    args = parser.parse_args()
    changes = parse_overrides(args.set)
    for preset in [None] if args.model else args.preset:
        if args.model:
            stored = model_file.changed(model_file.load(args.model), changes)
            scene, meshes = stored.scene, stored.meshes
        else:
            scene = mca.make_scene(args.scene, preset=preset, **changes)
            meshes = mca.mesh(scene)
        row = {"preset": preset or args.model.stem, "set": changes}
        row |= measure(scene, meshes, args.distance, args.device, args.precision)
        print(json.dumps(row), flush=True)
        if args.output:
            with args.output.open("a", encoding="utf-8") as file:
                file.write(json.dumps(row) + "\n")


if __name__ == "__main__":
    main()
