"""Two equal bars with cells graded along them collide end on: fine and coarse cells, each with a step of its own."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np

import warp_mca as mca
from warp_mca import Param

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"axial": 80}}


def build(
    *,
    v: Annotated[float, Param("speed of each bar", unit="m/s", low=0.0, exclusive=True)] = 0.1,
    length: Annotated[float, Param("of each bar", unit="m", low=0.0, exclusive=True)] = 10.0,
    side: Annotated[float, Param("of their section", unit="m", low=0.0, exclusive=True)] = 1.0,
    E: Annotated[float, Param("Young's modulus", unit="Pa", low=0.0, exclusive=True)] = 1.0,
    rho: Annotated[float, Param("density", unit="kg/m^3", low=0.0, exclusive=True)] = 1.0,
    ratio: Annotated[float, Param("longest cell over the shortest", low=1.0)] = 8.0,
    fine: Annotated[str, Param("where cells are short", choices=("contact", "ends"))] = "contact",
    axial: Annotated[int, Param("cells along each bar", low=2)] = 40,
    section: Annotated[int, Param("cells along each side of the section", low=1)] = 1,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True)] = 1.0,
) -> mca.Scene:
    """Elastic bars along x without Poisson effect that touch at x = 0."""
    box = mca.Box(size=(length, side, side), divisions=(axial, section, section)).build()
    sizes = np.geomspace(1.0, ratio, axial)
    places = length * np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    right = _graded(box, places if fine == "contact" else length - places[::-1])
    left = _graded(box, -length + places if fine == "ends" else -places[::-1])
    material = mca.Elastic(E=E, nu=0.0, rho=rho)
    transit = length / math.sqrt(E / rho)
    return mca.Scene(
        name="graded_bars",
        bodies=(
            mca.Body(name="left", geometry=left, material=material, velocity=(v, 0.0, 0.0)),
            mca.Body(name="right", geometry=right, material=material, velocity=(-v, 0.0, 0.0)),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="left", nodes="xmax"),
                master=mca.Surface(body="right", nodes="xmin"),
                penalty=penalty,
            ),
        ),
        impact=mca.ImpactPhase(duration=2.4 * transit, output_interval=0.01 * transit),
    )


def _graded(box: mca.Mesh, places: np.ndarray) -> mca.Mesh:
    """The mesh of a box with its layers of nodes along x at these places [m]."""
    layer = np.unique(box.points[:, 0].round(9), return_inverse=True)[1]
    return replace(box, points=np.column_stack([places[layer], box.points[:, 1:]]))
