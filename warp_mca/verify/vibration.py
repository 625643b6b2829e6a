"""Owns the cases of vibrating bars and beams: their closed forms, and how frequencies are read off histories."""

from __future__ import annotations

import dataclasses
import math
from typing import cast

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case

ALUMINIUM = mca.Elastic(E=70e9, nu=0.0, rho=2700.0)


def fitted_frequencies(time: Array, value: Array, guesses: tuple[float, ...]) -> Array:
    """Frequencies [Hz] of the sum of sinusoids and a constant that fits a curve best, shape (len(guesses),), float64.

    Args:
        time: [s], shape (count,).
        value: the curve, shape (count,).
        guesses: near the frequencies [Hz]: within what the curve's duration can tell apart.
    """
    from scipy.optimize import least_squares

    def left_over(share: Array) -> Array:
        phase = 2.0 * np.pi * time[:, None] * (share * guesses)
        basis = np.column_stack([np.cos(phase), np.sin(phase), np.ones(len(time))])
        return value - basis @ np.linalg.solve(basis.T @ basis, basis.T @ value)

    found = least_squares(left_over, np.ones(len(guesses)), xtol=1e-12, ftol=1e-14, gtol=1e-14)
    return found.x * guesses


def timoshenko_frequencies(
    *, length: float, depth: float, E: float, G: float, rho: float, shear: float, count: int
) -> tuple[float, ...]:
    """The lowest bending frequencies of a cantilever of rectangular section [Hz], by Timoshenko's theory.

    Roots b = omega L^2 sqrt(rho A / (E I)) of the frequency equation of Huang, J. Appl. Mech. 28 (1961) 579.

    Args:
        length, depth: of the beam and its section [m].
        E, G: moduli [Pa].
        rho: density [kg/m^3].
        shear: shear coefficient kappa [-].
        count: how many, all below the one at which the section oscillates by itself.
    """
    from scipy.optimize import brentq

    r2 = depth**2 / 12.0 / length**2
    s2 = r2 * E / (shear * G)

    def free_end(b: float) -> float:
        root = math.sqrt((r2 - s2) ** 2 + 4.0 / b**2)
        alpha, beta = (b * math.sqrt(0.5 * (root + sign * (r2 + s2))) for sign in (-1.0, 1.0))
        waves = (b**2 * (r2 - s2) ** 2 + 2.0) * math.cosh(alpha) * math.cos(beta)
        slope = b * (r2 + s2) / math.sqrt(1.0 - b**2 * r2 * s2)
        return 2.0 + waves - slope * math.sinh(alpha) * math.sin(beta)

    grid = np.linspace(0.5, min(8.0 * count**2, 0.999 / math.sqrt(r2 * s2)), 400 * count)
    value = np.array([free_end(float(b)) for b in grid])
    at = np.flatnonzero(value[:-1] * value[1:] < 0.0)[:count]
    pace = math.sqrt(E / rho * r2) / length
    roots = [cast(float, brentq(free_end, grid[k], grid[k + 1], xtol=1e-13)) for k in at]
    return tuple(root * pace / (2.0 * math.pi) for root in roots)


@case(
    group="elements",
    title="A bar clamped at one end vibrates along its axis at c / 4 L",
    reference="One-dimensional theory, exact without Poisson effect: f = sqrt(E / rho) / (4 L).",
)
def bar_vibration(setup: Setup) -> list[Row]:
    """L = 1 m, 20 mm x 20 mm, E = 70 GPa, rho = 2700 kg/m^3, nu = 0; sudden acceleration along x, four periods."""
    counts = setup.choose((8, 16), (8, 16, 32))
    c = ALUMINIUM.wave_speeds["bar"]
    exact = c / 4.0
    bar = {"length": 1.0, "depth": 0.02, "width": 0.01, "deep": 2, "sag": 0.0, "samples": 400}
    bar |= {"push": 1e-4 * c**2, "duration": 4.0 / exact}  # a strain of 1e-4 at the root
    measured = []
    for count in counts:
        result = setup.run(setup.scene("cantilever", axial=count, **bar))
        modes = tuple((2 * k + 1) * exact for k in range(5))
        measured.append(float(fitted_frequencies(result.time, result["tip_vx"], modes)[0]))
    tolerance = 1.1 * (0.5 * np.pi / counts[-1]) ** 2 / setup.by_element(24.0, tet4=12.0)
    why = "lumped mass lowers it by (k h)^2 / 24 with k = pi / (2 L), and a tenth of that for the reading"
    why += setup.by_element(
        "",
        tet4="; so does the mean of two cells' volume changes, which a third of the stress "
        "follows, by a quarter of (k h)^2 of that third",
    )
    sizes = tuple(1.0 / count for count in counts)
    return [Row("lowest frequency", exact, measured, "Hz", tolerance, why, sizes=sizes, least_order=1.8)]


def _hung_by_midline(scene: mca.Scene) -> mca.Scene:
    """The cantilever with a root that may contract along y too: only its midline is held there."""
    mesh = cast(mca.Box, scene.body("bar").geometry).build()
    root = mesh.node_sets["xmin"]
    sets = {**mesh.node_sets, "midline": root[np.abs(mesh.points[root, 1]) < 1e-9]}
    bar = dataclasses.replace(scene.body("bar"), geometry=dataclasses.replace(mesh, node_sets=sets))
    held = (("xmin", "x"), ("midline", "y"), ("zmin", "z"))
    fixed = tuple(mca.Fixed(body="bar", nodes=nodes, axes=axes) for nodes, axes in held)
    return dataclasses.replace(scene, bodies=(bar,), fixed=fixed)


def _bending(
    setup: Setup, mesh: tuple[int, int], *, nu: float, depth: float, periods: float, midline: bool = False
) -> tuple[float, float]:
    """Measured and exact lowest bending frequency [Hz] of a bar of 1 m with `mesh` cells along length and depth."""
    length = 1.0
    bar = dataclasses.replace(ALUMINIUM, nu=nu)
    exact = timoshenko_frequencies(
        length=length,
        depth=depth,
        E=bar.E,
        G=bar.shear_modulus,
        rho=bar.rho,
        shear=5.0 * (1.0 + nu) / (6.0 + 5.0 * nu),
        count=3,
    )
    wide = setup.by_element(1, tet4=mesh[1] // 2)  # whose errors depend on every edge
    sag = 1e-3 * 8.0 * bar.E * depth**2 / (12.0 * bar.rho * length**3)  # a static deflection of L / 1000
    shape = {
        "length": length,
        "depth": depth,
        "width": 0.25 * depth,
        "axial": mesh[0],
        "deep": mesh[1],
        "wide": wide,
        "nu": nu,
    }
    scene = setup.scene("cantilever", sag=sag, duration=periods / exact[0], samples=400, **shape)
    result = setup.run(_hung_by_midline(scene) if midline else scene)
    return float(fitted_frequencies(result.time, result["tip_vy"], exact)[0]), exact[0]


@case(
    group="elements",
    title="A cantilever vibrates in bending as Timoshenko's beam",
    reference="Timoshenko, Phil. Mag. 41 (1921) 744, with shear coefficient 5 / 6, exact for nu = 0.",
)
def cantilever_vibration(setup: Setup) -> list[Row]:
    """L = 1 m, depth 0.1 m, half width 25 mm, E = 70 GPa, rho = 2700 kg/m^3, nu = 0; sudden weight, two periods."""
    meshes = setup.choose(((20, 2), (40, 4)), ((20, 2), (40, 4), (80, 8)))
    found = [_bending(setup, mesh, nu=0.0, depth=0.1, periods=2.0) for mesh in meshes]
    measured, exact = tuple(f for f, _ in found), found[0][1]
    coarse, fine = measured[-2:]
    turning = 1.1 * 0.00024
    # of tetrahedra: the energy of the exact field between their corners, which is more than that of the solution
    stiff = setup.by_element(1.1 * 0.0052, hex8i=turning, hex8r=turning, tet4=0.5 * (1.5 + 2.0) / 4.0**2)
    inertia = "lumped masses of n layers have 1 + 2 / n^2 of the section's rotary inertia, which lowers the root of "
    inertia += "Timoshenko's equation by 0.024 % with 40 x 4 cells; and a tenth of that"
    locking = setup.by_element(
        "shear locking adds (G / E) (a / d)^2 / 2 for cells of length a in a depth d, one mean dilatation in "
        "each of n cells takes 1 / (6 n^2): 1.56 - 1.04 = 0.52 % with 40 x 4 cells; and a tenth of that",
        hex8i=inertia,
        hex8r=inertia,
        tet4="the exact curvature between the corners of tetrahedra has a parasitic shear of a / 2 and steps "
        "of stress over the height h of a cell, which add 3 (G / E) (a / d)^2 + 2 (h / d)^2 to the energy at "
        "most, half as much to the frequency",
    )
    left = "terms of order 4, which fall to a sixteenth with the mesh, and the root, which beam theory simplifies"
    left += setup.by_element("", tet4="; those of tetrahedra are of the size of (7 %)^2 with 40 x 4 cells")
    tolerances = (
        stiff * (40.0 / meshes[-1][0]) ** 2,
        setup.by_element(0.001, tet4=0.005) if setup.level == "quick" else 0.0003,
    )
    order = setup.by_element(1.7, hex8i=None, hex8r=None)  # less than the root's share is left
    name, limit = "lowest frequency", ((4.0 * fine - coarse) / 3.0,)
    sizes = tuple(1.0 / mesh[0] for mesh in meshes)
    return [
        Row(name, exact, measured, "Hz", tolerances[0], locking, sizes=sizes, least_order=order),
        Row(f"{name}, extrapolated from the two finest meshes with order 2", exact, limit, "Hz", tolerances[1], left),
    ]


@case(
    group="elements",
    title="A nearly incompressible cantilever does not lock",
    reference="Timoshenko's beam with shear coefficient 5 (1 + nu) / (6 + 5 nu) (Kaneko, J. Phys. D 8 (1975) 1927).",
)
def near_incompressible_bending(setup: Setup) -> list[Row]:
    """L = 1 m, depth 0.2 m, half width 50 mm, nu = 0.499; the root may contract: its midline alone is held along y."""
    meshes = setup.choose(((10, 2), (20, 4)), ((10, 2), (20, 4), (40, 8)))
    found = [_bending(setup, mesh, nu=0.499, depth=0.2, periods=1.25, midline=True) for mesh in meshes]
    measured, exact = tuple(f for f, _ in found), found[0][1]
    name = "lowest frequency, nu = 0.499"
    if setup.element == "tet4":
        coarse, fine = measured[-2:]
        tolerance, sizes = (coarse - fine) / exact / (2.0**2 - 1.0), tuple(1.0 / mesh[0] for mesh in meshes)
        why = (
            "what order 2 leaves of the change from the mesh before: the parasitic shear of linear tetrahedra is of "
            "order 2, pressure left in the layer of cells at the surface of order 3; locking would not fall"
        )
        return [Row(name, exact, measured, "Hz", tolerance, why, sizes=sizes, least_order=2.0)]
    why = "a root held on its midline alone yields, more on finer meshes; locking would add tens of per cent"
    right = (
        ": with 20 x 4, 40 x 8 cells it takes 0.37, 0.58 % off the frequency, as it sinks and turns in statics of the "
        "meshes; rotary inertia of lumped masses takes 0.09, 0.02 %; 0.1 % of order 2 is left with 20 x 4; and a tenth "
        "of all. hex8, 0.9 and 0.6 % too stiff in bending, hides that"
    )
    why += setup.by_element("", hex8i=right, hex8r=right)
    return [Row(name, exact, measured, "Hz", setup.by_element(0.005, hex8i=0.0065, hex8r=0.0065), why)]
