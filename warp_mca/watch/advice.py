"""Owns what is said of a scene's meshes before it runs: notes of readers, slivers, loose parts, coarse slaves."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.geometry import Box, Mesh, NestedPlate, Parts, Plate, Rod, Sphere
from warp_mca.geometry.quality import doubled_nodes, pieces
from warp_mca.physics.contact.surfaces import face_geometry
from warp_mca.physics.ties.nodes import tie_warnings
from warp_mca.scene import Prismatic, RigidPlane, Weld
from warp_mca.watch.mass_report import mass_warnings
from warp_mca.watch.unit_warnings import unit_warnings

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.scene import Contact, Scene

LOGGER = "warp_mca"  # name of the logger that warnings go to while a run goes on
SHORTENED = 10.0  # an element that makes the time step so many times shorter is worth a look
COARSER = 1.5  # slave's faces so many times as wide as the master's: where it is 2, a third of the force is missing


def warn(sentences: Iterable[str]) -> None:
    """Log warnings, each once."""
    for sentence in dict.fromkeys(sentences):
        logging.getLogger(LOGGER).warning("%s", sentence)


def mesh_warnings(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> list[str]:
    """What is worth a look in the meshes of a scene, one sentence each.

    Args:
        scene: the scene.
        meshes: of its bodies, by name.
        model: assembled of them.
    """
    found = list(dict.fromkeys(note for mesh in meshes.values() for note in mesh.notes))
    stable = model.stable
    if stable.shortened > SHORTENED:
        name, element = model.owner(stable.element)
        mesh = meshes[name]
        x, y, z = mesh.points[mesh.cell(element)].mean(axis=0)
        found.append(
            f"element {element} of body {name}, at ({x:.4g}, {y:.4g}, {z:.4g}) m in the body's frame, makes the "
            f"time step {stable.shortened:.0f} times shorter than half of the elements need; improve the mesh there"
        )
    for body in scene.bodies:
        own = not isinstance(body.geometry, (Box, NestedPlate, Parts, Plate, Rod, Sphere))
        if own and (count := doubled_nodes(meshes[body.name])):
            found.append(
                f"{count} nodes of body {body.name} lie where others of it do: unless cracks are meant, merge the "
                "parts of its mesh, which hang together at shared nodes only"
            )
        elif own and (count := pieces(meshes[body.name])) > 1:
            found.append(
                f"body {body.name} is {count} pieces that share no node: they fall apart, and pass through each other "
                "where they overlap, which counts their mass twice; make one solid of them, or bodies of their own"
            )
    unstressed = [path.name for path in scene.paths if path not in scene.stress_paths]
    if unstressed:
        rigid = " and ".join(
            sorted({line.body for path in scene.paths for line in path.lines} & set(scene.rigid_names))
        )
        found.append(f"{', '.join(unstressed)} leave out their lines in {rigid}: rigid bodies have no stress")
    for contact in scene.contacts:
        if (ratio := _coarser(contact, meshes)) > COARSER:
            found.append(
                f"faces of the slave {contact.slave.body} are {ratio:.2g} times as wide as those of its master, "
                "whose nodes pass between its own: make the finer side the slave, or set two_way"
            )
    found += mass_warnings([body for body in scene.bodies if body.exact_mass], meshes)
    found += _loose_nodes(scene, meshes, model) + tie_warnings(model.ties)
    return found + unit_warnings(scene, meshes, model)


def _loose_nodes(scene: Scene, meshes: Mapping[str, Mesh], model: Model) -> list[str]:
    """Joints of node sets that bind only some of the nodes where two bodies meet, as meshes that differ there leave."""
    found = []
    for joint, pairs in zip(scene.joints, model.joints, strict=True):
        if joint.other is None or not isinstance(joint, (Prismatic, Weld)):
            continue
        assert joint.other_nodes is not None
        own, other = (len(meshes[b].nodes(s)) for b, s in ((joint.body, joint.nodes), (joint.other, joint.other_nodes)))
        bound, wanted, remedy = pairs.end - pairs.start, min(own, other), "mesh both alike there, or use a Tie"
        if isinstance(joint, Prismatic):
            slides = model.joint_slides[
                (model.joint_slides[:, 0] >= pairs.start) & (model.joint_slides[:, 0] < pairs.end)
            ]
            bound, wanted, remedy = int((slides[:, 1] - slides[:, 0]).sum()), own, "give rails to all that should slide"
        if bound < wanted:
            found.append(
                f"joint {joint.name} binds {bound} of the {own} nodes {joint.nodes} of {joint.body} to the {other} "
                f"nodes {joint.other_nodes} of {joint.other}; the others are free: {remedy}"
            )
    return found


def _coarser(contact: Contact, meshes: Mapping[str, Mesh]) -> float:
    """Width of the slave's faces over that of the master's [-]; 0 where nodes of both are kept out.

    The lesser of the ratio of the smallest and that of the usual: faces far from contact may be of any size.
    """
    if contact.two_way or isinstance(contact.master, RigidPlane):
        return 0.0
    sides = ((meshes[side.body], side.nodes) for side in (contact.slave, contact.master))
    slave, master = (face_geometry(mesh.points, mesh.surface(nodes)[0])[0] for mesh, nodes in sides)
    return math.sqrt(min(slave.min() / master.min(), np.median(slave) / np.median(master)))
