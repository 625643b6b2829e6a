"""Owns a recorder of the user's own: a table of the greatest von Mises stress of each frame."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from warp_mca.recorders.recorder import SURFACE, Cadence, Frame, RunInfo, check_file


class PeakStress:
    """Writes time [s] and greatest stress on the skins [Pa], one line for each frame."""

    def __init__(self, file: str | Path, *, cadence: Cadence) -> None:
        self.path = check_file("peak", file, ".csv")
        self.name, self.files = str(self.path), (self.path,)
        self.needs, self.cadence = frozenset((SURFACE,)), cadence

    def start(self, info: RunInfo) -> None:
        """Open the file."""
        self.file = self.path.open("w", encoding="utf-8")

    def frame(self, frame: Frame) -> None:
        """Write one line."""
        peak = max(float(value.max()) for value in frame.von_mises.values())
        print(repr(frame.time), repr(peak), sep=",", file=self.file)

    def history(self, rows: Mapping[str, np.ndarray]) -> None:
        """Is not written to this file."""

    def finish(self, ok: bool) -> None:
        """Close the file."""
        self.file.close()
