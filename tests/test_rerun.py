"""Tests the rerun recorder by reading its recordings back with rerun's own reader."""

from __future__ import annotations

import dataclasses
import os
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from flying_bars import DT, STEPS, FlyingBars
from rrd import rows

from warp_mca.base.errors import RequestError
from warp_mca.recorders import rerun_stream
from warp_mca.recorders.colours import SLIP, STICK
from warp_mca.recorders.rerun_stream import RerunStream
from warp_mca.recorders.rerun_viewer import recording_in
from warp_mca.results.result import HISTORY_COLUMNS

FRAMES = 9


def history_rows() -> dict[str, np.ndarray]:
    """Five rows; the scene has no tip."""
    rng = np.random.default_rng(2)
    rows = {name: rng.normal(size=5) for name in HISTORY_COLUMNS}
    return rows | {"time_s": np.arange(5) * 1e-6, "tip_vx": np.full(5, np.nan)}


def record(file: Path, bars: FlyingBars, **options: object) -> RerunStream:
    """A whole recording."""
    recorder = RerunStream(file, **options)
    recorder.start(bars.info)
    for index in range(FRAMES):
        recorder.frame(bars.frame(index))
    recorder.history(history_rows())
    recorder.finish(True)
    return recorder


@pytest.fixture
def recording(bars: FlyingBars, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A recording of the flying bars."""
    file = tmp_path_factory.mktemp("rrd") / "bars.rrd"
    record(file, bars)
    return file


@pytest.mark.parametrize(("body", "entity"), [("upper bar", "/world/upper_bar"), ("lower", "/world/lower")])
def test_topology_is_stored_once_and_every_frame_has_positions(
    recording: Path, bars: FlyingBars, body: str, entity: str
):
    ((static, _, triangles),) = rows(recording, entity, "Mesh3D:triangle_indices")
    assert static
    np.testing.assert_array_equal(triangles, bars.info.surfaces[body].triangles)
    frames = sorted((step, value) for static, step, value in rows(recording, entity, "Mesh3D:vertex_positions"))
    assert [step for step, _ in frames] == [STEPS * k for k in range(FRAMES)]
    last = bars.positions(frames[-1][0])
    np.testing.assert_array_equal(frames[-1][1], last[bars.info.surfaces[body].nodes].astype(np.float32))


def test_colours_follow_the_running_maximum(recording: Path):
    colours = sorted((step, set(value)) for _, step, value in rows(recording, "/world/lower", "Mesh3D:vertex_colors"))
    assert colours[0][1] == {0x440154FF}
    assert colours[-1][1] == {0xFDE725FF}
    ticks = sorted((step, value[-1]) for _, step, value in rows(recording, "/legend/ticks", "Points2D:labels"))
    assert ticks[0] == (0, "0 MPa")
    assert ticks[-1] == (8000, "8 MPa")


def test_history_is_stored_as_it_is(recording: Path):
    expected = history_rows()
    for entity, column in (("force", "F_n_N"), ("force", "F_t_N"), ("energy", "E_kinetic"), ("velocity", "tip_vy")):
        found = list(rows(recording, f"/plots/{entity}/{column}", "Scalars:scalars"))
        np.testing.assert_array_equal([value[0] for _, _, value in found], expected[column])
        assert [step for _, step, _ in found] == [round(t / DT) for t in expected["time_s"]]
    assert not list(rows(recording, "/plots/velocity/tip_vx", "Scalars:scalars"))


def test_contact_points_and_paths_are_stored(recording: Path):
    points = {step: value for _, step, value in rows(recording, "/world/contact_points", "Points3D:colors")}
    assert points[0] == []
    assert points[2000] == [STICK, SLIP]
    stress = {step: value for _, step, value in rows(recording, "/paths/Path_1", "BarChart:values")}
    assert len(stress) == FRAMES


def test_the_file_passes_rerun_s_own_check(recording: Path):
    command = [sys.executable, "-m", "rerun_cli", "rrd", "verify", str(recording)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert "verified without error" in done.stdout + done.stderr


def test_a_file_that_cannot_be_written_is_refused_before_the_run(tmp_path: Path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.rrd").mkdir()
    for name, remedy in (("file/a.rrd", "not a folder"), ("folder.rrd", "is a folder"), ("a.txt", "suffix .rrd")):
        with pytest.raises(RequestError, match=remedy):
            RerunStream(tmp_path / name)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "folder.rrd"]


def test_a_full_disk_is_a_warning_and_what_was_recorded_stays(
    tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch
):
    free = iter([1 << 40] + [1 << 20] * 9)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=next(free)))
    record(tmp_path / "full.rrd", bars)
    (warning,) = bars.said
    assert "are free on its disk" in warning
    assert len(list(rows(tmp_path / "full.rrd", "/world/lower", "Mesh3D:vertex_positions"))) >= rerun_stream.FLUSH_EVERY


def test_a_file_without_its_end_is_removed_and_counts_as_failed(tmp_path: Path, bars: FlyingBars):
    """rerun says nothing when its last write fails."""
    recorder = RerunStream(tmp_path / "a.rrd")
    recorder.start(bars.info)
    recorder.frame(bars.frame(0))
    assert recorder._file is not None
    stream = recorder._file.stream
    disconnect = stream.disconnect
    stream.disconnect = lambda: (disconnect(), os.truncate(tmp_path / "a.rrd", 2000))
    recorder.finish(True)
    assert recorder.failed
    assert list(tmp_path.iterdir()) == []
    (warning,) = bars.said
    assert warning.endswith("recording stopped after 1 frames: it could not be written; the broken file is removed")


def test_a_recorder_serves_a_second_run(tmp_path: Path, bars: FlyingBars):
    recorder = record(tmp_path / "a.rrd", bars)
    recorder.start(bars.info)
    recorder.frame(bars.frame(0))
    recorder.finish(True)
    assert recorder.frame_count == 1
    assert list(rows(tmp_path / "a.rrd", "/legend/ticks", "Points2D:labels"))  # they come with the first frame


def test_names_stay_apart(tmp_path: Path, bars: FlyingBars):
    surfaces = dict(zip(("rod 1", "rod_1", "contact points"), [*bars.info.surfaces.values()] * 2, strict=False))
    bars.info = dataclasses.replace(bars.info, surfaces=surfaces)
    record(tmp_path / "a.rrd", bars)
    for entity in ("/world/rod_1", "/world/rod_1_", "/world/contact_points_"):
        assert len(list(rows(tmp_path / "a.rrd", entity, "Mesh3D:vertex_positions"))) == FRAMES


def test_a_viewer_that_cannot_open_is_a_warning(tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch):
    from warp_mca.recorders import rerun_viewer

    monkeypatch.setattr(rerun_viewer, "command", lambda *arguments: [sys.executable, "-c", "raise SystemExit(1)"])
    record(tmp_path / "both.rrd", bars, viewer=True)
    (warning,) = bars.said
    assert "viewer did not open" in warning
    assert len(list(rows(tmp_path / "both.rrd", "/world/lower", "Mesh3D:vertex_positions"))) == FRAMES


def test_a_viewer_that_never_answers_is_a_warning(tmp_path: Path, bars: FlyingBars, monkeypatch: pytest.MonkeyPatch):
    from warp_mca.recorders import rerun_viewer

    silent = "import socket, sys, time; s = socket.create_server(('127.0.0.1', int(sys.argv[1]))); time.sleep(60)"
    monkeypatch.setattr(rerun_viewer, "command", lambda *a: [sys.executable, "-c", silent, a[a.index("--port") + 1]])
    monkeypatch.setattr(rerun_viewer, "FLUSH_TIMEOUT", 1.0)
    recorder = RerunStream(tmp_path / "both.rrd", viewer=True)
    recorder.start(bars.info)
    viewer = recorder.viewer
    assert viewer is not None
    try:
        for index in range(FRAMES):
            recorder.frame(bars.frame(index))
        recorder.finish(True)
        (warning,) = bars.said
        assert "viewer" in warning
    finally:
        viewer.process.kill()
    assert len(list(rows(tmp_path / "both.rrd", "/world/lower", "Mesh3D:vertex_positions"))) == FRAMES


def test_view_finds_the_newest_recording(tmp_path: Path):
    for age, name in ((20, "old.rrd"), (10, "new.rrd")):
        (tmp_path / name).write_bytes(b"")
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    assert recording_in(tmp_path).name == "new.rrd"
    assert recording_in(tmp_path / "old.rrd").name == "old.rrd"
    with pytest.raises(RequestError, match="--rrd"):
        recording_in(tmp_path / "nothing")
