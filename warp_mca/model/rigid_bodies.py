"""Owns the rigid bodies of the impact phase on the host: mass properties, riders, and rows that bind them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.model.assembly import GROUND, Assembly
from warp_mca.model.constraints import JointPairs
from warp_mca.model.couplings import Coupling
from warp_mca.model.joint_loads import MovableBase
from warp_mca.model.surfaces import ContactPass
from warp_mca.scene import Scene
from warp_mca.scene.joints import Joint

if TYPE_CHECKING:
    from warp_mca.model.model import Model
    from warp_mca.rigid.chain import Chain

Array = NDArray[np.float64]
Index = NDArray[np.int32]

HELD = 1e-4  # least share of a rigid motion that shows at fixed axes
APART = 1e-6  # of the extent of a joint's nodes: distance at which two of them differ


@dataclass(frozen=True, kw_only=True)
class RigidBody:
    """A rigid body with its riders: nodes of flexible bodies that joints tie to its own nodes.

    Attributes:
        name: of the body.
        own: its nodes, shape (node_count,), int32.
        loaded: those among them on which contact may act, int32.
        riders: shape (rider_count,), int32.
        pairs: pair of `Model.joint_first` that ties each rider, shape (rider_count,), int32.
        signs: 1 where a rider is the first node of its pair, -1 where it is the second, shape (rider_count,), float64.
        mass: of nodes and riders [kg].
        centre: of this mass at the reference positions [m], shape (3,), float64.
        inertia: about the centre, J = sum m (r . r I - r r^T) [kg m^2], shape (3, 3), float64.
        scene: number of the scene in a batch.
    """

    name: str
    own: Index
    loaded: Index
    riders: Index
    pairs: Index
    signs: Array
    mass: float
    centre: Array
    inertia: Array
    scene: int = 0

    @property
    def nodes(self) -> Index:
        """All that move with the body, shape (node_count + rider_count,), int32."""
        return np.concatenate([self.own, self.riders]).astype(np.int32)


@dataclass(frozen=True, kw_only=True)
class RigidRow:
    """A scalar condition of `kernels.nodes.rigid_rows`.

    Attributes:
        first, second: places of the bodies in `Model.rigid_bodies`; second is GROUND for the ground.
        point: reference position of the common point [m], shape (3,), float64.
        direction: n at the reference positions [-], shape (3,), float64.
        pair: of `Model.joint_first` that takes the impulse, -1 where none does.
    """

    first: int
    second: int
    point: Array
    direction: Array
    pair: int = -1


def own_nodes(parts: Assembly) -> dict[str, Index]:
    """Nodes of each rigid body of a scene, by name."""
    start, meshes = parts.node_start, parts.meshes
    return {
        body.name: np.arange(start[body.name], start[body.name] + len(meshes[body.name].points), dtype=np.int32)
        for body in parts.scene.bodies
        if body.rigid
    }


def flexible(
    couplings: Sequence[Coupling], pairs: Mapping[str, NDArray], bodies: Sequence[RigidBody]
) -> tuple[Coupling, ...]:
    """The couplings without those of rigid bodies."""
    own = np.concatenate([np.zeros(0, np.int32), *(body.own for body in bodies)])
    rigid = np.isin(pairs["joint_first"], own)
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
    parts: Assembly,
    pairs: Mapping[str, NDArray],
    joints: Sequence[JointPairs],
    couplings: Sequence[Coupling],
    passes: Sequence[ContactPass],
    velocity: Array,
) -> tuple[tuple[RigidBody, ...], tuple[RigidRow, ...]]:
    """The rigid bodies of a scene, and what binds them.

    Args:
        parts: of the scene.
        pairs, joints: as in `Model`.
        couplings: of all joints between clusters.
        passes: of its contacts.
        velocity: initial velocities [m/s], shape (node_count, 3), float64.

    Raises:
        RequestError: something binds a rigid body in a way that it cannot be bound.
    """
    nodes = own_nodes(parts)
    if not nodes:
        return (), ()
    owner = np.full(len(parts.X), GROUND, dtype=np.int32)
    for place, own in enumerate(nodes.values()):
        owner[own] = place
    _check_drives(parts)
    coupled = {item.start: item for item in couplings}
    for joint, found in zip(parts.scene.joints, joints, strict=True):
        _check_joint(joint, pairs, found, owner, found.start in coupled)
    touched = np.zeros(len(parts.X), dtype=bool)
    for item in passes:
        touched[item.slave], touched[item.master] = True, True
    bodies = [_body(parts, name, own, touched, pairs, owner) for name, own in nodes.items()]
    rows = [row for found in joints for row in _joint_rows(parts, pairs, found, owner, coupled.get(found.start))]
    rows += [row for place, name in enumerate(nodes) for row in _fixed_rows(parts, place, name, bodies, velocity)]
    return tuple(bodies), tuple(rows)


def _check_drives(parts: Assembly) -> None:
    for item in parts.scene.prescribed:
        if parts.scene.body(item.body).rigid:
            remedy = "its nodes move as one rigid body, which no table drives; give it a velocity, or leave rigid off"
            raise bad_value("Prescribed.body", item.body, remedy)


def _check_joint(joint: Joint, pairs: Mapping[str, NDArray], found: JointPairs, owner: Index, coupled: bool) -> None:
    first, second = (pairs[name][found.start : found.end] for name in ("joint_first", "joint_second"))
    sides = np.concatenate([owner[first], owner[second[second != GROUND]]])
    tied = pairs["joint_tied"][found.start : found.end]
    if (sides != GROUND).any() and coupled:
        if (sides == GROUND).any():
            remedy = "a pin joins two flexible bodies or two rigid ones; choose axis or ends, or leave rigid off"
            raise bad_value(f"{joint.title}.nodes", "pin", remedy)
    elif (sides != GROUND).any() and (tied != np.eye(3)).any():
        remedy = "nodes of rigid bodies are tied in all directions or not at all; leave rigid off, or the joint out"
        raise bad_value(f"{joint.title}.body", joint.body, remedy)


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
    parts: Assembly, name: str, own: Index, touched: NDArray[np.bool_], pairs: Mapping[str, NDArray], owner: Index
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


def _joint_rows(
    parts: Assembly, pairs: Mapping[str, NDArray], found: JointPairs, owner: Index, coupling: Coupling | None
) -> list[RigidRow]:
    """Independent rows that hold the common nodes of two rigid bodies, or of one and the ground, together.

    A coupling of rigid bodies joins two points of its axis.
    """
    first, second = (pairs[name][found.start : found.end] for name in ("joint_first", "joint_second"))
    a = owner[first[0]]
    if coupling:
        b = owner[first[-1]] if coupling.end > coupling.middle else GROUND
    else:
        b = GROUND if second[0] == GROUND else owner[second[0]]
    if a == GROUND or (b == GROUND and not coupling and second[0] != GROUND):
        return []  # flexible bodies alone, or riders
    points = parts.X[first]
    if coupling:
        reach = np.ptp(points, axis=0).max()
        points = np.stack([coupling.place, coupling.place + reach * coupling.axis])
    away = np.linalg.norm(points - points[0], axis=1)
    far = int(away.argmax())
    rows = [(0, direction) for direction in np.eye(3)]
    if away[far] > 0.0:
        along = (points[far] - points[0]) / away[far]
        off = points - points[0] - np.outer((points - points[0]) @ along, along)
        aside = np.linalg.norm(off, axis=1)
        third = int(aside.argmax())
        rows += [(far, direction) for direction in _across(along)]
        if aside[third] > APART * away[far]:
            rows.append((third, np.cross(along, off[third] / aside[third])))
    return [
        RigidRow(first=int(a), second=int(b), point=points[k], direction=direction, pair=found.start + k)
        for k, direction in rows
    ]


def _across(along: Array) -> Array:
    """Two unit vectors perpendicular to another and to each other, shape (2, 3)."""
    one = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    one /= np.linalg.norm(one)
    return np.stack([one, np.cross(along, one)])


def _fixed_rows(parts: Assembly, place: int, name: str, bodies: Sequence[RigidBody], velocity: Array) -> list[RigidRow]:
    """Independent rows that hold the fixed axes of a rigid body's nodes.

    Raises:
        RequestError: such an axis moves at the start.
    """
    from scipy.linalg import qr

    node, axis = [np.zeros(0, np.int32)], [np.zeros(0, np.int64)]
    for item in parts.scene.fixed:
        if item.body == name:
            nodes = parts.nodes(item.body, item.nodes)
            for letter in item.axes:
                k = "xyz".index(letter)
                if (velocity[nodes, k] != 0.0).any():
                    remedy = f"nodes of rigid body {name} move along {letter} at the start; start at rest there"
                    raise bad_value("Fixed.axes", item.axes, remedy)
                node.append(nodes)
                axis.append(np.full(len(nodes), k))
    nodes, axes = np.concatenate(node), np.concatenate(axis)
    if not len(nodes):
        return []
    body = bodies[place]
    radius = float(np.sqrt(np.trace(body.inertia) / body.mass))
    n = np.eye(3)[axes]
    motions = np.concatenate([n, np.cross((parts.X[nodes] - body.centre) / radius, n)], axis=1)
    _, R, order = qr(motions.T, mode="economic", pivoting=True)
    size = np.abs(np.diag(R))
    chosen = order[: int((size > HELD * size[0]).sum())]
    return [RigidRow(first=place, second=GROUND, point=parts.X[nodes[k]], direction=n[k]) for k in chosen]
