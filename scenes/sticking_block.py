"""A block pressed onto a rigid plane swings on its tangential contact springs, below the limit of friction."""

from __future__ import annotations

import math
from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 16}}


def build(
    *,
    share: Annotated[float, Param("of the limit of friction that is reached", low=0.0, high=1.0, exclusive=True)] = 0.8,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, exclusive=True)] = 0.3,
    depth: Annotated[float, Param("to which the block is pressed in", unit="m", low=0.0, exclusive=True)] = 1e-5,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 10e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 1000.0,
    edge: Annotated[float, Param("of the cells, one of which is the height", unit="m", low=0.0, exclusive=True)] = 0.01,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True)] = 0.001,
    cells: Annotated[int, Param("cells along each side", low=1)] = 4,
    periods: Annotated[float, Param("simulated time in periods", low=0.0, exclusive=True)] = 10.0,
) -> mca.Scene:
    """All nodes keep their height, so that the normal force stays what it is; the block starts along +x."""
    material = mca.Elastic(E=E, nu=nu, rho=rho)
    springs = penalty * material.bulk_modulus * edge * (cells + 1) ** 2
    omega = math.sqrt(springs / (rho * cells**2 * edge**3))
    block = mca.Body(
        name="block",
        geometry=mca.Box(size=(cells * edge, edge, cells * edge), divisions=(cells, 1, cells)),
        material=material,
        position=(0.0, -depth, 0.0),
        velocity=(share * mu * depth * omega, 0.0, 0.0),
    )
    sole = mca.Surface(body="block", nodes="ymin")
    period = 2.0 * math.pi / omega
    return mca.Scene(
        name="sticking_block",
        bodies=(block,),
        contacts=(
            mca.Contact(
                slave=sole,
                master=mca.RigidPlane(),
                mu=mu,
                penalty=penalty,
                initial_overlap="press",
                law=mca.Penalty(),  # undamped, as the closed form
            ),
        ),
        fixed=tuple(mca.Fixed(body="block", nodes=nodes, axes="y") for nodes in ("ymin", "ymax")),
        impact=mca.ImpactPhase(duration=periods * period, output_interval=period / 40.0),
        tip=mca.Point(body="block", at=(0.0, 0.0, 0.0)),
    )
