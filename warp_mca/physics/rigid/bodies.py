"""Owns the rigid bodies of the impact phase on the host: mass properties and riders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.physics.rigid.joining import join_whole
from warp_mca.physics.rigid.rows import check_joint, fixed_rows, joint_rows, pin_of, pin_rows
from warp_mca.scene import Scene
from warp_mca.system.bodies import GROUND, Bodies
from warp_mca.system.body_joints import BodyJoint
from warp_mca.system.contact import ContactPass
from warp_mca.system.joints import Coupling, JointPairs
from warp_mca.system.loads import LoadedNodes, MovableBase
from warp_mca.system.rigid import RigidBody, RigidPin, RigidRow

if TYPE_CHECKING:
    from warp_mca.rigid.chain import Chain
    from warp_mca.system.model import Model


class Rigid(NamedTuple):
    """Rigid bodies of a scene, rows, pins and joints, as `Model` has them."""

    rigid_bodies: tuple[RigidBody, ...] = ()
    rigid_rows: tuple[RigidRow, ...] = ()
    rigid_pins: tuple[RigidPin, ...] = ()
    body_joints: tuple[BodyJoint, ...] = ()


def own_nodes(parts: Bodies) -> dict[str, Index]:
    """Nodes of each rigid body of a scene, by name."""
    start, meshes = parts.node_start, parts.meshes
    return {
        body.name: np.arange(start[body.name], start[body.name] + len(meshes[body.name].points), dtype=np.int32)
        for body in parts.scene.bodies
        if body.rigid
    }


def flexible(
    couplings: Sequence[Coupling], pairs: Mapping[str, NDArray], nodes: Mapping[str, Index]
) -> tuple[Coupling, ...]:
    """The couplings without those of rigid bodies, whose `nodes` are given by name."""
    rigid = np.isin(pairs["joint_first"], np.concatenate([np.zeros(0, np.int32), *nodes.values()]))
    return tuple(item for item in couplings if not rigid[item.start : item.end].any())


def rigid_nodes(model: Model) -> NDArray[np.bool_]:
    """Nodes of rigid bodies, riders aside, shape (node_count,), bool."""
    found = np.zeros(model.node_count, dtype=bool)
    for body in model.rigid_bodies:
        found[body.own] = True
    return found


def moves_with_rigid(model: Model) -> NDArray[np.bool_]:
    """Nodes of rigid bodies and riders, shape (node_count,), bool."""
    found = np.zeros(model.node_count, dtype=bool)
    for body in model.rigid_bodies:
        found[body.nodes] = True
    return found


def rigid_bodies(
    parts: Bodies,
    pairs: Mapping[str, NDArray],
    joints: Sequence[JointPairs],
    couplings: Sequence[Coupling],
    passes: Sequence[ContactPass],
    loads: Mapping[str, Sequence[LoadedNodes]],
    velocity: Array,
) -> Rigid:
    """The rigid bodies of a scene and what binds them.

    Args:
        parts: of the scene.
        pairs, joints: as in `Model`.
        couplings: of all joints between clusters.
        passes: of its contacts.
        loads: on its nodes, by kind.
        velocity: initial velocities [m/s], shape (node_count, 3), float64.

    Raises:
        RequestError: something binds a rigid body in a way that it cannot be bound.
    """
    nodes = own_nodes(parts)
    if not nodes:
        return Rigid()
    owner = np.full(len(parts.X), GROUND, dtype=np.int32)
    for place, own in enumerate(nodes.values()):
        owner[own] = place
    _check_drives(parts)
    coupled = {item.start: item for item in couplings}
    tied = [item for item in zip(parts.scene.acting_joints, joints, strict=True) if item[0].whole() is None]
    for joint, found in tied:
        check_joint(joint, pairs, found, owner, found.start in coupled)
    touched = np.zeros(len(parts.X), dtype=bool)
    for item in passes:
        touched[item.slave], touched[item.master] = True, True
    for item in (item for items in loads.values() for item in items):
        touched[item.node] = True
    bodies = [_body(parts, name, own, touched, pairs, owner) for name, own in nodes.items()]
    pins: list[RigidPin] = []
    rows = []
    for _, found in tied:
        if found.start in coupled and (item := pin_of(coupled[found.start], pairs, owner)):
            rows += pin_rows(item, len(pins), found.start, bool(owner[pairs["joint_first"][found.start]] == GROUND))
            pins.append(item)
        else:
            rows += joint_rows(parts, pairs, found, owner, coupled.get(found.start))
    for place, body in enumerate(bodies):
        rows += fixed_rows(parts, place, body.name, body.centre, body.radius, velocity)
    whole = join_whole(parts, pairs, joints, bodies, velocity, len(pins))
    return Rigid(tuple(bodies), (*rows, *whole.rows), (*pins, *whole.pins), whole.joints)


def _check_drives(parts: Bodies) -> None:
    for item in parts.scene.prescribed:
        if parts.scene.body(item.body).rigid:
            remedy = "its nodes move as one rigid body, which no table drives; give it a velocity, or leave rigid off"
            raise bad_value("Prescribed.body", item.body, remedy)


def check_loads(scene: Scene, chain: Chain | None, bases: Sequence[MovableBase]) -> None:
    """Refuse torques and friction in hinges of rigid links, and bases that move or slide with a rigid link.

    Raises:
        RequestError: there is such a link.
    """
    rigid = set(scene.rigid_names)
    if chain is None or not rigid:
        return
    remedy = "{} acts on nodes of flexible links; leave rigid off for this body"
    if bases and chain.links[0].body in rigid:
        raise bad_value("Body.rigid", chain.links[0].body, remedy.format("a base that moves or slides"))
    loads = chain.loads
    for j, link in enumerate(chain.links if loads else ()):
        assert loads is not None
        loaded = loads.torques[j] is not None or loads.friction[j] != 0.0 or loads.damping[j] != 0.0
        hinged = {link.body, chain.links[j - 1].body} if j else {link.body}
        if loaded and hinged & rigid:
            raise bad_value("Body.rigid", min(hinged & rigid), remedy.format("torque or friction in its hinge"))


def _body(
    parts: Bodies, name: str, own: Index, touched: NDArray[np.bool_], pairs: Mapping[str, NDArray], owner: Index
) -> RigidBody:
    first, second = pairs["joint_first"], pairs["joint_second"]
    place = owner[own[0]]
    others = np.where(second == GROUND, GROUND, owner[second])
    carried = [
        ((others == place) & (owner[first] == GROUND), first, 1.0),
        ((owner[first] == place) & (second != GROUND) & (others == GROUND), second, -1.0),
    ]
    index = np.concatenate([np.flatnonzero(mask) for mask, _, _ in carried])
    riders = np.concatenate([node[mask] for mask, node, _ in carried])
    signs = np.concatenate([np.full(int(mask.sum()), sign) for mask, _, sign in carried])
    nodes = np.concatenate([own, riders])
    mass, X = parts.mass[nodes], parts.X[nodes]
    centre = mass @ X / mass.sum()
    arm = X - centre
    squares = np.einsum("n,ni,nj->ij", mass, arm, arm)
    return RigidBody(
        name=name,
        own=own,
        loaded=own[touched[own]],
        riders=riders.astype(np.int32),
        pairs=index.astype(np.int32),
        signs=signs,
        mass=float(mass.sum()),
        centre=centre,
        inertia=np.trace(squares) * np.eye(3) - squares,
    )
