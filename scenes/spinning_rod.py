"""A straight rod spins about z, about its end or freely about its centre."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 160}}


def build(
    *,
    hinged: Annotated[bool, Param("hinged to the ground at its end; off: free, about its centre")] = True,
    omega: Annotated[float, Param("angular velocity", unit="rad/s")] = 20.0,
    length: Annotated[float, Param("length of the rod", unit="m", low=0.0, exclusive=True)] = 1.0,
    side: Annotated[float, Param("of its square section", unit="m", low=0.0, exclusive=True)] = 0.02,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 70e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.0,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    periods: Annotated[float, Param("simulated periods of the lowest axial mode", low=0.0, exclusive=True)] = 4.0,
    samples: Annotated[int, Param("rows of the history", low=1)] = 400,
    axial: Annotated[int, Param("cells along the rod, even", low=2)] = 40,
    section: Annotated[int, Param("cells along each side of the section, even", low=2)] = 2,
) -> mca.Scene:
    """The rod lies along x at first and is free of stress, so that its stress overshoots to twice the lasting one."""
    first = 0.0 if hinged else -0.5 * length
    rod = mca.Box(
        size=(length, side, side), divisions=(axial, section, section), origin=(first, -0.5 * side, -0.5 * side)
    )
    duration = periods * (4.0 if hinged else 2.0) * length / math.sqrt(E / rho)
    material = mca.Elastic(E=E, nu=nu, rho=rho)
    line = mca.Line(body="rod", start=(first, 0.0, 0.0), end=(first + length, 0.0, 0.0))
    return mca.Scene(
        name="spinning_rod",
        bodies=(mca.Body(name="rod", geometry=rod, material=material, angular_velocity=(0.0, 0.0, omega)),),
        joints=(mca.Revolute(name="O", body="rod", at=(0.0, 0.0, 0.0)),) if hinged else (),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / samples),
        paths=(mca.Path(name="axis", lines=(line,), spacing=length / axial),),
        tip=mca.Point(body="rod", at=(first + length, 0.0, 0.0)),
    )
