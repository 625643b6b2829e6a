"""Owns what drives a chain besides gravity: torques and friction in its joints, and a base that moves by a table."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Table:
    """Values that change linearly between given times and keep the first and last value before and after.

    Attributes:
        times: [s], increasing, shape (count,), float64.
        values: at those times, shape (count,) or (count, 2), float64.
    """

    times: Array
    values: Array

    def at(self, t: float) -> Array:
        """The value at time t [s], float64, shape () or (2,)."""
        columns = self.values.reshape(len(self.times), -1).T
        found = np.array([np.interp(t, self.times, column) for column in columns])
        return found.reshape(self.values.shape[1:])

    def slope(self, t: float) -> Array:
        """The rate of change at time t [1/s], float64, shape () or (2,); at a corner that of the part after it."""
        k = int(np.searchsorted(self.times, t, side="right"))
        if k in (0, len(self.times)):
            return np.zeros(self.values.shape[1:])
        return (self.values[k] - self.values[k - 1]) / (self.times[k] - self.times[k - 1])

    def integral(self, t: float) -> Array:
        """The integral from 0 to t [s], float64, shape () or (2,): the trapezoidal rule is exact between corners."""
        inner = self.times[(self.times > 0.0) & (self.times < t)]
        knots = np.array([0.0, *inner, t])
        values = np.array([self.at(knot) for knot in knots])
        return np.tensordot(np.diff(knots), 0.5 * (values[1:] + values[:-1]), axes=1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Loads:
    """What acts on a chain besides gravity. A joint's torque turns the link that it carries to greater theta.

    Joint j connects link j - 1 (the ground if j = 0) with link j; its rate is w_j = theta_dot_j - theta_dot_(j-1).
    Its torque on link j, and reversed on link j - 1, is

        tau_j = tau_drive_j(t) - c_j w_j - tau_C_j tanh(w_j / w_0)

    where tanh stands for the sign of w: a joint at rest under a torque tau < tau_C creeps at w_0 artanh(tau / tau_C).

    Attributes:
        friction: Coulomb torque tau_C of each joint [N m], shape (link_count,), float64.
        damping: viscous coefficient c of each joint [N m s/rad], shape (link_count,), float64.
        friction_rate: w_0 [rad/s].
        torques: tau_drive of each joint over time from the release [N m], or None.
        base_velocity: of the ground hinge over time from the release [m/s], values of shape (count, 2), or None.
    """

    friction: Array
    damping: Array
    friction_rate: float
    torques: tuple[Table | None, ...]
    base_velocity: Table | None = None

    @cached_property
    def corners(self) -> Array:
        """Times at which a table bends [s], float64, increasing."""
        tables = [table.times for table in (*self.torques, self.base_velocity) if table is not None]
        return np.unique(np.concatenate(tables)) if tables else np.zeros(0)

    @cached_property
    def greatest_torque(self) -> float:
        """Sum over the joints of their greatest torque [N m], viscous damping aside."""
        driven = sum(float(np.abs(table.values).max()) for table in self.torques if table is not None)
        return driven + float(self.friction.sum())

    def drive_torques(self, t: float) -> Array:
        """tau_drive of each joint at time t [N m], shape (link_count,), float64."""
        return np.array([0.0 if table is None else float(table.at(t)) for table in self.torques])

    def friction_torques(self, rates: Array) -> Array:
        """-c w - tau_C tanh(w / w_0) of each joint [N m], shape (link_count,), float64, at their rates [rad/s]."""
        return -self.damping * rates - self.friction * np.tanh(rates / self.friction_rate)


def joint_rates(theta_dot: Array) -> Array:
    """w_j = theta_dot_j - theta_dot_(j-1) of each joint [rad/s], shape (link_count,), float64."""
    return np.diff(theta_dot, prepend=0.0)


def link_torques(joint_torques: Array) -> Array:
    """Torque on each link towards greater theta [N m], shape (link_count,), float64: tau_j - tau_(j+1)."""
    return joint_torques - np.append(joint_torques[1:], 0.0)
