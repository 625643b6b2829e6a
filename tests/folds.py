"""Strips and tubes that lie in folds, for tests of self-contact."""

from collections.abc import Callable

import numpy as np

import warp_mca as mca

ALLOY = mca.J2Bilinear(E=70e9, nu=0.33, rho=2700.0, sigma_y=80e6, E_t=300e6, beta=1.0)
THICK = 0.8e-3  # of walls [m]

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
