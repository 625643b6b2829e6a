"""A rigid bar swings on a hinge at its end, as far as it is let go."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "small": {"amplitude": 0.05}}


def build(
    *,
    amplitude: Annotated[float, Param("greatest angle from the downward vertical", unit="rad")] = 2.0,
    gravity: Annotated[float, Param("acceleration of gravity, along -y", unit="m/s^2", low=0.0, exclusive=True)] = 9.8,
    length: Annotated[float, Param("of the bar", unit="m", low=0.0, exclusive=True)] = 1.0,
    side: Annotated[float, Param("of its square section", unit="m", low=0.0, exclusive=True)] = 0.1,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 6.0,
    samples: Annotated[int, Param("rows of the history, and steps at least", low=1)] = 2000,
    axial: Annotated[int, Param("cells along the bar", low=1)] = 4,
) -> mca.Scene:
    """The bar hangs on the origin and turns about z; it is let go at rest."""
    bar = mca.Box(size=(length, side, side), divisions=(axial, 2, 2), origin=(0.0, -0.5 * side, -0.5 * side))
    body = mca.Body(
        name="bar",
        geometry=bar,
        material=mca.Elastic(E=70e9, nu=0.3, rho=rho),
        rotation=(0.0, 0.0, amplitude - 0.5 * math.pi),
        rigid=True,
    )
    return mca.Scene(
        name="pendulum",
        bodies=(body,),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0)),),
        gravity=(0.0, -gravity, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / samples),
        tip=mca.Point(body="bar", at=(length, 0.0, 0.0)),
    )
