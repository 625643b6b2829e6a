"""Owns what of a machine may touch what: its pairs of surfaces, and the distance of each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.robots.machine import Machine
from warp_mca.robots.skins import Nearest, Skin
from warp_mca.scene import Body, RigidPlane

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot

FAR = 1e3  # beyond which distances are not told apart [m]
BEYOND = 0.1  # of the machine's extent, twice the way in a step: farther geoms have the distance of their hulls


class Pose(NamedTuple):
    """Where a surface is and how it moves.

    Attributes:
        origin: of its frame [m], shape (3,), float64.
        rotation: from its frame to the world [-], shape (3, 3), float64.
    """

    origin: Array
    rotation: Array


@dataclass(frozen=True, kw_only=True)
class Side:
    """A surface that may touch another one.

    Attributes:
        name: of the geom, of the flexible link, or of the body or plane beside the machine.
        link: number of the machine's body that carries it; 0 for the world and what stands beside.
        geom: number of the geom; None of a flexible link and of what stands beside.
        skin: its triangles, in the frame of its body; None of an analytic geom and of a plane.
        plane: a plane beside the machine.
        body: a body beside the machine, which moves on as it is.
    """

    name: str
    link: int = 0
    geom: int | None = None
    skin: Skin | None = None
    plane: RigidPlane | None = None
    body: Body | None = None

    def pose(self, data: Any, t: float) -> Pose:
        """Where its frame is at time t [s], the machine's frames being placed."""
        if self.body is not None:
            omega, velocity = np.array(self.body.angular_velocity), np.array(self.body.velocity)
            turned = rotation_matrix(omega * t) @ rotation_matrix(self.body.rotation)
            return Pose(np.array(self.body.position) + velocity * t, turned)
        if self.geom is not None:
            return Pose(np.array(data.geom_xpos[self.geom]), np.array(data.geom_xmat[self.geom]).reshape(3, 3))
        return Pose(np.array(data.xpos[self.link]), np.array(data.xmat[self.link]).reshape(3, 3))

    def velocity(self, point: Array, t: float) -> Array:
        """Velocity of a point of a side beside the machine [m/s], shape (3,), float64."""
        if self.plane is not None:
            return np.array(self.plane.velocity)
        if self.body is None:
            return np.zeros(3)
        arm = point - np.array(self.body.position) - np.array(self.body.velocity) * t
        return np.array(self.body.velocity) + np.cross(self.body.angular_velocity, arm)


class Pair:
    """Two surfaces whose distance is watched."""

    def __init__(self, mj: Any, machine: Machine, first: Side, second: Side) -> None:
        self._mj, self._machine, self.first, self.second = mj, machine, first, second
        self.analytic = (
            first.skin is None and second.skin is None and first.geom is not None and second.geom is not None
        )

    @property
    def name(self) -> str:
        """Of both, for messages."""
        return f"{self.first.name} and {self.second.name}"

    def gap(self, t: float, q: Array) -> float:
        """Distance at time t [s] and coordinates q [m]."""
        return self.nearest(t, q).distance

    def nearest(self, t: float, q: Array) -> Nearest:
        """Where they are nearest to each other at time t [s] and coordinates q."""
        data = self._machine.place(q)
        if self.analytic:
            ends = np.zeros(6)
            model = self._machine.model
            distance = self._mj.mj_geomDistance(model, data, self.first.geom, self.second.geom, FAR, ends)
            return Nearest(float(distance), ends[:3], ends[3:])
        first, second = self.first.pose(data, t), self.second.pose(data, t)
        if self.second.plane is not None:
            return self._over_plane(first, np.array(self.second.plane.point), np.array(self.second.plane.normal))
        if self.second.skin is None:  # a plane of the file
            return self._over_plane(first, second.origin, second.rotation[:, 2])
        if self.first.geom is not None and self.second.geom is not None:
            ends, model = np.zeros(6), self._machine.model
            apart = float(self._mj.mj_geomDistance(model, data, self.first.geom, self.second.geom, FAR, ends))
            if apart > BEYOND * float(model.stat.extent):
                return Nearest(apart, ends[:3], ends[3:])
        return min(
            _one_way(self.first, first, self.second, second),
            _swapped(_one_way(self.second, second, self.first, first)),
            key=lambda item: item.distance,
        )

    def _over_plane(self, pose: Pose, origin: Array, normal: Array) -> Nearest:
        normal = normal / np.linalg.norm(normal)
        assert self.first.skin is not None
        points = pose.origin + self.first.skin.points @ pose.rotation.T
        heights = (points - origin) @ normal
        lowest = int(heights.argmin())
        return Nearest(float(heights[lowest]), points[lowest], points[lowest] - heights[lowest] * normal)


def _one_way(one: Side, at: Pose, other: Side, there: Pose) -> Nearest:
    """Nodes of the one from faces of the other."""
    assert one.skin is not None and other.skin is not None
    points = at.origin + one.skin.points @ at.rotation.T
    distance, which, foot = other.skin.nearest((points - there.origin) @ there.rotation)
    return Nearest(distance, points[which], there.origin + there.rotation @ foot)


def _swapped(found: Nearest) -> Nearest:
    return Nearest(found.distance, found.second, found.first)


def pairs_of(mj: Any, robot: Robot, machine: Machine, skins: dict[str, Skin], geoms: Any) -> list[Pair]:
    """The pairs of surfaces that may touch.

    Pairs of geoms are those that the file lets collide (contype, conaffinity, exclude, no parent and child unless its
    flags say so), and those that it names (pair of contact); a flexible link has its skin in place of its geoms, with
    bits of 1 where it has none. What stands beside the machine may touch each of these surfaces that has bits.

    Args:
        mj: the module.
        robot: as it was asked for.
        machine: of it.
        skins: of flexible links and bodies beside the machine, by name.
        geoms: gives the skin of a geom, for pairs that are not analytic.

    Raises:
        RequestError: nothing may touch, or a name is not known.
    """
    sides, named = list(_own_sides(robot, machine, skins)), _named(machine)
    found = []
    for (b, mask_b), (a, mask_a) in combinations(sides, 2):  # the outer link first: it moves against the inner one
        asked = any({one, other} in named for one in _geoms(machine, a) for other in _geoms(machine, b))
        if "CONTACT" not in machine.off and (asked or _meet(machine, a, mask_a, b, mask_b)):
            found.append((a, b))
    movable = [(side, mask) for side, mask in sides if machine.model.body_weldid[side.link] != 0]
    for item in robot.against:
        beside = _beside(robot, item, skins)
        found += [(side, beside) for side, mask in movable if side.skin is not None or mask.any()]
    known = {side.name for side, _ in sides} | {machine.names.body(side.link) for side, _ in sides}
    for name in robot.touch:
        if name not in known:
            raise bad_value("Robot.touch", name, f"the file's links and geoms are {', '.join(sorted(known))}")
    if robot.touch:
        chosen = lambda side: side.name in robot.touch or machine.names.body(side.link) in robot.touch  # noqa: E731
        found = [pair for pair in found if any(map(chosen, pair))]
    return [_ready(mj, machine, a, b, geoms) for a, b in found]


def _own_sides(robot: Robot, machine: Machine, skins: dict[str, Skin]) -> Iterator[tuple[Side, Array]]:
    """Sides of the machine, with their bits of contype and conaffinity, shape (2,)."""
    model, names = machine.model, machine.names
    bits = np.stack([model.geom_contype, model.geom_conaffinity], axis=1)
    named = {geom for both in _named(machine) for geom in both}
    for k in range(model.nbody):
        own = np.flatnonzero(model.geom_bodyid == k)
        if names.body(k) in robot.flexible:
            bit = np.bitwise_or.reduce(bits[own], axis=0) if len(own) else np.ones(2, dtype=int)
            yield Side(name=names.body(k), link=k, skin=skins[names.body(k)]), bit
            continue
        for geom in own:
            if bits[geom].any() or int(geom) in named:
                yield Side(name=names.geom(int(geom)), link=k, geom=int(geom)), bits[geom]


def _named(machine: Machine) -> list[set[int]]:
    """Numbers of the geoms of each pair that the file names."""
    model = machine.model
    return [{int(one), int(other)} for one, other in zip(model.pair_geom1, model.pair_geom2, strict=True)]


def _geoms(machine: Machine, side: Side) -> list[int]:
    """Numbers of the geoms that a side of the machine stands for."""
    if side.geom is not None:
        return [side.geom]
    return np.flatnonzero(machine.model.geom_bodyid == side.link).tolist()


def _meet(machine: Machine, a: Side, mask_a: Array, b: Side, mask_b: Array) -> bool:
    """Whether the file lets two sides collide."""
    model = machine.model
    one, other = (int(model.body_weldid[side.link]) for side in (a, b))
    if one == other:
        return False
    if (
        one
        and other
        and "FILTERPARENT" not in machine.off
        and (
            model.body_weldid[model.body_parentid[one]] == other or model.body_weldid[model.body_parentid[other]] == one
        )
    ):
        return False
    low, high = sorted((a.link, b.link))
    if ((low << 16) + high) in set(model.exclude_signature.tolist()):
        return False
    return bool((mask_a[0] & mask_b[1]) or (mask_b[0] & mask_a[1]))


def _beside(robot: Robot, item: RigidPlane | Body, skins: dict[str, Skin]) -> Side:
    if isinstance(item, Body):
        return Side(name=item.name, body=item, skin=skins[item.name])
    place = [other for other in robot.against if isinstance(other, RigidPlane)].index(item)
    return Side(name=f"plane {place + 1}", plane=item)


def _ready(mj: Any, machine: Machine, a: Side, b: Side, geoms: Any) -> Pair:
    """The pair, with skins for geoms where MuJoCo's distance is not that of both surfaces."""
    smooth = {
        int(getattr(mj.mjtGeom, f"mjGEOM_{kind}"))
        for kind in ("PLANE", "SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX")
    }
    if all(side.geom is not None and int(machine.model.geom_type[side.geom]) in smooth for side in (a, b)):
        return Pair(mj, machine, a, b)
    flat = [side.plane is not None or _is_plane(mj, machine, side) for side in (a, b)]
    a, b = (side if side.skin or plane else geoms(side) for side, plane in zip((a, b), flat, strict=True))
    return Pair(mj, machine, *((b, a) if flat[0] else (a, b)))


def _is_plane(mj: Any, machine: Machine, side: Side) -> bool:
    return side.geom is not None and int(machine.model.geom_type[side.geom]) == int(mj.mjtGeom.mjGEOM_PLANE)
