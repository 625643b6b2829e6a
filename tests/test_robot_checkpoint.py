"""A robot's run that is stopped in swings and impacts goes on to the same bits."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.phases.checkpoint import ENDED, FILE, Checkpoint
from warp_mca.recorders import AnimationFile
from warp_mca.verify.machines import robot

pytest.importorskip("mujoco")
pytestmark = pytest.mark.usefixtures("no_figures")

HAMMER = """<mujoco><compiler angle="radian" autolimits="true"/><worldbody>
  <geom name="anvil" type="plane" size="1 1 1"/>
  <body name="hammer" pos="0 0 0.02"><joint name="pivot" axis="0 -1 0" damping="0.01" range="-1 2"/>
    <geom name="head" type="sphere" pos="0.3 0 0" size="0.02" mass="0.5"/></body></worldbody>
  <actuator><position name="servo" joint="pivot" kp="5" kv="0.1" forcerange="-2 2"/></actuator></mujoco>"""
IMPACT = mca.ImpactPhase(duration=1e-3, output_interval=2e-5)


class StoppedError(Exception):
    pass


def run(folder: Path, stop: int = 0, **kept: Any):
    """Two strikes of a hammer whose controller keeps a sum; its call number `stop` stops the run."""
    total = [0.0, 0]

    def control(t: float, q: Any, v: Any) -> list[float]:
        total[0] += float(q[0])
        total[1] += 1
        if total[1] == stop:
            raise KeyboardInterrupt
        return [-0.2 - 0.01 * total[0]]

    machine = robot(HAMMER, folder, qpos={"pivot": 0.3}, controller=control, period=0.01)
    return machine.run(t_end=0.4, impact=IMPACT, stiffness=1e7, faces=8, threads=1, precision="float64", **kept)


def test_a_run_that_is_stopped_anywhere_goes_on_to_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    whole, out = run(tmp_path), tmp_path / "out"
    assert len(whole.impacts) >= 2 and whole.stopped is None
    kept = {"out": out, "checkpoint": "2e-4s"}
    store, count = Checkpoint.store, [0]

    def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
        store(self, impact, place, more)
        count[0] += 1
        if count[0] == 2:
            raise StoppedError

    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, 3, **kept)  # in the first swing
    with monkeypatch.context() as patch, pytest.raises(StoppedError):
        patch.setattr(Checkpoint, "store", store_and_stop)
        run(tmp_path, **kept)  # in the first impact
    assert (out / FILE).exists()
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, 2 + int(whole.starts[0] / 0.01) + 2, **kept)  # in the second swing
    assert [path.name for path in out.glob("*.npz")] == [ENDED.format(1)]
    found = run(tmp_path, **kept)
    assert not list(out.iterdir())
    for one, other in zip(whole.swings, found.swings, strict=True):
        assert np.array_equal(one.qpos_t, other.qpos_t) and np.array_equal(one.qvel, other.qvel)
    for one, other in zip(whole.impacts, found.impacts, strict=True):
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.history)
        assert {**one.summary, "wall": 0} == {**other.summary, "wall": 0}


def test_what_cannot_go_on_is_refused(tmp_path: Path):
    with pytest.raises(mca.RequestError, match="the state needs a folder; name one by out"):
        run(tmp_path, checkpoint="7")
    film = AnimationFile(tmp_path / "a.gif")
    with pytest.raises(mca.RequestError, match="recordings cannot be continued"):
        run(tmp_path, out=tmp_path / "out", recorders=[film])
    assert not (tmp_path / "out").exists()
