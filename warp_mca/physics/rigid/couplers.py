"""Owns couplers on the host: rows that tie a rate of a joint between whole bodies to that of another one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.scene import Scene
from warp_mca.system.body_joints import BodyJoint
from warp_mca.system.rigid import RigidRow

ASTRAY = 1e-6  # of the bodies' speeds at the start, by which rates may be against a coupler


def coupler_rows(scene: Scene, joints: Sequence[BodyJoint], rates: Sequence[tuple[Array, Array]]) -> list[RigidRow]:
    """A row for each coupler.

    Args:
        scene: with couplers.
        joints: between whole bodies.
        rates: of each at the start, and those that count as its bodies' speed [rad/s], [m/s].

    Raises:
        RequestError: rates at the start are against a coupler.
    """
    place, rows = {item.name: k for k, item in enumerate(joints)}, []
    freedoms = {item.name: whole.freedoms for item in scene.acting_joints if (whole := item.whole()) is not None}
    for name, own in freedoms.items():
        for number, freedom in enumerate(own):
            if (coupler := freedom.follows) is None:
                continue
            j, leader = place[name], place[coupler.joint]
            k = sum(item.rates for item in own[:number])
            m = sum(item.rates for item in freedoms[coupler.joint][: coupler.freedom - 1])
            rate, other = float(rates[j][0][k]) + 0.0, float(rates[leader][0][m]) + 0.0
            fast = max(float(rates[j][1][k]), abs(coupler.ratio) * float(rates[leader][1][m]))
            if abs(rate - coupler.ratio * other) > ASTRAY * fast:
                remedy = (
                    f"freedom {number + 1} of joint {name} starts at {rate:.6g} and the other one at {other:.6g} per s"
                )
                raise bad_value("Coupler.ratio", coupler.ratio, f"{remedy}; give bodies velocities that fit")
            bodies = [max(joints[n].body, joints[n].other) for n in (j, leader)]
            rows.append(
                RigidRow(
                    first=bodies[0],
                    second=bodies[1],
                    point=joints[j].place,
                    direction=np.zeros(3),
                    geared=j,
                    leader=leader,
                    rates=(k, m),
                    ratio=coupler.ratio,
                )
            )
    return rows
