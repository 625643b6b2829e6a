"""Owns what starts a drop test: the place of a body on a plane, its velocity after a fall."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base import validate
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix

if TYPE_CHECKING:
    from warp_mca.scene.bodies import Body
    from warp_mca.scene.contacts import RigidPlane

Vec3 = tuple[float, float, float]


def resting_place(body: Body, plane: RigidPlane, gap: float) -> Vec3:
    """Origin of the body [m] where its lowest node lies `gap` [m] above the plane; moved along the plane's normal only.

    Raises:
        RequestError: the gap is below 0, or the body cannot be meshed.
    """
    from warp_mca.geometry.mesh import Mesh

    _check("place_on: gap", gap, "give 0 or a distance above it, in metres")
    if not (hasattr(plane, "normal") and hasattr(plane, "point")):
        raise bad_value("place_on: plane", validate.brief(plane), "give a RigidPlane")
    mesh = body.geometry if isinstance(body.geometry, Mesh) else body.geometry.build()
    normal = np.array(plane.normal) / math.hypot(*plane.normal)
    position = np.array(body.position)
    placed = position + mesh.points @ rotation_matrix(np.array(body.rotation)).T
    height = float(((placed - np.array(plane.point)) @ normal).min())
    x, y, z = (position + (gap - height) * normal).tolist()
    return (x, y, z)


def fall_velocity(height: float, gravity: Vec3) -> Vec3:
    """Velocity of a body that fell from rest [m/s]: sqrt(2 g h) along gravity.

    Args:
        height: of the fall [m].
        gravity: [m/s^2].

    Raises:
        RequestError: the height is below 0, or there is no gravity.
    """
    _check("drop: height", height, "give 0 or a height above it, in metres")
    validate.vectors("drop", gravity=gravity)
    g = math.hypot(*gravity)
    if g == 0.0:
        raise bad_value("drop: gravity", gravity, "give a vector that is not zero, in m/s^2")
    x, y, z = (math.sqrt(2.0 * g * height) * component / g for component in gravity)
    return (x, y, z)


def _check(field: str, value: float, remedy: str) -> None:
    if not (validate.is_number(value) and value >= 0.0):
        raise bad_value(field, value, remedy)
