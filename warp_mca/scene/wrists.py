"""Owns hinges whose nodes others would take, too: between rigid bodies they need none."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.scene.joints import Joint, Revolute, Spherical

if TYPE_CHECKING:
    from warp_mca.scene.scene import Scene

NEAR = 1e-6  # of their distance from the body's origin: places so near each other are one


def without_shared_nodes(scene: Scene) -> tuple[Joint, ...]:
    """The joints of a scene, with `nodes=None` where rigid bodies have two whose nodes may be the same.

    A node may be in one joint alone. Rigid bodies need no nodes for theirs, so that axes may cross, as in a wrist.
    Swings and phases before the impact know no joints without nodes; there all stay as they are.
    """
    if scene.rigid is not None or scene.phases:
        return scene.joints
    rigid = {*scene.rigid_names, None}
    meeting = [joint for joint in scene.joints if isinstance(joint, Revolute | Spherical) and joint.nodes is not None]
    shared = set()
    for one, two in combinations(meeting, 2):
        both = {one.body, one.other} & {two.body, two.other} & set(scene.rigid_names)
        if any(_meet(one, two, name) for name in both):
            shared |= {joint.name for joint in (one, two) if {joint.body, joint.other} <= rigid}
    return tuple(_free(joint) if joint.name in shared else joint for joint in scene.joints)


def _free(joint: Joint) -> Joint:
    assert isinstance(joint, Revolute | Spherical)
    return replace(joint, nodes=None, **({"pin_radius": None} if isinstance(joint, Revolute) else {}))


def _line(joint: Revolute | Spherical, body: str) -> tuple[Array, Array, float]:
    """A point and the direction of its axis in the frame of a body [m], [-], zero of a ball; and its radius [m]."""
    at = np.array(joint.at if joint.body == body else joint.other_at, dtype=np.float64)
    if isinstance(joint, Spherical):
        return at, np.zeros(3), 0.0
    axis = np.array(joint.axis, dtype=np.float64)
    return at, axis / np.linalg.norm(axis), joint.pin_radius or 0.0


def _meet(one: Revolute | Spherical, two: Revolute | Spherical, body: str) -> bool:
    """Whether two axes come so near each other that nodes around both may be the same."""
    (a, n, r), (b, m, s) = _line(one, body), _line(two, body)
    between, across = b - a, np.cross(n, m)
    if (size := float(np.linalg.norm(across))) > 1e-9:
        away = abs(float(between @ across)) / size
    else:  # parallel, or a ball
        n = n if n.any() else m
        away = float(np.linalg.norm(between - (between @ n) * n))
    return away <= r + s + NEAR * float(np.linalg.norm(a) + np.linalg.norm(b))
