"""A rigid top precesses steadily: freely about its mass centre, or under gravity about a point that it stands on."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

import warp_mca as mca
from warp_mca import Param
from warp_mca.base.rotation import rotation_matrix

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "heavy": {"heavy": True}}


def inertia(side: float, height: float, rho: float, cells: int) -> tuple[float, float, float]:
    """Mass [kg], and moments of inertia of the box's nodes about its centre [kg m^2]: across its axis and about it.

    Nodes of n equal cells along a length a have the second moment a^2 / 12 (1 + 2 / n^2) of their mass.
    """
    mass, more = rho * side**2 * height, (1.0 + 2.0 / cells**2) / 12.0
    return mass, mass * more * (side**2 + height**2), mass * more * 2.0 * side**2


def build(
    *,
    heavy: Annotated[bool, Param("stands on the middle of its lower face, under gravity; off: free")] = False,
    tilt: Annotated[float, Param("angle of its axis from the vertical z", unit="rad")] = 0.4,
    precession: Annotated[float, Param("angular velocity of its axis about z", unit="rad/s")] = 20.0,
    gravity: Annotated[float, Param("acceleration of gravity of a heavy top, along -z", unit="m/s^2")] = 9.8,
    side: Annotated[float, Param("of its square section", unit="m", low=0.0, exclusive=True)] = 0.2,
    height: Annotated[float, Param("of the top", unit="m", low=0.0, exclusive=True)] = 0.1,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 2700.0,
    turns: Annotated[float, Param("simulated turns of its axis", low=0.0, exclusive=True)] = 2.0,
    samples: Annotated[int, Param("rows of the history", low=1)] = 200,
    cells: Annotated[int, Param("cells along each edge, even", low=2)] = 2,
) -> mca.Scene:
    """The axis turns about z at the rate W of `precession` while the top turns about it at w_3, as

        I_3 w_3 W - I_1 W^2 cos(tilt) = m g l

    demands, with l and I_1 about the point that it stands on; without gravity I_1 W is its angular momentum along z.
    """
    mass, across, about = inertia(side, height, rho, cells)
    arm = 0.5 * height if heavy else 0.0
    turning = (across + mass * arm**2) * precession**2 * math.cos(tilt)
    spin = (turning + mass * gravity * arm) / (about * precession)
    frame = rotation_matrix((0.0, tilt, 0.0))
    omega = np.array([0.0, 0.0, precession]) + (spin - precession * math.cos(tilt)) * frame[:, 2]
    box = mca.Box(
        size=(side, side, height),
        divisions=(cells, cells, cells),
        origin=(-0.5 * side, -0.5 * side, 0.0 if heavy else -0.5 * height),
    )
    top = mca.Body(
        name="top",
        geometry=box,
        material=mca.Elastic(E=70e9, nu=0.3, rho=rho),
        rotation=(0.0, tilt, 0.0),
        angular_velocity=(float(omega[0]), float(omega[1]), float(omega[2])),
        rigid=True,
    )
    duration = turns * 2.0 * math.pi / abs(precession)
    return mca.Scene(
        name="spinning_top",
        bodies=(top,),
        joints=(mca.Spherical(name="O", body="top", at=(0.0, 0.0, 0.0)),) if heavy else (),
        gravity=(0.0, 0.0, -gravity if heavy else 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / samples),
        tip=mca.Point(body="top", at=(0.0, 0.0, 0.5 * height + arm)),
    )
