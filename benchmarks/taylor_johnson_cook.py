"""Taylor bars of three metals after Johnson and Cook beside axisymmetric elements: `python -m ... --help`.

Bars of 25.4 mm by 7.6 mm at three speeds, as in their paper (Proc. 7th Int. Symp. Ballistics (1983) 541), which end
free of friction on a rigid wall. `taylor_axisymmetric` is given the same law, and cells half as wide.
"""

from __future__ import annotations

import argparse
import dataclasses
import time

import warp_mca as mca
from benchmarks.taylor_axisymmetric import JohnsonCook, bar
from warp_mca.verify.taylor import Foot

LENGTH, RADIUS, DURATION = 25.4e-3, 3.8e-3, 80e-6
METALS = {
    "OFHC copper": (mca.library.OFHC_COPPER, (130.0, 146.0, 190.0)),
    "Armco iron": (mca.library.ARMCO_IRON, (197.0, 221.0, 279.0)),
    "4340 steel": (mca.library.STEEL_4340, (208.0, 282.0, 343.0)),
}


def axisymmetric(metal: mca.JohnsonCook, speed: float, across: int, along: int) -> tuple[float, float]:
    """Length and radius of the foot [m]."""
    names = ("E", "nu", "rho", "A", "B", "n", "C", "m", "c_p", "beta")
    values = {name: getattr(metal, name) for name in names}
    size = {"length": LENGTH, "radius": RADIUS, "speed": speed, "duration": DURATION}
    other = JohnsonCook(**size, **values, span=metal.T_melt - metal.T_room)
    return bar(across, along, "additive", held=False, metal=other)


def engine(metal: mca.JohnsonCook, speed: float, count: int, element: str, device: str) -> tuple[float, float]:
    """The same by warp_mca, with `count` cells along the bar, a sixth as many over its radius."""
    mesh = {"axial": count, "section": count // 6, "ring": count // 12}
    size = {"v": speed, "length": LENGTH, "radius": RADIUS, "duration": DURATION}
    scene = mca.make_scene("taylor_bar", **size, time_step_scale=0.15 * 24.0 / count, **mesh)
    bodies = tuple(dataclasses.replace(body, material=metal, element=element) for body in scene.bodies)
    shape = Foot(LENGTH, RADIUS)
    mca.run(dataclasses.replace(scene, bodies=bodies), device=device, recorders=[shape])
    return shape.length, shape.radius


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.taylor_johnson_cook")
    parser.add_argument("--cells", type=int, default=24, help="along the bar, a multiple of 12")
    parser.add_argument("--element", default="hex8")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--metal", choices=tuple(METALS), nargs="+", default=list(METALS))
    parser.add_argument("--speed", type=float, nargs="+", help="of these alone [m/s]")
    args = parser.parse_args()
    print("| metal | speed [m/s] | length, other code [mm] | here | foot, other code [mm] | here | seconds |")
    print("|---|---|---|---|---|---|---|")
    for name in args.metal:
        metal, speeds = METALS[name]
        for speed in args.speed or speeds:
            length, radius = axisymmetric(metal, speed, args.cells // 3, 2 * args.cells)
            start = time.perf_counter()
            found = engine(metal, speed, args.cells, args.element, args.device)
            cells = [f"{1e3 * length:.3f}", f"{1e3 * found[0]:.3f} ({100.0 * (found[0] / length - 1.0):+.2f} %)"]
            cells += [f"{1e3 * radius:.3f}", f"{1e3 * found[1]:.3f} ({100.0 * (found[1] / radius - 1.0):+.2f} %)"]
            print(f"| {name} | {speed:g} | {' | '.join(cells)} | {time.perf_counter() - start:.0f} |", flush=True)


if __name__ == "__main__":
    main()
