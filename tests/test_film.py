"""Recorders in a run of swings and impacts: frames of all phases, and the same run with and without them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rrd import rows
from test_cycle import COARSE
from test_recording import Memory

import warp_mca as mca
from warp_mca.recorders import AnimationFile, Cadence, FinalState, RerunStream, SnapshotFile, UsdFile, VtkHdfFile
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE, VOLUME

FRAMES = 6


def scene() -> mca.Scene:
    return mca.make_scene("single_link", t_end=0.5, **COARSE)


@cache
def filmed() -> tuple[mca.Result, Memory, Memory]:
    """Two impacts with swings around them, with a few frames of each and with one at a time of each kind of phase."""
    film = Memory(SURFACE, CONTACT, PATHS, VOLUME, cadence=Cadence(frames=FRAMES))
    impacts = [1e-5, 0.1]  # within the first impact and the swing behind it [s]
    looks = Memory(SURFACE, VOLUME, cadence=Cadence(times=(*impacts, 0.2)))
    return mca.run(scene(), duration=1.5e-3, threads=1, recorders=[film, looks]), film, looks


def spans() -> list[tuple[str, float, float]]:
    """Kind, start and end of each phase after first contact [s]."""
    summary = filmed()[0].summary
    return [(p["kind"], p["start"] - summary["t_contact"], p["end"] - summary["t_contact"]) for p in summary["phases"]]


def test_a_run_is_the_same_with_and_without_recorders():
    alone, (result, film, _) = mca.run(scene(), duration=1.5e-3, threads=1), filmed()
    assert all(alone[name].tobytes() == result[name].tobytes() for name in alone.history)
    assert film.ended is True
    told = {name: np.concatenate([part[name] for part in film.rows]) for name in result.history}
    assert all(np.array_equal(told[name], result[name], equal_nan=True) for name in result.history)


def test_each_phase_has_its_frames():
    _, film, _ = filmed()
    times = np.array([frame.time for frame in film.frames])
    assert [frame.index for frame in film.frames] == list(range(len(film.frames)))
    assert (np.diff(times) > 0.0).all() and (np.diff([frame.step for frame in film.frames]) > 0).all()
    for kind, start, end in spans():
        own = times[(times >= start - 1e-9) & (times <= end + 1e-9)]
        assert len(own) >= FRAMES - 2 if kind == "rigid" else len(own) >= 2
    assert times[0] == pytest.approx(spans()[0][1]) and times[-1] == pytest.approx(spans()[-1][2])


def test_frames_show_one_motion():
    """Skins, displacements and velocities agree, also from one phase to the next."""
    _, film, looks = filmed()
    X = film.info.model.X
    for frame in film.frames + looks.frames:
        assert frame.volume is not None
        for body, surface in film.info.surfaces.items():
            moved = X[surface.nodes] + frame.volume.displacement[surface.nodes]
            assert frame.points[body] == pytest.approx(moved, abs=2e-7)
    first, second = (min(film.frames, key=lambda frame: abs(frame.time - t)) for t in (spans()[1][2], spans()[2][2]))
    assert first.volume and second.volume
    hinge = film.info.surfaces["OA"].nodes
    assert np.linalg.norm(first.volume.displacement[hinge], axis=1).min() < 1e-3  # the hinge stays where it is
    assert np.linalg.norm(second.volume.displacement[hinge], axis=1).min() < 1e-3


def test_velocities_are_those_of_the_motion():
    _, film, _ = filmed()
    swing = [frame for frame in film.frames if frame.time < 0.0]
    assert len(swing) >= FRAMES - 2
    at = film.info.surfaces["OA"].nodes
    first = swing[0]
    assert first.volume and not first.volume.velocity.any() and not first.volume.von_mises.any()
    speed = [float(np.linalg.norm(frame.volume.velocity[at], axis=1).max()) for frame in swing if frame.volume]
    assert (np.diff(speed) > 0.0).all() and speed[-1] == pytest.approx(2.0, rel=0.6)


def test_what_an_impact_leaves_is_seen_in_the_swing_behind_it():
    _, film, looks = filmed()
    assert [frame.time for frame in looks.frames] == pytest.approx([1e-5, 0.1, 0.2], abs=5e-3)
    hit, after, later = (frame.volume for frame in looks.frames)
    assert hit and after and later
    assert hit.von_mises.max() > 1e6
    assert 0.0 < after.plastic_strain.max() == later.plastic_strain.max()
    assert np.array_equal(after.von_mises, later.von_mises)
    s = later.stress.astype(float)
    again = np.sqrt(
        0.5 * ((s[:, 0] - s[:, 1]) ** 2 + (s[:, 1] - s[:, 2]) ** 2 + (s[:, 2] - s[:, 0]) ** 2)
        + 3.0 * (s[:, 3:] ** 2).sum(axis=1)
    )
    assert again == pytest.approx(later.von_mises, abs=1e-4 * float(later.von_mises.max()))
    assert not np.array_equal(after.stress, later.stress)  # it turns with the body
    assert not any(len(frame.contact_points) for frame in film.frames if frame.time < 0.0)


def test_files_hold_the_frames_of_all_phases(tmp_path: Path):
    cadence = Cadence(frames=4)
    film = Memory(SURFACE, cadence=cadence)
    files: list[Any] = [
        RerunStream(tmp_path / "a.rrd", cadence=cadence),
        UsdFile(tmp_path / "a.usdc", cadence=cadence),
        VtkHdfFile(tmp_path / "a.vtkhdf", cadence=cadence),
        AnimationFile(tmp_path / "a.gif", cadence=cadence),
        SnapshotFile(tmp_path / "a.png", time=0.03),
        FinalState(tmp_path / "a.vtu"),
    ]
    result = mca.run(mca.make_scene("single_link", t_end=0.2, **COARSE), duration=1.5e-3, recorders=[film, *files])
    assert not result.failed and all((tmp_path / f"a.{kind}").exists() for kind in ("gif", "png", "vtu"))
    count = len(film.frames)
    assert count >= 6
    seen = {step for _, step, _ in rows(tmp_path / "a.rrd", "/world/OA", "Mesh3D:vertex_positions")}
    assert seen == {frame.step for frame in film.frames}

    from pxr import Usd, UsdGeom
    from vtkmodules.vtkIOHDF import vtkHDFReader

    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/World/OA")).GetPointsAttr()
    assert len(points.GetTimeSamples()) == count
    reader = vtkHDFReader()
    reader.SetFileName(str(tmp_path / "a.vtkhdf"))
    reader.Update()
    assert reader.GetNumberOfSteps() == count


def test_a_time_that_the_run_does_not_reach_is_refused(tmp_path: Path):
    with pytest.raises(mca.RequestError, match="the run ends at"):
        mca.run(scene(), recorders=[SnapshotFile(tmp_path / "a.png", time=0.5)])


def test_a_run_that_fails_closes_its_recorders(monkeypatch: pytest.MonkeyPatch):
    from warp_mca.phases import impact_driver

    def fail(*_: Any) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(impact_driver, "return_to_rigid", fail)
    film = Memory(SURFACE)
    with pytest.raises(KeyboardInterrupt):
        mca.run(mca.make_scene("single_link", t_end=0.2, **COARSE), duration=1e-3, recorders=[film])
    assert film.ended is False and film.frames
