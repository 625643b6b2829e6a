"""How much of a pulse passes a hinge between two rods in a line: `python -m benchmarks.hinge_pulse [--section 6]`.

The free end of one rod is driven once, along the rods or across them; the table has the share of the energy that is in
the other rod when the pulse has passed the hinge, and before an echo from the ends comes back. `none` is one rod twice
as long.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.phases.carry_out import begin
from warp_mca.phases.prepare import Request, prepare
from warp_mca.phases.settings import Settings

RADIUS, LENGTH = 0.013, 0.21
METAL = mca.Elastic(E=70e9, nu=0.27, rho=2700.0)
HINGES = ("none", "ends", "axis", "pin", "lug")
PULSES = (("along", "x", 15e-6, 60e-6), ("along", "x", 40e-6, 82e-6), ("across", "y", 40e-6, 120e-6))


def rods(hinge: str, section: int, axis: str, pulse: float, duration: float) -> mca.Scene:
    """Rods OA and AB along x, at rest, the far end of AB driven by half a sine of `pulse` [s]."""
    cells: dict[str, Any] = {"radius": RADIUS, "tip": "flat", "section": section, "ring": section // 2}
    cells |= {"axial": 7 * section, "length": LENGTH}
    inner, outer = mca.Rod(**cells), mca.Rod(**cells)
    tied: dict[str, Any] = {"nodes": hinge}
    if hinge == "none":
        inner = mca.Rod(**cells | {"length": 2.0 * LENGTH, "axial": 14 * section})
    elif hinge == "pin":
        tied["pin_radius"] = 0.75 * RADIUS
    elif hinge == "lug":
        inner, outer = mca.LugRod(**cells, start="flat", end="fork"), mca.LugRod(**cells)
        tied = {"nodes": "hole", "pin_radius": outer.hole_radius}
    bodies = [mca.Body(name="OA", geometry=inner, material=METAL, exact_mass=False)]
    joints = ()
    if hinge != "none":
        at: Any = (LENGTH, 0.0, 0.0)
        bodies += [mca.Body(name="AB", geometry=outer, material=METAL, position=at, exact_mass=False)]
        joints = (mca.Revolute(name="A", body="OA", at=at, other="AB", **tied),)
    times = tuple(pulse * i / 100 for i in range(101))
    speeds = tuple(-(math.sin(math.pi * t / pulse) ** 2) for t in times)
    drive = mca.Prescribed(body=bodies[-1].name, nodes="end", axis=axis, times=times, velocities=speeds)  # pyright: ignore[reportArgumentType]
    return mca.Scene(
        name="rods",
        bodies=tuple(bodies),
        joints=joints,
        prescribed=(drive,),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-6),
    )


def passed(scene: mca.Scene) -> float:
    """Share of the energy that is at x < LENGTH at the end of a run [-]."""
    meshes = mca.mesh(scene)
    request = Request(span=scene.impact.duration, settings=Settings("cpu", "float64", 1))
    impact = begin([prepare(scene, meshes, request)], request)
    impact.advance()
    solver, state = impact.solver, impact.state
    model = solver.model
    solver.forces(state)
    for stage in solver.elements:
        stage.energies(solver.work, state)
    elastic = np.empty(len(model.element_of))
    elastic[model.element_of] = solver.work.energy.numpy()[0]
    middles = np.concatenate(
        [mesh.points[mesh.hexahedra].mean(axis=1)[:, 0] + scene.body(name).position[0] for name, mesh in meshes.items()]
    )
    kinetic = 0.5 * model.mass * (state.v.numpy() ** 2).sum(axis=1)
    behind, cells = model.X[:, 0] < LENGTH, middles < LENGTH
    if len(meshes) > 1:  # lugs reach beyond the hinge
        behind = np.arange(len(model.X)) < len(meshes["OA"].points)
        cells = np.arange(len(middles)) < meshes["OA"].cell_count
    return float((kinetic[behind].sum() + elastic[cells].sum()) / (kinetic.sum() + elastic.sum()))


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.hinge_pulse", description="Pulses through hinges.")
    parser.add_argument("--section", type=int, default=6)
    args = parser.parse_args()
    print(f"| hinge | {' | '.join(f'{name}, {1e6 * pulse:.0f} us' for name, _, pulse, _ in PULSES)} |")
    print("|---" * (len(PULSES) + 1) + "|")
    for hinge in HINGES:
        shares = [passed(rods(hinge, args.section, axis, pulse, end)) for _, axis, pulse, end in PULSES]
        print(f"| {hinge} | {' | '.join(f'{100 * share:.1f} %' for share in shares)} |", flush=True)


if __name__ == "__main__":
    main()
