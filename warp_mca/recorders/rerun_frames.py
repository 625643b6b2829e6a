"""Owns frames on their way to rerun: several are sent by one call for each entity.

A call takes 0.1 ms whatever it sends, as long as all else that a frame of 2,000 vertices takes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.recorders.colours import SLIP, STICK, packed
from warp_mca.recorders.rerun_setting import PathBars

if TYPE_CHECKING:
    import rerun as rr

    from warp_mca.recorders.recorder import Frame

TO_MPA = 1e-6
RADIUS = -3.0  # of contact points, negative: in points of the screen


class FrameQueue:
    """Frames that were taken and not sent yet."""

    def __init__(self, bodies: Mapping[str, str], paths: Mapping[str, str], bars: Mapping[str, PathBars]) -> None:
        """Take the entities of bodies and paths by their names, and the bars of each path."""
        self.bodies, self.paths, self.bars = bodies, paths, bars
        self._times: list[float] = []
        self._steps: list[int] = []
        self._limits: list[float] = []
        self._parts: dict[str, list[NDArray]] = {}

    def add(self, frame: Frame, limit: float) -> None:
        """Copy what is shown of a frame; `limit` is the stress at the upper end of its colours [Pa]."""
        self._limits.append(limit)
        self._times.append(float(frame.time))
        self._steps.append(int(frame.step))
        for body, points in frame.points.items():
            self._keep(f"points {body}", points)
            self._keep(f"stress {body}", frame.von_mises[body])
        self._keep("contact points", frame.contact_points)
        self._keep("contact stick", frame.contact_stick)
        for path, stress in frame.path_stress.items():
            self._keep(f"path {path}", stress)

    def _keep(self, name: str, array: NDArray) -> None:
        self._parts.setdefault(name, []).append(array.copy())

    def send(self, streams: Sequence[rr.RecordingStream]) -> None:
        """Send all frames, and forget them."""
        import rerun as rr

        if not self._times:
            return
        nanoseconds = np.round(1e9 * np.array(self._times)).astype("timedelta64[ns]")  # rerun would truncate
        indexes = [
            rr.TimeColumn("sim_time", duration=nanoseconds),
            rr.TimeColumn("step", sequence=np.array(self._steps)),
        ]
        for entity, columns in self._columns():
            for stream in streams:
                stream.send_columns(entity, indexes=indexes, columns=columns)
        self._times, self._steps, self._limits, self._parts = [], [], [], {}

    def _columns(self) -> Iterator[tuple[str, list[Any]]]:
        """Each entity with its columns, a row for each frame."""
        import rerun as rr

        count = len(self._times)
        for body, entity in self.bodies.items():
            points, lengths = self._joined(f"points {body}")
            stress = zip(self._parts[f"stress {body}"], self._limits, strict=True)
            colours = np.concatenate([packed(value, limit) for value, limit in stress])
            yield entity, list(rr.Mesh3D.columns(vertex_positions=points, vertex_colors=colours).partition(lengths))
        points, lengths = self._joined("contact points")
        stick, _ = self._joined("contact stick")
        colours = np.where(stick, np.uint32(STICK), np.uint32(SLIP))
        dots = rr.Points3D.columns(positions=points, colors=colours).partition(lengths)
        yield "world/contact_points", [*dots, *rr.Points3D.columns(radii=np.full(count, RADIUS, dtype=np.float32))]
        for path, entity in self.paths.items():
            stress, _ = self._joined(f"path {path}")
            yield entity, [self.bars[path].column(TO_MPA * stress, count)]

    def _joined(self, name: str) -> tuple[NDArray, list[int]]:
        """An array of all frames, one after the other, and the length of each."""
        parts = self._parts[name]
        return np.concatenate(parts), [len(part) for part in parts]
