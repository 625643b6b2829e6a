"""Output intervals of many steps, which are captured in parts."""

from __future__ import annotations

import numpy as np
import pytest
from test_recording import Memory, bar

import warp_mca as mca
from warp_mca.recorders.recorder import SURFACE
from warp_mca.step.replay import Replay


@pytest.mark.parametrize("recorded", [False, True])
def test_parts_of_an_interval_give_the_same_bits(monkeypatch: pytest.MonkeyPatch, recorded: bool):
    scene = bar(impact=mca.ImpactPhase(duration=3e-5, output_interval=1e-5))

    def run() -> mca.Result:
        return mca.run(scene, threads=1, recorders=[Memory(SURFACE)] if recorded else [])

    whole = run()
    assert whole.summary["n_steps"] > 3 * 7
    monkeypatch.setattr(Replay, "most", lambda self, state, count, substeps, needs=(): 7)
    parts = run()
    for name, column in whole.history.items():
        np.testing.assert_array_equal(column, parts[name], err_msg=name)
