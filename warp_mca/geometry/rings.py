"""Owns `Ring` and `join`: the half O-grid (z >= 0) that the blocks of a rod's section and tip are made of."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.geometry.blocks import Blocks

Vector = NDArray[np.float64]

# The two ends of each outer side; corners 0 and 1 lie in the plane z = 0, where the other half is mirrored on.
SIDES = ((1, 2), (2, 3), (3, 0))

CORE_RADIUS = 0.64  # from the axis to the corners of a disc's core [radius]
CORE_BULGE = 0.24  # of the core's edges [rad]


@dataclass(frozen=True)
class Ring:
    """Block corners of a four-sided core and of the rim around it, as handles.

    Attributes:
        core: the middle of the core's side towards -y, of that towards +y, its corners at +y and at -y.
        rim: the corresponding points of the rim.
    """

    core: list[int]
    rim: list[int]

    def faces(self) -> list[list[int]]:
        """The three faces between core and rim, in the order of SIDES."""
        return bands(self.core, self.rim)


def bands(inner: list[int], outer: list[int]) -> list[list[int]]:
    """The faces between two such sets of four corners, in the order of SIDES."""
    return [[inner[a], inner[b], outer[b], outer[a]] for a, b in SIDES]


def join(blocks: Blocks, low: Ring, high: Ring, divisions: tuple[int, int, int], cells: str) -> None:
    """Adds the four blocks from ring to ring.

    Args:
        blocks: takes the blocks.
        low, high: where they begin and end.
        divisions: number of cells along each whole side of the core, from core to rim, and from low to high.
        cells: name of the cell set.
    """
    section, ring, count = divisions
    half = section // 2
    blocks.block(low.core + high.core, (section, half, count), cells)
    for below, above, along in zip(low.faces(), high.faces(), (half, section, half), strict=True):
        blocks.block(below + above, (along, ring, count), cells)


def bowed_face(blocks: Blocks, origin: Vector, near: Vector, far: Vector, bulge: float) -> list[int]:
    """Half of a four-sided face whose edges are arcs that bow away from `origin`.

    Args:
        blocks: takes the points.
        origin: [m], shape (3,), in the plane z = 0.
        near, far: corners at +y and at -y relative to the origin [m], shape (3,).
        bulge: angle between an edge and its chord at their ends [rad].

    Returns:
        Handles in the order of `Ring.core`.
    """
    middles = []
    for corner in (far, near):
        foot = corner * [1.0, 1.0, 0.0]
        middles.append(foot * (1.0 + corner[2] * math.tan(0.5 * bulge) / np.linalg.norm(foot)))
    places = [*middles, near, far]
    handles = [blocks.point(origin + place) for place in places]
    mirrored = np.array([1.0, 1.0, -1.0])
    for a, b, start in ((0, 3, far * mirrored), (1, 2, near * mirrored), (2, 3, near), (0, 1, places[0])):
        chord = places[b] - start
        foot = 0.5 * (start + places[b])
        away = foot - chord * (foot @ chord) / (chord @ chord)
        if np.linalg.norm(away) > 1e-9 * np.linalg.norm(chord):  # a chord through the origin stays straight
            away *= 0.5 * np.linalg.norm(chord) / math.tan(bulge) / np.linalg.norm(away)
            blocks.arc(handles[a], handles[b], blocks.point(origin + foot - away))
    return handles


def disc(blocks: Blocks, x: float, radius: float) -> tuple[Ring, int]:
    """The ring of a round section of this radius [m] at `x` [m] on the x axis, and its centre."""
    origin = np.array([x, 0.0, 0.0])
    centre = blocks.point(origin)
    d = math.sqrt(0.5)
    near, far = np.array([0.0, d, d]), np.array([0.0, -d, d])
    inner = CORE_RADIUS * radius
    core = bowed_face(blocks, origin, inner * near, inner * far, CORE_BULGE)
    outer = np.array([0.0, -1.0, 0.0]), np.array([0.0, 1.0, 0.0]), near, far
    rim = [blocks.point(origin + radius * place) for place in outer]
    for a, b in SIDES:
        blocks.arc(rim[a], rim[b], centre)
    return Ring(core, rim), centre
