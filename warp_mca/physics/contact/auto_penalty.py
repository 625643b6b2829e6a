"""Owns `penalty="auto"`: contact springs just so stiff that they give away little of the force peak.

Springs on the faces of a Hertzian contact are an elastic layer. With p the penalty, b = K A / V of its faces, so that
p b is the layer's stiffness for each area [N/m^3], the pressure of Hertz stores (9 / 8) F^2 / (2 pi a^2 p b) in it, and
the bodies store (2 / 5) F delta. With F = (4 / 3) E* sqrt(R) delta^(3/2) and a^2 = R delta (Johnson, Contact Mechanics,
4.2, 11.4) the layer's share is

    s_0 = (15 / (8 pi)) E* / (a p b),

and, as the softer contact then is pressed together less, s_0 / (1 + 1.3 s_0), measured on balls.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.physics.contact.stiffness import FLAT, flat_modulus, nearest_faces
from warp_mca.scene import Contact, RigidPlane, Surface
from warp_mca.system.bodies import Bodies
from warp_mca.system.contact import ChosenPenalty, Faces

SHARE = 0.067  # of the energy that springs may hold, by estimate: some 2 % of the force peak
SATURATION = 1.3
LEAST, MOST = 0.1, 30.0  # penalties that are chosen; stiffer springs shorten the step
NEAR = 4.0  # faces that tell the curvature, in widths of the face that is touched first
FLATNESS = 1e-4  # angle over which faces turn within that reach, below which they are flat [rad]


@dataclass(frozen=True)
class _Side:
    """A surface where it is nearest to the other one.

    Attributes:
        faces: of the surface.
        face: the one that is nearest.
    """

    faces: Faces
    face: int

    @property
    def curvature(self) -> float:
        """Mean curvature of the faces nearby [1/m], positive where convex; 0 where they are flat."""
        faces, reach = self.faces, NEAR * math.sqrt(self.faces.area[self.face])
        arm = faces.middle - faces.middle[self.face]
        distance = np.linalg.norm(arm, axis=1)
        near = (distance > 0.0) & (distance <= reach)
        unit = faces.normal / np.linalg.norm(faces.normal, axis=1, keepdims=True)
        turned = unit[near] - unit[self.face]
        if not near.any() or np.linalg.norm(turned, axis=1).max() < FLATNESS:
            return 0.0
        return float(((turned * arm[near]).sum(axis=1) / distance[near] ** 2).mean())

    def moduli(self, K: Array) -> tuple[float, float, float]:
        """E / (1 - nu^2) and K [Pa], and K A / V [N/m^3], of the element there."""
        faces, k = self.faces, self.face
        bulk = float(K[faces.element[k]])
        return bulk * float(faces.contact[k] / faces.bulk[k]), bulk, float(faces.bulk[k] / faces.area[k])

    def flat_modulus(self, K: Array, G: Array) -> float:
        """Modulus of springs of flat ends [Pa], of the element there."""
        one = self.faces.element[self.face : self.face + 1]
        return float(flat_modulus(np.array([self.moduli(K)[0]]), K[one], G[one])[0])


def chosen_penalty(
    parts: Bodies, contact: Contact, slave: Faces, master: Faces | None, velocity: Array
) -> ChosenPenalty:
    """The penalty of a contact that leaves it to the program; `velocity` of the nodes [m/s], shape (node_count, 3)."""
    own, other, normal = _nearest(contact, slave, master)
    sides = [own] if other is None else [own, other]
    found = [side.moduli(parts.K) for side in sides]
    default = FLAT * min(
        side.flat_modulus(parts.K, parts.G) / bulk for side, (_, bulk, _) in zip(sides, found, strict=True)
    )
    modulus = 1.0 / sum(1.0 / item[0] for item in found)
    curvature = sum(side.curvature for side in sides)
    if curvature <= 0.0:
        return ChosenPenalty(penalty=default, why="flat")
    bodies = [contact.slave.body, *([contact.master.body] if isinstance(contact.master, Surface) else [])]
    yielding = sum(_yielding(parts, name, own.faces.middle[own.face], normal) for name in bodies)
    speeds = [velocity[side.faces.node[side.face]].mean(axis=0) @ normal for side in sides]
    speed = float((speeds[1] if other is not None else 0.0) - speeds[0])
    if speed <= 0.0 or yielding <= 0.0:
        return ChosenPenalty(penalty=default, why="no approach")
    mass, radius = 2.0 ** _planes(parts, contact, slave) / yielding, 1.0 / curvature
    depth = (15.0 * mass * speed**2 / (16.0 * modulus * math.sqrt(radius))) ** 0.4
    patch = math.sqrt(radius * depth)
    layer = 15.0 / (8.0 * math.pi) * modulus / (patch * min(item[2] for item in found))
    wanted = SHARE / (1.0 - SATURATION * SHARE)
    penalty = min(max(layer / wanted, LEAST), MOST)
    share = layer / penalty / (1.0 + SATURATION * layer / penalty)
    known = {"radius": radius, "patch": patch, "mass": mass, "speed": speed}
    return ChosenPenalty(penalty=float(f"{penalty:.3g}"), why="curved", share=share, **known)


def settled(
    parts: Bodies, contact: Contact, slave: Faces, master: Faces | None, velocity: Array
) -> tuple[Contact, ChosenPenalty | None]:
    """The contact with a number for its penalty, if that is left to the program, and what was chosen."""
    if contact.penalty != "auto":
        return contact, None
    chosen = chosen_penalty(parts, contact, slave, master, velocity)
    return replace(contact, penalty=chosen.penalty), chosen


def _nearest(contact: Contact, slave: Faces, master: Faces | None) -> tuple[_Side, _Side | None, Array]:
    """Where the surfaces are nearest to each other, and the unit normal there, which points to the slave."""
    own, other = nearest_faces(contact, slave, master)
    if master is None:
        assert isinstance(contact.master, RigidPlane)
        normal = np.asarray(contact.master.normal, dtype=float)
    else:
        normal = master.normal[other]
    normal = normal / np.linalg.norm(normal)
    return _Side(slave, own), None if master is None else _Side(master, other), normal


def _yielding(parts: Bodies, name: str, place: Array, normal: Array) -> float:
    """How easily a free body moves along a direction at a place, 1/m + (r x n) . I^-1 (r x n) [1/kg]; 0 if it is held.

    Joints are left out. A body that is held along other axes does not turn.
    """
    nodes = parts.all_nodes(name)
    X, mass = parts.X[nodes], parts.mass[nodes]
    axes = {axis for item in parts.scene.fixed if item.body == name for axis in item.axes}
    if axes:
        return 0.0 if "xyz"[int(np.abs(normal).argmax())] in axes else float(1.0 / mass.sum())
    centre = np.average(X, axis=0, weights=mass)
    arm = X - centre
    moments = np.einsum("n,ni,nj->ij", mass, arm, arm)
    inertia = np.trace(moments) * np.eye(3) - moments
    turning = np.cross(place - centre, normal)
    return float(1.0 / mass.sum() + turning @ np.linalg.solve(inertia, turning))


def _planes(parts: Bodies, contact: Contact, slave: Faces) -> int:
    """Planes of symmetry that cut the contact: axes along which some nodes of the slave's surface are held."""
    body = contact.slave.body
    sets = [(item.axes, parts.nodes(body, item.nodes)) for item in parts.scene.fixed if item.body == body]
    return len({axis for axes, nodes in sets if np.isin(nodes, slave.nodes).any() for axis in axes})
