"""Owns the steps of DOP853, and states between them (Hairer, Norsett, Wanner, Solving ODEs I, II.5 and II.6).

SciPy's class of this name does the same arithmetic in the same order, so its states have the same bits. For a chain of
two links it takes four times as long, and half a second to import.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warp_mca.rigid.dop853_table import BETWEEN, ERROR_3, ERROR_5, STAGES, TIMES

Array = NDArray[np.float64]
Slopes = Callable[[float, Array], Array | list[float]]

SAFETY, LEAST, GREATEST = 0.9, 0.2, 10.0  # factors of a step after the one before
EXPONENT = -1.0 / 8.0  # of the error
NEW = 12  # the stage at the new state
TOO_SMALL = "Required step size is less than spacing between numbers."


class Piece:
    """States during one step: its start, its end, and a polynomial of degree 7 in each coordinate."""

    def __init__(self, t: float, h: float, y: Array, powers: Array) -> None:
        """From time t [s] and state y, shape (n,), for h [s]; `powers` of shape (7, n)."""
        self.t, self.h, self.y, self.powers = t, h, y, powers

    def __call__(self, t: float) -> Array:
        """The state at time t [s], shape (n,)."""
        return _between((t - self.t) / self.h, self.y, self.powers[::-1])


def states(times: ArrayLike, pieces: Sequence[Piece], t: Array) -> Array:
    """States at times t [s] of a motion whose pieces meet at these times [s], shape (len(t), n)."""
    k = np.clip(np.searchsorted(times, t) - 1, 0, len(pieces) - 1)
    start, h = np.array([(piece.t, piece.h) for piece in pieces])[k].T
    powers = np.array([piece.powers for piece in pieces])[:, ::-1].swapaxes(0, 1)
    return _between(((t - start) / h)[:, None], np.array([piece.y for piece in pieces])[k], powers[:, k])


def _between(x: float | Array, y: Array, powers: Array) -> Array:
    """y + x (P_0 + (1 - x) (P_1 + x (P_2 + ...))), the highest power first."""
    value, rest = np.zeros_like(y), 1 - x
    for i, power in enumerate(powers):
        value += power
        value *= x if i % 2 == 0 else rest
    value += y
    return value


class Dop853:
    """Steps from a state to a time, each as long as its error allows.

    Attributes:
        t: time reached [s].
        y: state then, shape (n,), float64.
        done: whether t is the last time.
    """

    def __init__(
        self, slopes: Slopes, t: float, y: Array, until: float, *, longest: float, rtol: float, atol: float
    ) -> None:
        """Begin at time t [s] and state y.

        Args:
            slopes: y' as a function of t and y.
            t: time [s].
            y: state then, shape (n,).
            until: the last time, after t [s].
            longest: no step is longer than this [s].
            rtol, atol: errors that a step may have, relative and absolute.
        """
        self._slopes, self._until, self._longest, self._rtol, self._atol = slopes, until, longest, rtol, atol
        self.t, self.y, self.done = t, np.array(y, dtype=np.float64), t == until
        self._K = np.empty((len(TIMES), len(y)))
        self._before = [self._K[:k].T for k in range(len(TIMES) + 1)]
        self._before_step, self._h, self._next = (t, self.y), 0.0, 0.0
        if not self.done:
            self._K[NEW] = slopes(t, self.y)
            self._next = self._first_step()

    def _first_step(self) -> float:
        """Length of the first step to try [s]: II.4 of the book."""
        y, f, left = self.y, self._K[NEW], abs(self._until - self.t)
        scale, root = self._atol + np.abs(y) * self._rtol, y.size**0.5
        d0, d1 = _norm(y / scale) / root, _norm(f / scale) / root
        h0 = min(1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1, left)
        ahead = np.asarray(self._slopes(self.t + h0, y + h0 * f))
        d2 = _norm((ahead - f) / scale) / root / h0
        h1 = max(1e-6, h0 * 1e-3) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** (1 / 8)
        return min(100 * h0, h1, left, self._longest)

    def step(self) -> str | None:
        """Take one step; says why, if there is none."""
        t, y, K = self.t, self.y, self._K
        least = 10.0 * abs(math.nextafter(t, math.inf) - t)
        length, again = self._longest if self._next > self._longest else max(self._next, least), False
        K[0] = K[NEW]
        while True:
            if length < least:
                return TOO_SMALL
            t_new = min(t + length, self._until)
            h = length = t_new - t
            self._stages(range(1, NEW), t, y, h)
            new = y + h * np.dot(self._before[NEW], STAGES[NEW - 1])
            K[NEW] = self._slopes(t + h, new)
            error = self._error(h, self._atol + np.maximum(np.abs(y), np.abs(new)) * self._rtol)
            if error < 1.0:
                factor = GREATEST if error == 0.0 else min(GREATEST, SAFETY * error**EXPONENT)
                self._next = length * (min(1.0, factor) if again else factor)
                self._before_step, self._h, self.t, self.y = (t, y), h, t_new, new
                self.done = t_new >= self._until
                return None
            length *= max(LEAST, SAFETY * error**EXPONENT)
            again = True

    def _stages(self, which: range, t: float, y: Array, h: float) -> None:
        K, before, slopes = self._K, self._before, self._slopes
        for k in which:
            K[k] = slopes(t + TIMES[k] * h, y + np.dot(before[k], STAGES[k - 1]) * h)

    def _error(self, h: float, scale: Array) -> float:
        """Error of a step over the allowed one: II.10 of the book."""
        K = self._before[NEW + 1]
        fifth, third = _norm(np.dot(K, ERROR_5) / scale) ** 2, _norm(np.dot(K, ERROR_3) / scale) ** 2
        if fifth == 0.0 and third == 0.0:
            return 0.0
        return h * fifth / np.sqrt((fifth + 0.01 * third) * len(scale))

    def path(self) -> Piece:
        """States during the last step."""
        K, h, (t, y) = self._K, self._h, self._before_step
        self._stages(range(NEW + 1, len(TIMES)), t, y, h)
        powers, way = np.empty((7, len(y))), self.y - y
        powers[0] = way
        powers[1] = h * K[0] - way
        powers[2] = 2 * way - h * (K[NEW] + K[0])
        powers[3:] = h * np.dot(BETWEEN, K)
        return Piece(t, self.t - t, y, powers)


def _norm(x: Array) -> np.float64:
    return np.sqrt(x.dot(x))
