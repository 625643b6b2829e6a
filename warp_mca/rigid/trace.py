"""Owns the way of a swing: what of its steps is kept, and states at the times where they meet and between them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from warp_mca.rigid.dop853 import Dop853, Piece, states

Array = NDArray[np.float64]


class Trace:
    """All steps of a swing.

    Attributes:
        t: end of the last step [s].
    """

    def __init__(self, t: float, y: Array) -> None:
        """Begin at time t [s] and state y, shape (n,), float64."""
        self.t, self._times, self._pieces = t, [t], list[Piece]()

    def path_of(self, steps: Dop853) -> Callable[[float], Array]:
        """States during the step that was just taken, until the next one."""
        self._pieces.append(steps.path())
        return self._pieces[-1]

    def end_at(self, t: float) -> None:
        """That step ends at t [s]; it is left out if that is where it began."""
        if t > self.t:
            self._times.append(t)
            self.t = t
        else:
            self._pieces.pop()

    def met(self, end: Array) -> tuple[Array, Array]:
        """Times at which steps meet [s] and states then; the state `end` of a swing that has none."""
        times = np.array(self._times)
        return times, states(times, self._pieces, times) if self._pieces else end[None]

    def sampled(self, end: Array, count: int) -> tuple[Array, Array]:
        """So many times at equal distances [s] and states then; one and `end` of a swing without steps."""
        times = np.array(self._times)
        if not self._pieces:
            return times, end[None]
        t = np.linspace(times[0], times[-1], count)
        return t, states(times, self._pieces, t)


class Ends(Trace):
    """The start and the end of a swing; a path is found where somebody asks for it."""

    def __init__(self, t: float, y: Array) -> None:
        """Begin as a `Trace`."""
        super().__init__(t, y)
        self._times, self._start = [t, t], y
        self._piece: Piece | None = None

    def path_of(self, steps: Dop853) -> Callable[[float], Array]:
        """States during the step that was just taken, until the next one."""
        self._piece = None

        def path(t: float) -> Array:
            self._piece = self._piece or steps.path()
            return self._piece(t)

        return path

    def end_at(self, t: float) -> None:
        """That step ends at t [s]."""
        self.t = self._times[1] = t

    def met(self, end: Array) -> tuple[Array, Array]:
        """Start and end [s], and states then."""
        return np.array(self._times), np.array([self._start, end])

    def sampled(self, end: Array, count: int) -> tuple[Array, Array]:
        """The same."""
        return self.met(end)
