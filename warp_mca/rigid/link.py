"""Owns the rigid links of a planar chain: slender rods, or the masses of a mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value

Vec2 = tuple[float, float]
Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Link:
    """One rigid link. Its frame is the body's frame, shifted to the inbound hinge.

    Attributes:
        body: name of the body that it stands for.
        mass: [kg].
        centre: of mass, in the link's frame [m].
        inertia: about the centre of mass and the z axis [kg m^2].
        hinge_out: the next link's hinge in this link's frame [m]; of no account on the last link.
        hinge_in: the inbound hinge in the body's frame [m].
    """

    body: str
    mass: float
    centre: Vec2
    inertia: float
    hinge_out: Vec2 = (0.0, 0.0)
    hinge_in: Vec2 = (0.0, 0.0)

    def __post_init__(self) -> None:
        if not (math.isfinite(self.mass) and self.mass > 0.0):
            raise bad_value(f"mass of link {self.body}", self.mass, "give a finite number of kg above 0")
        if not (math.isfinite(self.inertia) and self.inertia >= 0.0):
            raise bad_value(f"inertia of link {self.body}", self.inertia, "give a finite number of kg m^2, 0 or above")


def slender_link(
    body: str, end: Vec2, *, mass: float, hinge_out: Vec2 = (0.0, 0.0), hinge_in: Vec2 = (0.0, 0.0)
) -> Link:
    """A uniform slender rod from the inbound hinge to `end` [m] in the link's frame; inertia m l^2 / 12 (Eq. 3)."""
    inertia = mass * (end[0] ** 2 + end[1] ** 2) / 12.0
    centre = (0.5 * end[0], 0.5 * end[1])
    return Link(body=body, mass=mass, centre=centre, inertia=inertia, hinge_out=hinge_out, hinge_in=hinge_in)


def mesh_link(
    body: str, points: Array, masses: Array, *, hinge_out: Vec2 = (0.0, 0.0), hinge_in: Vec2 = (0.0, 0.0)
) -> Link:
    """A link with the planar mass, centre and inertia of lumped nodal masses.

    These sums are what the finite-element model will carry, so a rigid motion keeps momentum, angular momentum and
    kinetic energy to round-off when it is handed over.

    Args:
        body: its name.
        points: node positions in the body's frame [m], shape (node_count, 3), float64.
        masses: lumped nodal masses [kg], shape (node_count,), float64.
        hinge_out: the next hinge in the link's frame [m].
        hinge_in: the inbound hinge in the body's frame [m].

    Raises:
        RequestError: one mass for each node is not given.
    """
    if masses.shape != (len(points),):
        raise bad_value(
            f"shape of the nodal masses of {body}", masses.shape, f"give one for each of {len(points)} nodes"
        )
    arms = points[:, :2] - np.asarray(hinge_in)
    mass = masses.sum()
    centre = masses @ arms / mass
    inertia = masses @ ((arms - centre) ** 2).sum(axis=1)
    return Link(
        body=body,
        mass=float(mass),
        centre=(float(centre[0]), float(centre[1])),
        inertia=float(inertia),
        hinge_out=hinge_out,
        hinge_in=hinge_in,
    )
