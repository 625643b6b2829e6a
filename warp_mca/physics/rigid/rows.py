"""Owns what binds rigid bodies on the host: joints, pins and fixed axes as rows."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.scene.joints import Joint
from warp_mca.system.bodies import GROUND, Bodies
from warp_mca.system.joints import Coupling, JointPairs
from warp_mca.system.rigid import RigidPin, RigidRow

HELD = 1e-4  # least share of a rigid motion that shows at fixed axes
APART = 1e-6  # of the extent of a joint's nodes: distance at which two of them differ


def check_joint(joint: Joint, pairs: Mapping[str, NDArray], found: JointPairs, owner: Index, coupled: bool) -> None:
    """Refuse a joint of rigid bodies that ties its nodes in some directions only; `owner` is each node's rigid body.

    Raises:
        RequestError: so it does.
    """
    first, second = (pairs[name][found.start : found.end] for name in ("joint_first", "joint_second"))
    sides = np.concatenate([owner[first], owner[second[second != GROUND]]])
    tied = pairs["joint_tied"][found.start : found.end]
    if not coupled and (sides != GROUND).any() and (tied != np.eye(3)).any():
        remedy = "nodes of rigid bodies are tied in all directions or not at all; leave rigid off, or the joint out"
        raise bad_value(f"{joint.title}.body", joint.body, remedy)


def pin_of(coupling: Coupling, pairs: Mapping[str, NDArray], owner: Index) -> RigidPin | None:
    """A coupling of a rigid body with a flexible one; None where both sides are alike, or one is the ground."""
    if coupling.middle == coupling.end:
        return None
    sides = [owner[pairs["joint_first"][k]] for k in (coupling.start, coupling.middle)]
    if (sides[0] == GROUND) == (sides[1] == GROUND):
        return None
    soft = 0 if sides[0] == GROUND else 1
    start, end = ((coupling.start, coupling.middle), (coupling.middle, coupling.end))[soft]
    return RigidPin(
        body=int(max(sides)),
        start=start,
        end=end,
        weight=coupling.weight[start - coupling.start : end - coupling.start],
        place=coupling.place,
        axis=coupling.axis,
        arm=coupling.arm[soft],
    )


def pin_rows(pin: RigidPin, place: int, pair: int, second: bool) -> list[RigidRow]:
    """Rows of a pin; its rigid body is the `second` one of the joint, or the first."""
    common = {"first": pin.body, "second": GROUND, "point": pin.place, "pin": place, "pair": pair}
    common["sign"] = -1.0 if second else 1.0
    rows = [RigidRow(direction=direction, **common) for direction in np.eye(3)]
    return rows + [RigidRow(direction=np.zeros(3), twist=twist, **common) for twist in across(pin.axis)]


def joint_rows(
    parts: Bodies, pairs: Mapping[str, NDArray], found: JointPairs, owner: Index, coupling: Coupling | None
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
        rows += [(far, direction) for direction in across(along)]
        if aside[third] > APART * away[far]:
            rows.append((third, np.cross(along, off[third] / aside[third])))
    return [
        RigidRow(first=int(a), second=int(b), point=points[k], direction=direction, pair=found.start + k)
        for k, direction in rows
    ]


def across(along: Array) -> Array:
    """Two unit vectors perpendicular to another and to each other, shape (2, 3)."""
    one = np.asarray(np.cross(along, np.eye(3)[np.abs(along).argmin()]), dtype=np.float64)
    one = one / np.linalg.norm(one)
    return np.stack([one, np.cross(along, one)])


def fixed_rows(parts: Bodies, place: int, name: str, centre: Array, radius: float, velocity: Array) -> list[RigidRow]:
    """Independent rows that hold the fixed axes of a rigid body's nodes.

    Args:
        parts: of the scene.
        place: of the body in `Model.rigid_bodies`.
        name: of the body.
        centre: its mass centre [m], shape (3,), float64.
        radius: of inertia [m].
        velocity: of all nodes at the start [m/s], shape (node_count, 3), float64.

    Raises:
        RequestError: such an axis moves at the start.
    """
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
    n = np.eye(3)[axes]
    motions = np.concatenate([n, np.cross((parts.X[nodes] - centre) / radius, n)], axis=1)
    chosen = independent(motions)
    return [RigidRow(first=place, second=GROUND, point=parts.X[nodes[k]], direction=n[k]) for k in chosen]


def independent(motions: Array) -> list[int]:
    """Rows of a matrix that span all of them, the longest first (Gram and Schmidt with pivots)."""
    left, chosen = motions.copy(), []
    for _ in range(motions.shape[1]):
        size = np.linalg.norm(left, axis=1)
        k = int(size.argmax())
        if size[k] <= HELD * np.linalg.norm(motions, axis=1).max():
            break
        chosen.append(k)
        unit = left[k] / size[k]
        left -= np.outer(left @ unit, unit)
    return chosen
