"""A phase before the impact from outside the package: viscous damping at a given rate for a given time."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from test_recording import Memory
from test_settle import GAP, SPEED, WEIGHT, scene

import warp_mca as mca
from warp_mca.phases.half_steps import HalfSteps
from warp_mca.phases.impact import Impact
from warp_mca.phases.stretch import Stretch, stretch_ended
from warp_mca.scene import model_file

LOOK = 10  # steps


@dataclass(frozen=True, kw_only=True)
class Viscous:
    """Bodies at rest are damped with v' = -rate v [1/s] for a time [s]."""

    rate: float
    time: float

    def advance(self, impact: Impact, tell: Callable[[float], None]) -> Stretch:
        """Damp every `LOOK` steps."""
        fine, motion = impact.steps, HalfSteps(impact)
        motion.slow(0.0)
        steps = round(self.time / (LOOK * fine.dt)) * LOOK
        while impact.state.steps < steps:
            impact.advance(until=impact.state.steps + LOOK)
            motion.look()
            motion.slow(math.exp(-self.rate * LOOK * fine.dt))
            tell(impact.state.steps / steps)
        motion.rest(fine.per_interval - 1)
        stretch = stretch_ended(impact, "viscous", "time", fine)
        motion.release(impact.scene_runs[0])
        return stretch


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    register(Viscous)


def damped() -> mca.Scene:
    return replace(scene(), phases=(Viscous(rate=4e4, time=5e-4),))


def test_weight_and_ledger_are_those_of_bodies_at_rest():
    film = Memory("surface")
    result = mca.run(damped(), precision="float64", threads=1, recorders=[film])
    first, struck = int(np.argmax(result.time > -1e-12)), int(np.argmax(result.contacts[1].pressure > 0.0))
    assert result.contacts[0].pressure[first:struck] == pytest.approx(WEIGHT, rel=0.01)
    assert result.time[struck] == pytest.approx(GAP / SPEED, abs=2e-6)
    assert result.summary["energy_error"] < 1e-4 and result.summary["energy"]["damping"] > 0.0
    assert [phase["kind"] for phase in result.summary["phases"]] == ["viscous", "impact"]
    assert film.frames[0].time == 0.0 and len(film.frames) == 5  # recorders see the impact
    assert len(np.concatenate([rows["time_s"] for rows in film.rows])) == (result.time > -1e-12).sum()


def test_a_model_file_holds_it(tmp_path: Path):
    made = damped()
    model_file.save(tmp_path / "a.mca", made, mca.mesh(made))
    assert model_file.load(tmp_path / "a.mca").scene == made
