"""Owns the steps of a swing: an explicit scheme, or an implicit one where stiff drives hold the explicit one up."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array

if TYPE_CHECKING:
    from warp_mca.robots.machine import Machine

TOLERANCE = 1e-10  # relative error of a step: momenta of a free chain drift by 1e-12 in a swing, at half again the cost
IMPLICIT_TOLERANCE = 1e-9  # likewise of the implicit scheme: rates of arms with stiff servos are right to 1e-9
SMALLEST = 1e-3  # of the tolerance, the absolute error of a coordinate; the implicit scheme takes all, for rounding
MAX_TURN_PER_STEP = 0.05  # as of the planar chain: a gap has at most one minimum in a step
SHORT = 1e-3  # mean step below which it is asked what makes it so short [s]
LOOK = 20  # steps from one such question to the next
DECAY = 4.0  # in a step, of the fastest motion, beyond which stability and not accuracy limits the explicit scheme
NUDGE = 1e-7  # of coordinates and rates of 1, for differences of y'
LEAST_NUDGED = 0.1  # of smaller ones as of this


class Stepper:
    """Steps of one swing: DOP853, or Radau IIA of order 5 once the machine has proved to be stiff.

    A servo with a large kv on a light link makes a motion decay in microseconds; steps of an explicit scheme last as
    long, even when that motion is over. Radau damps it, and its steps are those of the motion that is left.
    See Hairer and Wanner, Solving Ordinary Differential Equations II, chapters IV.2 and IV.8.

    Attributes:
        stiff: whether the machine has proved to be so.
    """

    def __init__(self, machine: Machine) -> None:
        """Begin with the explicit scheme."""
        self.stiff = False
        self._machine, self._count = machine, machine.nq + machine.nv
        self._solver: Any = None
        self._span, self._steps = 0.0, 0

    def begin(self, t: float, y: Array, until: float) -> None:
        """Go on from time t [s] and state y, at most to a time [s]."""
        self._solver, self._until = self._made(t, y, until), until

    def _made(self, t: float, y: Array, until: float) -> Any:
        from scipy.integrate import DOP853, Radau  # whose import takes a tenth of a second

        accuracy = IMPLICIT_TOLERANCE if self.stiff else TOLERANCE
        tolerance = np.full(self._count + 2, accuracy if self.stiff else SMALLEST * accuracy)
        tolerance[self._count :] = np.inf  # works are watched by the balance, not by the step
        more: dict[str, Any] = {"rtol": accuracy, "atol": tolerance}
        if self.stiff:
            return Radau(self._machine.rates, t, y, until, jac=self._slope, **more)
        return DOP853(self._machine.rates, t, y, until, **more)

    def step(self) -> str | None:
        """Take a step; a message where it fails."""
        machine, solver = self._machine, self._solver
        if not self.stiff and self._steps >= LOOK and self._is_stiff():
            self.stiff = True
            self.begin(solver.t, solver.y, self._until)
            solver = self._solver
        pace = _pace(machine, solver.y[machine.nq : self._count])
        solver.max_step = MAX_TURN_PER_STEP / pace if pace > 0.0 else math.inf
        before = solver.t
        message = solver.step()
        self._span, self._steps = self._span + solver.t - before, self._steps + 1
        if solver.status == "failed" or not np.isfinite(solver.y).all():
            return message or "its rates are not finite"
        return None

    @property
    def t(self) -> float:
        """Time at the end of the latest step [s]."""
        return self._solver.t

    @property
    def y(self) -> Array:
        """State there."""
        return self._solver.y

    @property
    def running(self) -> bool:
        """Whether there are steps to take."""
        return self._solver.status == "running"

    def piece(self) -> Callable[[Any], Array]:
        """The state over time within the latest step."""
        return self._solver.dense_output()

    def state(self, t: float) -> Array:
        """The state at a time within the latest step [s]: as right as at its end, which Radau's interpolant is not."""
        from scipy.integrate import Radau

        solver: Any = self._solver
        if not isinstance(solver, Radau) or t <= solver.t_old:
            return self.piece()(t)
        again = self._made(solver.t_old, solver.y_old, t)  # pyright: ignore[reportArgumentType]
        while again.status == "running":
            again.step()
        return again.y if again.status == "finished" else self.piece()(t)

    def _is_stiff(self) -> bool:
        """Whether a motion that decays within a step holds the steps up; asked of short steps alone."""
        solver = self._solver
        mean = self._span / self._steps
        self._span, self._steps = 0.0, 0
        if mean > SHORT:
            return False
        slopes = self._slope(solver.t, solver.y)[: self._count, : self._count]
        return bool(np.isfinite(slopes).all() and -np.linalg.eigvals(slopes).real.min() * mean > DECAY)

    def _slope(self, t: float, y: Array) -> Array:
        """d(y') / d(y), shape (nq + nv + 2, nq + nv + 2), float64; works change nothing."""
        found, at = np.zeros((len(y), len(y))), self._machine.rates(t, y)
        for k in range(self._count):
            beside, way = y.copy(), NUDGE * max(abs(y[k]), LEAST_NUDGED)
            beside[k] += way
            found[:, k] = (self._machine.rates(t, beside) - at) / way
        return found


def _pace(machine: Machine, v: Array) -> float:
    """Rate at which frames turn or cross the machine [rad/s], for the longest step."""
    model, slide = machine.model, int(machine.mj.mjtJoint.mjJNT_SLIDE)
    extent = max(float(model.stat.extent), 1e-9)
    rates = np.abs(np.where(model.jnt_type[model.dof_jntid] == slide, v / extent, v))
    return float(max(rates.max(initial=0.0), np.sqrt(np.linalg.norm(model.opt.gravity) / extent)))
