"""Owns how figures of claims are read off the results of runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warp_mca.paper.evidence import MissingRunError
from warp_mca.results.force_figure import compression_phases
from warp_mca.results.force_history import Interval
from warp_mca.results.paths import PathHistory
from warp_mca.results.result import Result

FRONT = 5e-3  # share of the greatest stress on the axis at which a wave has arrived; that of spinning rods is 3e-3
EVENT = 1.57e-3  # the paper's longest impact [s]: contacts that begin later count as another one
EARLY = 100e-6  # time in which the paper describes waves [s]


def first_peak(result: Result) -> float:
    """Of F_n [kN].

    Raises:
        MissingRunError: F_n has no peak.
    """
    peak = result.summary["F_n_first_peak"]
    if peak is None:
        raise MissingRunError("F_n has no peak")
    return 1e-3 * peak


def second_peak(result: Result) -> float:
    """Of F_n [kN].

    Raises:
        MissingRunError: there is none.
    """
    peaks = result.summary["F_n_peaks"]
    if len(peaks) < 2:
        raise MissingRunError("F_n has no second peak")
    return 1e-3 * peaks[1][1]


def impulse(result: Result) -> float:
    """Of F_n [N s]."""
    return float(np.sum(result.F_n[1:] * np.diff(result.time)))


def greatest_F_t(result: Result) -> float:
    """F_t where it opposes the tip's way along +x most [kN]."""
    return 1e-3 * result.summary["F_t_min"]


def duration(result: Result) -> float:
    """Sum of all contacts [ms].

    Raises:
        MissingRunError: the last one was not over when the run ended.
    """
    if result.summary["contact_open_at_end"]:
        raise MissingRunError("still in contact when the run ended")
    return 1e3 * result.summary["contact_duration"]


def event_duration(result: Result) -> float:
    """From the first touch to the last separation, succession collisions and the gaps between them included [ms].

    Raises:
        MissingRunError: nothing touched, or the last contact was not over when the run ended.
    """
    contacts = result.summary["contacts"]
    counted = [contact for contact in contacts if contact[0] < EVENT]
    if not counted:
        raise MissingRunError("no contact")
    if result.summary["contact_open_at_end"] and len(counted) == len(contacts):
        raise MissingRunError("still in contact when the run ended")
    return 1e3 * (counted[-1][1] - counted[0][0])


def stick_time(result: Result) -> float:
    """Sum of all times of sticking [ms]."""
    return 1e3 * sum(end - start for start, end in result.summary["sticks"])


def stick_start(result: Result) -> float:
    """When the contact sticks first [ms].

    Raises:
        MissingRunError: it never sticks.
    """
    sticks = result.summary["sticks"]
    if not sticks:
        raise MissingRunError("the contact never sticks")
    return 1e3 * sticks[0][0]


def compressions(result: Result) -> int:
    """How often the contact is compressed."""
    return len(compression_phases(result)[0])


def overlap(first: Sequence[Interval], second: Sequence[Interval]) -> float:
    """Time that is in both [s]."""
    return sum(max(0.0, min(b, d) - max(a, c)) for a, b in first for c, d in second)


def after_contact(result: Result, column: str) -> np.ndarray:
    """Values of a column after the first contact, shape (row_count,).

    Raises:
        MissingRunError: the run ends with it.
    """
    contacts = result.summary["contacts"]
    later = result[column][result.time > contacts[0][1]] if contacts else np.empty(0)
    if len(later) == 0:
        raise MissingRunError("the run ends in contact")
    return later


def path(result: Result, number: int) -> PathHistory:
    """Path 1, 2 or 3 of Fig. 10.

    Raises:
        MissingRunError: the run's folder has no paths.npz.
    """
    if not result.paths:
        raise MissingRunError("the run's paths.npz is missing")
    return result.paths[number - 1]


def row_at(result: Result, time: float) -> int:
    """Number of the row at a time [s]."""
    return int(np.argmin(np.abs(result.time - time)))


def front(result: Result, time: float) -> float:
    """How far the fastest wave has come along the axis at a time [m]: Path 2, from the tip's end."""
    axis, row = path(result, 2), row_at(result, time)
    stress = axis.von_mises
    arrived = axis.position[stress[row] > FRONT * float(stress[: row + 1].max())]
    return float(arrived.max()) if len(arrived) else 0.0


def stress_ratio(result: Result, first: int, second: int) -> float:
    """Mean stress on one path over that on another, on rod AB, until EARLY."""
    rows = slice(1, row_at(result, EARLY) + 1)
    on_AB = path(result, first).position < 0.2
    means = [float(path(result, k).von_mises[rows][:, on_AB].mean()) for k in (first, second)]
    return means[0] / means[1]


def end_ratio(result: Result) -> float:
    """Mean stress of Path 1 over that of Path 2 where they begin, at 0.0148 m, until EARLY."""
    rows = slice(1, row_at(result, EARLY) + 1)
    means = [float(path(result, k).von_mises[rows, 0].mean()) for k in (1, 2)]
    return means[0] / means[1]


def transmitted(result: Result) -> float:
    """When a wave has come through hinge A, on Path 2 [us]: stress on OA reaches FRONT of the greatest until EARLY.

    Raises:
        MissingRunError: none has.
    """
    axis = path(result, 2)
    stress, on_OA = axis.von_mises, axis.position > 0.22
    arrived = stress[:, on_OA].max(axis=1) > FRONT * float(stress[: row_at(result, EARLY) + 1].max())
    if not arrived.any():
        raise MissingRunError("no stress passes hinge A")
    return 1e6 * float(result.time[np.argmax(arrived)])
