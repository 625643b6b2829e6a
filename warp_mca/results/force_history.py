"""Owns the evaluation of force histories: contact intervals, peaks and stick intervals.

A history has one row per output interval, all of one length. `time[i]` is the end of interval i, which begins at
`time[i - 1]`; the first one begins one interval earlier, though not before 0. Forces are means over their interval.

Lengths are counted in rows and compared with the length of the contact, never with seconds: what is found does not
depend on the unit of time.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Interval = tuple[float, float]
Rows = tuple[int, int]  # the first row and the one after the last

CONTACT_THRESHOLD = 1e-3  # share of the greatest F_n above which the bodies count as touching
ROUNDING = 1e-6  # of the normal force, below which there is no tangential one
REVERSAL_THRESHOLD = 1e-2  # share of the greatest |F_t| that both signs must reach
MERGED_GAP = 0.02  # share of a contact below which a separation is a change of nodes and does not end the contact
GRAZING = 0.05  # share of the greatest F_n that a contact stays below in which the bodies only graze each other
GRAZING_TIME = 0.01  # share of the time in contact from which on such contacts matter
FAINT, FIRM = 0.01, 0.1  # shares of the greatest F_n: below the first, between forces above the other, a mesh may part
STICK_THRESHOLD = 0.5  # share of the contact that must stick
SMOOTHING = 0.02  # share of a contact: standard deviation of the Gaussian that takes the jitter out of its force
PROMINENCE = 0.05  # share of the greatest F_n by which a peak must stand out of its valleys
TURN = 0.05  # share of the range of a contact's work by which it must rise or fall to count as a phase


def interval_edges(time: Array) -> Array:
    """Bounds of the output intervals [s], shape (row_count + 1,), float64."""
    if len(time) == 0:
        return np.zeros(1)
    typical = float(np.median(np.diff(time))) if len(time) > 1 else float(time[0])
    return np.concatenate([[max(0.0, float(time[0]) - typical)], time])


def active_rows(active: NDArray[np.bool_]) -> NDArray[np.intp]:
    """First row of each run of active rows and the row after its last, shape (run_count, 2)."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], active, [False]]).astype(np.int8)))
    return change.reshape(-1, 2)


def joined(runs: NDArray[np.intp], length: int = 0) -> list[Rows]:
    """Join runs of rows that belong together.

    If the widest gap between runs is below MERGED_GAP of the whole, from the first run to the last, all of them are one
    contact. Otherwise they are split at this gap, and both sides are treated likewise. So a force that jitters on and
    off is one contact, however short its runs are, and contacts of very different durations are each judged by their
    own length.

    Args:
        runs: as from `active_rows`.
        length: least number of rows with which gaps are compared, if the whole is shorter.
    """
    found: list[Rows] = []
    left = [runs] if len(runs) else []
    while left:
        part = left.pop()
        whole = int(part[-1, 1] - part[0, 0])
        gaps = part[1:, 0] - part[:-1, 1]
        if gaps.max(initial=0) < MERGED_GAP * max(whole, length):
            found.append((int(part[0, 0]), int(part[-1, 1])))
        else:
            cut = int(gaps.argmax()) + 1
            left += [part[cut:], part[:cut]]  # the earlier one is taken next
    return found


def contact_rows(F_n: Array) -> list[Rows]:
    """Rows of each contact: F_n above 0.1 % of its greatest value, short separations included, see `joined`.

    Args:
        F_n: normal force [N], shape (row_count,), positive in compression.
    """
    peak = float(np.max(F_n, initial=0.0))
    return joined(active_rows(F_n > CONTACT_THRESHOLD * peak)) if peak > 0.0 else []


def unfinished(F_n: Array) -> bool:
    """Whether a contact is still in progress in the last row; F_n as in `contact_rows`."""
    rows = contact_rows(F_n)
    return bool(rows) and rows[-1][1] == len(F_n)


def grazing_share(F_n: Array) -> float:
    """Share of the time in contact that belongs to finished contacts in which the bodies only graze each other [-].

    Whether they touch there, and how long, depends on the mesh. Shares too small to matter are returned as 0.

    Args:
        F_n: as in `contact_rows`.
    """
    rows = contact_rows(F_n)
    peak = max((float(F_n[first:end].max()) for first, end in rows), default=0.0)
    light = [end - first for first, end in rows if end < len(F_n) and F_n[first:end].max() < GRAZING * peak]
    return _mattering(sum(light), rows)


def faint_share(F_n: Array) -> float:
    """Share of the time in contact in which the bodies hardly touch between two compressions [-].

    With another mesh they may part there, which shortens the contact. Shares too small to matter are returned as 0.

    Args:
        F_n: as in `contact_rows`.
    """
    rows = contact_rows(F_n)
    peak = float(np.max(F_n, initial=0.0))
    count = 0
    for first, end in rows:
        firm = np.flatnonzero(F_n[first:end] > FIRM * peak)
        if len(firm):
            count += int(np.count_nonzero(F_n[first + firm[0] : first + firm[-1]] <= FAINT * peak))
    return _mattering(count, rows)


def _mattering(count: int, rows: list[Rows]) -> float:
    """Number of some rows over that of rows in contact [-]; 0 if it is too small to matter."""
    share = count / max(1, sum(end - first for first, end in rows))
    return share if share > GRAZING_TIME else 0.0


def intervals(time: Array, rows: list[Rows]) -> list[Interval]:
    """Start and end of runs of rows [s]. A run in the first row alone, at t = 0, has no length and is left out.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        rows: as from `joined`.
    """
    edges = interval_edges(time)
    return [(float(edges[first]), float(edges[end])) for first, end in rows if edges[end] > edges[first]]


def contact_intervals(time: Array, F_n: Array) -> list[Interval]:
    """Start and end of each contact [s], see `contact_rows`.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,), positive in compression.
    """
    return intervals(time, contact_rows(F_n))


def stick_intervals(time: Array, F_n: Array, stick_fraction: Array) -> list[Interval]:
    """Start and end of each time of sticking [s]: in contact, with at least half of the contact not sliding.

    Slips shorter than 2 % of the contact are left out.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,).
        stick_fraction: share of the contact that sticks [-], shape (row_count,).
    """
    found: list[Rows] = []
    for first, end in contact_rows(F_n):
        sticks = active_rows(stick_fraction[first:end] >= STICK_THRESHOLD)
        found += joined(sticks + first, end - first)
    return intervals(time, found)


def reverses(F_t: Array, F_n: Array) -> bool:
    """Whether the tangential force changes sign: both signs reach 1 % of its greatest size.

    Smaller values come from springs of a few nodes in the last microseconds of a contact. A tangential force below a
    millionth of the normal force is rounding.

    Args:
        F_t: tangential force [N], shape (row_count,).
        F_n: normal force [N], shape (row_count,).
    """
    greatest, normal = (float(np.max(np.abs(force), initial=0.0)) for force in (F_t, F_n))
    if greatest <= ROUNDING * normal:
        return False
    size = REVERSAL_THRESHOLD * greatest
    return bool(size > 0.0 and F_t.max() > size and F_t.min() < -size)


def smoothed(values: Array, rows: Rows) -> Array:
    """Values of a contact through a Gaussian of 2 % of its length, shape (rows of the contact,), float64.

    Values beyond the contact count as 0, values beyond the history as in its first and last row.
    """
    from scipy.ndimage import gaussian_filter1d

    first, end = rows
    apart = int(first > 0), int(end < len(values))
    smooth = gaussian_filter1d(np.pad(values[first:end], apart), SMOOTHING * (end - first), mode="nearest")
    return smooth[apart[0] : len(smooth) - apart[1]]


def force_peaks(time: Array, F_n: Array) -> list[Interval]:
    """Time [s] and value [N] of each peak of F_n, in order: one for each turn from compression to restitution.

    Nodes that enter and leave the contact make the force jitter. So peaks are found on the force of each contact
    smoothed by a Gaussian of 2 % of its length, where they must stand out by 5 % of the greatest value; each value is
    then the greatest *raw* one between the valleys on either side. So the largest peak of a finished contact equals its
    largest force, as read off the plot, and smoothing lowers no value. A force that still rises when the history ends
    is no peak.

    Args:
        time: ends of the output intervals [s], shape (row_count,).
        F_n: normal force [N], shape (row_count,).
    """
    contacts = contact_rows(F_n)
    smooth = [smoothed(F_n, rows) for rows in contacts]
    prominence = PROMINENCE * max((float(force.max()) for force in smooth), default=0.0)
    return [
        (float(time[row]), float(F_n[row]))
        for rows, force in zip(contacts, smooth, strict=True)
        for row in _peak_rows(F_n, rows, force, prominence)
    ]


def _peak_rows(F_n: Array, rows: Rows, smooth: Array, prominence: float) -> list[int]:
    """Rows of the peaks of one contact that stand out of its `smooth` force by `prominence` [N]."""
    ended = rows[1] < len(F_n)
    # A zero before it lets a force that begins high count as a peak, and one after it a force that ends at once.
    # Turns begin with this zero as a valley; the last one may be no turn but the end of the history.
    found = [row - 1 for row in _turns(np.pad(smooth, (1, int(ended))), prominence)[1:-1:2]]
    if not found:
        return []
    valleys = [a + int(np.argmin(smooth[a:b])) for a, b in itertools.pairwise(found)]
    last = len(smooth) if ended else int(found[-1] + np.argmin(smooth[found[-1] :]))
    bounds = [0, *valleys, last]
    return [rows[0] + a + int(np.argmax(F_n[rows[0] + a : rows[0] + b])) for a, b in itertools.pairwise(bounds)]


def phases(F_n: Array, closing_speed: Array, least: float) -> tuple[list[Rows], list[Rows]]:
    """Rows of compression and of restitution.

    The surfaces press on each other with the power F_n v, where v is the speed at which they close. A contact is
    compressed while the work of this power since its beginning rises, and restitutes while it falls. The power is
    smoothed as in `force_peaks`, and turns of less than 5 % of the range of the work belong to the phase around them.

    Args:
        F_n: normal force [N], shape (row_count,).
        closing_speed: as in `ContactHistory` [m/s], shape (row_count,).
        least: work over the interval between rows [W]; a contact that does no more is at rest and has no phases.
    """
    found: tuple[list[Rows], list[Rows]] = [], []
    power = F_n * np.nan_to_num(closing_speed)
    for first, end in contact_rows(F_n):
        work = np.concatenate([[0.0], np.cumsum(smoothed(power, (first, end)))])
        size = float(np.ptp(work))
        if size > least:
            turns = _turns(work, TURN * size)
            bounds = [first, *(first + turn for turn in turns[1:-1]), end]
            for k, (start, stop) in enumerate(itertools.pairwise(bounds)):
                found[int(work[turns[k + 1]] < work[turns[k]])].append((start, stop))
    return found


def _turns(values: Array, height: float) -> list[int]:
    """Rows where values turn, at the ends of each rise and fall by at least `height`; empty without any."""
    found: list[int] = []
    low = high = direction = 0
    for i, value in enumerate(values.tolist()):
        if value > values[high]:
            high = i
        if value < values[low]:
            low = i
        if direction >= 0 and values[high] - value >= height:
            found.append(high)
            direction, low = -1, i
        elif direction <= 0 and value - values[low] >= height:
            found.append(low)
            direction, high = 1, i
    return [*found, high if direction > 0 else low] if found else []
