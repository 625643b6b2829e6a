"""Owns `InertiaBrick`: what stands for a rigid body without geometry, and the nodes that carry a given inertia."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.geometry.box import Box
from warp_mca.geometry.mass_properties import HEAVIEST, LIGHTEST, Matrix, inertia_matrix
from warp_mca.geometry.mesh import Mesh

CARRIERS = "inertia"  # node set of the corners that carry a given mass
FARTHEST = 1e3  # weight of a corner in the place of a point, at most: rounding of the corners grows by so much
LEAST = 1e-4  # half an edge over the longest, at least: an inertia is then off by its square


@dataclass(frozen=True, kw_only=True)
class InertiaBrick:
    """The brick in whose corners equal masses have a given centre and inertia; node set inertia, its corners.

    With I_1, I_2, I_3 about its axes, half of its edge along the first one is sqrt((I_2 + I_3 - I_1) / (2 m)).

    Attributes:
        mass: [kg].
        centre: of mass, in the body's frame [m].
        inertia: about the centre, along the axes of the frame [kg m^2], three rows.
    """

    mass: float
    centre: tuple[float, ...]
    inertia: Matrix

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.within("InertiaBrick", LIGHTEST, HEAVIEST, mass=self.mass)
        validate.vectors("InertiaBrick", centre=self.centre)
        object.__setattr__(self, "inertia", inertia_matrix("InertiaBrick", self.inertia))

    def refined(self, factor: float) -> InertiaBrick:
        """Itself: it is not computed."""
        return self

    def build(self) -> Mesh:
        """One cell."""
        box = Box(size=(2.0, 2.0, 2.0), divisions=(1, 1, 1), origin=(-1.0, -1.0, -1.0)).build()
        half, axes = half_edges(self.mass, np.array(self.inertia))
        points = np.array(self.centre) + (half * box.points) @ axes.T
        corners = np.arange(8, dtype=np.int32)
        return Mesh(points, box.hexahedra, {CARRIERS: corners}, box.cell_sets)


def half_edges(mass: float, inertia: Array) -> tuple[Array, Array]:
    """Half edges of a brick whose corners carry a mass with an inertia [m], shape (3,); its axes as columns, (3, 3).

    Args:
        mass: [kg].
        inertia: about the centre, shape (3, 3), float64.
    """
    moments, axes = np.linalg.eigh(inertia)
    if np.linalg.det(axes) < 0.0:
        axes = axes * np.array([1.0, 1.0, -1.0])
    half = np.sqrt(np.maximum(0.5 * moments.sum() - moments, 0.0) / mass)
    return np.maximum(half, LEAST * half.max()), axes


def corner_points(mass: float, centre: Array, inertia: Array) -> Array:
    """Corners of the `InertiaBrick` [m], shape (8, 3), float64."""
    half, axes = half_edges(mass, inertia)
    signs = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    return centre + (half * signs) @ axes.T


def corner_weights(field: str, body: str, place: Array, mesh: Mesh) -> tuple[Index, Array]:
    """Corners of the brick that stands for a rigid body, and weights by which a point moves with them.

    They are (1 + sum_k s_k xi_k) / 8 with signs s of corners, linear in the place xi in half edges: any place has
    its weights.

    Args:
        field, body: for errors.
        place: of the point [m], shape (3,).
        mesh: of the `InertiaBrick`.

    Raises:
        RequestError: the point, of the named field, lies farther away than rounding allows.
    """
    centre = mesh.points.mean(axis=0)
    arms = mesh.points - centre
    weight = 0.125 + arms @ np.linalg.solve(arms.T @ arms, place - centre)  # arms^T arms = 8 sum_k h_k h_k^T
    if not np.abs(weight).max() <= FARTHEST:
        remedy = f"body {body} is too thin or too small, by its inertia, for a point so far from it; give a nearer one"
        raise bad_value(field, tuple(place.tolist()), remedy)
    return np.arange(8, dtype=np.int32), weight
