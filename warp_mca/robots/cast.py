"""Owns what recorders draw of a machine: the geoms of its links, flexible links, and what stands beside it."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import RequestError
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.phases.prepare import Clock, Prepared, Request, prepare
from warp_mca.phases.settings import settings_of
from warp_mca.recorders.recorder import apart
from warp_mca.robots.contacts import STEEL, turned_on
from warp_mca.robots.geoms import filled, geom_surface, hull, joined
from warp_mca.robots.machine import Machine, Motion
from warp_mca.scene import Body, Contact, ImpactPhase, RigidPlane, Scene, Surface

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot

HIDDEN = 3  # group of geoms from which on MuJoCo's viewer does not draw them
AROUND = 24  # faces around a round geom
MOST = 4000  # triangles of a mesh; finer ones are drawn as their convex hulls


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
    """All that is drawn of a machine and of what stands beside it.

    Geoms are those that MuJoCo's viewer shows, of groups 0 to 2; of a link without any, all. Meshes that do not face
    away from their middle everywhere, or have more than MOST triangles, are drawn as their convex hulls.
    """
    found, model = [], machine.model
    geoms = [k for k in range(model.ngeom) if int(model.geom_type[k]) != int(machine.mj.mjtGeom.mjGEOM_PLANE)]
    for link in range(model.nbody):
        name = machine.names.body(link)
        if link and machine.carrier(link) != link:
            continue
        if name in robot.flexible:
            found.append(Part(name, link, robot.meshes[name], deforms=True))
            continue
        own = [k for k in geoms if machine.carrier(int(model.geom_bodyid[k])) == link]
        seen = [k for k in own if int(model.geom_group[k]) < HIDDEN] or own
        meshes = [mesh for mesh in (_drawn(machine, link, k) for k in seen) if mesh is not None]
        if meshes:
            found.append(Part(name, link, joined(meshes)))
    beside = [item for item in robot.against if isinstance(item, Body)]
    found += [Part(item.name, 0, robot.meshes[item.name], item, not item.rigid) for item in beside]
    names = apart(part.name for part in found)
    return [part._replace(name=name) for part, name in zip(found, names, strict=True)]


def _drawn(machine: Machine, link: int, geom: int) -> Mesh | None:
    """The mesh of a geom in the frame of the link that carries it; None of a kind without a surface."""
    name, data = machine.names.geom(geom), machine.data
    try:
        points, faces = geom_surface(machine.mj, machine, geom, name, AROUND)
    except RequestError:
        return None
    try:
        mesh = filled(name, (points, faces) if len(faces) <= MOST else hull(points), name)
    except RequestError:
        mesh = filled(name, hull(points), name)
    turned = np.array(data.geom_xmat[geom]).reshape(3, 3)
    return replace(mesh, points=machine.local(link, np.array(data.geom_xpos[geom]) + mesh.points @ turned.T))


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
