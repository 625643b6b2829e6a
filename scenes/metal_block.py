"""A block of metal pulled and pushed in cycles, free to contract sideways."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 4}}

_TABLE = 40  # entries of the velocity table in each stroke


def build(
    *,
    strain: Annotated[
        float, Param("greatest tensile and compressive strain", low=0.0, high=0.1, exclusive=True)
    ] = 0.01,
    strokes: Annotated[int, Param("the first from rest to tension, each other one across to the far side", low=1)] = 4,
    stroke: Annotated[float, Param("time of each stroke", unit="s", low=0.0, exclusive=True)] = 2e-3,
    size: Annotated[float, Param("edge of the block", unit="m", low=0.0, exclusive=True)] = 0.01,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    sigma_y: Annotated[float, Param("yield stress", unit="Pa", low=0.0, exclusive=True)] = 400e6,
    E_t: Annotated[float, Param("tangent modulus beyond yield", unit="Pa", low=0.0)] = 20e9,
    beta: Annotated[float, Param("share of isotropic hardening", low=0.0, high=1.0)] = 0.0,
    cells: Annotated[int, Param("along each edge", low=1)] = 1,
) -> mca.Scene:
    """A cube; its face x = size moves, slowly beside its own vibrations, and rests at the end of every stroke."""
    block = mca.Box(size=(size, size, size), divisions=(cells, cells, cells))
    times, velocities = [], []
    for n in range(strokes):
        reach = size * strain * (1.0 if n == 0 else 2.0) * (-1.0) ** n
        for i in range(_TABLE + (n == strokes - 1)):
            times.append(stroke * (n + i / _TABLE))
            # Straight lines between equally spaced entries enclose just the area of the cosine: the displacement.
            velocities.append(reach / stroke * (1.0 - math.cos(2.0 * math.pi * i / _TABLE)))
    return mca.Scene(
        name="metal_block",
        bodies=(
            mca.Body(
                name="block",
                geometry=block,
                material=mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta),
            ),
        ),
        fixed=tuple(mca.Fixed(body="block", nodes=f"{axis}min", axes=axis) for axis in "xyz"),
        prescribed=(
            mca.Prescribed(body="block", nodes="xmax", axis="x", times=tuple(times), velocities=tuple(velocities)),
        ),
        impact=mca.ImpactPhase(duration=strokes * stroke, output_interval=stroke / 200.0),
        paths=(
            mca.Path(
                name="axis",
                lines=(
                    mca.Line(body="block", start=(0.0, 0.5 * size, 0.5 * size), end=(size, 0.5 * size, 0.5 * size)),
                ),
                spacing=0.5 * size,
            ),
        ),
        tip=mca.Point(body="block", at=(size, 0.0, 0.0)),
    )
