"""Owns the rigid phase: swings a chain until a gap closes or the time is up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import ArrayLike

from warp_mca.base.errors import bad_value
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.flow import flow, own_pace, round_off
from warp_mca.rigid.loads import Loads
from warp_mca.rigid.touch import Gap, Watch

if TYPE_CHECKING:
    from scipy.integrate import OdeSolution

MAX_TURN_PER_STEP = 0.05  # of the chain's own time scale, so that the gap has at most one minimum in a step
SAMPLE_COUNT = 257  # of the trajectory kept for plotting


@dataclass(frozen=True, kw_only=True)
class Swing:
    """How the chain moved, until a gap closed or the time was up.

    Coordinates are the links' angles [rad], with the carriage's way [m] in front where the base slides.

    Attributes:
        ended_by: "touch" if a gap closed, "t_end" if the time was up.
        touched: index of the gap that closed, or None.
        t_end: time of the end, from the release [s].
        theta: coordinates then, shape (coordinate_count,), float64.
        theta_dot: their rates then [rad/s, m/s], shape (coordinate_count,), float64.
        energy_drift: largest error of the energy balance over the largest kinetic energy [-].
        t: times of the sampled trajectory, from the start to t_end [s], shape (sample_count,), float64.
        theta_t: coordinates at those times, shape (sample_count, coordinate_count), float64.
        theta_dot_t: their rates at those times, shape (sample_count, coordinate_count), float64.
        closest: the smallest gap on the way [m] and its time [s]; (inf, t_end) if no gap was watched.
        work_t: put in by the joints' prescribed torques, heat of the joints, and put in by the base's prescribed
            motion, at the sampled times [J], shape (sample_count, 3), float64.
    """

    ended_by: Literal["touch", "t_end"]
    touched: int | None
    t_end: float
    theta: Array
    theta_dot: Array
    energy_drift: float
    t: Array
    theta_t: Array
    theta_dot_t: Array
    closest: tuple[float, float]
    work_t: Array


def swing(
    chain: Chain, theta0: ArrayLike, theta_dot0: ArrayLike, gap: Gap, t_max: float, *, t_end: float | None = None
) -> Swing:
    """Swing the chain from its release at t = 0 until the gap to the target closes.

    Args:
        chain: the links.
        theta0: initial coordinates, as in `swing_until`.
        theta_dot0: their initial rates.
        gap: distance of the tip from the target [m], a function of time [s] and coordinates.
        t_max: give up then [s].
        t_end: end then in place of t_max, touch or not [s].

    Raises:
        RequestError: the tip overlaps the target at the start, or does not reach it by t_max.
    """
    y = _state(chain, theta0, theta_dot0)
    own_pace(chain, y, t_max if t_end is None else t_end, "RigidPhase.t_max" if t_end is None else "t_end")
    start = gap(0.0, y[: chain.coordinate_count])
    if start < -round_off(chain):
        remedy = f"the tip overlaps the target at the start by {-start:.6g} m; move the target away or change"
        raise bad_value("gap to RigidPhase.target at t = 0 [m]", float(start), f"{remedy} RigidPhase.theta, in radians")
    run = swing_until(chain, theta0, theta_dot0, (gap,), t_end=t_max if t_end is None else t_end)
    if run.ended_by == "touch" or t_end is not None:
        return run
    value, t = run.closest
    later = "; it was still closing, so a later RigidPhase.t_max may do" if t == run.t_end else ""
    raise bad_value(
        "closest gap to RigidPhase.target [m]",
        float(value),
        f"the tip never reaches the target by t_max = {t_max:g} s and was closest at t = {t:.6g} s; bring target and "
        f"ground hinge nearer by more than that (lower H), or start higher or faster{later}",
    )


def swing_until(
    chain: Chain,
    theta: ArrayLike,
    theta_dot: ArrayLike,
    gaps: Sequence[Gap],
    *,
    t_start: float = 0.0,
    t_end: float,
) -> Swing:
    """Integrate the chain from any state until one of the gaps closes, or to t_end.

    DOP853 (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations I, II.5) at relative tolerance 1e-12, from
    corner to corner of the loads' tables; closing gaps are found on its dense output. Minima of the gaps between steps
    are looked at too, so a touch that begins and ends within one step is found. A gap that is closed at the start ends
    the swing at once if it shrinks; if it opens, it is watched from then on (`Watch`).

    Args:
        chain: the links, with origin and loads as at the release.
        theta: coordinates at t_start: angles [rad], with the carriage's way [m] in front where the base slides, shape
            (coordinate_count,).
        theta_dot: their rates then, shape (coordinate_count,).
        gaps: distances to what may be touched [m], functions of time from release [s] and coordinates.
        t_start: time from release at which to begin [s].
        t_end: time from release at which to end at the latest [s].

    Raises:
        RequestError: the state does not fit the chain or is not finite, the time is too long for the chain's pace, or
            the integration breaks off.
    """
    y = _state(chain, theta, theta_dot)
    pace = own_pace(chain, y, t_end - t_start, "time of a swing [s]")
    watches = [Watch(gap, chain.coordinate_count, t_start, y, round_off(chain)) for gap in gaps]
    if chain.loads is not None:
        y = np.concatenate([y, np.zeros(3)])
    times, pieces = [t_start], []
    touch = next(((t_start, k) for k, watch in enumerate(watches) if watch.touching), None)
    for until in _stops(chain.loads, t_start, t_end) if touch is None else []:
        y, touch = _advance(chain, watches, (times, pieces), y, until, pace)
        if touch is not None:
            break
    closest = min((watch.closest for watch in watches), default=(math.inf, times[-1]))
    return _record(chain, times, pieces, y, touch, closest)


def _state(chain: Chain, theta: ArrayLike, theta_dot: ArrayLike) -> Array:
    """Coordinates and rates in one, checked, shape (2 * coordinate_count,), float64."""
    y = np.concatenate([np.asarray(theta, dtype=np.float64), np.asarray(theta_dot, dtype=np.float64)])
    if y.shape != (2 * chain.coordinate_count,) or not np.isfinite(y).all():
        raise bad_value("RigidPhase.theta", theta, f"give a finite angle and rate for each of {len(chain.links)} links")
    return y


def _stops(loads: Loads | None, t_start: float, t_end: float) -> list[float]:
    """Where the integration halts: corners of the tables, and the end [s]."""
    corners = [] if loads is None else [float(t) for t in loads.corners if t_start < t < t_end]
    return [*corners, t_end] if t_end > t_start else []


def _advance(
    chain: Chain, watches: list[Watch], trace: tuple[list, list], y: Array, until: float, pace: float
) -> tuple[Array, tuple[float, int] | None]:
    """Integrate to the time `until` [s] or the first touch; `trace` gets the ends and the dense output of each step.

    Returns:
        The state at the end, and time [s] and index of the gap that closed, or None.

    Raises:
        RequestError: the integration breaks off.
    """
    from scipy.integrate import DOP853  # whose import takes a tenth of a second

    times, pieces = trace
    start = times[-1]
    longest = min(until - start, MAX_TURN_PER_STEP / pace) if pace > 0.0 else until - start
    solver = DOP853(flow(chain, 0.5 * (start + until)), start, y, until, max_step=longest, rtol=1e-12, atol=1e-14)
    while solver.status == "running":
        message = solver.step()
        if solver.status == "failed":
            rates = tuple(float(v) for v in y[chain.coordinate_count : 2 * chain.coordinate_count])
            raise bad_value("RigidPhase.theta_dot", rates, f"the swing broke off: {message}")
        path = solver.dense_output()
        pieces.append(path)
        found = [(watch.advance(path, solver.t, solver.y), k) for k, watch in enumerate(watches)]
        touch = min(((t, k) for t, k in found if t is not None), default=None)
        if touch is None:
            times.append(solver.t)
            continue
        if touch[0] > times[-1]:
            times.append(touch[0])
        else:  # it closes where the step begins
            pieces.pop()
        return path(touch[0]), touch
    return solver.y, None


def _record(
    chain: Chain,
    times: list[float],
    pieces: list,
    end: Array,
    touch: tuple[float, int] | None,
    closest: tuple[float, float],
) -> Swing:
    """The swing, with its energy checked at the integrator's own steps."""
    from scipy.integrate import OdeSolution

    count, t_end = chain.coordinate_count, times[-1]
    path: OdeSolution | None = OdeSolution(times, pieces) if pieces else None
    steps = np.array(times) if path is not None else np.array([t_end])
    t = np.linspace(times[0], t_end, SAMPLE_COUNT if path is not None else 1)
    states = end[None] if path is None else path(steps).T
    samples = end[None] if path is None else path(t).T
    kinetic, total = _energies(chain, steps, states)
    scale = kinetic.max()
    return Swing(
        ended_by="t_end" if touch is None else "touch",
        touched=None if touch is None else touch[1],
        t_end=t_end,
        theta=states[-1, :count],
        theta_dot=states[-1, count : 2 * count],
        energy_drift=float(np.abs(total - total[0]).max() / scale) if scale > 0.0 else 0.0,
        t=t,
        theta_t=samples[:, :count],
        theta_dot_t=samples[:, count : 2 * count],
        closest=closest,
        work_t=samples[:, 2 * count :] if chain.loads is not None else np.zeros((len(t), 3)),
    )


def _energies(chain: Chain, times: Array, states: Array) -> tuple[Array, Array]:
    """Kinetic energy, and energy with heat added and work put in taken off [J], each shape (count,), float64."""
    count = chain.coordinate_count
    placed = [chain.moved_to(t) for t in times]
    kinetic = np.array([p.kinetic_energy(y[:count], y[count : 2 * count]) for p, y in zip(placed, states, strict=True)])
    total = kinetic + np.array([chain.potential_energy(y[:count]) for y in states])
    if chain.loads is not None:
        shift = np.array([p.origin for p in placed]) - np.asarray(chain.origin)
        total = total - chain.mass * shift @ np.asarray(chain.gravity) + states[:, 2 * count :] @ [-1.0, 1.0, -1.0]
    return kinetic, total
