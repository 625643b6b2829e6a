"""Owns balls of a machine with a range: how far they may turn, and what pushes them back."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine

STILL = 1e-9  # angle below which a ball has no direction in which it is turned [rad]


class Socket(NamedTuple):
    """A ball with a range.

    Attributes:
        joint, place, dof: numbers of the joint, of its first coordinate and of its first rate.
        most: greatest angle [rad].
        stiffness, damping: of its limit [N m/rad], [N m s/rad].
    """

    joint: int
    place: int
    dof: int
    most: float
    stiffness: float
    damping: float

    def push(self, q: Array, v: Array) -> Array:
        """Torque of the limit in the link's frame at coordinates q and rates v [N m], shape (3,), float64."""
        angle, n = turned(q[self.place : self.place + 4])
        if angle <= self.most:
            return np.zeros(3)
        return -(self.stiffness * (angle - self.most) + self.damping * (n @ v[self.dof : self.dof + 3])) * n


def sockets_of(machine: Machine, mobility: Array, rate: float) -> list[Socket]:
    """Those of a machine, whose limits have a rate [rad/s] on the inertias 1 / `mobility` and critical damping.

    Raises:
        RequestError: one starts beyond its range.
    """
    model, found = machine.model, []
    ball = int(machine.mj.mjtJoint.mjJNT_BALL)
    for joint in np.flatnonzero(model.jnt_limited.astype(bool) & (model.jnt_type == ball)).tolist():
        place, dof, most = int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint]), float(model.jnt_range[joint, 1])
        inertia = 3.0 / float(mobility[dof : dof + 3].sum())
        angle, _ = turned(machine.start[place : place + 4])
        if angle > most:
            name = machine.names.joint(joint)
            raise bad_value(f"Robot.qpos of joint {name} [rad]", angle, f"start within its range of {most:g}")
        found.append(Socket(joint, place, dof, most, inertia * rate**2, 2.0 * inertia * rate))
    return found


def turned(quaternion: Array) -> tuple[float, Array]:
    """Angle of a rotation [rad], and its axis [-], shape (3,), float64, which is 0 where it does not turn."""
    w, v = float(quaternion[0]), np.asarray(quaternion[1:], dtype=np.float64)
    sine = float(np.linalg.norm(v))
    angle = 2.0 * float(np.arctan2(sine, abs(w)))
    return angle, v / (sine if w >= 0.0 else -sine) if angle > STILL else np.zeros(3)


def axes_of(quaternion: Array) -> Array:
    """Three axes, the first along that of a rotation, shape (3, 3), float64, right-handed; x, y, z of none."""
    angle, n = turned(quaternion)
    if angle <= STILL:
        return np.eye(3)
    across = np.cross(n, np.eye(3)[int(np.abs(n).argmin())])
    across /= np.linalg.norm(across)
    return np.array([n, across, np.cross(n, across)], dtype=np.float64)
