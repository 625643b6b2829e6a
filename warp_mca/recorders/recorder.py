"""Owns the interface of recorders: facts given before a run, frames, and when frames are taken."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import bad_value
from warp_mca.base.files import check_folder, given_path, nearest
from warp_mca.base.validate import brief, is_list, is_number
from warp_mca.scene import RigidPlane
from warp_mca.step.shown import CONTACT, NEEDS, PATHS, SURFACE, VOLUME, SurfaceMesh  # noqa: F401, read from here

if TYPE_CHECKING:
    from warp_mca.scene import Scene
    from warp_mca.system.model import Model

Float = NDArray[np.float32]

DISK_RESERVE = 64 << 20  # disk space that recorders leave free for the results [byte]
FULL = f"less than {DISK_RESERVE >> 20} MiB are free on its disk"


@dataclass(frozen=True)
class Cadence:
    """When frames are taken: `frames` over the run, one every `seconds` [s] of simulated time, or at `times` [s].

    The state can be read at the end of each output interval: the nearest ends are taken. The first two ways always
    take the first and the last one; times that a run does not reach are refused when it starts.

    Raises:
        RequestError: none or several of them are given, or one is no whole number from 2 on, no time, no list of times.
    """

    frames: int | None = None
    seconds: float | None = None
    times: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        given = (self.frames, self.seconds, self.times)
        if sum(value is not None for value in given) != 1:
            raise bad_value("Cadence", tuple(map(brief, given)), "give one of frames, seconds and times")
        if self.frames is not None and not (isinstance(self.frames, int | np.integer) and self.frames >= 2):
            raise bad_value("frames", brief(self.frames), "give a whole number, at least 2: the first and the last")
        if self.seconds is not None and not (is_number(self.seconds) and self.seconds > 0.0):
            raise bad_value("seconds", brief(self.seconds), "give a finite time above 0 s")
        if self.times is not None:
            if not (is_list(self.times) and len(self.times) and min(self.times) >= 0.0):
                value = self.times if isinstance(self.times, tuple | list) else brief(self.times)
                raise bad_value("times", value, "give a tuple of finite times from 0 s on")
            object.__setattr__(self, "times", tuple(map(float, self.times)))

    def rows(self, intervals: int, interval: float) -> NDArray[np.bool_]:
        """Which ends of `intervals` output intervals of `interval` [s] are frames, shape (intervals + 1,), bool."""
        if self.frames is not None:
            at = np.linspace(0.0, intervals, min(self.frames, intervals + 1))
        elif self.seconds is not None:
            at = np.append(np.arange(0.0, intervals, max(1.0, self.seconds / interval)), intervals)
        else:
            at = np.asarray(self.times) / interval
        chosen = np.zeros(intervals + 1, dtype=bool)
        chosen[np.minimum(np.round(at), intervals).astype(int)] = True
        return chosen


@dataclass(frozen=True)
class RunInfo:
    """What never changes during a run.

    Attributes:
        scene: that is run.
        model: its arrays; `model.X` holds the positions at t = 0.
        surfaces: skin of each body, by its name.
        paths: position of the probes along each path [m], shape (probe_count,), float64, by the path's name.
        dt: time step [s].
        output_interval: time between rows of the history [s].
        duration: simulated time of the run, from first contact on [s].
        warn: takes a sentence about what a recorder could not do; it is shown with the run's other warnings.
        phases: whether the run goes through swings and impacts in turn: frames then have times before first contact
            too, each phase has as many as the cadence says of a run, and how many there will be is not known.
    """

    scene: Scene
    model: Model
    surfaces: Mapping[str, SurfaceMesh]
    paths: Mapping[str, NDArray[np.float64]]
    dt: float
    output_interval: float
    duration: float
    warn: Callable[[str], None]
    phases: bool = False

    @property
    def striking(self) -> list[str]:
        """Bodies that are not only struck, as a plate is that is much larger than what strikes it."""
        struck = {c.master.body for c in self.scene.listed if not isinstance(c.master, RigidPlane)}
        return [body for body in self.surfaces if body not in struck] or list(self.surfaces)


@dataclass(frozen=True)
class Volume:
    """Fields at all nodes of the model.

    Attributes:
        displacement: since t = 0 [m], shape (node_count, 3), float32.
        velocity: [m/s], shape (node_count, 3), float32.
        stress: xx, yy, zz, xy, yz, xz in the world frame [Pa], shape (node_count, 6), float32.
        von_mises: [Pa], shape (node_count,), float32.
        plastic_strain: equivalent plastic strain [-], shape (node_count,), float32.
        failed: whether each element has failed, as counted in the concatenated meshes, shape (element_count,), bool;
            None where none can.
    """

    displacement: Float
    velocity: Float
    stress: Float
    von_mises: Float
    plastic_strain: Float
    failed: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class Frame:
    """The state at one time. Arrays are valid during the call only: copy what is to be kept.

    What no recorder of the run needs is empty. Stress at a node is the mean over its elements of the stress at the
    integration point nearest to it.

    Attributes:
        index: counts the frames that this recorder was given, from 0.
        step: steps since t = 0.
        time: since first contact [s].
        points: positions of each skin's vertices [m], shape (vertex_count, 3), float32, by body.
        von_mises: stress there [Pa], shape (vertex_count,), float32, by body.
        plastic_strain: equivalent plastic strain there [-], shape (vertex_count,), float32, by body.
        contact_points: positions of slave nodes in contact [m], shape (contact_count, 3), float32.
        contact_stick: which of them stick, shape (contact_count,), bool.
        path_stress: von Mises stress along each path [Pa], shape (probe_count,), float32, by path.
        volume: fields at all nodes, or None.
        faces: which faces of its skin are at the surface, of each body whose elements may fail, shape (face_count,),
            bool, by body.
    """

    index: int
    step: int
    time: float
    points: Mapping[str, Float]
    von_mises: Mapping[str, Float]
    plastic_strain: Mapping[str, Float]
    contact_points: Float
    contact_stick: NDArray[np.bool_]
    path_stress: Mapping[str, Float]
    volume: Volume | None = None
    faces: Mapping[str, NDArray[np.bool_]] = field(default_factory=dict)


class Recorder(Protocol):
    """Writes or shows a run while it goes on.

    What `check` or `start` raises stops the run before it begins. A recorder that raises later is dropped with a
    warning, and the run goes on without it; what it has written stays as far as it can be opened.

    Attributes:
        name: for warnings, such as the file that it writes.
        needs: what its frames must hold, out of SURFACE, CONTACT, PATHS and VOLUME.
        cadence: when it wants a frame.

    It may have besides: `files`, the paths that it writes; `check(info)`, which refuses what it can before any recorder
    of the run opens a file; `idle()`, called while the run waits for its last frames, which writes what is held;
    `before_finish()`, called before the `finish` of any recorder, which begins what goes on beside them; `failed`,
    whether it went on after a failure that it warned of itself.
    """

    @property
    def name(self) -> str: ...
    @property
    def needs(self) -> frozenset[str]: ...
    @property
    def cadence(self) -> Cadence: ...

    def start(self, info: RunInfo) -> None:
        """Open the file or the viewer.

        Raises:
            RequestError: it cannot be opened. The run does not begin, whatever is raised.
        """
        ...

    def frame(self, frame: Frame) -> None:
        """Take one frame."""
        ...

    def history(self, rows: Mapping[str, NDArray[np.float64]]) -> None:
        """Take further rows of the history, by column."""
        ...

    def finish(self, ok: bool) -> None:
        """Close what is open; `ok` tells that the run ended as it should. Called once, also if `start` failed."""
        ...


class FramesOnly:
    """Base of recorders that leave out the rows of the history, and need not start or finish."""

    def start(self, info: RunInfo) -> None:
        """Nothing is to be opened."""

    def history(self, rows: Mapping[str, NDArray[np.float64]]) -> None:
        """Nothing is kept of it."""

    def finish(self, ok: bool) -> None:
        """Nothing is open."""


def apart(names: Iterable[str]) -> list[str]:
    """The names, made unique by underscores appended to repeated ones."""
    found: list[str] = []
    for name in names:
        while name in found:
            name += "_"
        found.append(name)
    return found


def file_path(field: str, file: object) -> Path:
    """The file that the user named `field`.

    Raises:
        RequestError: it is no path.
    """
    return given_path(field, file, "name a file")


def check_disk(field: str, path: Path) -> None:
    """Check that the disk of a file, which may be made yet, has room.

    Raises:
        RequestError: it is full.
    """
    if shutil.disk_usage(nearest(path).absolute()).free < DISK_RESERVE:
        raise bad_value(field, str(path), f"it cannot be written ({FULL}); name another file")


def check_file(field: str, file: str | os.PathLike[str], *suffixes: str) -> Path:
    """`file` as a path, when a recording can be written there.

    Args:
        field: how the user named it.
        file: the path; missing folders above it are made when the run starts.
        suffixes: that the name may end with.

    Raises:
        RequestError: it is no name, the suffix is another one, or the path is a folder or cannot be written to.
    """
    path = file_path(field, file)
    if path.suffix not in suffixes:
        raise bad_value(field, str(path), f"give the file the suffix {' or '.join(suffixes)}")
    if path.is_dir():
        raise bad_value(field, str(path), f"{path} is a folder; name another")
    if path.is_symlink() or not path.exists():
        check_folder(field, path.parent if path.is_symlink() else path)
        return path
    try:  # it stays as it is until the run starts
        path.open("r+b").close()
    except OSError as error:
        raise bad_value(
            field, str(path), f"it cannot be written to ({error.strerror or error}); name another"
        ) from error
    return path


def make_way(path: Path) -> None:
    """Make missing folders above a file, and remove a symbolic link in its place: what it points to stays as it is.

    Raises:
        OSError: that cannot be done.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_symlink():
        path.unlink()
