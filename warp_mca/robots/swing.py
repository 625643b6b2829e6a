"""Owns the swing of a machine: its integration under error control, to the first touch or a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from warp_mca.base import validate
from warp_mca.base.arrays import Array
from warp_mca.base.errors import bad_value
from warp_mca.rigid.touch import Watch
from warp_mca.robots.machine import Machine
from warp_mca.robots.nearby import Nearby
from warp_mca.robots.stepping import Stepper
from warp_mca.robots.touching import Pair

if TYPE_CHECKING:
    from warp_mca.robots.robot import Robot

SAMPLE_COUNT = 257  # of the trajectory that is kept
BEFORE = 1e-7  # gap at which the normal of a touch is taken [m]
PARTING = 1e-3  # and after an impact [m]: faces of round geoms lie that deep in them, at a radius of 60 mm
MOST_STEPS = 10_000_000  # of a swing: they take hours
LOOK = 1000  # steps from one forecast of their number to the next
ROUND_OFF = 1e-12  # gaps up to this at the start are closed [m]


@dataclass(frozen=True, kw_only=True)
class Touch:
    """The first touch of two surfaces.

    Attributes:
        first, second: names of the surfaces: a geom, a flexible link, or what stands beside the machine.
        point: of the touch [m], shape (3,), float64.
        normal: from the second to the first [-], shape (3,), float64.
        velocity: of the first surface there, relative to the second [m/s], shape (3,), float64.
        effective_mass: 1 / (n . J M^-1 J^T n) of the machine along the normal there [kg]; infinite masses beside it.
    """

    first: str
    second: str
    point: Array
    normal: Array
    velocity: Array
    effective_mass: float


@dataclass(frozen=True, kw_only=True)
class RobotSwing:
    """How a machine moved, until it touched something or the time was up.

    Coordinates and rates are those of MuJoCo: `qpos`, with a quaternion for a ball or free joint, and `qvel`.

    Attributes:
        ended_by: "touch" or "t_end".
        t_end: time of the end, from the start [s].
        touch: the first touch, or None.
        qpos: coordinates at the end [m, rad], shape (nq,), float64.
        qvel: their rates then [m/s, rad/s], shape (nv,), float64.
        ctrl: controls that are held then, shape (nu,), float64.
        momentum: generalised momenta M qvel then [kg m/s, kg m^2/s], shape (nv,), float64.
        kinetic_energy: then [J].
        drives: force of each actuator on its joint or tendon then [N m, N], shape (nu,), float64.
        energy_drift: largest error of the energy balance over the largest kinetic energy [-].
        closest: the smallest gap on the way [m], its time [s]; (inf, t_end) if none was watched.
        t: times of the sampled trajectory [s], shape (sample_count,), float64.
        qpos_t: coordinates then, shape (sample_count, nq), float64.
        qvel_t: rates then, shape (sample_count, nv), float64.
    """

    ended_by: Literal["touch", "t_end"]
    t_end: float
    touch: Touch | None
    qpos: Array
    qvel: Array
    ctrl: Array
    momentum: Array
    kinetic_energy: float
    drives: Array
    energy_drift: float
    closest: tuple[float, float]
    t: Array
    qpos_t: Array
    qvel_t: Array


def swing(robot: Robot, machine: Machine, pairs: Sequence[Pair], t_end: float, *, stops: bool = True) -> RobotSwing:
    """Integrate a machine from its start until two surfaces touch, or to t_end.

    DOP853, as for the planar chain, or an implicit scheme where drives are stiff, see `stepping`, from sample to sample
    of the controller. Kinks of the forces, where limits or clamps of drives set in, are met by error control.

    Args:
        robot: as it was asked for.
        machine: of it, at its start.
        pairs: of surfaces that are watched.
        t_end: [s].
        stops: whether a touch ends it.

    Raises:
        RequestError: surfaces overlap at the start, or the integration breaks off or would not end.
    """
    y = np.concatenate([machine.start, np.zeros(2)])
    path = _Path(machine, t_end)
    watches = _watches(machine, pairs, y, robot.clock > 0.0) if stops else []
    nearby = Nearby(machine, pairs, watches, y)
    touch = next(((0.0, k) for k, watch in enumerate(watches) if watch.touching), None)
    if touch and watches[touch[1]].start < -ROUND_OFF:
        remedy = "they still close at the end of the impact; give it a duration at whose end they part"
        raise bad_value(f"gap of {pairs[touch[1]].name} [m]", watches[touch[1]].start, remedy)
    while touch is None and path.times[-1] < t_end:
        until = _sample(robot, machine, path.times[-1], y, t_end)
        y, touch = path.advance(y, until, nearby)
    end = path.times[-1]
    found = _touch(machine, pairs[touch[1]], end, y) if touch else None
    return _record(machine, path, y, found, nearby.closest if watches else (math.inf, end))


def _sample(robot: Robot, machine: Machine, t: float, y: Array, t_end: float) -> float:
    """Set the controls at time t [s]; returns until when they are held.

    Raises:
        RequestError: the controller fails, or does not give a control for each actuator.
    """
    if robot.controller is None:
        return t_end
    assert robot.period is not None
    q, v = y[: machine.nq].copy(), y[machine.nq : machine.nq + machine.nv].copy()
    found = validate.call("Robot.controller", "given", "it", robot.controller, robot.clock + t, q, v)
    if not validate.is_list(found) or len(found) != len(machine.ctrl):
        remedy = f"return a list or array of {len(machine.ctrl)} finite numbers, one for each actuator"
        raise bad_value(f"Robot.controller at t = {t:g} s", validate.brief(found), remedy)
    machine.ctrl = np.array(found, dtype=np.float64)
    return min(t_end, (round(t / robot.period) + 1) * robot.period)


def _watches(machine: Machine, pairs: Sequence[Pair], y: Array, after: bool) -> list[Watch]:
    """Of all pairs. After an impact, round surfaces that had faces may overlap a little as they part.

    Raises:
        RequestError: surfaces overlap.
    """
    q = y[: machine.nq]
    for pair in pairs:
        if (gap := pair.gap(0.0, q)) < (-PARTING if after else -ROUND_OFF):
            remedy = "move them apart, exclude them from contact in the file, or name in Robot.touch what may touch"
            raise bad_value(f"gap of {pair.name} at the start [m]", gap, f"they overlap; {remedy}")
    return [Watch(pair.gap, machine.nq, 0.0, _flow(machine, y), ROUND_OFF) for pair in pairs]


def _flow(machine: Machine, y: Array) -> Array:
    """Coordinates and their time derivatives, as a `Watch` takes them, shape (2 nq,), float64."""
    q, v = y[: machine.nq], y[machine.nq : machine.nq + machine.nv]
    return np.concatenate([q, machine.coordinate_rates(q, v)])


class _Path:
    """The trajectory so far: ends of its steps [s], and their dense output."""

    def __init__(self, machine: Machine, t_end: float) -> None:
        self._machine, self._t_end, self.times, self.pieces = machine, t_end, [0.0], []
        self._stepper = Stepper(machine)

    def advance(self, y: Array, until: float, nearby: Nearby) -> tuple[Array, tuple[float, int] | None]:
        """Go on to a time [s] or the first touch; returns the state, and time and number of the pair that touches.

        Raises:
            RequestError: the integration breaks off or would not end.
        """
        machine, count, stepper = self._machine, self._machine.nq + self._machine.nv, self._stepper
        stepper.begin(self.times[-1], y, until)
        while stepper.running:
            if (message := stepper.step()) is not None:
                rates = tuple(float(v) for v in y[machine.nq : count])
                raise bad_value("Robot.qvel", rates, f"the swing broke off at t = {stepper.t:g} s: {message}")
            piece = stepper.piece()
            flow = lambda s, piece=piece: _flow(machine, piece(s))  # noqa: E731
            touch = nearby.advance(flow, stepper.t, stepper.y)
            if touch is None or touch[0] > self.times[-1]:
                self.pieces.append(piece)
                self.times.append(stepper.t if touch is None else touch[0])
            if touch is not None:
                return stepper.state(touch[0]), touch
            if len(self.times) % LOOK == 0:
                self._forecast(stepper.y)
        return stepper.y, None

    def _forecast(self, y: Array) -> None:
        """Refuse a swing that would not end, as of a machine that spins too fast, or whose loops lock.

        Raises:
            RequestError: steps as short as the latest ones would be too many.
        """
        machine, t = self._machine, self.times[-1]
        step = (t - self.times[-LOOK]) / (LOOK - 1)
        if len(self.times) + (self._t_end - t) / max(step, 1e-300) <= MOST_STEPS:
            return
        rate = float(np.abs(y[machine.nq : machine.nq + machine.nv]).max())
        remedy = f"steps of {step:.2g} s are too short to swing to t = {self._t_end:g} s; start slower or elsewhere"
        raise bad_value(f"greatest rate of the machine at t = {t:.3g} s [rad/s, m/s]", rate, f"{remedy}, or end sooner")


def _touch(machine: Machine, pair: Pair, t: float, y: Array) -> Touch:
    """What there is to say of the touch of a pair at time t [s] and state y."""
    q, v = y[: machine.nq], y[machine.nq : machine.nq + machine.nv]
    machine.advance(y)
    nearest = pair.nearest(t, q)
    point = 0.5 * (nearest.first + nearest.second)
    inverse = machine.mobility()
    J = machine.point_jacobian(pair.first.link, point) - machine.point_jacobian(pair.second.link, point)
    velocity = J @ v + pair.first.velocity(point, t) - pair.second.velocity(point, t)
    span = BEFORE / max(float(np.linalg.norm(velocity)), BEFORE)
    apart = pair.nearest(t - span, q - span * machine.coordinate_rates(q, v))
    away = np.copysign(1.0, apart.distance) * (apart.first - apart.second)
    length = float(np.linalg.norm(away))
    normal = away / length if length > 0.0 else -velocity / np.linalg.norm(velocity)
    mobility = float(normal @ J @ inverse @ J.T @ normal)
    return Touch(
        first=pair.first.name,
        second=pair.second.name,
        point=point,
        normal=normal,
        velocity=velocity,
        effective_mass=1.0 / mobility if mobility > 0.0 else math.inf,
    )


def _record(machine: Machine, path: _Path, y: Array, touch: Touch | None, closest: tuple[float, float]) -> RobotSwing:
    """The swing, with its energy checked at the integrator's own steps."""
    from scipy.integrate import OdeSolution

    nq, nv = machine.nq, machine.nv
    last = path.times[-1]
    along: Callable[[Array], Array] = (
        OdeSolution(path.times, path.pieces) if path.pieces else lambda t: np.outer(y, np.ones(len(t)))
    )
    t = np.linspace(0.0, last, SAMPLE_COUNT if path.pieces else 1)
    samples = np.asarray(along(t)).T
    kinetic, total = np.array([machine.energies(state) for state in np.asarray(along(np.array(path.times))).T]).T
    data: Any = machine.advance(y)
    q, v = np.array(data.qpos), np.array(data.qvel)
    scale = float(kinetic.max())
    return RobotSwing(
        ended_by="t_end" if touch is None else "touch",
        t_end=last,
        touch=touch,
        qpos=q,
        qvel=v,
        ctrl=machine.ctrl.copy(),
        momentum=machine.mass_matrix() @ v,
        kinetic_energy=float(kinetic[-1]),
        drives=np.array(data.actuator_force) * machine.model.actuator_gear[:, 0],
        energy_drift=float(np.abs(total - total[0]).max() / scale) if scale > 0.0 else 0.0,
        closest=closest,
        t=t,
        qpos_t=samples[:, :nq],
        qvel_t=samples[:, nq : nq + nv],
    )
