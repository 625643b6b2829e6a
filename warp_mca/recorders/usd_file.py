"""Owns the USD recorder: deformed skins over time, with colours, stress and plastic strain."""
# pyright: reportAttributeAccessIssue=false
# (usd-core comes without types)

from __future__ import annotations

import os
import re
import shutil
import signal
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.pictures.setting import up_of
from warp_mca.recorders.colours import ColourScale, check_limit
from warp_mca.recorders.recorder import (
    CONTACT,
    DISK_RESERVE,
    FULL,
    SURFACE,
    Cadence,
    FramesOnly,
    apart,
    check_disk,
    check_file,
    make_way,
)
from warp_mca.recorders.usd_prims import BodyPrim, ContactPrim
from warp_mca.recorders.usd_setting import Setting, bind, make_material, set_up_axis

if TYPE_CHECKING:
    from warp_mca.recorders.recorder import Frame, RunInfo

FRAMES = Cadence(frames=100)
WRITE_EVERY = 5  # frames that are written together
# What a kill may cost: frames of as long, or of as much. The more a save has to write, the longer it takes.
SAVE_AFTER = 1.0  # time between saves [s]
SAVE_BYTES = 1 << 20  # or what waits for one
KEPT = ("points", "von_mises", "plastic_strain", "contact_points", "contact_stick")  # of a frame
PLAYBACK = 24.0  # frames shown in a second
POINT_SIZE = 0.004  # of contact points, as a share of the scene


class UsdFile(FramesOnly):
    """Writes /World/BODY meshes with one time code for each frame, so that microseconds do not collapse.

    Colours are indices into a static palette, in linear colour space as USD has it. `vonMises` [Pa] and
    `plasticStrain` [-] are rounded to 256 values of each frame, denser towards zero: off by at most 0.4 % of the
    frame's greatest. Physical times and the stress at the upper end of the colours are in the layer's customLayerData.
    """

    def __init__(self, file: str | os.PathLike[str], *, cadence: Cadence = FRAMES, limit: float | None = None) -> None:
        """Record to `file` (.usdc, .usd or .usda), which is made, or replaced.

        Args:
            file: the path.
            cadence: when frames are taken.
            limit: stress at the upper end of the colours [Pa], see `ColourScale`.

        Raises:
            RequestError: `file` cannot be written, or the limit is not a number above 0.
        """
        check_limit(limit)
        self.path = check_file("usd", file, ".usdc", ".usd", ".usda")
        self.name, self.files = str(self.path), (self.path,)
        if not _is_utf8(self.name):
            raise bad_value("usd", self.name, "USD takes names in UTF-8 only; name another file")
        self.needs = frozenset((SURFACE, CONTACT))
        self.cadence, self.limit = cadence, limit
        self._reset()

    def _reset(self) -> None:
        self.times: list[float] = []
        self.limits: list[float] = []
        self.bodies: dict[str, BodyPrim] = {}
        self.stage: Any = None
        self.setting: Any = None
        self.contact: Any = None
        self.held: list[Frame] = []  # copies of frames to write
        self.saved_count = self.tried_count = 0  # frames that the file holds, or should hold
        self._saved, self._waiting = 0.0, 0  # time of the last save [s], bytes of frames since

    def check(self, info: RunInfo) -> None:
        """Load USD, and check the disk.

        Raises:
            RequestError: the disk is full.
        """
        with _signals_held():
            from pxr import Sdf, Tf, Usd, UsdGeom, Vt  # noqa: F401
        check_disk("usd", self.path)

    def start(self, info: RunInfo) -> None:
        """Write what never changes.

        Raises:
            RequestError: the file cannot be made.
        """
        self._reset()
        from pxr import Tf, UsdGeom

        self.info = info
        self.scale = ColourScale(info.scene, self.limit)
        try:
            make_way(self.path)
            self.stage = _new_stage(str(self.path))
        except (Tf.ErrorException, OSError) as error:
            raise bad_value("usd", str(self.path), f"it cannot be written ({_reason(error)}); name another") from error
        UsdGeom.SetStageMetersPerUnit(self.stage, 1.0)
        self.stage.SetTimeCodesPerSecond(PLAYBACK)
        self.stage.SetFramesPerSecond(PLAYBACK)
        world = UsdGeom.Xform.Define(self.stage, "/World")
        self.stage.SetDefaultPrim(world.GetPrim())
        set_up_axis(self.stage, world, up_of(info.scene))
        contact, setting, *names = apart(["contact", "setting", *map(Tf.MakeValidIdentifier, info.surfaces)])
        UsdGeom.Scope.Define(self.stage, f"/World/{setting}")
        material = make_material(self.stage, f"/World/{setting}/colours")
        for name, (body, surface) in zip(names, info.surfaces.items(), strict=True):
            mesh = UsdGeom.Mesh.Define(self.stage, f"/World/{name}")
            self.bodies[body] = BodyPrim(mesh, body, surface, info.model.X[surface.nodes])
            bind(material, mesh)
        self.setting = Setting(self.stage, f"/World/{setting}", material, info)
        size = float(np.ptp(np.concatenate([info.model.X[s.nodes] for s in info.surfaces.values()]), axis=0).max())
        points = UsdGeom.Points.Define(self.stage, f"/World/{contact}")
        self.contact = ContactPrim(points, POINT_SIZE * size)
        bind(material, points)
        try:
            self._save()
        except OSError as error:
            self.finish(False)
            raise bad_value("usd", str(self.path), f"it cannot be written ({error}); name another file") from error

    def frame(self, frame: Frame) -> None:
        """Take one frame. Frames are written `WRITE_EVERY` at a time, which takes two thirds of the time of each alone.

        Raises:
            OSError: the disk is full or fails.
        """
        kept = {name: _copied(getattr(frame, name)) for name in KEPT}
        self.held.append(replace(frame, **kept))
        self._waiting += sum(map(_bytes, kept.values()))
        if len(self.held) == WRITE_EVERY:
            self._write()
            if self._waiting > SAVE_BYTES or time.monotonic() > self._saved + SAVE_AFTER:
                self._save()

    def idle(self) -> None:
        """Write and save what is held.

        Raises:
            OSError: the disk is full or fails.
        """
        if self.held:
            self._write()
        if self._waiting:
            self._save()

    def _write(self) -> None:
        """Write the frames that are held."""
        from pxr import Sdf, Usd

        with _signals_held():  # a frame that is interrupted is whole
            held, self.held = self.held, []
            with Sdf.ChangeBlock():
                for frame in held:
                    self.scale.include(max(float(value.max(initial=0.0)) for value in frame.von_mises.values()))
                    code, limit = Usd.TimeCode(len(self.times)), self.scale.limit
                    for name, body in self.bodies.items():
                        shown = (frame.points[name], frame.von_mises[name], frame.plastic_strain[name], limit)
                        body.write(code, *shown, frame.faces.get(name))
                    self.contact.write(code, frame.contact_points, frame.contact_stick)
                    self.setting.write(code, frame.time)
                    self.times.append(frame.time)
                    self.limits.append(limit)

    def finish(self, ok: bool) -> None:
        """Save what is left; a file without a frame is removed.

        Raises:
            OSError: the disk is full or fails.
        """
        if self.stage is None:
            return
        with _signals_held():
            try:
                self._write()
                if len(self.times) > self.tried_count:
                    self._save()
            finally:
                self.stage, self.bodies, self.contact, self.setting = None, {}, None, None
                if not self.saved_count:
                    self.path.unlink(missing_ok=True)

    def _save(self) -> None:
        from pxr import Tf, Vt

        self.tried_count = len(self.times)  # frames that cannot be saved now are not tried again
        self._saved, self._waiting = time.monotonic(), 0
        if shutil.disk_usage(self.path.parent).free < DISK_RESERVE:
            raise OSError(FULL)
        self.stage.SetStartTimeCode(0.0)
        self.stage.SetEndTimeCode(max(0.0, len(self.times) - 1.0))
        times, limits = (Vt.DoubleArray.FromNumpy(np.array(v, dtype=float)) for v in (self.times, self.limits))
        facts = {
            "scene": self.info.scene.name,
            "times_s": times,
            "time_step_s": self.info.dt,
            "colour_scale": self.scale.label,
            "colour_limits_Pa": limits,
        }
        self.stage.GetRootLayer().customLayerData = {"warp_mca": facts}
        try:
            self.stage.Save()
        except Tf.ErrorException as error:
            if _opens(self.path):
                raise OSError(_reason(error)) from error
            self.path.unlink(missing_ok=True)
            raise OSError(f"{_reason(error)}; the broken file is removed") from error
        self.saved_count = len(self.times)


def _copied(value: NDArray | Mapping[str, NDArray]) -> Any:
    """A copy of an array, or of several."""
    return value.copy() if isinstance(value, np.ndarray) else {name: array.copy() for name, array in value.items()}


def _bytes(value: NDArray | Mapping[str, NDArray]) -> int:
    """Size of an array, or of several together."""
    return value.nbytes if isinstance(value, np.ndarray) else sum(array.nbytes for array in value.values())


def _new_stage(path: str) -> Any:
    """An empty stage on `path`; a layer that an earlier run of this process left open is cleared."""
    from pxr import Sdf, Usd

    layer = Sdf.Layer.Find(path)
    if layer is None:
        return Usd.Stage.CreateNew(path)
    layer.Clear()
    return Usd.Stage.Open(layer)


def _opens(path: Path) -> bool:
    from pxr import Sdf, Tf

    try:
        return Sdf.Layer.OpenAsAnonymous(str(path)) is not None
    except Tf.ErrorException:
        return False


def _is_utf8(name: str) -> bool:
    try:
        return bool(name.encode())
    except UnicodeEncodeError:
        return False


@contextmanager
def _signals_held() -> Iterator[None]:
    """Delay signals that stop a run: in between, they would leave half a frame or a broken import of pxr."""
    held: list[int] = []
    main_thread = threading.current_thread() is threading.main_thread()  # no other may take signals
    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP) if main_thread else ()
    handlers = {number: signal.signal(number, lambda number, frame: held.append(number)) for number in numbers}
    try:
        yield
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler or signal.SIG_DFL)
        for number in held[:1]:
            signal.raise_signal(number)


def _reason(error: Exception) -> str:
    found = re.search(r": '([^']*)'", str(error))  # the message, without the place in USD's sources
    return " ".join((found[1] if found else str(error)).split())[:200]
