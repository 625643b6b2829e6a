"""Runs of machines through swings and impacts in turn, and what recorders see of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import pytest
from rrd import rows
from test_recording import Memory

import warp_mca as mca
from warp_mca.recorders import Cadence, RerunStream, UsdFile
from warp_mca.recorders.recorder import CONTACT, SURFACE, VOLUME
from warp_mca.verify.machines import robot

pytest.importorskip("mujoco")

STEEL = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, E_t=1e9)
# A pendulum whose head, of finite elements, falls on an anvil. Its handle is drawn only, the plate on it is hidden.
HAMMER = """<mujoco><compiler angle="radian"/><worldbody>
  <geom name="anvil" type="box" pos="0.3 0 -0.05" size="0.1 0.1 0.05"/>
  <body name="handle" pos="0 0 0.02"><joint name="pivot" axis="0 -1 0"/>
    <geom type="capsule" fromto="0.02 0 0 0.28 0 0" size="0.005" mass="0.1" contype="0" conaffinity="0"/>
    <geom type="box" size="0.2 0.2 0.2" mass="0" contype="0" conaffinity="0" group="3"/>
    <body name="head" pos="0.29 0 0"><geom type="box" size="0.012 0.012 0.012" mass="0.3"/></body>
  </body></worldbody></mujoco>"""
HEAD = mca.Box(size=(0.02, 0.02, 0.02), divisions=(3, 3, 3), origin=(-0.01, -0.01, -0.015))
ANGLE, LENGTH, T_END = 0.12, 0.29, 0.3
IMPACT = mca.ImpactPhase(duration=8e-4, output_interval=1e-5)
STRIKE = {"impact": IMPACT, "precision": "mixed", "threads": 1}


@cache
def filmed():
    """The run, frames of all phases, and the folder of its files."""
    folder = Path(mkdtemp())
    flexible = {"flexible": {"head": HEAD}, "material": STEEL, "mounts": {"head": "zmax"}}
    machine = robot(HAMMER, folder, qpos={"pivot": ANGLE}, **flexible)
    film = Memory(SURFACE, CONTACT, VOLUME, cadence=Cadence(frames=9))
    few = Cadence(frames=3)
    files = [RerunStream(folder / "a.rrd", cadence=few), UsdFile(folder / "a.usdc", cadence=few)]
    return machine, machine.run(t_end=T_END, recorders=[film, *files], **STRIKE), film, folder


def head_of(frame):
    return frame.points["head"].astype(float).mean(axis=0)


def at(angle: float, place: np.ndarray) -> np.ndarray:
    """Where a point of the head's frame is at an angle of the pivot."""
    turned = np.array([[np.cos(angle), 0, -np.sin(angle)], [0, 1, 0], [np.sin(angle), 0, np.cos(angle)]])
    return np.array([0, 0, 0.02]) + turned @ (np.array([LENGTH, 0, 0]) + place)


def test_links_are_drawn_where_the_swing_has_them():
    _, run, film, _ = filmed()
    assert sorted(film.info.surfaces) == ["handle", "head", "world"]
    reach = np.ptp(film.frames[0].points["handle"], axis=0)
    assert np.linalg.norm(reach[[0, 2]]) == pytest.approx(0.26 + 0.01, rel=0.02)  # without the hidden plate
    place = HEAD.build().points[np.unique(HEAD.build().boundary[0])].mean(axis=0)
    first, last = film.frames[0], film.frames[-1]
    assert head_of(first) == pytest.approx(at(ANGLE, place), abs=1e-6)
    assert head_of(last) == pytest.approx(at(float(run.swings[-1].qpos_t[-1, 0]), place), abs=1e-6)
    assert first.time == pytest.approx(-run.starts[0]) and last.time == pytest.approx(T_END - run.starts[0])
    assert all(np.array_equal(first.points["world"], frame.points["world"]) for frame in film.frames)


def test_frames_go_on_from_phase_to_phase():
    """No jump where an impact begins or ends; velocities are those of the motion."""
    _, run, film, _ = filmed()
    times = np.array([frame.time for frame in film.frames])
    assert run.stopped is None and len(run.impacts) >= 1 and len(run.swings) == len(run.impacts) + 1
    assert (np.diff(times) > 0.0).all() and ((times >= 0.0) & (times <= IMPACT.duration)).sum() >= 9
    top = 3.5  # m/s, of the head's outermost node
    for one, two in zip(film.frames, film.frames[1:], strict=False):
        for name in film.info.surfaces:
            way = np.linalg.norm(two.points[name].astype(float) - one.points[name], axis=1).max()
            assert way <= top * (two.time - one.time) + 1e-6
    nodes = film.info.surfaces["head"].nodes
    speed = lambda frame: np.linalg.norm(frame.volume.velocity[nodes].mean(axis=0))  # noqa: E731
    touch = run.swings[0].touch
    before = next(frame for frame in film.frames if frame.time == pytest.approx(0.0, abs=1e-9))
    assert speed(before) == pytest.approx(np.linalg.norm(touch.velocity), rel=0.1)
    handle = film.info.surfaces["handle"].nodes
    assert np.linalg.norm(before.volume.velocity[handle], axis=1).max() == pytest.approx(speed(before), rel=0.1)


def test_stress_is_shown_in_the_impact_alone():
    _, _, film, _ = filmed()
    during = [frame for frame in film.frames if 0.0 < frame.time < IMPACT.duration]
    assert max(frame.von_mises["head"].max() for frame in during) > 1e7
    assert not any(frame.von_mises["handle"].any() for frame in film.frames)
    assert not any(frame.von_mises["head"].any() for frame in film.frames if frame.time < 0.0)
    assert any(len(frame.contact_points) for frame in during)
    told = np.concatenate([part["time_s"] for part in film.rows])
    assert (np.diff(told) > 0.0).all()


def test_the_impact_is_that_of_strike_and_run():
    machine, run, _, _ = filmed()
    alone = mca.run(machine.strike(impact=IMPACT), threads=1)
    assert np.array_equal(alone.F_n, run.impacts[0].F_n)


def test_files_hold_all_phases():
    from pxr import Usd, UsdGeom

    _, run, _, folder = filmed()
    found = list(rows(folder / "a.rrd", "/world/handle", "Mesh3D:vertex_positions"))
    steps = [step for _, step, _ in found]
    assert not run.failed and len(set(steps)) >= 3 * 3 - 2 and min(steps) < 0 < max(steps)
    stage = Usd.Stage.Open(str(folder / "a.usdc"))
    points = UsdGeom.Mesh(stage.GetPrimAtPath("/World/head")).GetPointsAttr()
    assert len(points.GetTimeSamples()) == len(set(steps))


def test_what_cannot_be_run_is_refused(tmp_path):
    machine = robot(HAMMER, tmp_path)
    with pytest.raises(mca.RequestError, match="give stiffness, mu, fixed, faces and name"):
        machine.run(t_end=0.1, impact=IMPACT, swing=None)
    with pytest.raises(mca.RequestError, match="t_end"):
        machine.run(t_end=-1.0, impact=IMPACT)
