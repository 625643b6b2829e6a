"""Taylor bars of three metals after Johnson and Cook beside axisymmetric elements: `python -m ... --help`.

Bars of 7.62 mm diameter at the lengths and speeds of their paper (Proc. 7th Int. Symp. Ballistics (1983) 541), which
end free of friction on a rigid wall. `taylor_axisymmetric` is given the same law, and cells half as wide.

Measured lengths and feet of copper are those of Zerilli and Armstrong's table (J. Appl. Phys. 61 (1987) 1816), of 4340
steel those of Johnson and Cook's figures, as Banerjee collected them (bbanerjee/HighRateExptData, `TaylorData/DAT`).
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from typing import NamedTuple

import warp_mca as mca
from benchmarks.taylor_axisymmetric import JohnsonCook
from benchmarks.taylor_axisymmetric import bar as other_bar
from warp_mca.verify.taylor import Foot

RADIUS, DURATION = 3.81e-3, 80e-6


class Bar(NamedTuple):
    """A bar: speed [m/s], length [m]; measured length and radius of the foot afterwards [m], 0 where unknown."""

    speed: float
    length: float = 25.4e-3
    measured: float = 0.0
    foot: float = 0.0


METALS = {
    "OFHC copper": (
        mca.library.OFHC_COPPER,
        Bar(130.0, measured=19.56e-3, foot=4.95e-3),
        Bar(146.0, measured=18.69e-3, foot=5.33e-3),
        Bar(190.0, measured=16.21e-3, foot=6.78e-3),
    ),
    "Armco iron": (mca.library.ARMCO_IRON, Bar(197.0), Bar(221.0), Bar(279.0)),
    "4340 steel": (
        mca.library.STEEL_4340,
        Bar(208.0, measured=22.48e-3, foot=5.55e-3),
        Bar(282.0, 12.7e-3, measured=10.71e-3, foot=5.20e-3),
        Bar(343.0, 8.1e-3, measured=6.54e-3, foot=6.00e-3),
    ),
}


def axisymmetric(metal: mca.JohnsonCook, bar: Bar, across: int, along: int) -> tuple[float, float]:
    """Length and radius of the foot [m]."""
    names = ("E", "nu", "rho", "A", "B", "n", "C", "m", "c_p", "beta")
    values = {name: getattr(metal, name) for name in names}
    size = {"length": bar.length, "radius": RADIUS, "speed": bar.speed, "duration": DURATION}
    other = JohnsonCook(**size, **values, span=metal.T_melt - metal.T_room)
    return other_bar(across, along, "additive", held=False, metal=other)


def engine(metal: mca.JohnsonCook, bar: Bar, count: int, element: str, device: str) -> tuple[float, float]:
    """The same by warp_mca, with `count` cells along the longest bar, a sixth as many over its radius."""
    mesh = {"axial": round(count * bar.length / Bar(0.0).length), "section": count // 6, "ring": count // 12}
    size = {"v": bar.speed, "length": bar.length, "radius": RADIUS, "duration": DURATION}
    scene = mca.make_scene("taylor_bar", **size, time_step_scale=0.15 * 24.0 / count, **mesh)
    bodies = tuple(dataclasses.replace(body, material=metal, element=element) for body in scene.bodies)
    shape = Foot(bar.length, RADIUS)
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
    print("| metal | m/s, mm | length [mm], other code | here | measured | foot's radius [mm] | here | measured |")
    print("|---|---|---|---|---|---|---|---|")
    for name in args.metal:
        metal, *bars = METALS[name]
        for bar in bars:
            if args.speed and bar.speed not in args.speed:
                continue
            along = round(2 * args.cells * bar.length / Bar(0.0).length)
            other, start = axisymmetric(metal, bar, args.cells // 3, along), time.perf_counter()
            found = engine(metal, bar, args.cells, args.element, args.device)
            cells = [name, f"{bar.speed:g}, {1e3 * bar.length:g}"]
            for theirs, ours, measured in zip(other, found, (bar.measured, bar.foot), strict=True):
                cells += [f"{1e3 * theirs:.3f}", f"{1e3 * ours:.3f} ({100.0 * (ours / theirs - 1.0):+.2f} %)"]
                cells += [f"{1e3 * measured:.2f} ({100.0 * (ours / measured - 1.0):+.1f} %)" if measured else ""]
            print(f"| {' | '.join(cells)} |", flush=True)
            print(f"{time.perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
