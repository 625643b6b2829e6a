"""Owns which pairs of surfaces need a look in a step of a swing: those that may come nearer than any pair so far."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.rigid.touch import Watch
from warp_mca.robots.machine import Machine
from warp_mca.robots.touching import Pair, Side

MARGIN = 2.0  # greatest rate of a gap within a step, over the greater one of its bounds at both ends

Flow = Callable[[float], Array]


class Nearby:
    """Watches of pairs, of which a step asks those that it may bring nearer than the smallest gap so far.

    A gap shrinks at most as fast as a point of the first surface moves in the frame of the second one: |v| + |w| r of
    their relative motion at the origin of the first link, whose surface lies within r of it.
    """

    def __init__(self, machine: Machine, pairs: Sequence[Pair], watches: Sequence[Watch], y: Array) -> None:
        """Begin at time 0 and state y."""
        self._machine, self.watches, self._data = machine, watches, machine.mj.MjData(machine.model)
        sides = [(pair.first, pair.second) for pair in pairs[: len(watches)]]
        self._links = np.array([[side.link for side in both] for both in sides], dtype=np.int64).reshape(-1, 2)
        self._radius = np.array([radius_of(machine, first) for first, _ in sides])
        self._beside = np.array([_speed(second) for _, second in sides])
        self._least = np.array([watch.start for watch in watches])
        self._rates, self._t, self._fresh = self._bounds(y), 0.0, np.ones(len(watches), dtype=bool)

    @property
    def closest(self) -> tuple[float, float]:
        """The smallest gap so far [m] and its time [s]; (inf, 0) of no pair."""
        return min((watch.closest for watch in self.watches), default=(np.inf, 0.0))

    def advance(self, flow: Flow, t: float, y: Array) -> tuple[float, int] | None:
        """Follow the gaps to time t [s] and state y; time and number of the first pair that touches, or None.

        Args:
            flow: coordinates and their rates over time in this step, as a `Watch` takes them.
            t: end of the step [s].
            y: state there.
        """
        if not self.watches:
            return None
        rates, before = self._bounds(y), self._t
        self._least = self._least - MARGIN * (t - before) * np.maximum(rates, self._rates)
        self._rates, self._t = rates, t
        due = self._least <= max(self.closest[0], 0.0)
        found, end = [], flow(t)
        for k in np.flatnonzero(due).tolist():
            watch = self.watches[k]
            if not self._fresh[k]:
                watch.restart(before, flow(before))
            if (touch := watch.advance(flow, t, end)) is not None:
                found.append((touch, k))
            self._least[k] = watch.latest
        self._fresh = due
        return min(found, default=None)

    def _bounds(self, y: Array) -> Array:
        """Greatest rate of each gap at state y [m/s], shape (pair_count,), float64."""
        if not self.watches:
            return np.zeros(0)
        origin, velocity, spin = self._motions(y)
        one, other = self._links.T
        across = np.cross(spin[other], origin[one] - origin[other])
        moved = np.linalg.norm(velocity[one] - velocity[other] - across, axis=1)
        return moved + np.linalg.norm(spin[one] - spin[other], axis=1) * self._radius + self._beside

    def _motions(self, y: Array) -> tuple[Array, Array, Array]:
        """Origins [m], their velocities [m/s] and spins [rad/s] of all links at y, each shape (nbody, 3), float64."""
        mj, model, data = self._machine.mj, self._machine.model, self._data
        self._machine.set(data, y)
        for step in (mj.mj_kinematics, mj.mj_comPos, mj.mj_comVel):
            step(model, data)
        origin, spin = np.array(data.xpos), np.array(data.cvel[:, :3])
        arm = origin - data.subtree_com[model.body_rootid]
        return origin, data.cvel[:, 3:] + np.cross(spin, arm), spin


def radius_of(machine: Machine, side: Side) -> float:
    """Of a ball around the origin of its link that a surface lies in [m]."""
    centre, model = 0.0, machine.model
    if side.geom is not None:
        centre = float(np.linalg.norm(model.geom_pos[side.geom]))
        if side.skin is None:
            return centre + float(model.geom_rbound[side.geom])
    assert side.skin is not None
    return centre + float(np.linalg.norm(side.skin.points, axis=1).max())


def _speed(side: Side) -> float:
    """Greatest speed of a surface beside the machine [m/s]; 0 of the machine's own."""
    if side.plane is not None:
        return float(np.linalg.norm(side.plane.velocity))
    if side.body is None or side.skin is None:
        return 0.0
    reach = float(np.linalg.norm(side.skin.points, axis=1).max())
    return float(np.linalg.norm(side.body.velocity)) + float(np.linalg.norm(side.body.angular_velocity)) * reach
