"""Owns how a scene becomes a chain: reads links, hinges, base and loads off its joints and its rigid phase."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from warp_mca.base.errors import bad_value
from warp_mca.base.rotation import rotation_matrix
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Array, Chain, Vec2
from warp_mca.rigid.link import Link, mesh_link, slender_link
from warp_mca.rigid.loads import Loads, Table
from warp_mca.scene import Revolute, RigidPhase, Scene, Tip, Vec3
from warp_mca.scene.ties import Pin


class _Span(NamedTuple):
    """One link: its inbound joint, its body, the inbound hinge in the body's frame and the outbound one from there."""

    joint: str
    body: str
    hinge_in: Vec2
    hinge_out: Vec2 | None


def chain_from_scene(scene: Scene, meshes: Mapping[str, Mesh], nodal_masses: Mapping[str, Array]) -> Chain:
    """The chain that the scene's revolute joints form, from the ground outwards.

    The frame of each link is its body's frame, shifted to the inbound hinge; z components of hinges play no part, and
    the position and rotation of the first link's body only place the ground hinge. "mesh" links carry the sums of
    their lumped nodal masses. "slender" links are uniform rods from hinge to hinge, the last one from its hinge to the
    apex of the tip, with one mass per length for all: the first link's nodal mass over its length.

    Args:
        scene: with a rigid phase.
        meshes: by body name.
        nodal_masses: lumped masses by body name [kg], each shape (node_count,), float64.

    Raises:
        RequestError: there is no rigid phase, the joints do not form one open chain from one ground hinge, a hinge is
            not parallel to z, the tip is not on the last link, or the angles do not match the links.
    """
    if scene.rigid is None:
        raise bad_value("Scene.rigid", None, "give a RigidPhase")
    if scene.gravity[2] != 0.0:
        raise bad_value("Scene.gravity", scene.gravity, "the chain swings in the xy plane; leave the z component 0")
    spans = _spans(scene)
    tip, names = scene.rigid.tip, [span.body for span in spans]
    _check_ties(scene, names)
    if len(scene.rigid.theta) != len(spans):
        remedy = f"give {len(spans)} angles and rates, one for each link from the ground outwards ({', '.join(names)})"
        raise bad_value("RigidPhase.theta", scene.rigid.theta, remedy)
    if tip.body != names[-1]:
        raise bad_value("RigidPhase.tip.body", tip.body, f"the tip must be on the last link, {names[-1]}")
    links: list[Link] = []
    line_density = 0.0
    for _, body, hinge_in, hinge_out in spans:
        if scene.rigid.inertia == "mesh":
            hinges = {"hinge_in": hinge_in, "hinge_out": hinge_out or (0.0, 0.0)}
            links.append(mesh_link(body, meshes[body].points, nodal_masses[body], **hinges))
            continue
        end = hinge_out or _apex(tip, hinge_in)
        length = math.hypot(*end)
        if length == 0.0:
            raise bad_value(f"length of link {body} [m]", length, "its two hinges must not coincide")
        line_density = line_density or float(nodal_masses[body].sum()) / length
        links.append(slender_link(body, end, mass=line_density * length, hinge_out=end, hinge_in=hinge_in))
    slide = scene.rigid.slide
    return Chain(
        tuple(links),
        origin=_ground_hinge(scene, spans[0].body, spans[0].hinge_in),
        gravity=scene.gravity[:2],
        slide=None if slide is None else _unit(slide.direction),
        carriage_mass=0.0 if slide is None else slide.carriage_mass,
        loads=_loads(scene.rigid, [span.joint for span in spans]),
    )


def pins(scene: Scene) -> tuple[Pin | None, ...]:
    """Pin in each hinge of the scene's chain, from the ground outwards; None where it has none."""
    found = {joint.name: joint.pin for joint in _hinges(scene)}
    return tuple(found[span.joint] for span in _spans(scene))


def release(rigid: RigidPhase) -> tuple[Array, Array]:
    """Coordinates of the chain at its release and their rates, each shape (coordinate_count,), float64."""
    slide = rigid.slide
    theta = rigid.theta if slide is None else (0.0, *rigid.theta)
    theta_dot = rigid.theta_dot if slide is None else (slide.velocity, *rigid.theta_dot)
    return np.array(theta, dtype=np.float64), np.array(theta_dot, dtype=np.float64)


def _check_ties(scene: Scene, links: list[str]) -> None:
    """Refuse ties of a link to another body, which would not swing with it.

    Raises:
        RequestError: there is one.
    """
    for tie in scene.ties:
        ends = {tie.slave.body, tie.master.body}
        if len(ends) > 1 and ends & set(links):
            remedy = "a link of the rigid phase is one body; make both meshes Parts of it, or leave the rigid phase out"
            raise bad_value(f"{tie.title}.master.body", tie.master.body, remedy)


def _unit(direction: Vec3) -> Vec2:
    length = math.hypot(direction[0], direction[1])
    return (direction[0] / length, direction[1] / length)


def _loads(rigid: RigidPhase, joints: list[str]) -> Loads | None:
    """What the rigid phase asks for besides gravity; None if nothing.

    Raises:
        RequestError: a torque names no joint of the chain, or one twice.
    """
    tables: dict[str, Table] = {}
    for torque in rigid.torques:
        if torque.joint not in joints or torque.joint in tables:
            remedy = f"name one of the chain's joints, each once: {', '.join(joints)}"
            raise bad_value("JointTorque.joint", torque.joint, remedy)
        tables[torque.joint] = Table(np.array(torque.times), np.array(torque.torques))
    base = rigid.base_motion
    if not (tables or base or any(rigid.joint_friction) or any(rigid.joint_damping)):
        return None
    none = np.zeros(len(joints))
    return Loads(
        friction=np.array(rigid.joint_friction) if rigid.joint_friction else none,
        damping=np.array(rigid.joint_damping) if rigid.joint_damping else none,
        friction_rate=rigid.friction_rate,
        torques=tuple(tables.get(joint) for joint in joints),
        base_velocity=base and Table(np.array(base.times), np.column_stack([base.vx, base.vy])),
    )


def _apex(tip: Tip, hinge: Vec2) -> Vec2:
    """Point of the tip's sphere farthest from the hinge, in the link's frame [m]."""
    x, y = tip.centre[0] - hinge[0], tip.centre[1] - hinge[1]
    distance = math.hypot(x, y)
    if distance == 0.0:
        raise bad_value("RigidPhase.tip.centre", tip.centre, "a slender link needs its tip away from its hinge")
    return (x * (1.0 + tip.radius / distance), y * (1.0 + tip.radius / distance))


def _ground_hinge(scene: Scene, name: str, hinge: Vec2) -> Vec2:
    """World position of the first hinge [m]: position + R(rotation) hinge, in the plane."""
    body = scene.body(name)
    turned = rotation_matrix(body.rotation) @ (*hinge, 0.0)
    return (body.position[0] + float(turned[0]), body.position[1] + float(turned[1]))


def _spans(scene: Scene) -> list[_Span]:
    """The links, from the ground outwards.

    Raises:
        RequestError: the joints do not form one open chain with hinges parallel to z from one ground hinge.
    """
    hinges = _hinges(scene)
    grounded = [joint for joint in hinges if joint.other is None]
    if len(grounded) != 1:
        remedy = "a chain hangs from exactly one ground hinge (a Revolute with other=None)"
        raise bad_value("Scene.joints on the ground", [joint.name for joint in grounded], remedy)
    body, hinge, name = grounded[0].body, grounded[0].at, grounded[0].name
    left = [joint for joint in hinges if joint.other is not None]
    spans = []
    while True:
        touching = [joint for joint in left if body in (joint.body, joint.other)]
        if len(touching) > 1:
            remedy = f"the chain branches or closes a loop at body {body}; give each link one outbound hinge"
            raise bad_value("Scene.joints", [joint.name for joint in touching], remedy)
        if not touching:
            break
        out, child, inbound = _cross(touching[0], body)
        spans.append(_Span(name, body, hinge[:2], (out[0] - hinge[0], out[1] - hinge[1])))
        left.remove(touching[0])
        body, hinge, name = child, inbound, touching[0].name
    if left:
        remedy = f"these joints do not hang on the ground hinge {grounded[0].name}; connect or remove them"
        raise bad_value("Scene.joints", [joint.name for joint in left], remedy)
    return [*spans, _Span(name, body, hinge[:2], None)]


def _hinges(scene: Scene) -> list[Revolute]:
    """The scene's joints, all hinges about z.

    Raises:
        RequestError: one of them is not.
    """
    hinges = []
    for joint in scene.joints:
        if not isinstance(joint, Revolute):
            remedy = "the links of a rigid phase hang on Revolute joints; leave other kinds out, or the rigid phase"
            raise bad_value("Scene.joints", joint.title, remedy)
        if joint.axis[0] != 0.0 or joint.axis[1] != 0.0 or joint.axis[2] == 0.0:
            raise bad_value(f"Revolute {joint.name}.axis", joint.axis, "a planar chain hinges about z; give (0, 0, 1)")
        hinges.append(joint)
    return hinges


def _cross(joint: Revolute, body: str) -> tuple[Vec3, str, Vec3]:
    """Where the joint lies in `body` [m], the body on its other side, and where it lies there [m]."""
    assert joint.other is not None
    if joint.body == body:
        return joint.at, joint.other, joint.other_at
    return joint.other_at, joint.body, joint.at
