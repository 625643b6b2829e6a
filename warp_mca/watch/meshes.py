"""Owns the rows about meshes and masses: notes of readers, slivers, loose parts, coarse surfaces and shapes."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial

import numpy as np

from warp_mca.geometry import Box, Mesh, NestedPlate, Parts, Plate, Rod, Sphere
from warp_mca.geometry.quality import doubled_nodes, pieces
from warp_mca.physics.contact.sides import face_geometry
from warp_mca.scene import Damping, Prismatic, RigidPlane, Weld
from warp_mca.watch.mass_report import body_report
from warp_mca.watch.row import Context, Finished, Kind, Values, When, row

_MASS = "the cells of body {body} have {share:.1%} {than} mass than its shape, because they are flat where it is round;"
COARSE = 0.02  # error of a mesh's mass: forces and stiffness are off by as much

advice = partial(row, kind=Kind.ADVICE, when=When.BEFORE)


@advice("{note}")
def note_of_a_reader(c: Context, _: float) -> Iterator[Values]:
    """What the readers of mesh files left out."""
    return (dict(note=note) for note in dict.fromkeys(note for mesh in c.meshes.values() for note in mesh.notes))


@advice(
    "element {element} of body {body}, at ({x:.4g}, {y:.4g}, {z:.4g}) m in the body's frame, makes the time step "
    "{times:.0f} times shorter than half of the elements need;",
    "improve the mesh there",
    10.0,
    "times at most",
)
def sliver(c: Context, most: float) -> Iterator[Values]:
    """By how much the element that sets the stable step shortens it."""
    stable = c.model.stable
    if stable.shortened > most:
        name, element = c.model.owner(stable.element)
        mesh = c.meshes[name]
        x, y, z = mesh.points[mesh.cell(element)].mean(axis=0)
        yield dict(element=element, body=name, x=x, y=y, z=z, times=stable.shortened)


@advice(
    "the damping of body {body} makes the time step {times:.1f} times shorter;",
    "leave its stiffness out, and give a loss_factor over the band of frequencies that matter",
    1.5,
    "times at most",
)
def costly_damping(c: Context, most: float) -> Iterator[Values]:
    """By how much the stiffness part of the damping of a body shortens the stable step."""
    damping = [load for load in c.scene.loads if isinstance(load, Damping) and load.stiffness]
    if damping and c.model.stable.damped > most:
        name, _ = c.model.owner(c.model.stable.element)
        yield dict(body=name, times=c.model.stable.damped)


@advice(
    "{count} nodes of body {body} lie where others of it do:",
    "unless cracks are meant, merge the parts of its mesh, which hang together at shared nodes only",
)
def doubled_node(c: Context, _: float) -> Iterator[Values]:
    """Nodes at one place, in meshes that no recipe of warp_mca made."""
    return (dict(count=n, body=name) for name, mesh in _foreign(c) if (n := doubled_nodes(mesh)))


@advice(
    "body {body} is {count} pieces that share no node: they fall apart, and pass through each other where they "
    "overlap, which counts their mass twice;",
    "make one solid of them, or bodies of their own",
    1.0,
    "piece at most",
)
def loose_pieces(c: Context, most: float) -> Iterator[Values]:
    """Pieces of such meshes of flexible bodies, without doubled nodes."""
    for name, mesh in _foreign(c):
        if name not in c.scene.rigid_names and (count := pieces(mesh)) > most and not doubled_nodes(mesh):
            yield dict(body=name, count=count)


@advice("{paths} leave out their lines in {rigid}:", "rigid bodies have no stress")
def path_without_stress(c: Context, _: float) -> Iterator[Values]:
    """Paths through rigid bodies."""
    unstressed = [path.name for path in c.scene.paths if path not in c.scene.stress_paths]
    if unstressed:
        rigid = {line.body for path in c.scene.paths for line in path.lines} & set(c.scene.rigid_names)
        yield dict(paths=", ".join(unstressed), rigid=" and ".join(sorted(rigid)))


@advice(
    "faces of the slave {slave} are {ratio:.2g} times as wide as those of its master, whose nodes pass between its "
    "own:",
    "make the finer side the slave, or leave two_way out",
    1.5,
    "times as wide at most; where it is 2, a third of the force is missing",
)
def coarse_slave(c: Context, most: float) -> Iterator[Values]:
    """Width of the slave's faces over that of the master's, where nodes of one of them only are kept out.

    The lesser of the ratio of the smallest and that of the usual: faces far from contact may be of any size.
    """
    for contact in c.scene.listed:
        if contact.two_way is not False or isinstance(contact.master, RigidPlane):
            continue
        sides = ((c.meshes[side.body], side.nodes) for side in (contact.slave, contact.master))
        slave, master = (face_geometry(mesh.points, mesh.surface(nodes)[0])[0] for mesh, nodes in sides)
        ratio = math.sqrt(min(slave.min() / master.min(), np.median(slave) / np.median(master)))
        if ratio > most:
            yield dict(slave=contact.slave.body, ratio=ratio)


@advice(
    f"{_MASS} its mass is scaled to that of the shape, but its sections and stiffness are not:",
    "refine its mesh, as with --refine 2",
    COARSE,
    "of the shape's mass at most",
)
def coarse_shape(c: Context, most: float) -> Iterator[Values]:
    """Mass of a body's cells against that of its shape, with exact_mass."""
    return _missing_mass(c, most, exact=True)


@advice(
    "joint {joint} binds {bound} of the {own} nodes {nodes} of {body} to the {others} nodes {other_nodes} of {other}; "
    "the others are free:",
    "{remedy}",
)
def free_joint_node(c: Context, _: float) -> Iterator[Values]:
    """Nodes of joints where two bodies meet that bind only some of them, as meshes that differ there leave."""
    for joint, pairs in zip(c.scene.acting_joints, c.model.joints, strict=True):
        if joint.other is None or not isinstance(joint, (Prismatic, Weld)) or joint.nodes is None:
            continue
        assert joint.other_nodes is not None
        sides = ((joint.body, joint.nodes), (joint.other, joint.other_nodes))
        own, others = (len(c.meshes[body].nodes(nodes)) for body, nodes in sides)
        bound, wanted, remedy = pairs.end - pairs.start, min(own, others), "mesh both alike there, or use a Tie"
        if isinstance(joint, Prismatic):
            slides = c.model.joint_slides
            slides = slides[(slides[:, 0] >= pairs.start) & (slides[:, 0] < pairs.end)]
            bound, wanted, remedy = int((slides[:, 1] - slides[:, 0]).sum()), own, "give rails to all that should slide"
        if bound < wanted:
            yield dict(
                joint=joint.name, bound=bound, own=own, nodes=joint.nodes, body=joint.body, others=others,
                other_nodes=joint.other_nodes, other=joint.other, remedy=remedy,
            )  # fmt: skip


@advice(
    "faces of the tied slave {slave} are {ratio:.2g} times as wide as those of its master {master}, whose nodes "
    "between them are tied to nothing:",
    "swap slave and master",
    1.05,
    "times as wide at most",
)
def coarse_tied_slave(c: Context, most: float) -> Iterator[Values]:
    """Width of the slave's faces over that of the master's in each tie."""
    for fact in c.model.ties.facts:
        if (ratio := 1.0 / float(fact["size_ratio"])) > most:  # type: ignore[arg-type]
            yield dict(slave=fact["slave"], master=fact["master"], ratio=ratio)


@row(f"{_MASS} the body has that mass:", "refine its mesh, as with --refine 2", COARSE, "of the shape's mass at most")
def coarse_mass(c: Context, most: float) -> Iterator[Values]:
    """Mass of a body's cells against that of its shape, without exact_mass: asked for, so not said before the run."""
    return _missing_mass(c, most, exact=False)


@row(
    "the rigid phase took slender rods: momentum changes by {momentum:.1%} and kinetic energy by {energy:.1%} at "
    "hand-off;",
    "rigid_inertia=mesh keeps both",
)
def slender_rods(c: Finished, _: float) -> Iterator[Values]:
    """Change of energy at the hand-off of a rigid phase with inertia="slender"."""
    if c.scene.rigid and c.scene.rigid.inertia == "slender" and c.start.energy_mismatch > 0.0:
        yield dict(momentum=c.start.momentum_mismatch, energy=c.start.energy_mismatch)


def _foreign(c: Context) -> Iterator[tuple[str, Mesh]]:
    """Bodies whose meshes may hang together badly, by name."""
    for body in c.scene.bodies:
        if not isinstance(body.geometry, (Box, NestedPlate, Parts, Plate, Rod, Sphere)):
            yield body.name, c.meshes[body.name]


def _missing_mass(c: Context, most: float, exact: bool) -> Iterator[Values]:
    for body in c.scene.bodies:
        coarse = (np.abs(1.0 / c.meshes[body.name].volume_ratio - 1.0) > most).any()
        if coarse and body.exact_mass == exact and body.mass is None:
            error = body_report([body], c.meshes)[body.name]["mass_error"]
            if error is not None and abs(error) > most:
                yield dict(body=body.name, share=abs(error), than="less" if error < 0.0 else "more")
