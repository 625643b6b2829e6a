"""An elastic block slides on a rigid plane under its weight until friction stops it."""

from __future__ import annotations

from typing import Annotated

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 8}}


def build(
    *,
    v: Annotated[float, Param("initial speed", unit="m/s", low=0.0, exclusive=True)] = 1.0,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, exclusive=True)] = 0.3,
    g: Annotated[float, Param("acceleration of gravity", unit="m/s^2", low=0.0, exclusive=True)] = 300.0,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 10e9,
    nu: Annotated[float, Param("Poisson's ratio", low=-1.0, high=0.5, exclusive=True)] = 0.3,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 1000.0,
    height: Annotated[
        float, Param("of the block, which is five times as long and as wide", unit="m", low=0.0, exclusive=True)
    ] = 0.02,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True)] = 0.01,
    cells: Annotated[int, Param("cells from bottom to top", low=1)] = 2,
) -> mca.Scene:
    """The block moves along +x on the plane y = 0, sunk into it as deep as its weight asks for.

    Contact is soft beside the block: an elastic block whose contact is as stiff as itself chatters as it slides.
    """
    size = (5.0 * height, height, 5.0 * height)
    divisions = (5 * cells, cells, 5 * cells)
    material = mca.Elastic(E=E, nu=nu, rho=rho)
    edge = height / cells
    springs = penalty * material.bulk_modulus * edge * (divisions[0] + 1) * (divisions[2] + 1)
    weight = rho * size[0] * size[1] * size[2] * g
    block = mca.Body(
        name="block",
        geometry=mca.Box(size=size, divisions=divisions),
        material=material,
        position=(0.0, -weight / springs, 0.0),
        velocity=(v, 0.0, 0.0),
    )
    sole = mca.Surface(body="block", nodes="ymin")
    duration = 1.2 * v / (mu * g)
    return mca.Scene(
        name="sliding_block",
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
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 240.0),
        gravity=(0.0, -g, 0.0),
        tip=mca.Point(body="block", at=(0.5 * size[0], 0.5 * size[1], 0.5 * size[2])),
    )
