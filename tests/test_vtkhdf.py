"""Tests the VTKHDF recorder by reading its files back with VTK's own reader, step by step."""

from __future__ import annotations

import dataclasses
import multiprocessing
import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
from flying_bars import DT, STEPS, FlyingBars
from test_full_disk import files_up_to
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline
from vtkmodules.vtkIOHDF import vtkHDFReader

from warp_mca.base.errors import RequestError
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.recorders import vtkhdf_file
from warp_mca.recorders.recorder import Cadence
from warp_mca.recorders.vtkhdf_file import FIELDS, VtkHdfFile

FRAMES = 11  # as many as the bars' run has ends of output intervals


def record(file: Path, bars: FlyingBars, count: int = FRAMES) -> VtkHdfFile:
    """A recording of `count` frames that is not yet closed."""
    recorder = VtkHdfFile(file)
    recorder.start(bars.info)
    for index in range(count):
        recorder.frame(bars.frame(index))
    return recorder


def reader(file: Path) -> tuple[vtkHDFReader, list[float]]:
    """VTK's reader of a file, and the times that it finds there [s]."""
    found = vtkHDFReader()
    found.SetFileName(str(file))
    found.UpdateInformation()
    return found, list(found.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS()) or [])


def arrays(data: object) -> dict[str, np.ndarray]:
    """VTK's arrays by name."""
    return {data.GetArrayName(k): vtk_to_numpy(data.GetArray(k)) for k in range(data.GetNumberOfArrays())}


def steps(file: Path) -> Iterator[tuple[float, object]]:
    """Time and grid of each step, as VTK sees them; a single step has no time of its own."""
    source, times = reader(file)
    for t in times or [0.0]:
        source.UpdateTimeStep(t)
        yield t, source.GetOutput()


def check(file: Path, bars: FlyingBars, count: int) -> None:
    """VTK finds the first `count` frames, and nothing else."""
    assert len(reader(file)[1]) == (count if count > 1 else 0)
    for index, (t, grid) in enumerate(steps(file)):
        frame = bars.frame(index)
        assert t == frame.time
        found = arrays(grid.GetPointData())
        for name in FIELDS:
            np.testing.assert_array_equal(found[name], getattr(frame.volume, name))
    assert index + 1 == count


@pytest.mark.parametrize("name", ["bars.vtkhdf", "new/folder/bars.hdf"])
def test_every_frame_comes_back(tmp_path: Path, bars: FlyingBars, name: str):
    record(tmp_path / name, bars).finish(True)
    check(tmp_path / name, bars, FRAMES)
    found = [arrays(grid.GetFieldData())["step"].tolist() for _, grid in steps(tmp_path / name)]
    assert found == [[STEPS * k] for k in range(FRAMES)]
    assert not bars.said


def test_the_mesh_is_stored_once_and_stands_still(tmp_path: Path, bars: FlyingBars):
    file, model = tmp_path / "bars.vtkhdf", bars.info.model
    record(file, bars).finish(True)
    elements = np.concatenate([block.conn.T for block in model.blocks])[np.argsort(model.element_of)]
    for _, grid in steps(file):
        np.testing.assert_array_equal(vtk_to_numpy(grid.GetPoints().GetData()), model.X)
        connectivity = vtk_to_numpy(grid.GetCells().GetConnectivityArray())
        np.testing.assert_array_equal(connectivity.reshape(-1, 8), elements)
        assert set(vtk_to_numpy(grid.GetCellTypes())) == {HEXAHEDRON.vtk}
        data = arrays(grid.GetCellData())
        np.testing.assert_array_equal(data["body"], np.repeat([0, 1], 10))
        np.testing.assert_array_equal(data["material"], np.zeros(20))
    with h5py.File(file) as stored:
        assert stored["VTKHDF/Points"].shape == (model.node_count, 3)
        assert list(stored["VTKHDF/CellData/body"].attrs["names"]) == ["upper bar", "lower"]


def test_warping_by_displacement_gives_the_positions(tmp_path: Path, bars: FlyingBars):
    from vtkmodules.vtkFiltersGeneral import vtkWarpVector

    record(tmp_path / "bars.vtkhdf", bars).finish(True)
    source, times = reader(tmp_path / "bars.vtkhdf")
    warp = vtkWarpVector()
    warp.SetInputConnection(source.GetOutputPort())
    warp.SetInputArrayToProcess(0, 0, 0, 0, "displacement")
    warp.UpdateTimeStep(times[7])
    moved = vtk_to_numpy(warp.GetOutput().GetPoints().GetData())
    np.testing.assert_allclose(moved - bars.info.model.X, bars.positions(7 * STEPS) - bars.info.model.X, rtol=1e-6)


@pytest.mark.parametrize("count", [1, 2, 5])
def test_the_file_can_be_read_while_the_run_goes_on_and_after_it_stopped_short(
    tmp_path: Path, bars: FlyingBars, count: int
):
    recorder = record(tmp_path / "bars.vtkhdf", bars, count)
    check(tmp_path / "bars.vtkhdf", bars, count)
    recorder.finish(False)
    check(tmp_path / "bars.vtkhdf", bars, count)


def test_a_run_killed_at_any_moment_leaves_every_frame(tmp_path: Path, bars: FlyingBars):
    planned = 4000
    bars.info = dataclasses.replace(bars.info, duration=planned * bars.info.output_interval)
    made = [bars.frame(index % FRAMES) for index in range(FRAMES)]

    def run(file: Path, written: int) -> None:
        recorder = VtkHdfFile(file, cadence=Cadence(frames=planned))
        recorder.start(bars.info)
        for index in range(planned):
            recorder.frame(dataclasses.replace(made[index % FRAMES], index=index, step=index, time=index * DT))
            os.write(written, b".")

    for trial in range(6):
        file = tmp_path / f"{trial}.vtkhdf"
        end, written = os.pipe()
        process = multiprocessing.get_context("fork").Process(target=run, args=(file, written))
        process.start()
        os.close(written)
        known = len(os.read(end, 1)) + len(os.read(end, 1))  # waits for two frames
        time.sleep(0.02 * trial)
        process.kill()
        process.join(60)
        known += len(os.read(end, planned))
        os.close(end)
        assert process.exitcode == -signal.SIGKILL
        source, times = reader(file)
        assert 2 <= known <= len(times) <= known + 1  # it may have been killed between a frame and its dot
        np.testing.assert_array_equal(times, DT * np.arange(len(times)))
        for index in {0, len(times) // 2, len(times) - 1}:
            source.UpdateTimeStep(times[index])
            found = arrays(source.GetOutput().GetPointData())
            for name in FIELDS:
                np.testing.assert_array_equal(found[name], getattr(made[index % FRAMES].volume, name))


def test_a_frame_that_is_interrupted_is_undone(tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch):
    recorder = record(tmp_path / "bars.vtkhdf", bars, 4)

    def interrupt(*args: object) -> None:
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(h5py.AttributeManager, "modify", interrupt)
        with pytest.raises(KeyboardInterrupt):
            recorder.frame(bars.frame(4))
    recorder.finish(False)
    check(tmp_path / "bars.vtkhdf", bars, 4)
    with h5py.File(tmp_path / "bars.vtkhdf") as stored:
        assert len(stored["VTKHDF/Steps/Values"]) == 4


def test_a_file_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path, bars: FlyingBars):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtkhdf").mkdir()
    for name, remedy in (("file/a.vtkhdf", "not a folder"), ("folder.vtkhdf", "is a folder"), ("a.vtu", ".vtkhdf or")):
        with pytest.raises(RequestError, match=remedy):
            VtkHdfFile(tmp_path / name)
    recorder = VtkHdfFile(tmp_path / "a.vtkhdf")
    (tmp_path / ".a.vtkhdf.part").mkdir()  # in the way
    with pytest.raises(RequestError, match=r"a\.vtkhdf.*cannot be written \(Is a directory\)"):
        recorder.start(bars.info)
    recorder.finish(False)
    assert sorted(path.name for path in tmp_path.iterdir()) == [".a.vtkhdf.part", "file", "folder.vtkhdf"]


def test_an_older_file_stays_until_there_is_a_frame(tmp_path: Path, bars: FlyingBars):
    file = tmp_path / "bars.vtkhdf"
    file.write_text("older")
    recorder = record(file, bars, 0)
    recorder.finish(False)
    assert file.read_text() == "older"
    assert [path.name for path in tmp_path.iterdir()] == ["bars.vtkhdf"]
    record(file, bars, 3).finish(True)
    check(file, bars, 3)
    assert [path.name for path in tmp_path.iterdir()] == ["bars.vtkhdf"]


def test_little_space_is_a_warning_before_and_an_error_when_it_ends(
    tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch
):
    free = iter([1 << 20, 1 << 40, 1 << 40, 1 << 20])
    monkeypatch.setattr(vtkhdf_file.shutil, "disk_usage", lambda path: SimpleNamespace(free=next(free)))
    recorder = record(tmp_path / "full.vtkhdf", bars, 2)
    assert "11 frames take" in bars.said[0]
    with pytest.raises(OSError, match="less than 64 MiB are free on its disk; the file holds the 2 frames before"):
        recorder.frame(bars.frame(2))
    recorder.finish(False)
    check(tmp_path / "full.vtkhdf", bars, 2)


@pytest.mark.parametrize("stage", ["fields", "count"])
def test_a_disk_that_fails_ends_the_recording_and_not_the_program(tmp_path: Path, bars: FlyingBars, stage: str):
    """HDF5 crashes Python at its exit when it still holds what it could not write."""
    script = f"""
        import resource, sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from flying_bars import FlyingBars
        from test_vtkhdf import record

        bars = FlyingBars()
        recorder = record({str(tmp_path / "full.vtkhdf")!r}, bars, 3)
        publish = recorder._publish

        def fill(*args):
            resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))  # any write beyond fails from now on
            if args:
                publish(*args)

        if {stage == "count"}:
            recorder._publish = fill
        else:
            fill()
        try:
            recorder.frame(bars.frame(3))
        except OSError as error:
            print(error)
        recorder.finish(False)
    """
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == "File too large; the file holds the 3 frames before\n"
    check(tmp_path / "full.vtkhdf", bars, 3)


@pytest.mark.parametrize("size", [0, 1000, 300_000, 400_000])
def test_a_limit_of_file_size_refuses_the_run_or_is_kept(tmp_path: Path, bars: FlyingBars, size: int):
    check_room = VtkHdfFile(tmp_path / "bars.vtkhdf").check
    with files_up_to(size):
        if size < 323_000:  # the file's size, bounded from above
            with pytest.raises(RequestError, match=r"11 frames cannot be written \(File too large\); take fewer"):
                check_room(bars.info)
            with pytest.raises(RequestError, match="File too large"):
                record(tmp_path / "bars.vtkhdf", bars, 0)
            assert list(tmp_path.iterdir()) == []
        else:
            check_room(bars.info)
            record(tmp_path / "bars.vtkhdf", bars).finish(True)
            check(tmp_path / "bars.vtkhdf", bars, FRAMES)


def test_a_disk_that_fails_at_the_start_refuses_the_run_without_a_crash(tmp_path: Path):
    """At most sizes the failure comes while HDF5 makes datasets, before the file has its length."""
    script = f"""
        import resource, sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from flying_bars import FlyingBars
        from warp_mca.base.errors import RequestError
        from warp_mca.recorders.vtkhdf_file import VtkHdfFile

        bars = FlyingBars()
        for size in (0, 100, 2000, 10_000, 30_000, 60_000, 80_000, 86_000):
            recorder = VtkHdfFile({str(tmp_path / "full.vtkhdf")!r})
            abandon = recorder._abandon

            def give_up():
                resource.setrlimit(resource.RLIMIT_FSIZE, before)  # a full disk does not limit files in memory
                abandon()

            recorder._check_room, recorder._abandon = lambda *args: None, give_up
            before = resource.getrlimit(resource.RLIMIT_FSIZE)
            resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
            try:
                recorder.start(bars.info)
            except RequestError as error:
                print(error)
    """
    command = [sys.executable, "-c", textwrap.dedent(script)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.count("cannot be written (File too large); name another file") == 8
    assert list(tmp_path.iterdir()) == []
