"""An elastic block is laid at rest on a moving belt, whose friction carries it along."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import warp_mca as mca
from warp_mca import Param
from warp_mca.scenes import sliding_block

PRESETS: dict[str, dict[str, object]] = {"quick": {}, "fine": {"cells": 8}}


def build(
    *,
    v: Annotated[float, Param("speed of the belt", unit="m/s", low=0.0, exclusive=True)] = 1.0,
    mu: Annotated[float, Param("coefficient of friction", low=0.0, exclusive=True)] = 0.3,
    g: Annotated[float, Param("acceleration of gravity", unit="m/s^2", low=0.0, exclusive=True)] = 300.0,
    penalty: Annotated[float, Param("factor of the contact stiffness", low=0.0, exclusive=True)] = 0.01,
    cells: Annotated[int, Param("cells from bottom to top", low=1)] = 2,
    held: Annotated[bool, Param("whether the block may only move up and down; asks for cells = 1")] = False,
) -> mca.Scene:
    """The block of `sliding_block` on a belt that moves along +x."""
    scene = sliding_block.build(v=v, mu=mu, g=g, penalty=penalty, cells=cells)
    block = dataclasses.replace(scene.body("block"), velocity=(0.0, 0.0, 0.0))
    belt = mca.RigidPlane(velocity=(v, 0.0, 0.0))
    return dataclasses.replace(
        scene,
        name="block_on_belt",
        bodies=(block,),
        contacts=(dataclasses.replace(scene.contacts[0], master=belt),),
        fixed=tuple(mca.Fixed(body="block", nodes=nodes, axes="xz") for nodes in ("ymin", "ymax")) if held else (),
    )
