"""Owns the target of a rigid phase: the plane that the chain will touch, and the gaps of tip and nodes to it."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array, Chain, link_axes
from warp_mca.rigid.placement import Placement
from warp_mca.rigid.plain_chain import end_point
from warp_mca.rigid.touch import Gap
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

    def at(self, t: float) -> tuple[Array, Array]:
        """A point of the plane [m] and its normal [-] at time t [s], each shape (3,), float64."""
        return self.point + t * self.velocity, self.normal


@dataclass(frozen=True, kw_only=True)
class TurningPlane:
    """The plane of a surface whose body moves and turns freely.

    Attributes:
        placement: pose and motion of the body at t_start.
        t_start: [s].
        normal: in the body's frame [-], shape (3,), float64.
        height: of the plane over the placement's pivot, along the normal [m].
    """

    placement: Placement
    t_start: float
    normal: Array
    height: float

    def at(self, t: float) -> tuple[Array, Array]:
        """A point of the plane [m] and its normal [-] at time t [s], each shape (3,), float64."""
        placed = self.placement.after(t - self.t_start)
        normal = placed.rotation @ self.normal
        return placed.origin + self.height * normal, normal


def moving_plane(mesh: Mesh, target: Surface, placement: Placement, t_start: float = 0.0) -> TargetPlane | TurningPlane:
    """The plane of a flat surface of a body that moves on from `placement` at time t_start [s].

    Args:
        mesh: of the body, undeformed: a dent in the surface does not move its plane.
        target: the surface.
        placement: pose and motion of the body at t_start.
        t_start: time from release [s].

    Raises:
        RequestError: the surface is not flat.
    """
    point, normal = _mean_plane(mesh, target)
    normal = normal / np.linalg.norm(normal)
    height = float((point - placement.pivot) @ normal)
    if placement.angular_velocity.any():
        return TurningPlane(placement=placement, t_start=t_start, normal=normal, height=height)
    turned = placement.rotation @ normal
    origin = placement.origin + height * turned - t_start * placement.velocity
    return TargetPlane(point=origin, normal=turned, velocity=placement.velocity)


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
        turned = rotation_matrix(body.rotation)
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
    """Distance of the tip's sphere on the last link from the plane [m], a function of time [s] and coordinates."""
    hinge = chain.links[-1].hinge_in
    centre = (tip.centre[0] - hinge[0], tip.centre[1] - hinge[1])
    position, shift = end_point(chain, centre), _base_shift(chain)
    normal, velocity, start = plane.normal.tolist(), plane.velocity.tolist(), plane.point.tolist()

    def gap(t: float, theta: Array) -> float:
        x, y = position(theta)
        if shift is not None:
            way = shift(t)
            x, y = x + float(way[0]), y + float(way[1])
        away = zip((x, y, tip.centre[2]), start, velocity, normal, strict=True)
        return sum((c - p - t * v) * n for c, p, v, n in away) - tip.radius

    return gap


def node_gap(chain: Chain, index: int, points: Array, plane: TargetPlane | TurningPlane) -> Gap:
    """Smallest distance of nodes of one link from the plane [m], a function of time [s] and coordinates.

    Only corners of the nodes' convex hull can be nearest to a plane: of their outline in the plane of motion where the
    normal stays in it. The others are left out once.

    Args:
        chain: the links.
        index: of the link.
        points: nodes in the body's frame, deformed or not [m], shape (count, 3), float64.
        plane: that they may touch.
    """
    in_plane = isinstance(plane, TargetPlane) and plane.normal[2] == 0.0
    arms = points - np.array([*chain.links[index].hinge_in, 0.0])
    x, y, z = arms[_hull(arms[:, :2] if in_plane else arms)].T
    rest, shift = np.zeros(chain.coordinate_count), _base_shift(chain)

    def gap(t: float, theta: Array) -> float:
        hinge = chain.hinges(theta, rest)[0][index]
        hinge = hinge if shift is None else hinge + shift(t)
        d, f = link_axes(chain.angles(theta)[index])
        point, normal = plane.at(t)
        height = (d @ normal[:2]) * x + (f @ normal[:2]) * y + normal[2] * z
        return float(height.min() + (hinge - point[:2]) @ normal[:2] - point[2] * normal[2])

    return gap


def _base_shift(chain: Chain) -> Callable[[float], Array] | None:
    """Way of a moving base since the release [m] as a function of time [s], or None."""
    return None if chain.loads is None or chain.loads.base_velocity is None else chain.loads.base_velocity.integral


def _hull(points: Array) -> NDArray[np.integer]:
    """Indices of the corners of the convex hull, of all points if they span no area or volume."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points).vertices
    except QhullError:
        return np.arange(len(points))
