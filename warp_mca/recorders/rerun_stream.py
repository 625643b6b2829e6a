"""Owns the rerun recorder: live into a viewer, into an .rrd file, or both.

Each destination has a stream of its own, so that one that fails takes nothing from the other: a frame of 20,000
vertices takes 3 ms of the run's thread for one of them, rerun's own threads do the rest.
"""

from __future__ import annotations

import os
import time
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING
from uuid import uuid4

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.validate import kinds, members
from warp_mca.pictures.setting import up_of
from warp_mca.recorders.colours import ColourScale, check_limit
from warp_mca.recorders.recorder import (
    CONTACT,
    PATHS,
    SURFACE,
    Cadence,
    apart,
    check_disk,
    check_file,
)
from warp_mca.recorders.rerun_file import RerunFile
from warp_mca.recorders.rerun_frames import FrameQueue
from warp_mca.recorders.rerun_setting import PLANES, PathBars, Planes, sights, topology

if TYPE_CHECKING:
    import rerun as rr

    from warp_mca.recorders.recorder import Frame, RunInfo
    from warp_mca.recorders.rerun_viewer import Viewer

FLUSH_EVERY = 4  # frames between flushes: as many may be lost when a run is killed
HOLD = 0.2  # a frame that comes later after the last ones were sent is sent at once, so that a viewer shows it [s]
FRAMES = Cadence(frames=100)


class RerunStream:
    """Streams surfaces coloured by von Mises stress, contact points, histories and stress along paths.

    Topology and normals are logged once; then come positions and colours. Both timelines carry every frame:
    `sim_time`, which rerun rounds to nanoseconds, and `step`.
    """

    def __init__(
        self,
        file: str | os.PathLike[str] | None = None,
        *,
        viewer: bool = False,
        cadence: Cadence = FRAMES,
        limit: float | None = None,
        viewer_options: Sequence[str] = (),
    ) -> None:
        """Record to `file` (.rrd), stream to a viewer that is opened, or both.

        Args:
            file: is made, or replaced.
            viewer: open rerun's viewer and stream to it.
            cadence: when frames are taken.
            limit: stress at the upper end of the colours [Pa], see `ColourScale`.
            viewer_options: of rerun's own program, such as --headless.

        Raises:
            RequestError: `file` cannot be written, neither file nor viewer is given, or a value has the wrong type.
        """
        kinds("RerunStream", bool, "give True or False", viewer=viewer)
        members("RerunStream", str, viewer_options=viewer_options)
        check_limit(limit)
        if file is None and not viewer:
            raise bad_value("RerunStream.file", file, "name a file, or set viewer=True")
        self.path = None if file is None else check_file("rrd", file, ".rrd")
        self.name = str(self.path or "rerun viewer")
        self.files = () if self.path is None else (self.path,)
        self.needs = frozenset((SURFACE, CONTACT, PATHS))
        self.cadence = cadence
        self.with_viewer, self.viewer_options, self.limit = viewer, tuple(viewer_options), limit
        self._reset()

    def _reset(self) -> None:
        self.streams: list[rr.RecordingStream] = []
        self.viewer: Viewer | None = None
        self.frame_count = 0
        self._seen: dict[str, NDArray[np.bool_]] = {}  # faces of bodies whose elements may fail
        self.failed = False
        self._file: RerunFile | None = None
        self._viewer_stream: rr.RecordingStream | None = None
        self._sent = 0.0  # time when frames were sent last [s]

    def check(self, info: RunInfo) -> None:
        """Check the disk: rerun, which cannot write there, may never come back.

        Raises:
            RequestError: it is full.
        """
        if self.path is not None:
            check_disk("rrd", self.path)

    def start(self, info: RunInfo) -> None:
        """Open the streams and log what never changes.

        Raises:
            RequestError: the file cannot be made.
        """
        from warp_mca.recorders.rerun_viewer import Viewer, load_rerun

        rr = load_rerun()
        from warp_mca.recorders.rerun_blueprint import blueprint, log_legend, log_styles, log_up

        self._reset()
        self.info = info
        self.scale = ColourScale(info.scene, self.limit)
        names = apart(["contact_points", "planes", *map(_plain, info.surfaces)])[2:]
        self.bodies = {body: entity("world", name) for body, name in zip(info.surfaces, names, strict=True)}
        names = apart(map(_plain, info.paths))
        self.paths = {path: entity("paths", name) for path, name in zip(info.paths, names, strict=True)}
        struck = [self.bodies[body] for body in info.surfaces if body not in info.striking]
        headings = {path.name: path.heading for path in info.scene.stress_paths}
        paths = [(at, headings.get(path, path)) for path, at in self.paths.items()]
        layout = blueprint(self.scale, sights(info), [*struck, PLANES], paths)
        # The viewer keeps a layout for each application: scenes must not share one.
        application, recording = f"warp_mca {info.scene.name}", uuid4()
        if self.path is not None:
            self._file = RerunFile(self.path, application, recording, layout)
        if self.with_viewer:
            stream = self._viewer_stream = rr.RecordingStream(application, recording_id=recording)
            self.viewer = Viewer(stream, layout, self.viewer_options)
        self.streams = [stream for stream in (self._file and self._file.stream, self._viewer_stream) if stream]
        self.planes = Planes(info)
        bars = {path: PathBars(position, k) for k, (path, position) in enumerate(info.paths.items())}
        self.queue = FrameQueue(self.bodies, self.paths, bars)
        for stream in self.streams:
            log_up(stream, up_of(info.scene))
            log_legend(stream)
            log_styles(stream)
            self.planes.log(stream)
            for body, surface in info.surfaces.items():
                if surface.between is not None:  # with the frames
                    continue
                stream.log(self.bodies[body], topology(info, surface.nodes, surface.triangles), static=True)
            for path, item in bars.items():
                stream.log(self.paths[path], item.once, static=True)
        self._warm_up()

    def frame(self, frame: Frame) -> None:
        """Log one frame."""
        self._drop_failed()
        if not self.streams:
            return
        greatest = max((float(value.max(initial=0.0)) for value in frame.von_mises.values()), default=0.0)
        rescaled = self.scale.include(greatest) or self.frame_count == 0
        for stream in self.streams:
            self._log_beside(stream, frame, rescaled)
        self._seen = {body: seen.copy() for body, seen in frame.faces.items()}
        self.queue.add(frame, self.scale.limit)
        self.frame_count += 1
        if self.frame_count % FLUSH_EVERY == 0 or time.monotonic() > self._sent + HOLD:
            self._send()
        if self.viewer:
            self.viewer.sent(sum(points.nbytes for points in frame.points.values()) * 4 // 3)
        if self._file and self.frame_count % FLUSH_EVERY == 0 and not self._file.flush():
            self._close_file(self._file)

    def idle(self) -> None:
        """Send the frames that wait."""
        self._drop_failed()
        if self.streams:
            self._send()

    def history(self, rows: Mapping[str, NDArray[np.float64]]) -> None:
        """Log rows of the history as curves."""
        import rerun as rr

        from warp_mca.recorders.rerun_blueprint import PLOTS

        self._drop_failed()
        time = np.asarray(rows["time_s"], dtype=np.float64)
        step = np.round(time / self.info.dt).astype(np.int64)
        indexes = [rr.TimeColumn("sim_time", duration=time), rr.TimeColumn("step", sequence=step)]
        for stream in self.streams:
            for plot, _, curves in PLOTS:
                for column, _, _ in curves:
                    if column in rows and np.isfinite(rows[column]).any():
                        scalars = rr.Scalars.columns(scalars=rows[column])
                        stream.send_columns(f"plots/{plot}/{column}", indexes=indexes, columns=scalars)

    def before_finish(self) -> None:
        """Send what is left, and begin to close the file, which takes rerun some milliseconds."""
        self._drop_failed()
        if self.streams:
            self._send()
        if self._file:
            self._file.begin_to_close()

    def finish(self, ok: bool) -> None:
        """Write and send what is left; a recording that lacks something is a warning."""
        self.before_finish()
        if self._file:
            self._close_file(self._file)
            if not ok and not self.frame_count and self.path:
                self.path.unlink(missing_ok=True)
        if self.viewer:
            self.viewer.finish()
        self._drop_failed()
        self.streams = []

    def _send(self) -> None:
        """Send the frames that wait."""
        self.queue.send(self.streams)
        self._sent = time.monotonic()

    def _log_beside(self, stream: rr.RecordingStream, frame: Frame, rescaled: bool) -> None:
        """Log what few frames change: the legend, and planes that move."""
        from warp_mca.recorders.rerun_blueprint import log_ticks

        for body, seen in frame.faces.items():
            if not np.array_equal(self._seen.get(body, ()), seen):
                part = self.info.surfaces[body].part(seen)
                stream.set_time("sim_time", duration=float(frame.time))
                stream.set_time("step", sequence=int(frame.step))
                stream.log(self.bodies[body], topology(self.info, part.nodes, part.triangles))
        if rescaled or self.planes.move_at_all:
            stream.set_time("sim_time", duration=float(frame.time))
            stream.set_time("step", sequence=int(frame.step))
            self.planes.move(stream, float(frame.time))
            if rescaled:
                log_ticks(stream, self.scale)

    def _warm_up(self) -> None:
        """Encode one mesh before the clock runs: rerun's first one takes 0.6 s."""
        import rerun as rr

        idle = rr.RecordingStream("warp_mca_warm_up")
        sink = idle.memory_recording()
        mesh = rr.Mesh3D.columns(vertex_positions=np.zeros((3, 3), np.float32), vertex_colors=np.zeros(3, np.uint32))
        idle.send_columns("mesh", indexes=[rr.TimeColumn("step", sequence=[0])], columns=mesh.partition([3]))
        sink.drain_as_bytes()

    def _close_file(self, file: RerunFile) -> None:
        file.close()
        self.streams = [stream for stream in self.streams if stream is not file.stream]
        self._file = None
        if file.reason:
            self.failed = True
            self.info.warn(f"{self.path}: recording stopped after {self.frame_count} frames: {file.reason}")

    def _drop_failed(self) -> None:
        """Stop sending to a viewer that was given up, and say so once."""
        if self.viewer and not self.viewer.open:
            self.info.warn(str(self.viewer.problem))
            self.streams = [stream for stream in self.streams if stream is not self._viewer_stream]
            self.viewer = self._viewer_stream = None


def _plain(name: str) -> str:
    return name.replace(" ", "_")


def entity(*parts: str) -> str:
    """Path of an entity; parts may hold any characters."""
    import rerun as rr

    return rr.new_entity_path(list(parts))
