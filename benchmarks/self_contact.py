"""Bodies that fold, crush and mushroom, and what their self-contact gives: `python -m benchmarks.self_contact`.

The table has the imbalance of energy, how deep springs were pressed, and where parts went through each other, as a run
finds it from the skin alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import replace

import numpy as np

import warp_mca as mca
from warp_mca.scenes import taylor_bar

ALLOY = mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=80e6, E_t=300e6, beta=1.0)
THICK = 0.8e-3  # of walls [m]
FOLDED = mca.ContactAll(mu=0.1)

Place = Callable[[float], tuple[tuple[float, float], tuple[float, float]]]


def fold_line(arms: int, arm: float, bend: float) -> tuple[Place, float]:
    """Middle line of a strip whose straight arms lie above each other, joined by half circles, and its length [m].

    It gives the place in the plane x-y and the tangent at a length s from its start.
    """
    fold = arm + np.pi * bend

    def place(s: float) -> tuple[tuple[float, float], tuple[float, float]]:
        n = min(int(s // fold), arms - 1)
        s, sign, start = s - n * fold, 1 - 2 * (n % 2), arm * (n % 2)
        if s <= arm:
            return (start + sign * s, 2.0 * bend * n), (sign, 0.0)
        a = (s - arm) / bend
        at = start + sign * (arm + bend * np.sin(a)), 2.0 * bend * n + bend * (1.0 - np.cos(a))
        return at, (sign * np.cos(a), np.sin(a))

    return place, arms * arm + (arms - 1) * np.pi * bend


def folded(arms: int, arm: float, bend: float, cell: float, around: int = 0, radius: float = 0.0) -> mca.Mesh:
    """A strip in folds, one cell wide, or a quarter of a tube of it `around` the axis y; node sets top and low besides.

    The wall is one cell thick; faces of its outermost arms are the sets.
    """
    place, length = fold_line(arms, arm, bend)
    wide = cell if not around else 1.0
    box = mca.Box(size=(1.0, THICK, wide), divisions=(round(length / cell), 1, around or 1)).build()
    places, tangents = (np.array(part) for part in zip(*(place(s * length) for s in box.points[:, 0]), strict=True))
    aside = box.points[:, 1] - 0.5 * THICK
    x, y, z = places[:, 0] - aside * tangents[:, 1], places[:, 1] + aside * tangents[:, 0], box.points[:, 2]
    top, low = np.flatnonzero(y > 2.0 * bend * (arms - 1) + 0.49 * THICK), np.flatnonzero(y < -0.49 * THICK)
    if around:
        angle = 0.5 * np.pi * z
        x, z = (radius + x) * np.cos(angle), (radius + x) * np.sin(angle)
        x[angle > 0.5 * np.pi - 1e-9] = 0.0
    sets = {**box.node_sets, "top": top.astype(np.int32), "low": low.astype(np.int32)}
    return mca.Mesh(np.column_stack([x, y, z]), box.hexahedra, sets)


def press(mesh: mca.Mesh, contacts: object, duration: float, speed: float, held: tuple[str, str]) -> mca.Scene:
    """Press the topmost arm down at a speed [m/s]; `held` are the axes that the sides zmin and zmax do not leave."""
    body = mca.Body(name="strip", geometry=mesh, material=ALLOY, kinematics="finite")
    push = mca.Prescribed(body="strip", nodes="top", axis="y", times=(0.0, 3e-5), velocities=(0.0, -speed))
    sides = tuple(mca.Fixed(body="strip", nodes=n, axes=a) for n, a in zip(("zmin", "zmax"), held, strict=True))
    return mca.Scene(
        name="folds",
        bodies=(body,),
        contacts=contacts,
        prescribed=(push,),
        fixed=(*sides, mca.Fixed(body="strip", nodes="low", axes="xyz")),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 100.0),
    )


def hairpin(contacts: object) -> mca.Scene:
    """A strip whose upper arm falls on its lower one, at some 40 m/s."""
    body = mca.Body(
        name="strip",
        geometry=folded(arms=2, arm=0.02, bend=0.0025, cell=1e-3),
        material=ALLOY,
        kinematics="finite",
    )
    return mca.Scene(
        name="hairpin",
        bodies=(body,),
        contacts=contacts,
        gravity=(0.0, -3e5, 0.0),
        fixed=(
            mca.Fixed(body="strip", nodes="low", axes="xy"),
            mca.Fixed(body="strip", nodes="zmin", axes="z"),
            mca.Fixed(body="strip", nodes="zmax", axes="z"),
        ),
        impact=mca.ImpactPhase(duration=4e-4, output_interval=4e-6),
    )


def tube() -> mca.Scene:
    """A quarter of a tube whose eight folds are pressed on each other at 30 m/s."""
    mesh = folded(arms=9, arm=0.003, bend=0.9e-3, cell=0.6e-3, around=3, radius=0.006)
    return press(mesh, (FOLDED,), 2.45e-4, 30.0, ("z", "x"))


def mushroom(contacts: tuple[mca.ContactAll, ...]) -> mca.Scene:
    """Taylor's bar, whose rim crushes cells and does not reach itself, with further contacts."""
    scene = taylor_bar.build(section=2, ring=1, axial=18, duration=4e-5)
    phase = replace(scene.impact, output_interval=2e-8)  # less than any stable step
    return replace(scene, impact=phase, contacts=(*scene.contacts, *contacts))


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.self_contact", description="Bodies that fold.")
    parser.add_argument("--device", default="cpu")
    device = parser.parse_args().device
    print("| scene | contact | imbalance | force [N] | depth of springs [mm] | parts in each other [mm] |")
    print("|---" * 6 + "|")
    for what, contact, scene in (
        ("strip", "none", hairpin(())),
        ("strip", '"all"', hairpin("all")),
        ("tube, eight folds", '"all", μ = 0.1', tube()),
        ("Taylor bar", "of the wall", mushroom(())),
        ("Taylor bar", '"all", μ = 0.1, too', mushroom((FOLDED,))),
    ):
        result = mca.run(scene, device=device)
        said = [line.split("up to ")[1].split(" m ")[0] for line in result.warnings if "went through each" in line]
        figures = f"{100 * result.summary['energy_error']:.2g} %", f"{max(abs(result.F_n).max(), 0.0):.3g}"
        depths = f"{1e3 * result.summary['max_penetration']:.2g}", f"{1e3 * float(said[0]):.2g}" if said else "none"
        print(f"| {what} | {contact} | {' | '.join([*figures, *depths])} |", flush=True)


if __name__ == "__main__":
    main()
