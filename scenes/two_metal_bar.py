"""A bar of two metals, end to end: a pulse meets the interface, part of it goes on and part of it comes back."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated

import numpy as np

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 800}}

_TABLE = 200  # entries of the table of the driven end's velocity


def build(
    *,
    v: Annotated[float, Param("greatest speed of the driven end", unit="m/s")] = 1.0,
    rise: Annotated[float, Param("half the duration of the pulse", unit="s", low=0.0, exclusive=True)] = 25e-6,
    length: Annotated[float, Param("of each of the two parts", unit="m", low=0.0, exclusive=True)] = 0.5,
    side: Annotated[float, Param("of the square section", unit="m", low=0.0, exclusive=True)] = 0.01,
    E: Annotated[float, Param("Young's modulus of the driven part", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    rho: Annotated[float, Param("its density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    E_far: Annotated[float, Param("Young's modulus of the far part", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    rho_far: Annotated[float, Param("its density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    nu: Annotated[float, Param("Poisson's ratio of both", low=-1.0, high=0.5, exclusive=True)] = 0.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 195e-6,
    axial: Annotated[int, Param("cells along each part", low=1)] = 200,
) -> mca.Scene:
    """A bar along x, one cell wide, the interface in the middle; stress is recorded on its axis."""
    origin = (0.0, -0.5 * side, -0.5 * side)
    mesh = mca.Box(size=(2.0 * length, side, side), divisions=(2 * axial, 1, 1), origin=origin).build()
    far = np.flatnonzero(mesh.points[mesh.hexahedra].mean(axis=1)[:, 0] > length).astype(np.int32)
    mesh = dataclasses.replace(mesh, cell_sets={**mesh.cell_sets, "far": far})
    material = {
        "far": mca.Elastic(E=E_far, nu=nu, rho=rho_far),
        "*": mca.Elastic(E=E, nu=nu, rho=rho),
    }
    times = tuple(2.0 * rise * i / _TABLE for i in range(_TABLE + 1))
    return mca.Scene(
        name="two_metal_bar",
        bodies=(mca.Body(name="bar", geometry=mesh, material=material),),
        prescribed=(
            mca.Prescribed(
                body="bar",
                nodes="xmin",
                axis="x",
                times=times,
                velocities=tuple(v * math.sin(0.5 * math.pi * t / rise) ** 2 for t in times),
            ),
        ),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 600.0),
        paths=(
            mca.Path(
                name="axis",
                lines=(mca.Line(body="bar", start=(0.0, 0.0, 0.0), end=(2.0 * length, 0.0, 0.0)),),
                spacing=length / 20.0,
            ),
        ),
        tip=mca.Point(body="bar", at=(length, 0.0, 0.0)),
    )
