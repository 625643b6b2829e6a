"""Owns the search for a touch: when a gap, watched from step to step of a swing, closes."""

from __future__ import annotations

from collections.abc import Callable

from warp_mca.rigid.brent import brent_root
from warp_mca.rigid.chain import Array

Gap = Callable[[float, Array], float]

PROBE = 1e-6  # time by which the rate of a gap is estimated [s]
ROOT = 4.0 * 2.0**-52  # accuracy of times, absolute [s] and relative [-], as SciPy's solve_ivp has it


class Watch:
    """One gap along a swing, followed from step to step.

    If the gap starts closed and opening (a tip that has just left its target, with a shape that does not fit exactly),
    the next touch is when it closes after having opened, or when it starts to shrink without having opened.

    Attributes:
        start: gap at the start [m].
        latest: gap at the latest time [m].
        touching: whether the gap is closed at the start and shrinks.
        closest: smallest gap so far [m] and when it was [s], out of the ends of steps and the minima between them.
    """

    def __init__(self, gap: Gap, count: int, t: float, y: Array, round_off: float) -> None:
        """Begin at time t [s].

        Args:
            gap: to watch.
            count: of the chain's coordinates.
            t: time [s].
            y: state then: coordinates, their rates and maybe more, shape (2 * count + more,), float64.
            round_off: gaps up to this count as closed at the start [m].
        """
        self._gap, self._count = gap, count
        self._t, self._rate = t, self._approach(t, y)
        self.start = self.latest = self._distance(t, y)
        self.closest = (self.start, t)
        self._closed = self.start <= round_off
        ahead = gap(t + PROBE, y[:count] + PROBE * y[count : 2 * count])  # of kinks in the gap, the side to come
        self.touching = self._closed and ahead < self.start

    def restart(self, t: float, y: Array) -> None:
        """Go on from time t [s] and state y, after steps in which the gap stayed open and had no new minimum."""
        self._t, self._rate = t, self._approach(t, y)

    def advance(self, path: Callable[[float], Array], t: float, y: Array) -> float | None:
        """Follow the gap to time t [s] and state y along `path`; the time at which it closes on the way, or None."""
        before, rate_before = self._t, self._rate
        value, self._t, self._rate = self._distance(t, y), t, self._approach(t, y)
        self.latest = value
        self._note(value, t)
        if self._closed:
            return self._leave(path, before, rate_before, value)
        if value <= 0.0:
            return _root(lambda s: self._distance(s, path(s)), before, t)
        if rate_before <= 0.0 <= self._rate:
            lowest = _root(lambda s: self._approach(s, path(s)), before, t)
            self._note(self._distance(lowest, path(lowest)), lowest)
            if self._distance(lowest, path(lowest)) <= 0.0:
                return _root(lambda s: self._distance(s, path(s)), before, lowest)
        return None

    def _leave(self, path: Callable[[float], Array], before: float, rate_before: float, value: float) -> float | None:
        """The time at which a gap that has been closed since the start closes again in this step, or None."""
        if self._rate >= 0.0:
            self._closed = value <= 0.0
            return None
        turned = _root(lambda s: self._approach(s, path(s)), before, self._t) if rate_before > 0.0 else before
        self._closed = self._distance(turned, path(turned)) <= 0.0
        if self._closed:
            return turned
        return _root(lambda s: self._distance(s, path(s)), turned, self._t) if value <= 0.0 else None

    def _note(self, value: float, t: float) -> None:
        self.closest = min(self.closest, (value, t))

    def _distance(self, t: float, y: Array) -> float:
        return self._gap(t, y[: self._count])

    def _approach(self, t: float, y: Array) -> float:
        """2 PROBE times the rate of the gap along the flow [m]."""
        q, way = y[: self._count], PROBE * y[self._count : 2 * self._count]
        return self._gap(t + PROBE, q + way) - self._gap(t - PROBE, q - way)


def _root(value: Callable[[float], float], low: float, high: float) -> float:
    """Where a value changes its sign between two times [s]; the end nearer to 0 if round-off hides the change."""
    ends = value(low), value(high)
    if ends[0] * ends[1] > 0.0:
        return low if abs(ends[0]) < abs(ends[1]) else high
    return float(brent_root(value, low, high, ends, ROOT))
