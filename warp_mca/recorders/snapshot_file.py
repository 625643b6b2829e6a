"""Owns the snapshot recorder: a picture of the deformed bodies at one time, drawn without a display."""

from __future__ import annotations

import os

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import brief, is_number
from warp_mca.pictures.setting import VIEW, View
from warp_mca.recorders.pictures import Subject
from warp_mca.recorders.recorder import Cadence, Frame, FramesOnly, RunInfo, check_file, make_way


class SnapshotFile(FramesOnly):
    """Draws the skins, coloured by a field, at the output interval's end nearest to a time."""

    def __init__(
        self,
        file: str | os.PathLike[str],
        *,
        time: float,
        field: str = "von_mises",
        magnify: float = 1.0,
        limit: float | None = None,
        view: View = VIEW,
    ) -> None:
        """Draw to `file` (.png) the state at `time` [s] after first contact; `field` and the others as in `Subject`.

        Raises:
            RequestError: the file cannot be written, or a value is not one.
        """
        if not (is_number(time) and time >= 0.0):
            raise bad_value("snapshot", brief(time), "give a finite time from 0 s on")
        self.path = check_file("snapshot", file, ".png")
        self.name, self.files = str(self.path), (self.path,)
        self.subject = Subject(field, magnify, limit, view)
        self.needs = self.subject.needs
        self.cadence = Cadence(times=(time,))

    def check(self, info: RunInfo) -> None:
        """Refuse a view that does not suit the bodies."""
        self.subject.check(info)

    def start(self, info: RunInfo) -> None:
        """Keep the faces."""
        self.info = info

    def frame(self, frame: Frame) -> None:
        """Draw the picture."""
        from warp_mca.pictures.snapshot import save_snapshot

        skins = self.subject.skins(self.info, frame)
        make_way(self.path)
        save_snapshot(self.path, skins, frame.time, self.subject.look(self.info, skins))
