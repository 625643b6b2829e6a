"""A square rod strikes a longer one of the same section and material end on, along their common axis."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 160, "section": 8}}


def build(
    *,
    v: Annotated[float, Param("speed of the short rod", unit="m/s", low=0.0, exclusive=True)] = 2.0,
    length: Annotated[float, Param("length of the short rod", unit="m", low=0.0, exclusive=True)] = 0.5,
    ratio: Annotated[float, Param("length of the long rod over that of the short one", low=1.0)] = 2.0,
    side: Annotated[float, Param("of their section", unit="m", low=0.0, exclusive=True)] = 0.04,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))] = 1.0,
    axial: Annotated[int, Param("cells along the short rod", low=1)] = 40,
    section: Annotated[int, Param("cells along each side of the section", low=1)] = 2,
) -> mca.Scene:
    """Elastic rods along x without Poisson effect that touch at x = 0; the short one comes from x < 0."""
    material = mca.Elastic(E=E, nu=0.0, rho=rho)
    short = mca.Box(size=(length, side, side), divisions=(axial, section, section), origin=(-length, 0.0, 0.0))
    long = mca.Box(size=(ratio * length, side, side), divisions=(round(ratio * axial), section, section))
    transit = 2.0 * length / math.sqrt(E / rho)
    contact = mca.Contact(
        slave=mca.Surface(body="short", nodes="xmax"), master=mca.Surface(body="long", nodes="xmin"), penalty=penalty
    )
    duration = (ratio + 1.3) * transit  # whole passages of the wave after contact
    return mca.Scene(
        name="coaxial_rods",
        bodies=(
            mca.Body(name="short", geometry=short, material=material, velocity=(v, 0.0, 0.0)),
            mca.Body(name="long", geometry=long, material=material),
        ),
        contacts=(contact,),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 660.0),
        tip=mca.Point(body="short", at=(-0.5 * length, 0.0, 0.0)),
        target=mca.Point(body="long", at=(0.5 * ratio * length, 0.0, 0.0)),
    )
