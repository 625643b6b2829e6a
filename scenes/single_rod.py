"""A round rod strikes a rigid plane with its end face, along its axis."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {
    "quick": {},
    "standard": {"section": 8, "ring": 4, "axial": 200},
}


def build(
    *,
    v: Annotated[float, Param("speed of the rod", unit="m/s", low=0.0, exclusive=True)] = 1.0,
    length: Annotated[float, Param("length of the rod", unit="m", low=0.0, exclusive=True)] = 0.2,
    radius: Annotated[float, Param("radius of the rod", unit="m", low=0.0, exclusive=True)] = 0.005,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.27,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, high=10.0)] = 0.0,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))] = 1.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 1.2e-4,
    output_interval: Annotated[
        float, Param("time between rows of the history", unit="s", low=0.0, exclusive=True)
    ] = 1e-6,
    section: Annotated[int, Param("cells along each side of the core, even", low=2)] = 4,
    ring: Annotated[int, Param("cells from the core to the surface", low=1)] = 2,
    axial: Annotated[int, Param("cells along the rod", low=1)] = 80,
) -> mca.Scene:
    """An elastic rod along x, its end at the plane x = length."""
    rod = mca.Rod(radius=radius, length=length, tip="flat", section=section, ring=ring, axial=axial)
    wall = mca.RigidPlane(point=(length, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    axis = mca.Line(body="rod", start=(length, 0.0, 0.0), end=(0.0, 0.0, 0.0))
    return mca.Scene(
        name="single_rod",
        bodies=(
            mca.Body(
                name="rod",
                geometry=rod,
                material=mca.Elastic(E=E, nu=nu, rho=rho),
                velocity=(v, 0.0, 0.0),
                exact_mass=False,  # published figures of this scene are of the mass of its cells
            ),
        ),
        contacts=(mca.Contact(slave=mca.Surface(body="rod", nodes="end"), master=wall, mu=mu, penalty=penalty),),
        impact=mca.ImpactPhase(duration=duration, output_interval=output_interval),
        paths=(mca.Path(name="axis", lines=(axis,), spacing=length / 80.0),),
        tip=mca.Point(body="rod", at=(0.5 * length, 0.0, 0.0)),
    )


def check(result: mca.Result) -> list[str]:
    """Bar theory: F = A rho c v with c = sqrt(E / rho), for 2 L / c; ends and radial inertia blur the corners."""
    p = {key: float(result.summary["parameters"][key]) for key in ("v", "length", "radius", "E", "rho", "section")}
    c = math.sqrt(p["E"] / p["rho"])
    sides = 4 * p["section"]  # of the polygon that the mesh has for a circle
    area = 0.5 * sides * math.sin(2.0 * math.pi / sides) * p["radius"] ** 2
    force = area * p["rho"] * c * p["v"]
    plateau = result.F_n[(result.time > 0.4 * p["length"] / c) & (result.time < 1.6 * p["length"] / c)].mean()
    found = []
    if abs(plateau / force - 1.0) > 0.02:
        found.append(f"mean force {plateau:.4g} N differs from A rho c v = {force:.4g} N by over 2 %")
    if abs(result.summary["contact_duration"] / (2.0 * p["length"] / c) - 1.0) > 0.1:
        found.append(
            f"contact lasted {result.summary['contact_duration']:.4g} s, not 2 L / c = {2 * p['length'] / c:.4g} s"
        )
    return found
