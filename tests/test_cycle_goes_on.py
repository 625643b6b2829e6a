"""A run of swings and impacts that is stopped anywhere goes on to the same bits."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_cycle import COARSE

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.phases.checkpoint import ENDED, FILE, Checkpoint
from warp_mca.phases.swing_driver import SwingDriver

SCENE = f'''"""A coarse rod strikes a plate, and strikes it again."""
import warp_mca as mca

def build() -> mca.Scene:
    return mca.make_scene("single_link", t_end=0.5, **{COARSE!r})
'''
COMMAND = ["run", "scene.py", "--duration", "1.5e-3", "--checkpoint", "2e-4s", "--out", "out", "--threads", "1"]
KILLED = """
import os, signal, sys
from warp_mca.cli.main import main
from warp_mca.phases.checkpoint import Checkpoint

store, count = Checkpoint.store, []

def store_and_die(self, impact, place, more=None):
    store(self, impact, place, more)
    count.append(place)
    if len(count) == 2:
        os.kill(os.getpid(), signal.SIGKILL)

Checkpoint.store = store_and_die
main(sys.argv[1:])
"""


class StoppedError(Exception):
    pass


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, no_figures: None) -> None:
    """An empty folder with the scene."""
    (tmp_path / "scene.py").write_text(SCENE, encoding="utf-8")
    monkeypatch.chdir(tmp_path)


def scene() -> mca.Scene:
    return mca.make_scene("single_link", t_end=0.5, **COARSE)


def test_a_run_that_is_stopped_again_and_again_goes_on_to_the_same_bits(monkeypatch: pytest.MonkeyPatch):
    """Killed within an impact, stopped within the swing behind it and within the next impact."""
    paths = os.pathsep.join(filter(None, sys.path))
    done = subprocess.run([sys.executable, "-c", KILLED, *COMMAND], env=os.environ | {"PYTHONPATH": paths}, check=False)
    assert done.returncode == -signal.SIGKILL
    assert [file.name for file in Path("out").iterdir()] == [FILE]

    def stop(*_: Any) -> None:
        raise StoppedError

    with monkeypatch.context() as patch:
        patch.setattr(SwingDriver, "run", stop)  # the first swing is another function
        with pytest.raises(StoppedError):
            main(["resume", "out"])
    assert [file.name for file in Path("out").iterdir()] == [ENDED.format(1)]

    places, store = [], Checkpoint.store

    def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
        store(self, impact, place, more)
        places.append(place)
        if len(places) == 2:
            raise StoppedError

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "store", store_and_stop)
        with pytest.raises(StoppedError):
            main(COMMAND)
    assert places == 2 * [{"impact": 2}]
    assert sorted(file.name for file in Path("out").iterdir()) == [ENDED.format(1), FILE]
    with pytest.raises(mca.RequestError, match="another request"):
        mca.run(scene(), duration=1.5e-3, threads=1, checkpoint="2e-4s", out="out", precision="float64")
    assert main(["resume", "out"]) == 0
    assert not [file for file in Path("out").iterdir() if "checkpoint" in file.name]

    result, expected = mca.load("out"), mca.run(scene(), duration=1.5e-3, threads=1)
    assert all(result[name].tobytes() == expected[name].tobytes() for name in expected.history)
    assert np.array_equal(result.contacts[0].force, expected.contacts[0].force)
    for name, value in json.loads(json.dumps(expected.summary)).items():
        if name not in ("wall", "element_steps_per_s", "parameters"):
            assert result.summary[name] == value, name
