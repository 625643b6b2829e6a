"""Owns `Amplitude`: a factor over time, by a table, that loads and thermal strains are multiplied by."""

from __future__ import annotations

import math
from dataclasses import dataclass

from warp_mca.base import validate
from warp_mca.base.errors import bad_value

MOST = 1e9  # that a factor may be [-]
PIECES = 100  # straight ones of a curve: the integral of a half sine is 8e-5 less than that of the curve


@dataclass(frozen=True, kw_only=True)
class Amplitude:
    """Factor over time: linear between the times of a table, constant beyond its ends.

    Attributes:
        times: [s], increasing, counted from the start of the impact phase.
        values: factor at each of them [-].
    """

    times: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        validate.plain(self)
        validate.table("Amplitude", self.times, values=self.values)
        for value in self.values:
            validate.within("Amplitude", -MOST, MOST, values=value)

    @classmethod
    def half_sine(cls, duration: float, start: float = 0.0) -> Amplitude:
        """A pulse sin(pi (t - start) / duration) that lasts `duration` [s].

        Raises:
            RequestError: the duration is no time above 0.
        """
        return cls._curve("half_sine", start, duration, lambda s: math.sin(math.pi * s) if s < 1.0 else 0.0)

    @classmethod
    def smooth_step(cls, duration: float, start: float = 0.0) -> Amplitude:
        """From 0 to 1 within `duration` [s], with no slope or curvature at the ends: s^3 (10 - 15 s + 6 s^2).

        Raises:
            RequestError: the duration is no time above 0.
        """
        return cls._curve("smooth_step", start, duration, lambda s: s**3 * (10.0 - 15.0 * s + 6.0 * s * s))

    @classmethod
    def _curve(cls, name: str, start: float, duration: float, value) -> Amplitude:
        validate.finite(f"Amplitude.{name}", start=start)
        validate.times(f"Amplitude.{name}", duration=duration)
        shares = [k / PIECES for k in range(PIECES + 1)]
        times = tuple(start + duration * share for share in shares)
        if times[1] <= times[0]:
            raise bad_value(f"Amplitude.{name}.duration", duration, f"it is lost in rounding after {start:g} s")
        return cls(times=times, values=tuple(map(value, shares)))


CONSTANT = Amplitude(times=(0.0,), values=(1.0,))
