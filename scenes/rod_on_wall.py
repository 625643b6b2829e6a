"""A square rod strikes a rigid wall with its whole end face, as a plane wave."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 160, "section": 16}}


def build(
    *,
    v: Annotated[float, Param("speed of the rod", unit="m/s", low=0.0, exclusive=True)] = 1.5,
    length: Annotated[float, Param("length of the rod", unit="m", low=0.0, exclusive=True)] = 2.0,
    area: Annotated[float, Param("of its cross-section", unit="m^2", low=0.0, exclusive=True)] = 0.2,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.0,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True, words=("auto",))] = 1.0,
    axial: Annotated[int, Param("cells along the rod", low=1)] = 40,
    section: Annotated[int, Param("cells along each side of the section", low=1)] = 4,
) -> mca.Scene:
    """An elastic rod along x, its end at the plane x = length."""
    side = math.sqrt(area)
    rod = mca.Box(size=(length, side, side), divisions=(axial, section, section))
    wall = mca.RigidPlane(point=(length, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    duration = 1.25 * 2.0 * length / math.sqrt(E / rho)
    return mca.Scene(
        name="rod_on_wall",
        bodies=(mca.Body(name="rod", geometry=rod, material=mca.Elastic(E=E, nu=nu, rho=rho), velocity=(v, 0.0, 0.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="rod", nodes="xmax"), master=wall, penalty=penalty),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 400.0),
        tip=mca.Point(body="rod", at=(0.5 * length, 0.0, 0.0)),
    )
