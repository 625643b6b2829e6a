"""Owns the axes of single bars: moduli, densities, Poisson's ratio, speeds, sizes, cells, steps, contact springs."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis
from warp_mca.verify.case import crossings

ROD = "40 cells along a rod without Poisson effect that strikes a wall: F = ρ c A v during 2 L / c"


def struck(
    *,
    E: float = 200e9,
    rho: float = 7800.0,
    nu: float = 0.0,
    v: float = 1.0,
    length: float = 2.0,
    side: float = 0.1,
    axial: int = 40,
    section: int = 2,
    tolerance: float = 0.01,
    kinematics: str = "corotational",
    **more: Any,
) -> Trial:
    """A rod that strikes a wall with its end; its force, impulse and duration by one-dimensional theory."""
    scene = mca.make_scene(
        "rod_on_wall",
        E=E,
        rho=rho,
        nu=nu,
        v=v,
        length=length,
        area=side**2,
        axial=axial,
        section=section,
        **more,
    )
    body = replace(scene.bodies[0], kinematics=kinematics)
    c = math.sqrt(E / rho)
    force, transit = rho * c * side**2 * v, 2.0 * length / c

    def read(result: mca.Result) -> list[Figure]:
        plateau = (result.time > 0.25 * transit) & (result.time < 0.75 * transit)
        impulse = float(result.F_n.sum() * (result.time[1] - result.time[0]))
        half = crossings(result.time, result.F_n, 0.5 * force)
        duration = float(half[-1] - half[0]) if len(half) > 1 else math.nan
        return [
            Figure("force", float(result.F_n[plateau].mean()), force, tolerance),
            Figure("impulse", impulse, force * transit, 2.0 * tolerance),
            Figure("duration", duration, transit, 3.0 * tolerance),
        ]

    return Trial(replace(scene, bodies=(body,)), read)


@axis(
    group="bars",
    title="Young's modulus [GPa]",
    reference=f"{ROD}, 1 m/s.",
    values=(0.7, 7.0, 70.0, 700.0, 7000.0),
    quick=(0.7, 7000.0),
)
def modulus(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(E=1e9 * value)


@axis(
    group="bars",
    title="Density [kg/m³]",
    reference=f"{ROD}, 1 m/s.",
    values=(0.1, 10.0, 1e3, 1e5),
)
def density(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(rho=value)


@axis(
    group="bars",
    title="Speed of impact [m/s]",
    reference=f"{ROD}, E = 200 GPa. At 1,000 m/s the strain is 0.2.",
    values=(1e-4, 1e-2, 1.0, 100.0, 1000.0, 5000.0),
    quick=(1e-4, 1000.0),
)
def speed(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(v=value)


@axis(
    group="bars",
    title="Speed of impact [m/s] of a soft rod",
    reference=f"{ROD}, E = 0.7 GPa: strains up to 3.",
    values=(1e-4, 1.0, 10.0, 20.0, 50.0, 100.0, 300.0, 1000.0),
)
def soft_speed(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(E=0.7e9, v=value)


@axis(
    group="bars",
    title="Poisson's ratio of a slender rod",
    reference="A rod of 40 × 2 × 2 cells, 20 times as long as it is wide, strikes a wall at 1 m/s: "
    "F = ρ c A v, less what the ends' lateral motion takes.",
    values=(-0.99, -0.9, -0.5, 0.0, 0.3, 0.45, 0.49, 0.499, 0.4999),
    quick=(-0.9, 0.4999),
)
def poisson(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(nu=value, tolerance=0.015)


@axis(
    group="bars",
    title="Poisson's ratio at 500 m/s",
    reference="As before: strains of 0.1 along the rod, and as much across it near ν = -1.",
    values=(-0.99, -0.9, -0.5, 0.3, 0.49, 0.4999),
)
def poisson_fast(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(nu=value, v=500.0, tolerance=0.015)


@axis(
    group="bars",
    title="Size: length of the rod [m]",
    reference=f"{ROD}, 1 m/s.",
    values=(1e-6, 1e-4, 1e-2, 1.0, 100.0, 1000.0),
    quick=(1e-6, 1000.0),
)
def size(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(length=value, side=0.05 * value)


@axis(
    group="bars",
    title="Cells: length along the rod over width",
    reference=f"{ROD}, 1 m/s.",
    values=("1:50", "1:10", "1:1", "10:1", "50:1"),
    quick=("1:50", "50:1"),
)
def cells(value: str, element: str) -> Trial:
    """As `struck`, of 40 cells, 2 of them across."""
    along, across = map(float, value.split(":"))
    return struck(side=2.0 * 2.0 / 40.0 * across / along)


@axis(
    group="bars",
    title="Cells along a cantilever: length over height",
    reference="Lowest bending frequency of a cantilever by Timoshenko, 2 cells deep, 4 long, ν = 0.3.",
    values=("2:1", "5:1", "20:1", "50:1"),
)
def bent_cells(value: str, element: str) -> Trial:
    """A cantilever under sudden gravity."""
    along, across = map(float, value.split(":"))
    return cantilever(depth=2.0 / 4.0 * across / along, nu=0.3, axial=4)


@axis(
    group="bars",
    title="Poisson's ratio of a cantilever",
    reference="Lowest bending frequency of a slender cantilever by Timoshenko, 2 cells deep, 20 long.",
    values=(-0.5, 0.0, 0.3, 0.45, 0.499),
)
def bent_poisson(value: float, element: str) -> Trial:
    """A cantilever under sudden gravity."""
    return cantilever(depth=0.1, nu=value, axial=20, tolerance=0.05)


def cantilever(*, depth: float, nu: float, axial: int = 16, deep: int = 2, tolerance: float = 0.03) -> Trial:
    """A cantilever of 1 m that starts to sag; its lowest frequency."""
    from warp_mca.verify.vibration import fitted_frequencies, timoshenko_frequencies

    E, rho = 70e9, 2700.0
    beam: dict[str, Any] = {"length": 1.0, "depth": depth, "width": 0.5 * depth}
    shear = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    exact = timoshenko_frequencies(length=1.0, depth=depth, E=E, G=0.5 * E / (1.0 + nu), rho=rho, shear=shear, count=1)[
        0
    ]
    scene = mca.make_scene(
        "cantilever",
        axial=axial,
        deep=deep,
        E=E,
        nu=nu,
        rho=rho,
        duration=1.2 / exact,
        samples=200,
        **beam,
        sag=1e-4 * 2.0 / 3.0 * E / rho * depth**2,  # the end sags by 1e-4 of the length at rest
    )

    def read(result: mca.Result) -> list[Figure]:
        value = np.asarray(result["tip_vy"])
        if not value.any():
            return [Figure("lowest frequency", math.nan, exact, tolerance)]
        found = fitted_frequencies(result.time, value, (exact, 6.27 * exact))[0]
        return [Figure("lowest frequency", float(found), exact, tolerance)]

    return Trial(scene, read)


@axis(
    group="steps",
    title="Share of the stable step (`time_step_scale`)",
    reference=f"{ROD}, 1 m/s. Values above 1 are refused.",
    values=(0.1, 0.5, 0.9, 0.95, 0.99, 1.0, 1.02, 1.05, 1.1, 1.2),
    quick=(0.99, 1.02),
)
def step_scale(value: float, element: str) -> Trial:
    """As `struck`."""
    trial = struck()
    return replace(trial, scene=replace(trial.scene, impact=replace(trial.scene.impact, time_step_scale=value)))


@axis(
    group="steps",
    title="Steps longer than stable, with the check of `time_step_scale` left out",
    reference="A rod of 4 cells in a row strikes a wall at 1 m/s: what the guard on energy does where a step is too "
    "long, whatever the reason.",
    values=(1.02, 1.05, 1.1, 1.2, 1.5),
    quick=(1.2,),
)
def forced_step(value: float, element: str) -> Trial:
    """As `struck`, of few cells."""
    trial = struck(axial=4, section=1, tolerance=0.1)
    impact = replace(trial.scene.impact, time_step_scale=1.0, output_interval=trial.scene.impact.duration / 20.0)
    return replace(trial, scene=replace(trial.scene, impact=impact), forced=value)


@axis(
    group="steps",
    title="Factor of the contact springs (`penalty`)",
    reference=f"{ROD}, 1 m/s.",
    values=(0.001, 0.01, 0.1, 1.0, 10.0, 100.0),
    quick=(0.001, 100.0),
)
def penalty(value: float, element: str) -> Trial:
    """As `struck`."""
    return struck(penalty=value, tolerance=0.02)
