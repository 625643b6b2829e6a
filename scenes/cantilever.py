"""A bar clamped at one end vibrates after a sudden acceleration along or across it."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 160, "deep": 8}}


def build(
    *,
    length: Annotated[float, Param("length, along x", unit="m", low=0.0, exclusive=True)] = 1.0,
    depth: Annotated[float, Param("depth of the section, along y", unit="m", low=0.0, exclusive=True)] = 0.1,
    width: Annotated[float, Param("half width of the section, along z", unit="m", low=0.0, exclusive=True)] = 0.025,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.0,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    push: Annotated[float, Param("acceleration along x", unit="m/s^2")] = 0.0,
    sag: Annotated[float, Param("acceleration along -y", unit="m/s^2")] = 1000.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 25e-3,
    samples: Annotated[int, Param("rows of the history", low=1)] = 400,
    axial: Annotated[int, Param("cells along the length", low=1)] = 40,
    deep: Annotated[int, Param("cells along the depth, even", low=2)] = 2,
    wide: Annotated[int, Param("cells along the half width", low=1)] = 1,
) -> mca.Scene:
    """Half of a bar that is symmetric about the plane z = 0; its root may contract along z."""
    bar = mca.Box(size=(length, depth, width), divisions=(axial, deep, wide), origin=(0.0, -0.5 * depth, 0.0))
    return mca.Scene(
        name="cantilever",
        bodies=(mca.Body(name="bar", geometry=bar, material=mca.Elastic(E=E, nu=nu, rho=rho)),),
        fixed=(
            mca.Fixed(body="bar", nodes="xmin", axes="xy"),
            mca.Fixed(body="bar", nodes="zmin", axes="z"),
        ),
        gravity=(push, -sag, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / samples),
        tip=mca.Point(body="bar", at=(length, 0.0, 0.0)),
    )
