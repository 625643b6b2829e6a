"""Owns the contacts of a machine at its hand-off, and the surfaces and bodies beside that they need."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.robots.drawing import drawn_geoms
from warp_mca.robots.filling import held_mass
from warp_mca.robots.geoms import filled, geom_surface, is_long, is_round, joined, touching_at
from warp_mca.robots.machine import Machine, Motion
from warp_mca.robots.nearby import radius_of
from warp_mca.scene import Body, Contact, RigidPlane, Surface
from warp_mca.scene.metals import J2Bilinear

if TYPE_CHECKING:
    from warp_mca.geometry.mesh import Mesh
    from warp_mca.robots.robot import Robot
    from warp_mca.robots.swing import RobotSwing
    from warp_mca.robots.touching import Pair, Side

AHEAD = 2.0  # pairs that are as near as this multiple of the way at the greatest speed may touch during the impact
STEEL = J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=1e12, E_t=0.0)  # of geoms, for springs on flexible bodies


class Contacts:
    """Contacts of the pairs of surfaces that may touch during an impact.

    Attributes:
        found: the contacts.
        held: bodies of geoms of the world, which do not move.
    """

    def __init__(
        self,
        robot: Robot,
        machine: Machine,
        swing: RobotSwing,
        duration: float,
        springs: tuple[float, float, int],
        drawn: bool = False,
    ) -> None:
        """Begin without contacts; `springs` are stiffness, mu and faces of `Robot.strike`, which has `drawn`, too."""
        self._robot, self._machine, self._swing, self._drawn = robot, machine, swing, drawn
        self._duration, (self._stiffness, self._mu, self._faces) = duration, springs
        self.found: list[Contact] = []
        self.held: list[str] = []
        # points of geoms that shall be nodes or, with a normal, in the middle of a face, in the geoms' frames
        self._touched: dict[int, list[tuple[Array, Array | None]]] = {}
        self._sets: dict[int, str] = {}

    def add(self, pairs: Sequence[Pair]) -> None:
        """Make contacts of the pairs that are near enough.

        Raises:
            RequestError: a surface cannot be that of a contact.
        """
        t, q = self._swing.t_end, self._swing.qpos
        touch = self._swing.touch
        reach = AHEAD * self._speed(pairs) * self._duration
        for pair in pairs:
            nearest = pair.nearest(t, q)
            touched = touch is not None and (pair.first.name, pair.second.name) == (touch.first, touch.second)
            if nearest.distance > reach and not touched:
                continue
            normal = touch.normal if touch is not None and touched else None
            self._mark(pair, (nearest.first, nearest.second), normal)
            self._join(pair, normal)

    def _mark(self, pair: Pair, points: tuple[Array, Array], normal: Array | None) -> None:
        """Note where the geoms of a pair touch: with a node, or one of two round ones, the longer, with a face."""
        machine, t, q = self._machine, self._swing.t_end, self._swing.qpos
        across = points[1] - points[0] if normal is None else normal
        poses = [side.pose(machine.place(q), t) for side in (pair.first, pair.second)]
        own = [(point - pose.origin) @ pose.rotation for point, pose in zip(points, poses, strict=True)]
        geoms = (pair.first.geom, pair.second.geom)
        both = all(
            geom is not None and is_round(machine.mj, machine, geom, point)
            for geom, point in zip(geoms, own, strict=True)
        )
        flat = 0 if both and is_long(machine, geoms[0]) and not is_long(machine, geoms[1]) else 1
        for k, geom in enumerate(geoms):
            if geom is not None:
                face = across @ poses[k].rotation if both and k == flat and across.any() else None
                self._touched.setdefault(geom, []).append((own[k], face))

    def _speed(self, pairs: Sequence[Pair]) -> float:
        """A bound of the speed of all links, their mass centres and surfaces, and of bodies beside [m/s]."""
        machine, most = self._machine, 0.0
        reach = np.linalg.norm(machine.model.body_ipos, axis=1)
        for side in (side for pair in pairs for side in (pair.first, pair.second) if side.link):
            reach[side.link] = max(reach[side.link], radius_of(machine, side))
        for link in range(1, machine.model.nbody):
            motion = machine.motion(link)
            turning = float(reach[link]) * float(np.linalg.norm(motion.spin))
            most = max(most, float(np.linalg.norm(motion.velocity)) + turning)
        beside = [np.linalg.norm(b.velocity) for b in self._robot.against if isinstance(b, Body)]
        return most + float(max(beside, default=0.0))

    def _join(self, pair: Pair, normal: Array | None) -> None:
        first, second = self._surface(pair.first), self._surface(pair.second)
        if isinstance(first, RigidPlane):
            first, second = second, first
            normal = None if normal is None else -normal
        if isinstance(first, RigidPlane):
            raise bad_value("Robot: geoms", pair.name, "two planes cannot touch; exclude the pair")
        rigid = all(map(self._is_rigid, (pair.first, pair.second)))
        more: dict[str, Any] = {"stiffness": self._stiffness} if rigid else {}
        if rigid and isinstance(second, Surface):
            more["two_way"] = True
        if normal is not None:
            more["normal"] = tuple(float(v) for v in normal)
        self.found.append(Contact(slave=first, master=second, mu=self._mu, **more))

    def _is_rigid(self, side: Side) -> bool:
        if side.body is not None:
            return side.body.rigid
        return side.plane is not None or side.geom is not None

    def _surface(self, side: Side) -> Surface | RigidPlane:
        """What a contact names for a side."""
        machine = self._machine
        if side.plane is not None:
            return side.plane
        if side.geom is None:
            return Surface(body=side.name, nodes="boundary")
        fixed = int(machine.model.body_weldid[side.link]) == 0
        if int(machine.model.geom_type[side.geom]) == int(machine.mj.mjtGeom.mjGEOM_PLANE):
            if not fixed:
                raise bad_value("Robot: geom", side.name, "a plane must not move; give a box")
            turned = np.array(machine.data.geom_xmat[side.geom]).reshape(3, 3)
            point, normal = (tuple(float(v) for v in w) for w in (machine.data.geom_xpos[side.geom], turned[:, 2]))
            return RigidPlane(point=point, normal=normal)  # type: ignore[arg-type]
        self._sets[side.geom] = side.name
        if not fixed:
            return Surface(body=machine.names.body(machine.carrier(side.link)), nodes=side.name)
        name = self._beside_name(side.name)
        if name not in self.held:
            self.held.append(name)
        return Surface(body=name, nodes=side.name)

    def _beside_name(self, geom: str) -> str:
        taken = {*self._machine.names.bodies, *(b.name for b in self._robot.against if isinstance(b, Body))}
        return f"{geom} geom" if geom in taken else geom

    def geometry(self, link: int) -> Mesh | None:
        """The mesh of the geoms of a link that may touch or are drawn, in the link's frame; None without any."""
        machine, data = self._machine, self._machine.data
        found = []
        for geom in self._sets:
            if machine.carrier(int(machine.model.geom_bodyid[geom])) != link:
                continue
            mesh = self._mesh(geom)
            turned = np.array(data.geom_xmat[geom]).reshape(3, 3)
            world = np.array(data.geom_xpos[geom]) + mesh.points @ turned.T
            found.append(replace(mesh, points=machine.local(link, world)))
        if self._drawn:
            found += [mesh for geom, mesh in drawn_geoms(machine, link).items() if geom not in self._sets]
        return joined(found) if found else None

    def _mesh(self, geom: int) -> Mesh:
        mj, name = self._machine.mj, self._sets[geom]
        surface = geom_surface(mj, self._machine, geom, name, self._faces)
        for touch in self._touched.get(geom, ()):
            surface = touching_at(mj, self._machine, geom, surface, touch, self._faces)
        return filled(name, surface, name)

    def beside(self) -> list[Body]:
        """Bodies of geoms of the world that may be touched, and bodies beside the machine that have moved on."""
        machine, found, t = self._machine, [], self._swing.t_end
        for geom, name in self._sets.items():
            if int(machine.model.body_weldid[machine.model.geom_bodyid[geom]]) != 0:
                continue
            turned, zero = np.array(machine.data.geom_xmat[geom]).reshape(3, 3), np.zeros(3)
            pose = Motion(np.array(machine.data.geom_xpos[geom]), turned, zero, zero)
            mesh = self._mesh(geom)
            own = held_mass(mesh, STEEL.rho)
            body = Body(name=self._beside_name(name), geometry=mesh, material=STEEL, rigid=True, **own)
            found.append(replace(body, position=_vec(pose.origin), rotation=_vec(pose.turn())))
        if self._drawn:
            found += self._scenery()
        for item in self._robot.against:
            if isinstance(item, Body):
                moved = np.array(item.position) + t * np.array(item.velocity)
                found.append(replace(item, position=_vec(moved), rotation=_vec(turned_on(item, t))))
        return found

    def _scenery(self) -> list[Body]:
        """Bodies of all other geoms of the world, and of links that do not move."""
        machine, found = self._machine, []
        for link in range(machine.model.nbody):
            if int(machine.model.body_weldid[link]) != 0:
                continue
            meshes = [mesh for geom, mesh in drawn_geoms(machine, link).items() if geom not in self._sets]
            if meshes and machine.carrier(link) == link:
                motion, name = machine.motion(link), f"{machine.names.body(link)} drawn"
                own = {"mass": 1.0, "inertia": (1.0, 1.0, 1.0)}  # which tells that its shape is drawn only
                body = Body(name=name, geometry=joined(meshes), material=STEEL, rigid=True, **own)
                found.append(replace(body, position=_vec(motion.origin), rotation=_vec(motion.turn())))
                self.held.append(name)
        return found


def turned_on(body: Body, t: float) -> Array:
    """Rotation vector of a body that has turned on for a time [s] at its own angular velocity [rad]."""
    from scipy.spatial.transform import Rotation

    spin = np.array(body.angular_velocity) * t
    return (Rotation.from_rotvec(spin) * Rotation.from_rotvec(body.rotation)).as_rotvec()


def _vec(values: Array) -> Any:
    return tuple(float(v) for v in values)
