"""Owns the rigid phase: swings a chain until a gap closes or the time is up."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from warp_mca.base.errors import bad_value
from warp_mca.rigid.chain import Array, Chain
from warp_mca.rigid.dop853 import Dop853
from warp_mca.rigid.flow import flow, own_pace, round_off
from warp_mca.rigid.loads import Loads
from warp_mca.rigid.touch import Gap, Watch
from warp_mca.rigid.trace import Ends, Trace

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
    chain: Chain,
    theta0: ArrayLike,
    theta_dot0: ArrayLike,
    gap: Gap,
    t_max: float,
    *,
    t_end: float | None = None,
    kept: bool = True,
) -> Swing:
    """Swing the chain from its release at t = 0 until the gap to the target closes.

    Args:
        chain: the links.
        theta0: initial coordinates, as in `swing_until`.
        theta_dot0: their initial rates.
        gap: distance of the tip from the target [m], a function of time [s] and coordinates.
        t_max: give up then [s].
        t_end: end then in place of t_max, touch or not [s].
        kept: as in `swing_until`.

    Raises:
        RequestError: the tip overlaps the target at the start, or does not reach it by t_max.
    """
    y = _state(chain, theta0, theta_dot0)
    own_pace(chain, y, t_max if t_end is None else t_end, "RigidPhase.t_max" if t_end is None else "t_end")
    start = gap(0.0, y[: chain.coordinate_count])
    if start < -round_off(chain):
        remedy = f"the tip overlaps the target at the start by {-start:.6g} m; move the target away or change"
        raise bad_value("gap to RigidPhase.target at t = 0 [m]", float(start), f"{remedy} RigidPhase.theta, in radians")
    run = swing_until(chain, theta0, theta_dot0, (gap,), t_end=t_max if t_end is None else t_end, kept=kept)
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
    kept: bool = True,
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
        kept: whether the trajectory is wanted; else its samples are its start and its end, which takes half the time.

    Raises:
        RequestError: the state does not fit the chain or is not finite, the time is too long for the chain's pace, or
            the integration breaks off.
    """
    y = _state(chain, theta, theta_dot)
    pace = own_pace(chain, y, t_end - t_start, "time of a swing [s]")
    watches = [Watch(gap, chain.coordinate_count, t_start, y, round_off(chain)) for gap in gaps]
    if chain.loads is not None:
        y = np.concatenate([y, np.zeros(3)])
    trace = Trace(t_start, y) if kept else Ends(t_start, y)
    touch = next(((t_start, k) for k, watch in enumerate(watches) if watch.touching), None)
    for until in _stops(chain.loads, t_start, t_end) if touch is None else []:
        y, touch = _advance(chain, watches, trace, y, until, pace)
        if touch is not None:
            break
    closest = min((watch.closest for watch in watches), default=(math.inf, trace.t))
    return _record(chain, trace, y, touch, closest)


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
    chain: Chain, watches: list[Watch], trace: Trace, y: Array, until: float, pace: float
) -> tuple[Array, tuple[float, int] | None]:
    """Integrate to the time `until` [s] or the first touch; `trace` gets each step.

    Returns:
        The state at the end, and time [s] and index of the gap that closed, or None.

    Raises:
        RequestError: the integration breaks off.
    """
    start = trace.t
    longest = min(until - start, MAX_TURN_PER_STEP / pace) if pace > 0.0 else until - start
    slopes = flow(chain, 0.5 * (start + until))
    steps = Dop853(slopes, start, y, until, longest=longest, rtol=1e-12, atol=1e-14)
    while not steps.done:
        if message := steps.step():
            rates = tuple(float(v) for v in y[chain.coordinate_count : 2 * chain.coordinate_count])
            raise bad_value("RigidPhase.theta_dot", rates, f"the swing broke off: {message}")
        path = trace.path_of(steps)
        found = [(watch.advance(path, steps.t, steps.y), k) for k, watch in enumerate(watches)]
        touch = min(((t, k) for t, k in found if t is not None), default=None)
        if touch is None:
            trace.end_at(steps.t)
            continue
        trace.end_at(touch[0])
        return path(touch[0]), touch
    return steps.y, None


def _record(
    chain: Chain, trace: Trace, end: Array, touch: tuple[float, int] | None, closest: tuple[float, float]
) -> Swing:
    """The swing, with its energy checked at the integrator's own steps."""
    count = chain.coordinate_count
    times, at_steps = trace.met(end)
    t, samples = trace.sampled(end, SAMPLE_COUNT)
    kinetic, total = _energies(chain, times, at_steps)
    scale = kinetic.max()
    return Swing(
        ended_by="t_end" if touch is None else "touch",
        touched=None if touch is None else touch[1],
        t_end=trace.t,
        theta=at_steps[-1, :count],
        theta_dot=at_steps[-1, count : 2 * count],
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
    q, v = states[:, :count], states[:, count : 2 * count]
    potential = chain.potential_energies(q)
    if chain.loads is None:
        kinetic = chain.kinetic_energies(q, v)
        return kinetic, kinetic + potential
    placed = [chain.moved_to(t) for t in times]
    kinetic = np.array([p.kinetic_energy(*state) for p, *state in zip(placed, q, v, strict=True)])
    shift = np.array([p.origin for p in placed]) - np.asarray(chain.origin)
    work = states[:, 2 * count :] @ [-1.0, 1.0, -1.0]
    return kinetic, kinetic + potential - chain.mass * shift @ np.asarray(chain.gravity) + work
