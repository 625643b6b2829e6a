"""Owns the ParaView recorder: nodal fields of the whole mesh over time in one VTKHDF file.

https://docs.vtk.org/en/latest/vtk_file_formats/vtkhdf_file_format/vtkhdf_specifications.html

A file that grows may be unreadable after its writer is killed or its disk is full. This one never grows: space for
all frames is reserved before the run, in a sparse file. Each frame is written to its place, and then the number of
steps is raised.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warp_mca.base.errors import RequestError, bad_value
from warp_mca.base.files import nearest
from warp_mca.pictures.setting import rigid_planes, up_of
from warp_mca.recorders.hidden_cells import HiddenCells
from warp_mca.recorders.mesh_file import cells
from warp_mca.recorders.recorder import DISK_RESERVE, VOLUME, Cadence, FramesOnly, check_disk, check_file

if TYPE_CHECKING:
    from pathlib import Path

    import h5py

    from warp_mca.recorders.recorder import Frame, RunInfo
    from warp_mca.scene import Scene
    from warp_mca.system.model import Model

    _Datasets = dict[str, h5py.Dataset]

FRAMES = Cadence(frames=100)
MOST = 5_000  # frames of a run of many phases
FIELDS = {"displacement": (3,), "velocity": (3,), "stress": (6,), "von_mises": (), "plastic_strain": ()}
# Bounds from above of what is written at the start for a node, an element, a frame, and in headers [byte].
NODE_BYTES, ELEMENT_BYTES, FRAME_BYTES, HEADER_BYTES = 24, 88, 256, 256 << 10


class VtkHdfFile(FramesOnly):
    """Writes displacement, velocity, stress, von Mises stress and plastic strain at all nodes, as float32.

    Points stay where they were at t = 0, in float64: float32 positions would lose displacements below 3e-8 m, and
    ParaView's Warp By Vector moves them by any multiple of `displacement`. Storing them in every frame as well would
    take a fifth more.

    The file appears with its first frame. From then on it can be opened at any time, also while the run goes on.
    """

    def __init__(self, file: str | os.PathLike[str], *, cadence: Cadence = FRAMES) -> None:
        """Record to `file` (.vtkhdf or .hdf), which is made, or replaced; `cadence` says when frames are taken.

        Raises:
            RequestError: `file` cannot be written.
        """
        self.path = check_file("vtkhdf", file, ".vtkhdf", ".hdf")
        self.name, self.files = str(self.path), (self.path,)
        self.needs = frozenset((VOLUME,))
        self.cadence = cadence
        self.frame_count = 0
        self._unborn = self.path.with_name(f".{self.path.name}.part")
        self._file: h5py.File | None = None

    def check(self, info: RunInfo) -> None:
        """Check that the disk has room for the mesh, and that a file may be as long as all frames need.

        Raises:
            RequestError: it has not, or may not.
        """
        check_disk("vtkhdf", self.path)
        self._check_room(info, nearest(self.path.parent))

    def _check_room(self, info: RunInfo, folder: Path) -> None:
        """Try a file as large in `folder`: HDF5 may crash Python where it meets a quota or a limit of file size.

        Raises:
            RequestError: the system refuses it.
        """
        count = self._planned(info)
        at_start, whole = _file_sizes(info.model, count, 1 if info.phases else count)
        try:
            with tempfile.TemporaryFile(dir=folder) as trial:
                trial.truncate(whole)  # takes no space
                if hasattr(os, "posix_fallocate"):
                    os.posix_fallocate(trial.fileno(), 0, at_start)
        except OSError as error:
            remedy = f"{count} frames cannot be written ({_reason(error)}); take fewer frames or name another file"
            raise bad_value("vtkhdf", str(self.path), remedy) from error

    def _planned(self, info: RunInfo) -> int:
        """Frames of the whole run, or the most that a run of many phases can have."""
        if info.phases:
            return MOST
        intervals = round(info.duration / info.output_interval)
        return int(self.cadence.rows(intervals, info.output_interval).sum())

    def start(self, info: RunInfo) -> None:
        """Write the mesh, and give every frame its place.

        Raises:
            RequestError: the file cannot be made.
        """
        try:
            import h5py
        except ImportError as error:
            raise RequestError(f"h5py cannot be imported ({error}): install it with pip install h5py") from error

        count = self._planned(info)
        self.node_count, self.frame_count = info.model.node_count, 0
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._check_room(info, self.path.parent)  # again: the run may have begun since `check`
            self._file = h5py.File(_create(self._unborn))
            root = self._file.create_group("VTKHDF")
            self._steps, self._values, self._places = _make_steps(root, count, self.node_count, info.phases)
            self._hidden = HiddenCells(root, count, len(info.model.element_of)) if info.model.fails else None
            _write_mesh(root, info.model)
            _write_setting(root, info.scene, count)
            self._file.flush()
            size, free = self._unborn.stat().st_size, shutil.disk_usage(self.path.parent).free
        except (OSError, RuntimeError) as error:
            self._abandon()
            remedy = f"it cannot be written ({_reason(error)}); name another file"
            raise bad_value("vtkhdf", str(self.path), remedy) from error
        if size + DISK_RESERVE > free:
            need = f"{count} frames take {size / 1e9:.2g} GB"
            info.warn(f"{self.path}: {need}, but its disk has {free / 1e9:.2g} GB free; take fewer frames")

    def frame(self, frame: Frame) -> None:
        """Write one frame.

        Raises:
            OSError: it cannot be written; the file stays as it was after the frame before.
        """
        assert self._file is not None and frame.volume is not None
        try:
            self._write(self._file, frame.step, frame.time, vars(frame.volume))
        except (OSError, RuntimeError) as error:
            self._abandon()
            raise OSError(f"{_reason(error)}; the file holds the {self.frame_count} frames before") from error

    def finish(self, ok: bool) -> None:
        """Close the file.

        Raises:
            OSError: it cannot be closed; it stays as it was after the last frame.
        """
        if self._file is None or not self.frame_count:
            self._abandon()
            return
        try:
            self._publish(self._file, self.frame_count)  # discards a frame whose writing was interrupted
            self._file.close()
            self._file = None
        except (OSError, RuntimeError) as error:
            raise OSError(f"{_reason(error)}; the file holds {self.frame_count} frames") from error
        finally:
            self._abandon()

    def _write(self, file: h5py.File, step: int, time: float, fields: Mapping[str, NDArray]) -> None:
        needed = DISK_RESERVE + sum(field.nbytes for field in fields.values() if field is not None)
        if shutil.disk_usage(self.path.parent).free < needed:
            raise OSError(f"less than {needed >> 20} MiB are free on its disk")
        if self.frame_count == len(self._places["step"]):
            raise OSError(f"it has room for {self.frame_count} frames; take fewer")
        place = slice(self.frame_count * self.node_count, (self.frame_count + 1) * self.node_count)
        if self._hidden and (failed := fields["failed"]) is not None:
            self._hidden.write(self.frame_count, failed)
        for name in FIELDS:
            if len(self._places[name]) < place.stop:  # of a run of many phases
                self._places[name].resize(place.stop, axis=0)
            self._places[name][place] = fields[name]
        self._places["step"][self.frame_count] = step
        file.flush()  # the frame is written before the number of steps counts it
        self._publish(file, self.frame_count + 1, time)
        if self.frame_count == 0:
            self._unborn.replace(self.path)
        self.frame_count += 1

    def _publish(self, file: h5py.File, count: int, time: float | None = None) -> None:
        """Set the number of steps; HDF5 writes it and the length of `Values`, its neighbour, in one go."""
        self._values.resize((max(count, 1),))
        if time is not None:
            self._values[count - 1] = time
        self._steps.attrs.modify("NSteps", np.int32(count))
        file.flush()

    def _abandon(self) -> None:
        """Close a file that HDF5 may be unable to write, and remove one without frames."""
        if self._file is not None:
            # HDF5 writes again what failed when Python exits, and crashes; writing to the null device succeeds.
            null = os.open(os.devnull, os.O_RDWR)
            os.dup2(null, self._file.id.get_vfd_handle())
            os.close(null)
            with suppress(OSError, RuntimeError):
                self._file.close()
            self._file = None
        with suppress(OSError):
            self._unborn.unlink(missing_ok=True)


def _create(path: Path) -> h5py.h5f.FileID:
    """Make an HDF5 file without buffers of data.

    A dataset whose buffer cannot be written when it is closed stays half open, which crashes Python at its exit.
    """
    import h5py

    h5f, access = h5py.h5f, h5py.h5p.create(h5py.h5p.FILE_ACCESS)
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    # The earliest version has no marks that keep readers from a file whose writer was killed. A lock would keep
    # ParaView from looking on.
    access.set_libver_bounds(h5f.LIBVER_EARLIEST, h5f.LIBVER_LATEST)
    access.set_file_locking(False, False)
    access.set_sieve_buf_size(0)
    return h5f.create(os.fsencode(path), h5f.ACC_TRUNC, fapl=access)


def _file_sizes(model: Model, count: int, filled: int) -> tuple[int, int]:
    """Bounds from above of a file with `count` places for frames [byte]: at the start, and with `filled` frames."""
    mesh = NODE_BYTES * model.node_count + ELEMENT_BYTES * len(model.element_of)
    at_start = HEADER_BYTES + mesh + FRAME_BYTES * count
    values = sum(int(np.prod(width)) for width in FIELDS.values())
    return at_start, at_start + filled * model.node_count * values * np.dtype(np.float32).itemsize


def _make_steps(
    root: h5py.Group, count: int, node_count: int, grows: bool
) -> tuple[h5py.Group, h5py.Dataset, _Datasets]:
    """Make places for `count` frames and say where each is: the group Steps, its Values, what frames are written to.

    With `grows` the places of fields are made as frames come.

    `Values` is as long as the number of steps, because VTK reads all of it. Its header and the one that holds this
    number come first in the file, side by side.
    """
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int32(0)
    values = steps.create_dataset("Values", data=np.zeros(1), chunks=(count,), maxshape=(count,))
    root.attrs["Version"] = (2, 0)
    root.attrs.create("Type", np.bytes_("UnstructuredGrid"))
    steps["NumberOfParts"] = np.ones(count, dtype=np.int64)
    for name in ("PartOffsets", "PointOffsets"):
        steps[name] = np.zeros(count, dtype=np.int64)  # every frame reads the same mesh
    for name in ("CellOffsets", "ConnectivityIdOffsets"):
        steps[name] = np.zeros((count, 1), dtype=np.int64)
    places = {}
    for name, width in FIELDS.items():
        one = (node_count, *width)
        room = {"maxshape": (None, *width), "chunks": one} if grows else {}
        shape = one if grows else (count * node_count, *width)
        places[name] = root.create_dataset(f"PointData/{name}", shape=shape, dtype=np.float32, **room)
        places[name][:1] = 0.0  # with the first value HDF5 allots the whole
        steps[f"PointDataOffsets/{name}"] = node_count * np.arange(count)
    places["step"] = root.create_dataset("FieldData/step", data=np.zeros(count, dtype=np.int64))
    steps["FieldDataOffsets/step"] = np.arange(count)
    return steps, values, places


def _write_mesh(root: h5py.Group, model: Model) -> None:
    """Points at t = 0 and elements, with the index of body and material, once for all frames."""
    runs, body, material = cells(model)
    sizes = np.concatenate([np.full(len(nodes), nodes.shape[1]) for _, nodes in runs])
    root["NumberOfPoints"] = np.array([model.node_count])
    root["NumberOfCells"] = np.array([len(model.element_of)])
    root["NumberOfConnectivityIds"] = np.array([sizes.sum()])
    root["Points"] = model.X
    root["Connectivity"] = np.concatenate([nodes.ravel() for _, nodes in runs])
    root["Offsets"] = np.append(0, np.cumsum(sizes))
    root["Types"] = np.concatenate([np.full(len(nodes), cell.vtk, dtype=np.uint8) for cell, nodes in runs])
    root["CellData/body"] = body
    root["CellData/body"].attrs["names"] = list(model.element_start)
    root["CellData/material"] = material


def _write_setting(root: h5py.Group, scene: Scene, count: int) -> None:
    """Which way is up, and the rigid planes, once for all `count` frames; VTK's reader wants the sizes in each."""
    planes = rigid_planes(scene)
    vectors = {"up": [up_of(scene)]}
    if planes:
        vectors |= {f"plane_{name}": [getattr(p, name) for p in planes] for name in ("point", "normal", "velocity")}
    for name, rows in vectors.items():
        root[f"FieldData/{name}"] = np.array(rows, dtype=float)
        root[f"Steps/FieldDataOffsets/{name}"] = np.zeros(count, dtype=np.int64)
        root[f"Steps/FieldDataSizes/{name}"] = np.tile(np.array([3, len(rows)]), (count, 1))


def _reason(error: Exception) -> str:
    """The system's message, which HDF5 wraps in a paragraph of its own."""
    found = re.search(r"error message = '([^']*)'", str(error))
    return found[1] if found else str(getattr(error, "strerror", None) or error)
