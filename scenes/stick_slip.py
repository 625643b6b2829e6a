"""A block on a belt, held back by a spring, sticks to the belt until the spring tears it off, and then swings."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

import warp_mca as mca
from warp_mca import Param
from warp_mca.geometry.mesh import Mesh

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 16}}


def build(
    *,
    v: Annotated[float, Param("speed of the belt", unit="m/s", low=0.0, exclusive=True)] = 0.1,
    force: Annotated[float, Param("limit of friction mu F_n", unit="N", low=0.0, exclusive=True)] = 1.0,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, exclusive=True)] = 0.3,
    stiffness: Annotated[float, Param("of the spring", unit="N/m", low=0.0, exclusive=True)] = 2e4,
    mass: Annotated[float, Param("of the block", unit="kg", low=0.0, exclusive=True)] = 2e-3,
    light: Annotated[float, Param("mass of the spring over that of the block", low=0.0, exclusive=True)] = 0.004,
    E: Annotated[float, Param("Young's modulus of the block", unit="Pa", low=0.0, exclusive=True)] = 100e9,
    edge: Annotated[float, Param("of the square section", unit="m", low=0.0, exclusive=True)] = 0.01,
    cells: Annotated[int, Param("cells along the spring; the block has a quarter of them", low=4)] = 8,
) -> mca.Scene:
    """A bar along x: a soft, light spring from x = 0, then the block. Only motion along x is free.

    All of it moves with the belt until the spring's far end is slowed down to rest, over twenty passages of waves to
    and fro in the spring, which leaves few of them. The block is pressed to the depth at which friction's limit is
    `force`; it is stiff, because waves in it would tear it off too early.
    """
    count = cells // 4
    cube = edge**3
    block = mca.Elastic(E=E, nu=0.0, rho=mass / (count * cube))
    spring = mca.Elastic(E=stiffness * cells / edge, nu=0.0, rho=light * mass / (cells * cube))
    bar = mca.Box(size=((cells + count) * edge, edge, edge), divisions=(cells + count, 1, 1)).build()
    along = bar.points[bar.hexahedra].mean(axis=1)[:, 0]
    cell_sets = {
        "spring": np.flatnonzero(along < cells * edge).astype(np.int32),
        "block": np.flatnonzero(along > cells * edge).astype(np.int32),
    }
    sole = bar.nodes("ymin")[bar.points[bar.nodes("ymin"), 0] > (cells - 0.5) * edge]
    mesh = Mesh(bar.points, bar.hexahedra, {**bar.node_sets, "sole": sole}, cell_sets)
    depth = force / mu / (block.bulk_modulus * edge * len(sole))
    period = 2.0 * math.pi * math.sqrt(mass / stiffness)
    slowing = 40.0 * math.sqrt(light * mass / stiffness)  # a wave passes in the square root
    duration = 0.5 * slowing + force / (stiffness * v) + 1.5 * period
    return mca.Scene(
        name="stick_slip",
        bodies=(
            mca.Body(
                name="bar",
                geometry=mesh,
                material={"spring": spring, "block": block},
                position=(0.0, -depth, 0.0),
                velocity=(v, 0.0, 0.0),
            ),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="bar", nodes="sole"),
                master=mca.RigidPlane(velocity=(v, 0.0, 0.0)),
                mu=mu,
                penalty=1.0,
                initial_overlap="press",
            ),
        ),
        fixed=tuple(mca.Fixed(body="bar", nodes=nodes, axes="yz") for nodes in ("ymin", "ymax")),
        prescribed=(mca.Prescribed(body="bar", nodes="xmin", axis="x", times=(0.0, slowing), velocities=(v, 0.0)),),
        impact=mca.ImpactPhase(duration=duration, output_interval=period / 800.0),
        tip=mca.Point(body="bar", at=((cells + count) * edge, 0.0, 0.0)),
    )
