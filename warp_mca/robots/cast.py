"""Owns what recorders draw of a machine: the geoms of its links, flexible links, and what stands beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.prepare import Clock, Prepared, Request, prepare
from warp_mca.phases.settings import settings_of
from warp_mca.recorders.recorder import apart
from warp_mca.robots.contacts import STEEL, turned_on
from warp_mca.robots.drawing import drawn_geoms
from warp_mca.robots.geoms import joined
from warp_mca.robots.machine import Machine, Motion
from warp_mca.scene import Body, Contact, ImpactPhase, RigidPlane, Scene, Surface

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot


class Part(NamedTuple):
    """What is drawn as one body.

    Attributes:
        name: of the link, of the flexible link, or of the body beside.
        link: of the machine that carries it; 0 for the world.
        mesh: in the frame of the link, or of the body beside.
        beside: the body beside the machine, as it is at the start of the run.
        deforms: whether its shape is that of finite elements.
    """

    name: str
    link: int
    mesh: Mesh
    beside: Body | None = None
    deforms: bool = False

    def motion(self, machine: Machine, t: float) -> Motion:
        """Where it is and how it moves, the machine's data being at time t [s]."""
        if self.beside is None:
            return machine.motion(self.link)
        velocity, spin = np.array(self.beside.velocity), np.array(self.beside.angular_velocity)
        turned = rotation_matrix(turned_on(self.beside, t))
        return Motion(np.array(self.beside.position) + t * velocity, turned, velocity, spin)


def parts_of(robot: Robot, machine: Machine) -> list[Part]:
    """All that is drawn of a machine and of what stands beside it."""
    found = []
    for link in range(machine.model.nbody):
        name = machine.names.body(link)
        if link and machine.carrier(link) != link:
            continue
        if name in robot.flexible:
            found.append(Part(name, link, robot.meshes[name], deforms=True))
            continue
        if meshes := drawn_geoms(machine, link):
            found.append(Part(name, link, joined(list(meshes.values()))))
    beside = [item for item in robot.against if isinstance(item, Body)]
    found += [Part(item.name, 0, robot.meshes[item.name], item, not item.rigid) for item in beside]
    names = apart(part.name for part in found)
    return [part._replace(name=name) for part, name in zip(found, names, strict=True)]


def cast(robot: Robot, machine: Machine, parts: list[Part], t: float) -> Prepared:
    """The parts as a scene that is shown but not run, the machine's data being at time t [s].

    Raises:
        RequestError: nothing is to be drawn, or a mesh is none.
    """
    bodies = []
    for part in parts:
        motion = part.motion(machine, t)
        made = Body(name=part.name, geometry=part.mesh, material=STEEL, rigid=True)
        if part.deforms:
            own = part.beside or robot.flexible[machine.names.body(part.link)]
            made = replace(own, name=part.name, geometry=part.mesh, velocity=(0.0,) * 3, angular_velocity=(0.0,) * 3)
        at, turn = (tuple(float(v) for v in w) for w in (motion.origin, motion.turn()))
        bodies.append(replace(made, position=at, rotation=turn))  # type: ignore[arg-type]
    option = machine.model.opt
    scene = Scene(
        name="robot",
        bodies=tuple(bodies),
        contacts=tuple(
            Contact(slave=Surface(body=bodies[-1].name, nodes="boundary"), master=plane, stiffness=1.0)
            for plane in _planes(robot, machine)
        ),
        gravity=tuple(float(g) for g in option.gravity),  # type: ignore[arg-type]
        impact=ImpactPhase(duration=1e-3),
    )
    meshes = {part.name: part.mesh for part in parts}
    return prepare(scene, meshes, Request(span=1e-3, settings=settings_of("cpu", "mixed", 1), clock=Clock()))


def _planes(robot: Robot, machine: Machine) -> list[RigidPlane]:
    """Planes beside the machine, and of its file."""
    found = [item for item in robot.against if isinstance(item, RigidPlane)]
    model, data = machine.model, machine.data
    for geom in range(model.ngeom):
        if int(model.geom_type[geom]) == int(machine.mj.mjtGeom.mjGEOM_PLANE):
            normal = np.array(data.geom_xmat[geom]).reshape(3, 3)[:, 2]
            point, normal = (tuple(float(v) for v in w) for w in (data.geom_xpos[geom], normal))
            found.append(RigidPlane(point=point, normal=normal))  # type: ignore[arg-type]
    return found


def placed(mesh: Mesh, motion: Motion) -> tuple[Array, Array]:
    """Positions [m] and velocities [m/s] of the nodes of a part, each shape (node_count, 3), float64."""
    arms = mesh.points @ motion.rotation.T
    return motion.origin + arms, motion.velocity + np.cross(motion.spin, arms)
