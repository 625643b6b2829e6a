"""Owns what is read off a force history: contact intervals, peaks and stick intervals.

A history has one row per output interval. `time[i]` is the end of interval i, which begins at `time[i - 1]`; the first
one begins one typical interval earlier, though not before 0. Forces are means over their interval.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[float, float]

CONTACT_THRESHOLD = 1e-3  # share of the greatest F_n above which the bodies count as touching
REVERSAL_THRESHOLD = 1e-2  # share of the greatest |F_t| that both signs must reach
MERGED_GAP = 5e-6  # separations shorter than this [s] are nodes changing over, not a second contact
STICK_THRESHOLD = 0.5  # share of the contact that must stick
SMOOTHING = 2e-6  # standard deviation of the Gaussian that takes the ringing out of forces and velocities [s]
PROMINENCE = 0.05  # share of the greatest F_n by which a peak must stand out of its valleys


def interval_edges(time: Array) -> Array:
    """Bounds of the output intervals [s], shape (row_count + 1,), float64."""
    if len(time) == 0:
        return np.zeros(1)
    typical = float(np.median(np.diff(time))) if len(time) > 1 else float(time[0])
    return np.concatenate([[max(0.0, float(time[0]) - typical)], time])


def intervals(time: Array, active: NDArray[np.bool_], merged_gap: float = MERGED_GAP) -> list[Interval]:
    """Start and end [s] of each run of active rows, after joining runs less than `merged_gap` [s] apart.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        active: which rows count, shape (row_count,).
        merged_gap: longest gap that is bridged [s].
    """
    edges = interval_edges(time)
    change = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(np.int8)))
    joined: list[Interval] = []
    for first, end in zip(change[::2], change[1::2], strict=True):
        start, stop = float(edges[first]), float(edges[end])
        if joined and start - joined[-1][1] < merged_gap:
            joined[-1] = (joined[-1][0], stop)
        else:
            joined.append((start, stop))
    return joined


def contact_intervals(time: Array, F_n: Array) -> list[Interval]:
    """Start and end of each contact [s]: F_n above 0.1 % of its greatest value, separations under 5 µs ignored.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,), positive in compression.
    """
    peak = float(np.max(F_n, initial=0.0))
    return intervals(time, F_n > CONTACT_THRESHOLD * peak) if peak > 0.0 else []


def stick_intervals(time: Array, F_n: Array, stick_fraction: Array) -> list[Interval]:
    """Start and end of each time of sticking [s]: in contact, with at least half of the contact not sliding.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,).
        stick_fraction: share of the contact that sticks [-], shape (row_count,).
    """
    touching = np.zeros(len(time), dtype=bool)
    for start, end in contact_intervals(time, F_n):
        touching |= (time > start) & (time <= end)
    return intervals(time, touching & (stick_fraction >= STICK_THRESHOLD))


def reverses(F_t: Array) -> bool:
    """Whether the tangential force changes sign: both signs reach 1 % of its greatest size.

    Less is what the springs of a few nodes give back in the last microseconds of a contact.

    Args:
        F_t: tangential force [N], shape (row_count,).
    """
    size = REVERSAL_THRESHOLD * float(np.max(np.abs(F_t), initial=0.0))
    return bool(size > 0.0 and F_t.max() > size and F_t.min() < -size)


def smoothed(time: Array, values: Array) -> Array:
    """The values through a Gaussian of SMOOTHING, which is no wider than all rows, shape (row_count,), float64."""
    from scipy.ndimage import gaussian_filter1d

    sigma = min(SMOOTHING / float(np.median(np.diff(interval_edges(time)))), float(len(time)))
    return gaussian_filter1d(values, sigma, mode="nearest")


def force_peaks(time: Array, F_n: Array) -> list[Interval]:
    """Time [s] and value [N] of each peak of F_n, in order: one for each turn from compression to restitution.

    Nodes that enter and leave the contact make the force jitter. So peaks are found on the history smoothed by a
    Gaussian of 2 µs, where they must stand out by 5 % of the greatest value; each value is then the greatest *raw* one
    between the valleys on either side. So the largest peak equals the largest force, as read off the plot, and
    smoothing lowers no value.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,).
    """
    from scipy.signal import find_peaks

    if np.max(F_n, initial=0.0) <= 0.0:
        return []
    smooth = smoothed(time, F_n)
    # A zero on either side lets a force that begins or ends high count as a peak.
    found, _ = find_peaks(np.pad(smooth, 1), prominence=PROMINENCE * float(smooth.max()))
    valleys = [a + int(np.argmin(smooth[a:b])) for a, b in zip(found[:-1] - 1, found[1:] - 1, strict=True)]
    bounds = [0, *valleys, len(F_n)]
    rows = [a + int(np.argmax(F_n[a:b])) for a, b in itertools.pairwise(bounds)]
    return [(float(time[row]), float(F_n[row])) for row in rows]
