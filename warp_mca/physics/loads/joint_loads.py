"""Owns what acts in the joints of a chain during an impact: torques and friction in hinges, and a base that moves."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.arrays import Array, Index
from warp_mca.base.errors import bad_value
from warp_mca.system.bodies import Bodies
from warp_mca.system.joints import Coupling, JointPairs
from warp_mca.system.loads import HingeLoad, MovableBase

if TYPE_CHECKING:
    from warp_mca.rigid.chain import Chain, Vec2
    from warp_mca.rigid.loads import Table


ON_AXIS = 1e-6  # of a body's extent: distance from a hinge's axis up to which nodes lie on it
MARGIN = 1.0 + 1e-9  # so that rounding leaves no node out


def _shifted(table: Table | None, start: float, rest: Array) -> tuple[Array, Array]:
    """Times from the start of the phase and values of a table; `rest` is the value without one."""
    if table is None:
        return np.zeros(1), rest
    return table.times - start, table.values


def hinge_loads(parts: Bodies, free: NDArray[np.bool_], chain: Chain | None, start: float) -> tuple[HingeLoad, ...]:
    """The chain's hinges in which torque or friction acts, for a phase that starts so long after the release [s].

    `free` are nodes that no joint ties and nothing holds or drives, shape (node_count,).

    Raises:
        RequestError: a link has no free nodes off the axis of such a hinge.
    """
    if chain is None or chain.loads is None:
        return ()
    found, loads = [], chain.loads
    for j, link in enumerate(chain.links):
        table, friction, damping = loads.torques[j], float(loads.friction[j]), float(loads.damping[j])
        if table is None and friction == 0.0 and damping == 0.0:
            continue
        inner = np.zeros(0, dtype=np.int32)
        if j > 0:
            before = chain.links[j - 1]
            hinge = before.hinge_in[0] + before.hinge_out[0], before.hinge_in[1] + before.hinge_out[1]
            inner = _near(parts, free, before.body, hinge)
        times, torques = _shifted(table, start, np.zeros(1))
        found.append(
            HingeLoad(
                inner=inner,
                outer=_near(parts, free, link.body, link.hinge_in),
                friction=friction,
                damping=damping,
                friction_rate=loads.friction_rate,
                times=times,
                torques=torques,
            )
        )
    return tuple(found)


def _near(parts: Bodies, free: NDArray[np.bool_], body: str, hinge: Vec2) -> Index:
    """Free nodes of a body as near to a hinge's axis as the body is thick there, more if these are on a line along z.

    Raises:
        RequestError: all free nodes are.
    """
    points, first = parts.meshes[body].points, parts.node_start[body]
    away = np.linalg.norm(points[:, :2] - np.asarray(hinge), axis=1)
    tolerance = ON_AXIS * float(np.ptp(points, axis=0).max())
    on_axis = away <= tolerance
    thickness = float(np.ptp(points[on_axis, 2])) if on_axis.any() else 0.0
    for radius in np.append(thickness, np.unique(away[away > thickness])):
        found = np.flatnonzero((away <= MARGIN * radius) & free[first : first + len(points)])
        if len(found) and np.ptp(points[found, :2], axis=0).max() > tolerance:
            return (found + first).astype(np.int32)
    raise bad_value(f"nodes of {body} at its hinge", hinge, "none is free to take the joint's torque; refine its mesh")


def movable_bases(
    parts: Bodies, joints: tuple[JointPairs, ...], couplings: Sequence[Coupling], chain: Chain | None, start: float
) -> tuple[MovableBase, ...]:
    """The chain's base, if it moves or slides, for a phase that starts so long after the release [s].

    Raises:
        RequestError: a carriage without mass carries a pin.
    """
    table = None if chain is None or chain.loads is None else chain.loads.base_velocity
    if chain is None or (table is None and chain.slide is None):
        return ()
    (pairs,) = [own for own, joint in zip(joints, parts.scene.acting_joints, strict=True) if joint.other is None]
    coupling = next((k for k, item in enumerate(couplings) if item.start == pairs.start), -1)
    if coupling >= 0 and chain.slide is not None and chain.carriage_mass == 0.0:
        raise bad_value("Slide.carriage_mass", 0.0, "a pin needs a carriage with mass; give one, or tie nodes=axis")
    times, velocities = _shifted(table, start, np.zeros((1, 2)))
    direction = np.zeros(3) if chain.slide is None else np.array([*chain.slide, 0.0])
    return (
        MovableBase(
            start=pairs.start,
            end=pairs.end,
            direction=direction,
            carriage_mass=chain.carriage_mass,
            times=times,
            velocities=velocities,
            coupling=coupling,
        ),
    )
