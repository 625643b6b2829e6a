"""Finite elements from the release on: as rigid links until the touch, and the same bits after any interruption."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.phases import flexible_swing
from warp_mca.phases.checkpoint import FILE, Checkpoint
from warp_mca.phases.every import Every
from warp_mca.recorders import SnapshotFile

SCENE = '''"""A short, coarse rod that turns fast strikes a plate 1.1 ms after its release."""
from dataclasses import replace
import warp_mca as mca

COARSE = {
    "section": 2, "ring": 1, "axial": 4, "focus_layers": 2, "focus_size": 2.2e-3, "output_interval": 2e-6,
    "plate_core": 2, "plate_core_depth": 1, "plate_layers": 2, "plate_extension": 2,
}

def build() -> mca.Scene:
    made = mca.make_scene("single_link", theta=46.6, **COARSE)
    impact = replace(made.impact, duration=1.2e-4)
    end = mca.Probe(name="end", body="OA", nodes="tip")
    middle = mca.Section(name="middle", body="OA", at=(0.1, 0.0, 0.0), normal=(1.0, 0.0, 0.0))
    rigid = replace(made.rigid, theta_dot=(-10.0,))
    return replace(made, rigid=rigid, impact=impact, probes=(end,), sections=(middle,))
'''
BLOCK, INTERVAL, COMMAND = 2, 2e-6, ["run", "scene.py", "--method", "pure-fem", "--checkpoint", "1", "--out", "out"]
KILLED = """
import os, signal, sys
from warp_mca.cli.main import main
from warp_mca.phases import flexible_swing
from warp_mca.phases.checkpoint import Checkpoint

flexible_swing.BLOCK, store, count = 2, Checkpoint.store, []

def store_and_die(self, impact, place, more=None):
    store(self, impact, place, more)
    count.append(place)
    if len(count) == 3:
        os.kill(os.getpid(), signal.SIGKILL)

Checkpoint.store = store_and_die
main(sys.argv[1:])
"""


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_figures: None) -> None:
    """An empty folder with the scene, and blocks so short that a swing has several."""
    (tmp_path / "scene.py").write_text(SCENE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(flexible_swing, "BLOCK", BLOCK)


@cache
def scene() -> mca.Scene:
    names: dict[str, Any] = {}
    exec(SCENE, names)
    line = mca.Line(body="OA", start=(0.05, 0.0, 0.0), end=(0.15, 0.0, 0.0))
    return replace(
        names["build"](),
        paths=(mca.Path(name="axis", lines=(line,), spacing=0.05),),
    )


@cache
def whole() -> mca.Result:
    """A run that was never interrupted."""
    return mca.run(scene(), method="pure-fem", threads=1)


def test_links_of_finite_elements_move_as_rigid_ones_until_they_touch():
    pure, two = whole(), mca.run(scene(), threads=1)
    a, b = pure.summary, two.summary
    assert a["t_contact"] == pytest.approx(b["t_contact"], abs=2 * INTERVAL)
    assert (a["v_n"], a["v_t"]) == pytest.approx((b["v_n"], b["v_t"]), rel=2e-3)
    assert 0.0 < a["configuration_error"] < 1e-5
    assert [t for t, _ in a["configuration"]] == pytest.approx(2e-4 * np.arange(1, len(a["configuration"]) + 1))
    impulses = [r.F_n[r.time > 0.0].sum() * INTERVAL for r in (pure, two)]
    assert impulses[0] == pytest.approx(impulses[1], rel=0.02)
    assert a["F_n_max"] == pytest.approx(b["F_n_max"], rel=0.02) and a["dt"] == pytest.approx(b["dt"], rel=1e-9)
    assert a["energy_error"] < 1e-3 and a["n_steps"] > 5 * b["n_steps"]


def test_the_history_is_coarse_in_the_swing_and_fine_from_shortly_before_the_touch():
    result = whole()
    step = np.diff(result.time)
    fine = int(np.argmax(step < 1e-5))
    assert step[:fine] == pytest.approx(1e-4) and step[fine:] == pytest.approx(INTERVAL)
    touch = int(np.argmax(result.F_n > 0.0))
    assert result.time[touch - 1] == pytest.approx(0.0, abs=1e-12) and touch - 1 >= fine
    assert result.time[0] == pytest.approx(-result.summary["t_contact"]) and not result.F_n[:touch].any()
    assert result.time[-1] == pytest.approx(1.2e-4)
    assert result.impact().time[0] == pytest.approx(0.0, abs=1e-12)
    assert len(result.contacts[0].pressure) == len(result.paths[0].stress) == len(result.time)
    (end,), (middle,) = result.probes, result.sections
    way = np.cumsum(0.5 * (end.velocity[1:] + end.velocity[:-1]) * np.diff(end.time)[:, None], axis=0)
    assert end.position[1:] == pytest.approx(end.position[0] + way, abs=1e-5) and len(middle.force) == len(result.time)
    gravity = result["E_kinetic"] - result["E_kinetic"][0]
    assert gravity[1:touch] == pytest.approx(gravity[touch - 1] * (result.time[1:touch] / -result.time[0] + 1), rel=0.1)


def test_phases_add_up():
    summary = whole().summary
    swing, impact = summary["phases"]
    assert (swing["kind"], swing["ended_by"], impact["kind"]) == ("swing", "touch", "impact")
    assert swing["end"] == impact["start"] == summary["t_contact"]
    assert impact["end"] - impact["start"] == pytest.approx(1.2e-4)
    assert impact["end"] == pytest.approx(summary["simulated_time"])
    given = summary["energy"]["initial"] + swing["energy"]["external_work"]
    assert swing["energy"]["kinetic"] + swing["energy"]["elastic"] == pytest.approx(given, rel=1e-4)
    assert swing["energy"]["plastic"] == 0.0 < impact["energy"]["friction"]
    two = mca.run(scene(), threads=1).summary["joint_impulse"]["O"]
    assert summary["joint_impulse"]["O"][:2] == pytest.approx(two[:2], rel=0.1)


def equal(result: mca.Result) -> None:
    """What was interrupted is the same as what was not, but for the time that it took."""
    expected = whole()
    assert all(np.array_equal(result[name], expected[name], equal_nan=True) for name in expected.history)
    assert np.array_equal(result.contacts[0].force, expected.contacts[0].force)
    assert np.array_equal(result.probes[0].position, expected.probes[0].position)
    assert np.array_equal(result.sections[0].moment, expected.sections[0].moment)
    other = ("wall", "phases", "element_steps_per_s")
    other += ("parameters", "wave_speeds", "path_headings")  # a file has no parameters and no paths
    for name, value in json.loads(json.dumps(expected.summary)).items():
        assert name in other or result.summary[name] == value, name


def test_the_same_command_goes_on_after_a_kill(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    paths = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run([sys.executable, "-c", KILLED, *COMMAND], env=os.environ | {"PYTHONPATH": paths}, check=False)
    assert done.returncode == -signal.SIGKILL
    assert [file.name for file in Path("out").iterdir()] == [FILE]

    places, store = [], Checkpoint.store

    def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
        store(self, impact, place, more)
        places.append(place)
        if place["stretches"] and len(places) > 3:
            raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "store", store_and_stop)
        assert main(COMMAND) == 130
    assert "the same command goes on" in capsys.readouterr().err
    assert not places[0]["stretches"] and len(places[0]["running"]) == 4  # three of the run that was killed
    assert main(["resume", "out"]) == 0
    assert not Path("out", FILE).exists()
    equal(mca.load("out"))


@pytest.mark.parametrize(
    ("change", "arguments", "words"),
    [
        ({"rigid": None}, {}, "without a rigid phase"),
        ({"t_end": 1.0}, {}, "leave t_end out"),
        ({"contacts": ()}, {}, "no link can touch"),
        ({}, {"recorders": [SnapshotFile("a.png", time=0.0)]}, "leave recorders out"),
        (
            {},
            {"method": "mca", "checkpoint": Every.parse("10"), "recorders": [SnapshotFile("a.png", time=0.0)]},
            "= '10': recordings",
        ),
        ({}, {"checkpoint": "30w"}, "name one by out"),
        ({}, {"checkpoint": "fast"}, "2e-5s"),
        ({}, {"method": "fem"}, "choose mca or pure-fem"),
    ],
)
def test_what_cannot_be_run_is_refused(change: dict[str, Any], arguments: dict[str, Any], words: str):
    with pytest.raises(mca.RequestError, match=words):
        mca.run(replace(scene(), **change), threads=1, **{"method": "pure-fem", **arguments})


def test_links_that_touch_nothing_in_time_are_an_error(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(flexible_swing, "LATEST", (0.3, 0.0))
    with pytest.raises(mca.GuardError, match=r"nothing touched until t = .* rigid links touch at 0\.001"):
        mca.run(scene(), method="pure-fem", threads=1)
