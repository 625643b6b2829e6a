"""Owns static cases of bending: cantilevers of few layers of cells, and clamped plates of one."""

from __future__ import annotations

import numpy as np

import warp_mca as mca
from warp_mca.verify.case import Row, Setup, case, every, share_row
from warp_mca.verify.small_meshes import Array, brick
from warp_mca.verify.statics import Kinematics, Statics, area_shares

LENGTH = 20.0  # of the beam [m], which is 1 m thick and 1 m wide
PLATE, THICK, PRESSURE = 0.1, 0.002, 1e4  # side and thickness of the plate [m], its load [Pa]
THIN, SOLID = 0.00126532, 1.0066  # deflection of the middle of a thin plate in q a^4 / D; of a solid one over that
SEEDS = range(8)
ASPECTS = (1, 2, 4)  # length of a cell over the thickness of the beam
WIDE = {4: 6.2, 8: 3.1, 16: 1.6}  # width of a cell over the thickness of the plate, by cells along half a side
BENDS = "error of the formulation with cells so long, as measured, and a tenth of it"
SKEW = "the same; projected hourglass gradients are exact in parallelepipeds"
# What errors of elements other than the default may be, by length or width of the cells.
BEAM = {
    "hex8": (0.44, 0.75, 0.98),
    "hex8r": (0.007, 0.014, 0.034),
    "tet4": (0.89, 0.98, 0.99),
    "tet10": (0.01, 0.02, 0.07),
    "tet10_mean": (0.95, 1.04, 1.14),
    "wedge6": (0.011, 0.024, 0.063),
}
TRAPEZOIDS = {
    "hex8": (0.22, 0.58, 0.96),
    "hex8r": (0.01, 0.09, 0.38),
    "tet4": (0.72, 0.93, 0.99),
    "tet10": (0.004, 0.007, 0.021),
    "tet10_mean": (0.73, 0.86, 1.02),
}
PLATE_EVEN = {
    "hex8": (0.99, 0.74, 0.12),
    "tet4": (0.99, 0.98, 0.83),
    "tet10": (0.2, 0.041, 0.015),
    "tet10_mean": (0.23, 0.5, 0.53),
    "wedge6": (0.24, 0.025, 0.005),
}
PLATE_MOVED = {
    "hex8": ((0.99, 0.99), (0.16, 0.17)),
    "hex8r": ((0.12, 0.22), (0.01, 0.01)),
    "tet4": ((0.99, 0.99), (0.84, 0.84)),
    "tet10": ((0.22, 0.24), (0.015, 0.016)),
    "tet10_mean": ((0.19, 0.24), (0.53, 0.53)),
    "wedge6": ((0.26, 0.3), (0.005, 0.005)),
}


def beam(
    setup: Setup,
    layers: int,
    aspect: float,
    nu: float,
    moved: float = 0.0,
    seed: int = 0,
    kinematics: Kinematics = "corotational",
) -> float:
    """Error of the deflection of a cantilever under a load at its end [-], against Timoshenko's beam, kappa = 5/6.

    Args:
        setup: with the element.
        layers: of cells over the thickness.
        aspect: length of a cell over the thickness of the beam [-].
        nu: Poisson's ratio [-].
        moved: nodes are moved along the beam by up to so many cell lengths [-].
        seed: of these.
        kinematics: of the body.
    """
    rng = np.random.default_rng(seed)

    def move(x: Array) -> Array:
        inside = (x[:, 0] > 1e-9) & (x[:, 0] < LENGTH - 1e-9)
        x[inside, 0] += moved * aspect * rng.uniform(-1.0, 1.0, inside.sum())
        return x

    mesh = brick(setup.element, (round(LENGTH / aspect), 1, layers), (LENGTH, 1.0, 1.0), move)
    statics = Statics(setup, mesh, mca.Elastic(E=1.0, nu=nu, rho=1.0), kinematics=kinematics)
    x, y, z = statics.body.X.T
    share, root = area_shares(statics.body.mesh, x > LENGTH - 1e-9), x < 1e-9
    held = np.stack([root, root & (y < 1e-9), root & (z < 1e-9)], axis=1)
    u = statics.solve(np.outer(share, [0.0, 0.0, 1.0]), held)
    exact = 4.0 * LENGTH**3 + 2.4 * (1.0 + nu) * LENGTH
    return float(share @ u[:, 2] / exact - 1.0)


def plate(setup: Setup, count: int, moved: float = 0.0, seed: int = 0) -> float:
    """Error of the deflection of a clamped square plate, one layer of cells, in its middle under its own weight [-].

    Args:
        setup: with the element.
        count: cells along half a side.
        moved: columns of nodes are moved in the plane by up to so many cell lengths [-], but for those at the edges.
        seed: of these.
    """
    half, E, nu, rho = 0.5 * PLATE, 70e9, 0.3, 2700.0
    offset = np.random.default_rng(seed).uniform(-1.0, 1.0, (count + 1, count + 1, 2)) * moved * half / count

    def move(x: Array) -> Array:
        i = np.rint(x[:, :2] * count / half).astype(int)
        x[:, :2] += offset[i[:, 0], i[:, 1]] * ((i > 0) & (i < count))
        return x

    statics = Statics(
        setup,
        brick(setup.element, (count, count, 1), (half, half, THICK), move),
        mca.Elastic(E=E, nu=nu, rho=rho),
    )
    x, y, _ = statics.body.X.T
    clamped = (x > half - 1e-9) | (y > half - 1e-9)
    held = np.stack([clamped | (x < 1e-9), clamped | (y < 1e-9), clamped], axis=1)
    u = statics.solve(np.outer(statics.body.model.mass, [0.0, 0.0, -PRESSURE / THICK / rho]), held)
    rigidity = E * THICK**3 / 12.0 / (1.0 - nu**2)
    middle = (x < 1e-9) & (y < 1e-9)
    return float(-u[middle, 2].mean() / (SOLID * THIN * PRESSURE * PLATE**4 / rigidity) - 1.0)


@case(
    group="elements",
    title="Cantilevers of few layers of cells, long and short ones, bend as they must",
    reference="Timoshenko's beam, 20 x 1 x 1, with shear coefficient 5/6 and free sides.",
    elements=every(),
)
def bent_beam(setup: Setup) -> list[Row]:
    """Layers of cells whose length is 1, 2 and 4 times the thickness of the beam; trapezoids, mean of three meshes."""
    every_aspect = setup.by_element((0.025, 0.025, 0.032), **BEAM)
    trapezoids = setup.by_element((0.01, 0.09, 0.35), **TRAPEZOIDS)
    rows = []
    for layers in setup.choose((1,), (1, 2, 4)):
        for nu in setup.choose((0.3, 0.499), (0.0, 0.3, 0.499)):
            for aspect, allowed in zip(ASPECTS, every_aspect, strict=True):
                what = f"deflection over exact, {layers} of cells {aspect}:1, nu = {nu}"
                rows.append(share_row(what, beam(setup, layers, aspect, nu), allowed, BENDS))
    what = "deflection over exact, 1 of cells 2:1, nu = 0.499, finite strain"
    rows.append(share_row(what, beam(setup, 1, 2, 0.499, kinematics="finite"), every_aspect[1], BENDS))
    for aspect, allowed in list(zip(ASPECTS, trapezoids, strict=True))[: setup.choose((1,), (3,))[0]]:
        errors = [beam(setup, 1, aspect, 0.3, 0.1, seed) for seed in SEEDS[:3]]
        what = f"deflection over exact, 1 of cells {aspect}:1, nu = 0.3, nodes moved by 10 %"
        why = "elements that carry constant strain in any shape cannot bend right as trapezoids (MacNeal)"
        rows.append(share_row(what, float(np.mean(errors)), allowed, why))
    return rows


@case(
    group="elements",
    title="A clamped plate of one layer of wide cells, also distorted ones, deflects as it must",
    reference=f"Thin plate, {THIN} q a^4 / D (Timoshenko and Woinowsky-Krieger), and {SOLID} of it for the solid of "
    "50 times its thickness, from 64 x 64 cells.",
    elements=every(),
)
def clamped_plate(setup: Setup) -> list[Row]:
    """100 x 100 x 2 mm, a quarter of 4, 8 and 16 cells along its sides; plans distorted by 20 % by eight seeds."""
    even = setup.by_element((0.015,) * 3, **PLATE_EVEN)
    mean, worst = setup.by_element(((0.14, 0.22), (0.03, 0.03)), **PLATE_MOVED)
    rows = [
        share_row(
            f"deflection over exact, cells {WIDE[count]} times the thickness", plate(setup, count), allowed, BENDS
        )
        for count, allowed in zip(WIDE, even, strict=True)
    ]
    for count, allowed, most in ((4, *mean), (16, *worst)):
        errors = np.array([plate(setup, count, 0.2, seed) for seed in SEEDS])
        what = f"the same, cells {WIDE[count]} times the thickness, distorted"
        rows.append(share_row(f"{what}, mean of {len(SEEDS)}", float(errors.mean()), allowed, SKEW))
        rows.append(share_row(f"{what}, farthest", float(errors[np.abs(errors).argmax()]), most, SKEW))
    return rows
