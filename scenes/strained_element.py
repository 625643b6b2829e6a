"""One element whose corners are led through tension and shear: together, one after the other, or around a circle."""

from __future__ import annotations

import dataclasses
import math
from typing import Annotated

import numpy as np

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"duration": 40e-3}}

_TABLE = 200  # entries of the velocity tables


def _rates(course: str, s: float) -> tuple[float, float]:
    """Rates of axial strain and of shear angle over sqrt(3) at the share s of the duration, as shares of the strain."""
    if course == "together":
        pull = 1.0 - math.cos(2.0 * math.pi * s)
        return pull, pull
    if course == "in turn":
        pull = 2.0 * (1.0 - math.cos(4.0 * math.pi * s))
        return (pull, 0.0) if s < 0.5 else (0.0, pull)
    if s < 0.2:  # out to the circle, then once around it, starting and ending at rest
        return 5.0 * (1.0 - math.cos(10.0 * math.pi * s)), 0.0
    around = (s - 0.2) / 0.8
    angle = 2.0 * math.pi * around - math.sin(2.0 * math.pi * around)
    turn = 2.0 * math.pi / 0.8 * (1.0 - math.cos(2.0 * math.pi * around))
    return -turn * math.sin(angle), turn * math.cos(angle)


def build(
    *,
    course: Annotated[str, Param("of axial strain and shear", choices=("together", "in turn", "around"))] = "in turn",
    strain: Annotated[float, Param("greatest axial strain", low=0.0, high=0.1, exclusive=True)] = 0.01,
    duration: Annotated[float, Param("simulated time", unit="s", low=0.0, exclusive=True)] = 4e-3,
    size: Annotated[float, Param("edge of the element", unit="m", low=0.0, exclusive=True)] = 0.01,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 200e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 7800.0,
    sigma_y: Annotated[float, Param("yield stress", unit="Pa", low=0.0, exclusive=True)] = 400e6,
    E_t: Annotated[float, Param("tangent modulus beyond yield", unit="Pa", low=0.0)] = 20e9,
    beta: Annotated[float, Param("share of isotropic hardening", low=0.0, high=1.0)] = 0.5,
) -> mca.Scene:
    """A cube; stretched by e along x, by -e / 2 along y and z, and sheared so that u_y = g x, g up to sqrt(3) e.

    All its corners are driven, so its inertia has no say. A shear of sqrt(3) e is as much as e to von Mises.
    """
    mesh = mca.Box(size=(size, size, size), divisions=(1, 1, 1)).build()
    corners = {f"corner{i}": np.array([i], dtype=np.int32) for i in range(8)}
    mesh = dataclasses.replace(mesh, node_sets={**mesh.node_sets, **corners})
    shares = [i / _TABLE for i in range(_TABLE + 1)]
    times = tuple(duration * s for s in shares)
    rates = strain / duration * np.array([_rates(course, s) for s in shares])
    driven = []
    for i, (x, y, z) in enumerate(mesh.points):
        speeds = {"x": x * rates[:, 0], "y": math.sqrt(3.0) * x * rates[:, 1] - 0.5 * y * rates[:, 0]}
        speeds["z"] = -0.5 * z * rates[:, 0]
        for axis, speed in speeds.items():
            velocities = tuple(speed.tolist())
            driven.append(
                mca.Prescribed(body="cube", nodes=f"corner{i}", axis=axis, times=times, velocities=velocities)
            )
    middle = 0.5 * size
    return mca.Scene(
        name="strained_element",
        bodies=(
            mca.Body(
                name="cube",
                geometry=mesh,
                material=mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=E_t, beta=beta),
            ),
        ),
        prescribed=tuple(driven),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 400.0),
        paths=(
            mca.Path(
                name="axis",
                lines=(mca.Line(body="cube", start=(0.0, middle, middle), end=(size, middle, middle)),),
                spacing=middle,
            ),
        ),
        tip=mca.Point(body="cube", at=(size, size, size)),
    )
