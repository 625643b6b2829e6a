"""Owns the target of a rigid phase: the plane that the tip will touch, and the tip's gap to it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import turn
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.swing import Gap
from warp_mca.scene import RigidPlane, Scene, Surface, Tip

FLATNESS = 1e-6  # of a target surface, as a share of its extent


@dataclass(frozen=True, kw_only=True)
class TargetPlane:
    """The plane that the tip will touch.

    Attributes:
        point: of the plane at t = 0 [m], shape (3,), float64.
        normal: towards the free side, of unit length [-], shape (3,), float64.
        velocity: of the plane [m/s], shape (3,), float64.
    """

    point: Array
    normal: Array
    velocity: Array

    def gap(self, point: Array, radius: float, t: float) -> float:
        """(c - p(t)) . n - r [m] for a sphere of that radius [m] around `point` [m] at time t [s]."""
        return float((point - self.point - t * self.velocity) @ self.normal) - radius


def target_plane(scene: Scene, target: Surface | RigidPlane, meshes: Mapping[str, Mesh]) -> TargetPlane:
    """The rigid plane, or the plane of a flat surface in its body's pose, that a rigid phase aims at.

    Point and normal of a surface are the means over its faces, weighted with their area.

    Raises:
        RequestError: the surface is not flat, its body turns, or the plane is parallel to the plane of the swing.
    """
    if isinstance(target, RigidPlane):
        point, normal = np.array(target.point, dtype=np.float64), np.array(target.normal, dtype=np.float64)
        velocity = np.array(target.velocity, dtype=np.float64)
    else:
        body = scene.body(target.body)
        if any(body.angular_velocity):
            raise bad_value(
                f"Body {body.name}.angular_velocity", body.angular_velocity, "a target must not turn; give 0"
            )
        point, normal = _mean_plane(meshes[target.body], target)
        turned = turn(body.rotation)
        point, normal = np.asarray(body.position) + turned @ point, turned @ normal
        velocity = np.array(body.velocity, dtype=np.float64)
    normal = normal / np.linalg.norm(normal)
    if math.hypot(normal[0], normal[1]) < 1e-6:
        raise bad_value("normal of RigidPhase.target", tuple(normal), "it must not be parallel to the hinges")
    return TargetPlane(point=point, normal=normal, velocity=velocity)


def _mean_plane(mesh: Mesh, target: Surface) -> tuple[Array, Array]:
    """Mean point [m] and unit normal [-] of a flat surface in the body's frame, each shape (3,), float64."""
    corners = mesh.points[mesh.surface(target.nodes)[0]]
    area = 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    size = np.linalg.norm(area, axis=1)
    point = size @ corners.mean(axis=1) / size.sum()
    normal = area.sum(axis=0) / size.sum()
    reach = np.abs((corners - point) @ normal).max() / np.ptp(corners, axis=(0, 1)).max()
    if reach > FLATNESS or np.linalg.norm(normal) < 1.0 - FLATNESS:
        remedy = (
            f"the surface is not flat (off its mean plane by {reach:.3g} of its extent); name the set of a flat face"
        )
        raise bad_value("RigidPhase.target.nodes", target.nodes, remedy)
    return point, normal


def tip_gap(chain: Chain, tip: Tip, plane: TargetPlane) -> Gap:
    """Distance of the tip's sphere on the last link from the plane [m], a function of time [s] and angles [rad]."""
    hinge = chain.links[-1].hinge_in
    centre = (tip.centre[0] - hinge[0], tip.centre[1] - hinge[1])
    last, rest = len(chain.links) - 1, np.zeros(len(chain.links))

    def gap(t: float, theta: Array) -> float:
        point, _ = chain.at(last, centre, theta, rest)
        return plane.gap(np.array([point[0], point[1], tip.centre[2]]), tip.radius, t)

    return gap
