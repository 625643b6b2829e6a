"""Owns the snapshot recorder: a picture of the deformed bodies at one time, drawn without a display."""

from __future__ import annotations

import os
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief, is_number
from warp_mca.recorders.recorder import SURFACE, Cadence, Frame, RunInfo, check_file


class SnapshotFile:
    """Draws the skins, coloured by von Mises stress, at the output interval's end nearest to a time."""

    def __init__(self, file: str | os.PathLike[str], *, time: float) -> None:
        """Draw to `file` (.png) the state at `time` [s] after first contact.

        Raises:
            RequestError: the file cannot be written, or the time is not one.
        """
        if not (is_number(time) and time >= 0.0):
            raise bad_value("snapshot", brief(time), "give a finite time from 0 s on")
        self.path = check_file("snapshot", file, ".png")
        self.name, self.files = str(self.path), (self.path,)
        self.needs = frozenset((SURFACE,))
        self.cadence = Cadence(times=(time,))

    def start(self, info: RunInfo) -> None:
        """Keep the faces."""
        self.info = info

    def frame(self, frame: Frame) -> None:
        """Draw the picture."""
        from warp_mca.report.snapshot import Skin, save_snapshot

        skins = {
            body: Skin(frame.points[body], surface.quads, frame.von_mises[body])
            for body, surface in self.info.surfaces.items()
        }
        self.path.parent.mkdir(parents=True, exist_ok=True)
        save_snapshot(self.path, skins, frame.time, bounds=self._bounds(frame))

    def _bounds(self, frame: Frame) -> NDArray[np.floating]:
        """What is shown: bodies that strike, and as much of those that are struck [m], shape (2, 3)."""
        bodies = self.info.striking
        points = np.concatenate([frame.points[body] for body in bodies])
        margin = 0.05 * np.ptp(points, axis=0).max()
        return np.array([points.min(axis=0) - margin, points.max(axis=0) + margin])

    def history(self, rows: Mapping[str, NDArray[np.float64]]) -> None:
        """Nothing is drawn of it."""

    def finish(self, ok: bool) -> None:
        """The picture is written already."""
