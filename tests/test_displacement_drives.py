"""Displacements over time: where driven nodes are at the times of the table, and the wave that they send."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impacts import finished, result_of
from outside import goes_on

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.0, rho=7800.0)
LENGTH, SPEED = 0.1, np.sqrt(210e9 / 7800.0)
TIMES, WAY = (2e-6, 12e-6, 20e-6), (0.0, 3e-6, 2e-6)


def driven(**table) -> mca.Scene:
    bar = mca.Box(size=(LENGTH, 0.002, 0.002), divisions=(100, 1, 1))
    return mca.Scene(
        name="driven",
        bodies=(mca.Body(name="bar", geometry=bar, material=STEEL),),
        prescribed=(mca.Prescribed(body="bar", nodes="xmin", axis="x", **table),),
        probes=(mca.Probe(name="end", body="bar", nodes="xmin"),),
        impact=mca.ImpactPhase(duration=24e-6, output_interval=2e-7),
    )


def test_nodes_are_where_the_table_has_them_and_their_wave_has_no_step():
    """Displacements at the times of the table; the strain behind is v / c of a curve without corners."""
    impact = finished(driven(times=TIMES, displacements=WAY), precision="float64")
    state, model = impact.state, impact.solver.model
    X, u = model.X[:, 0], state.u.numpy()[:, 0]
    t_end = state.steps * impact.solver.dt
    assert u[X == 0.0] == pytest.approx(np.full(4, WAY[-1]), rel=1e-5)
    for t, way in zip(TIMES[1:], WAY[1:], strict=True):  # the bar holds the history of its end
        x = np.unique(X)
        at = np.interp(SPEED * (t_end - t), x, [u[x_ == X].mean() for x_ in x])
        assert at == pytest.approx(way, abs=0.01 * WAY[1])
    energy = result_of(impact).summary["energy"]
    assert abs(energy["error"]) < 1e-4 * energy["external_work"]


def test_velocities_are_continuous_and_lead_to_the_displacements():
    drive = mca.Prescribed(body="bar", nodes="xmin", axis="x", times=TIMES, displacements=WAY)
    times, velocities = map(np.array, drive.velocity_table)
    way = np.append(0.0, np.cumsum(0.5 * np.diff(times) * (velocities[1:] + velocities[:-1])))
    assert np.interp(TIMES, times, way) == pytest.approx(WAY, abs=1e-15)
    assert velocities[0] == velocities[-1] == 0.0 and (np.diff(times) > 0.0).all()
    assert np.abs(np.diff(velocities)).max() < 0.35 * np.abs(velocities).max()
    assert (way > -1e-12).all() and way.max() < WAY[1] + 1e-12  # no overshoot
    turns = np.isclose(times, TIMES[1])
    assert velocities[turns] == pytest.approx(0.0)


@pytest.mark.parametrize("scale", [0.9, 0.37])
def test_short_pieces_of_a_table_of_velocities_move_nodes_by_their_integral(scale):
    """Pulses shorter than a step, and corners within one: the way at the end is the integral, whatever the step."""
    times = (0.0, 1.003e-6, 1.0035e-6, 1.004e-6, 5e-6, 5.0101e-6, 11.1e-6, 11.1001e-6)
    velocities = (0.0, 0.0, 9.0, 0.0, 2.0, -3.0, -3.0, 0.0)
    scene = driven(times=times, velocities=velocities)
    phase = mca.ImpactPhase(duration=12e-6, output_interval=2e-7, time_step_scale=scale)
    impact = finished(replace(scene, impact=phase), precision="float64")
    way = float(np.trapezoid(velocities, times))
    u = impact.state.u.numpy()[impact.solver.model.X[:, 0] == 0.0, 0]
    np.testing.assert_allclose(u, way, rtol=1e-12)
    energy = result_of(impact).summary["energy"]
    assert abs(energy["error"]) < 2e-3 * energy["external_work"]


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    goes_on(driven(times=TIMES, displacements=WAY), tmp_path)


@pytest.mark.parametrize(
    "table, words",
    [
        ({"times": (0.0,)}, r"Prescribed of bar.velocities = None: give either velocities or displacements"),
        ({"times": (0.0,), "velocities": (1.0,), "displacements": (0.0,)}, "give either velocities or displacements"),
        ({"times": (0.0, 1.0), "displacements": (1.0, 2.0)}, "begin with 0 at a time of 0 or later"),
        ({"times": (-1.0, 1.0), "displacements": (0.0, 2.0)}, "begin with 0 at a time of 0 or later"),
        ({"times": (0.0, 1.0), "displacements": (0.0,)}, "displacements = .*: give one value for each time"),
    ],
)
def test_tables_that_say_no_motion_are_refused(table: dict, words: str):
    with pytest.raises(mca.RequestError, match=words):
        driven(**table)
