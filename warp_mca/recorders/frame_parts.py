"""Owns what frames hold of the arrays that were sent, and at which rows of a phase recorders want one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.kernels.records.output import OPEN, STICK
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME, Cadence, Recorder, RunInfo, Volume

NOTHING: dict[str, Any] = {  # what a frame holds that needs nothing
    "points": {},
    "von_mises": {},
    "plastic_strain": {},
    "faces": {},
    "contact_points": np.zeros((0, 3), np.float32),
    "contact_stick": np.zeros(0, bool),
    "path_stress": {},
}


@dataclass(frozen=True)
class Times:
    """When the rows of a phase are.

    Attributes:
        begin: time of the first one [s].
        interval: between two [s].
        steps: of the run between two [-].
    """

    begin: float
    interval: float
    steps: int

    def of(self, row: int) -> float:
        """Time of a row [s]."""
        return self.begin + row * self.interval

    def step(self, row: int, dt: float) -> int:
        """Steps of `dt` [s] until then [-]."""
        return row * self.steps + round(self.begin / dt)


class FrameParts:
    """Cuts arrays of all bodies or paths into those of each.

    Attributes:
        shift: displacement of the nodes [m] where those of the solver are zero, shape (node_count, 3), float32, or
            None.
    """

    def __init__(self, info: RunInfo) -> None:
        self.shift: NDArray[np.float32] | None = None
        self._element_of, self._skins = info.model.element_of, info.surfaces
        self._cuts = {
            SURFACE: _cuts({body: len(skin.nodes) for body, skin in info.surfaces.items()}),
            PATHS: _cuts({path: len(position) for path, position in info.paths.items()}),
        }

    def of(self, sent: Mapping[tuple[str, str], NDArray]) -> dict[str, dict[str, Any]]:
        """What frames hold of the arrays that were sent, by need and the name in `Frame`."""
        parts: dict[str, dict[str, Any]] = {}
        for (need, name), array in sent.items():
            if name == "failed":
                continue
            cut = self._cuts.get(need)
            parts.setdefault(need, {})[name] = array if cut is None else {key: array[at] for key, at in cut.items()}
        if CONTACT in parts:
            points, state = (parts[CONTACT][name] for name in ("points", "state"))
            closed = state != OPEN
            parts[CONTACT] = {"contact_points": points[closed], "contact_stick": state[closed] == STICK}
        if (SURFACE, "failed") in sent:
            failed = self._failed(sent[SURFACE, "failed"])
            parts[SURFACE]["faces"] = {
                body: skin.seen(failed) for body, skin in self._skins.items() if skin.between is not None
            }
        if PATHS in parts:
            parts[PATHS] = {"path_stress": parts[PATHS]["von_mises"]}
        if VOLUME in parts:
            if self.shift is not None:
                parts[VOLUME]["displacement"] = parts[VOLUME]["displacement"] + self.shift
            failed = self._failed(sent[VOLUME, "failed"]) if (VOLUME, "failed") in sent else None
            parts[VOLUME] = {"volume": Volume(**parts[VOLUME], failed=failed)}
        return parts

    def _failed(self, sent: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Whether each element of the concatenated meshes has failed, of flags in the model's order."""
        found = np.zeros(len(self._element_of), dtype=bool)
        found[self._element_of[: len(sent)]] = sent != 0
        return found


def frame_values(parts: Mapping[str, Mapping[str, Any]], needs: frozenset[str]) -> dict[str, Any]:
    """What a frame of these needs holds."""
    found = dict(NOTHING)
    for need in needs:
        found |= parts.get(need, {})
    return found


def wanted_rows(recorder: Recorder, intervals: int, info: RunInfo) -> NDArray[np.bool_]:
    """The ends of output intervals at which a recorder wants a frame, see `Cadence.rows`.

    Raises:
        RequestError: the run does not reach one of its times.
    """
    for at in recorder.cadence.times or ():
        if at > info.duration + 0.5 * info.output_interval:
            remedy = f"the run ends at {info.duration:g} s; give times until then"
            raise bad_value(f"time of {recorder.name}", at, remedy)
    return recorder.cadence.rows(intervals, info.output_interval)


def rows_of_phase(cadence: Cadence, begin: float, interval: float, intervals: int, until: float) -> NDArray[np.bool_]:
    """The rows of one of several phases at which a recorder wants a frame; arguments as in `Recording.follow`.

    Of `Cadence.times` after `until` [s], when the phase before ended, each has the first row that is not earlier.
    """
    if cadence.times is None:
        return cadence.rows(intervals, interval)
    chosen = np.zeros(intervals + 1, dtype=bool)
    at = np.array([max(0, math.ceil((t - begin) / interval - 1e-6)) for t in cadence.times if t > until], dtype=int)
    chosen[at[at <= intervals]] = True
    return chosen


def _cuts(lengths: Mapping[str, int]) -> dict[str, slice]:
    """Where each of several arrays stands that follow each other."""
    ends = np.cumsum(list(lengths.values()), dtype=int).tolist()
    return {name: slice(end - length, end) for (name, length), end in zip(lengths.items(), ends, strict=True)}
