"""Owns the axes of two bodies that differ: stiffness, density, size of cells."""

from __future__ import annotations

import math
from dataclasses import replace

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis

RODS = "Two rods without Poisson effect, end on at 1 m/s: F = v Z1 Z2 / (Z1 + Z2), Z = A sqrt(E ρ)"


def rods(
    *,
    E: float = 200e9,
    rho: float = 7800.0,
    E_far: float = 200e9,
    rho_far: float = 7800.0,
    cells: int = 40,
    section: int = 2,
    tolerance: float = 0.01,
) -> Trial:
    """Two rods of different metals, as long as waves in each take the same time; force and impulse until they part.

    The slave is the near rod.
    """
    time, side, v = 4e-4, 0.1, 1.0  # transit there and back
    speeds = math.sqrt(E / rho), math.sqrt(E_far / rho_far)
    near, far = (0.5 * c * time for c in speeds)
    impedance = side**2 * math.sqrt(E * rho), side**2 * math.sqrt(E_far * rho_far)
    force = v * impedance[0] * impedance[1] / sum(impedance)

    def rod(name: str, length: float, start: float, material: mca.Elastic, count: int, across: int, speed: float):
        box = mca.Box(size=(length, side, side), divisions=(count, across, across), origin=(start, 0.0, 0.0))
        return mca.Body(name=name, geometry=box, material=material, velocity=(speed, 0.0, 0.0))

    bodies = (
        rod("near", near, -near, mca.Elastic(E=E, nu=0.0, rho=rho), cells, section, v),
        rod("far", far, 0.0, mca.Elastic(E=E_far, nu=0.0, rho=rho_far), 40, 2, 0.0),
    )
    faces = mca.Surface(body="near", nodes="xmax"), mca.Surface(body="far", nodes="xmin")
    scene = mca.Scene(
        name="rods",
        bodies=bodies,
        contacts=(mca.Contact(slave=faces[0], master=faces[1]),),
        impact=mca.ImpactPhase(duration=0.95 * time, output_interval=time / 400.0),
    )

    def read(result: mca.Result) -> list[Figure]:
        plateau = (result.time > 0.3 * time) & (result.time < 0.8 * time)
        impulse = float(result.F_n.sum() * (result.time[1] - result.time[0]))
        return [
            Figure("force", float(result.F_n[plateau].mean()), force, tolerance),
            Figure("impulse", impulse, 0.95 * force * time, 2.0 * tolerance),
        ]

    return Trial(scene, read)


@axis(
    group="two bodies",
    title="Young's modulus of the struck rod over that of the striking one",
    reference=f"{RODS}.",
    values=(1e-4, 1e-2, 1.0, 1e2, 1e4),
    quick=(1e-4, 1e4),
)
def stiffness_ratio(value: float, element: str) -> Trial:
    """As `rods`."""
    return rods(E_far=200e9 * value)


@axis(
    group="two bodies",
    title="Density of the struck rod over that of the striking one",
    reference=f"{RODS}.",
    values=(1e-3, 1e-1, 1.0, 10.0, 1e3),
    quick=(1e-3, 1e3),
)
def density_ratio(value: float, element: str) -> Trial:
    """As `rods`."""
    return rods(rho_far=7800.0 * value)


@axis(
    group="two bodies",
    title="Stiffness and density of the struck rod over those of the striking one, with friction 10",
    reference=f"{RODS}.",
    values=("1e-4, 1e-3", "1e-4, 1e3", "1e2, 1e-1", "1e4, 1e3"),
)
def both_ratios(value: str, element: str) -> Trial:
    """As `rods`."""
    stiffness, density = map(float, value.split(","))
    trial = rods(E_far=200e9 * stiffness, rho_far=7800.0 * density)
    contacts = tuple(replace(item, mu=10.0) for item in trial.scene.contacts)
    return replace(trial, scene=replace(trial.scene, contacts=contacts))


@axis(
    group="two bodies",
    title="Cells across the striking rod's end for each one of the struck rod",
    reference=f"{RODS}. The striking rod is the slave.",
    values=(0.5, 1, 3),
)
def cells_ratio(value: float, element: str) -> Trial:
    """As `rods`."""
    return rods(section=max(1, round(2 * value)))
