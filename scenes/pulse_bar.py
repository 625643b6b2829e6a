"""A square bar whose end is driven along it: a short pulse, or a speed that is reached and kept."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 800, "section": 2}}

_TABLE = 800  # entries of the table of the driven end's velocity


def build(
    *,
    v: Annotated[float, Param("greatest speed of the driven end", unit="m/s")] = 1.0,
    drive: Annotated[str, Param("its speed over time", choices=("pulse", "kept"))] = "pulse",
    rise: Annotated[float, Param("time until the greatest speed", unit="s", low=0.0, exclusive=True)] = 40e-6,
    length: Annotated[float, Param("length of the bar", unit="m", low=0.0, exclusive=True)] = 1.0,
    side: Annotated[float, Param("side of its section", unit="m", low=0.0, exclusive=True)] = 0.004,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    sigma_y: Annotated[float, Param("yield stress; 0: elastic", unit="Pa", low=0.0)] = 0.0,
    E_t: Annotated[float, Param("tangent modulus beyond yield", unit="Pa", low=0.0)] = 0.0,
    beta: Annotated[float, Param("share of isotropic hardening", low=0.0, high=1.0)] = 0.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 240e-6,
    axial: Annotated[int, Param("cells along the bar", low=1)] = 200,
    section: Annotated[int, Param("cells along half the side of the section", low=1)] = 1,
) -> mca.Scene:
    """A quarter of a bar along x with free sides, its end x = 0 driven; stress is recorded on the bar's axis."""
    half = 0.5 * side
    bar = mca.Box(size=(length, half, half), divisions=(axial, section, section))
    elastic = mca.Elastic(E=E, nu=nu, rho=rho)
    plastic = mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta) if sigma_y > 0.0 else None
    end = (2.0 if drive == "pulse" else 1.0) * rise
    times = tuple(end * i / _TABLE for i in range(_TABLE + 1))
    return mca.Scene(
        name="pulse_bar",
        bodies=(mca.Body(name="bar", geometry=bar, material=plastic or elastic),),
        fixed=(mca.Fixed(body="bar", nodes="ymin", axes="y"), mca.Fixed(body="bar", nodes="zmin", axes="z")),
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
                lines=(mca.Line(body="bar", start=(0.0, 0.0, 0.0), end=(length, 0.0, 0.0)),),
                spacing=length / 40.0,
            ),
        ),
        tip=mca.Point(body="bar", at=(0.5 * length, 0.0, 0.0)),
    )
