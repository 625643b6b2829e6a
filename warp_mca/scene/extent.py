"""Owns the box around bodies, their mass and its centre, from their meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import rotation_matrix
from warp_mca.scene.bodies import Body

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh


@dataclass(frozen=True)
class Extent:
    """The box around parts, in the frame in which they are given.

    Attributes:
        low, high: its corners [m], shape (3,), float64.
        centre: of mass [m], shape (3,), float64.
        mass: [kg].
    """

    low: Array
    high: Array
    centre: Array
    mass: float

    @property
    def diagonal(self) -> float:
        """Of the box [m]."""
        return float(np.linalg.norm(self.high - self.low))


def extent_of(bodies: Sequence[Body]) -> Extent:
    """The box around bodies and their centre of mass, in the scene's frame."""
    lows, highs, mass, moment = [], [], 0.0, np.zeros(3)
    for body in bodies:
        rotation, position = rotation_matrix(np.array(body.rotation)), np.array(body.position)
        mesh = mesh_of(body)
        points = in_place(body, mesh)
        lows.append(points.min(axis=0))
        highs.append(points.max(axis=0))
        own, centre = _weight(body, mesh)
        mass += own
        moment += own * (rotation @ centre + position)
    return Extent(np.min(lows, axis=0), np.max(highs, axis=0), moment / mass, mass)


def in_place(body: Body, mesh: Mesh) -> Array:
    """Nodes of a body's mesh in the scene's frame [m], shape (node_count, 3), float64."""
    return mesh.points @ rotation_matrix(np.array(body.rotation)).T + np.array(body.position)


def mesh_of(body: Body) -> Mesh:
    """Its mesh, or the one that its recipe makes."""
    from warp_mca.geometry.mesh import Mesh

    return body.geometry if isinstance(body.geometry, Mesh) else body.geometry.build()


def _weight(body: Body, mesh: Mesh) -> tuple[float, Array]:
    """Mass of a body [kg] and its centre in the body's frame [m]."""
    from warp_mca.geometry.cell_types import linear_type
    from warp_mca.geometry.quality import volumes
    from warp_mca.geometry.shape_volume import of_cells

    if body.mass is not None:
        return body.mass, np.array(body.centre)
    weight = volumes(mesh) * (of_cells(mesh) if body.exact_mass else 1.0)
    weight = weight * cell_values(body, mesh, "rho")
    middle = np.concatenate(
        [mesh.points[cells[:, : linear_type(name).corners]].mean(axis=1) for name, cells in mesh.cells.items()]
    )
    mass = float(np.nansum(weight))
    return mass, np.nansum(weight[:, None] * middle, axis=0) / mass


def cell_values(body: Body, mesh: Mesh, name: str) -> Array:
    """An attribute of the material of each cell, NaN where none is given, shape (cell_count,), float64."""
    if not isinstance(body.material, Mapping):
        return np.full(mesh.cell_count, getattr(body.material, name))
    values = np.full(mesh.cell_count, getattr(body.material.get("*"), name, math.nan))
    for key, material in body.material.items():
        if key in mesh.cell_sets:
            values[mesh.cell_sets[key]] = getattr(material, name)
    return values
