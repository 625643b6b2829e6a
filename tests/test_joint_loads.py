"""Owns the tests of what acts in a chain during an impact: torques, friction and damping in joints, a base that moves
or slides. Closed forms, the rigid phase that goes on in their place, energy, and states that go on to the same bits."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chains import BASE, SPAN, START, TORQUE, bars, impact, motion_at_end, ready, rigid_end
from impacts import SHORT_RANGES, momentum

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.model.assembly import Assembly
from warp_mca.model.batch_model import join_models
from warp_mca.phases.impact import Impact
from warp_mca.physics.loads.joint_loads import hinge_loads
from warp_mca.rigid.loads import Table
from warp_mca.rigid.swing import swing_until
from warp_mca.scenes import single_link

SLIDE = mca.Slide(direction=(0.8, 0.6, 0.0), carriage_mass=0.3, velocity=0.5)
FRICTION = {"joint_friction": (0.2, 0.1), "joint_damping": (0.02, 0.01)}
ALL = {"torques": (TORQUE,), "base_motion": BASE, "slide": SLIDE, **FRICTION}
CLOSED = 1e-6  # share of the exchanged energy that its balance may miss


def constant(torque: float, joint: str = "O") -> mca.JointTorque:
    return mca.JointTorque(joint=joint, times=(0.0,), torques=(torque,))


def spin(found: Impact) -> float:
    """Angular momentum about z and the origin at the latest half step, arms of its beginning [kg m^2/s]."""
    model, state = found.solver.model, found.state
    v = state.v.numpy()
    x = model.X + state.u.numpy() - found.solver.dt * v
    return float(model.mass @ np.cross(x, v)[:, 2])


@pytest.mark.parametrize(
    "given",
    [{"torques": (TORQUE,)}, FRICTION, {"base_motion": BASE}, {"slide": SLIDE}, ALL],
    ids=["torque", "friction", "base", "slide", "all"],
)
def test_finite_elements_go_on_as_the_rigid_phase_would(given: dict):
    """Coordinates and rates at the end are as near as the vibration of the bars lets them; energy is closed."""
    found = impact(bars(theta_dot=(-3.0, 4.0), **given))
    found.advance()
    begin, ledger = found.ready[0].start, found.scene_runs[0].ledger
    end, back = rigid_end(begin), motion_at_end(found)
    chain = begin.chain
    plain = replace(chain, loads=None, slide=None)
    plain_end = swing_until(plain, chain.angles(begin.theta), chain.angles(begin.theta_dot), (), t_end=SPAN)
    near = 1e-4 * np.abs(end.theta_dot).max()
    assert np.abs(chain.angles(end.theta_dot) - plain_end.theta_dot).max() > 50.0 * near  # what is tested shows
    np.testing.assert_allclose(back.theta_dot, end.theta_dot, rtol=0.0, atol=near)
    np.testing.assert_allclose(back.theta, end.theta, rtol=0.0, atol=near * SPAN)
    assert ledger.exchange_error < CLOSED
    heat = ledger.energy()["joint"]
    assert heat == pytest.approx(end.work_t[-1, 1], rel=0.02) if end.work_t[-1, 1] else heat == 0.0


@pytest.mark.parametrize("joint", ["O", "A"])
def test_angular_momentum_grows_by_the_torque_on_the_ground_hinge_alone(joint: str):
    """Without gravity dL/dt = -tau about z: exact but for the rounding and the hinge's turn within a step."""
    found = impact(bars(gravity=0.0, torques=(constant(0.7, joint),)))
    before = spin(found)
    found.solver.step(found.state, 300)
    gained = -0.7 * 300 * found.solver.dt if joint == "O" else 0.0
    assert spin(found) - before == pytest.approx(gained, abs=1e-9 * abs(before))


def test_a_torque_follows_its_table_from_the_release_on():
    table = Table(np.array(TORQUE.times), np.array(TORQUE.torques))
    found = impact(bars(count=1, gravity=0.0, torques=(replace(TORQUE, joint="O"),)))
    before, count = spin(found), found.steps.count
    found.solver.step(found.state, count)
    dt = found.solver.dt
    torques = [float(table.at(START + n * dt)) for n in range(count)]
    assert spin(found) - before == pytest.approx(-dt * sum(torques), abs=1e-9 * abs(before))


def test_coulomb_friction_stops_a_bar_and_turns_its_energy_to_heat():
    """It stops after I w / tau, at the angle I w^2 / (2 tau); some of its energy is left in the bar's vibration."""
    scene = bars(count=1, elements=5, gravity=0.0, theta_dot=(1.0,), joint_friction=(0.5,), friction_rate=1e-3)
    found = impact(scene, start=0.0, span=8e-3)
    item = found.ready[0]
    inertia = float(item.start.chain.mass_matrix(item.start.theta)[0, 0])
    assert 5e-3 < inertia / 0.5 < 7e-3
    found.advance()
    energy, back = found.scene_runs[0].ledger.energy(), motion_at_end(found, 8e-3)
    assert abs(back.theta_dot[0]) < 0.05
    assert back.theta[0] - 1.0 == pytest.approx(inertia / (2.0 * 0.5), rel=0.02)
    assert energy["joint"] + energy["elastic"] + energy["kinetic"] == pytest.approx(energy["initial"], rel=CLOSED)
    assert 0.99 * energy["initial"] < energy["joint"] < energy["initial"]


def test_damping_slows_a_bar_exponentially():
    found = impact(bars(count=1, gravity=0.0, theta_dot=(1.0,), joint_damping=(1.0,)), start=0.0)
    item = found.ready[0]
    inertia = float(item.start.chain.mass_matrix(item.start.theta)[0, 0])
    found.advance()
    rate = motion_at_end(found, SPAN).theta_dot[0]
    assert rate == pytest.approx(math.exp(-SPAN / inertia), rel=0.01) and rate < 0.9


def test_hinge_nodes_move_as_the_base_does_and_its_work_is_counted():
    found = impact(bars(base_motion=BASE))
    model, table = found.solver.model, Table(np.array(BASE.times), np.column_stack([BASE.vx, BASE.vy]))
    nodes = model.joint_first[: found.ready[0].model.joints[0].end]
    np.testing.assert_allclose(model.V[nodes, :2], np.broadcast_to(table.at(START), (len(nodes), 2)), rtol=1e-14)
    found.advance(until=500)
    dt, v = found.solver.dt, found.state.v.numpy()[nodes]
    np.testing.assert_allclose(v[:, :2], np.broadcast_to(table.at(START + 499.5 * dt), (len(nodes), 2)), rtol=1e-12)
    assert not v[:, 2].any()
    way = table.integral(START + 500 * dt) - table.integral(START)
    np.testing.assert_allclose(found.state.u.numpy()[nodes, :2], np.broadcast_to(way, (len(nodes), 2)), rtol=1e-5)
    assert abs(found.scene_runs[0].ledger.energies()["external_work"][-1]) > 1e-4


@pytest.mark.parametrize("base", [None, replace(BASE, vy=(0.0, 0.0, 0.0))], ids=["at rest", "moving along"])
def test_a_slide_keeps_the_momentum_along_it(base: mca.BaseMotion | None):
    """The rail has no friction, so that its own motion along itself plays no part; the torque is between the links."""
    slide = replace(SLIDE, direction=(1.0, 0.0, 0.0))
    found = impact(bars(gravity=0.0, slide=slide, base_motion=base, torques=(constant(3.0, "A"),)))

    def along() -> float:
        return float(momentum(found)[0] + slide.carriage_mass * found.state.loads.carriage.numpy()[0, 0])

    before = along()
    found.solver.step(found.state, 500)
    assert along() == pytest.approx(before, rel=1e-12)
    nodes = found.solver.model.joint_first[: found.ready[0].model.joints[0].end]
    u, v = found.state.u.numpy()[nodes], found.state.v.numpy()[nodes]
    np.testing.assert_array_equal(v[:, 0], found.state.loads.carriage.numpy()[0, 0])
    assert not u[:, 1:].any() and np.ptp(u[:, 0]) < 1e-12 * abs(u[0, 0])


def test_a_carriage_falls_with_its_bars():
    """On a vertical slide: way, speed and work of gravity on bars and carriage in free fall."""
    slide = mca.Slide(direction=(0.0, -2.0, 0.0), carriage_mass=0.3)
    found = impact(bars(theta_dot=(0.0, 0.0), slide=slide), start=0.0)
    found.advance()
    back = motion_at_end(found, SPAN)
    np.testing.assert_allclose(back.theta[0], 0.5 * 9.8 * SPAN**2, rtol=1e-9)
    np.testing.assert_allclose(back.theta_dot, [9.8 * SPAN, 0.0, 0.0], atol=1e-11)
    energy = found.scene_runs[0].ledger.energy()
    mass = found.solver.model.mass.sum() + 0.3
    assert energy["kinetic"] == pytest.approx(0.5 * mass * (9.8 * SPAN) ** 2, rel=1e-6)  # less (g dt)^2 m / 8
    assert energy["external_work"] == pytest.approx(energy["kinetic"] - energy["initial"], rel=1e-9)


def test_torques_act_near_the_hinge_on_free_nodes():
    model = ready(bars(**FRICTION)).model
    inner, outer = ((load.inner, load.outer) for load in model.hinge_loads)
    assert len(inner[0]) == 0 and len(inner[1]) > 0
    for nodes in (*inner, *outer):
        assert not np.isin(nodes, [model.joint_first, model.joint_second]).any()
    hinge = model.X[model.joint_first[model.joints[1].start]]
    for nodes in outer:
        away = np.linalg.norm(model.X[nodes, :2] - hinge[:2], axis=1)
        assert away.max() <= 0.0200001 and len(nodes) > 6


def test_a_link_without_free_nodes_off_the_axis_is_refused():
    item = ready(bars(**FRICTION))
    parts = Assembly(item.scene, item.meshes, item.start.positions)
    with pytest.raises(RequestError, match=r"^nodes of bar0 at its hinge = .*: none is free to take"):
        hinge_loads(parts, np.zeros(item.model.node_count, dtype=bool), item.start.chain, START)


def test_a_scene_without_loads_has_none():
    model = ready(bars()).model
    assert model.hinge_loads == () and model.bases == () and model.joint_tied.all(axis=0).any()


def test_a_stored_state_goes_on_to_the_same_bits(tmp_path: Path):
    whole, paused, fresh = (impact(bars(**ALL)) for _ in range(3))
    whole.advance()
    paused.advance(until=333)
    paused.save(tmp_path / "state")
    fresh.load(tmp_path / "state")
    fresh.advance()
    assert fresh.state.differences(whole.state) == []
    own = whole.state.loads
    assert own.work.numpy()[1, 0] > 0.0 > own.work.numpy()[:, 1].max() and own.base_work.numpy()[0] != 0.0


def test_threads_give_the_same_bits(monkeypatch: pytest.MonkeyPatch):
    for name, length in SHORT_RANGES.items():
        monkeypatch.setattr(name, length)
    one, two = (impact(bars(elements=40, **ALL), threads=threads) for threads in (1, 2))
    assert two.solver.threads == 2
    for found in (one, two):
        found.advance(until=100)
    assert two.state.differences(one.state) == []


@pytest.mark.gpu
def test_a_gpu_gives_what_a_cpu_does_and_repeats_it():
    host, first, again = (impact(bars(**ALL), device=device) for device in ("cpu", "cuda:0", "cuda:0"))
    for found in (host, first, again):
        found.advance()
    assert again.state.differences(first.state) == []
    known, energy = (found.scene_runs[0].ledger.energy() for found in (host, first))
    for key in ("kinetic", "external_work", "joint"):
        assert energy[key] == pytest.approx(known[key], rel=1e-6)
    assert first.scene_runs[0].ledger.exchange_error < CLOSED


def test_a_cycle_goes_through_an_impact_on_a_driven_sliding_base():
    """The rigid phases before and after join the impact without a jump of energy; all work and heat add up."""
    scene = single_link.build(
        axial=4,
        section=2,
        ring=1,
        plate_core=2,
        plate_core_depth=1,
        plate_layers=2,
        plate_extension=1,
        focus_size=2e-3,
        focus_layers=2,
        output_interval=1e-5,
        t_end=0.11,
    )
    assert scene.rigid is not None
    loads = {
        "base_motion": mca.BaseMotion(times=(0.0, 0.1, 0.2), vx=(0.0, 0.3, 0.0), vy=(0.0, -0.1, 0.1)),
        "slide": mca.Slide(carriage_mass=0.3, velocity=0.2),
        "torques": (constant(-0.4),),
        "joint_friction": (0.02,),
        "joint_damping": (0.001,),
    }
    result = mca.run(replace(scene, rigid=replace(scene.rigid, **loads)), precision="float64")
    swing, hit, back = result.summary["phases"]
    assert [phase["kind"] for phase in (swing, hit, back)] == ["rigid", "impact", "rigid"]
    assert abs(hit["jump"]) < 1e-12 and abs(hit["jump_back"]) < 1e-12
    assert swing["energy"]["joint"] < hit["energy"]["joint"] < back["energy"]["joint"]
    assert result.summary["energy_error"] < 1e-3
    errors, t = result.history["E_total_error"], result.history["time_s"]
    after = np.flatnonzero(t > hit["end"] - hit["start"] + 1e-9)
    assert np.ptp(errors[after]) < 1e-6  # of some 0.3 J: the swing goes on from what the impact left


def test_scenes_of_a_batch_take_their_own_loads():
    scenes = [bars(**ALL), bars(slide=SLIDE), bars(**{**ALL, "torques": (), "base_motion": None})]
    batch = impact(*scenes)
    batch.advance()
    models = [item.model for item in batch.ready]
    joined = join_models(models)
    assert [load.scene for load in joined.hinge_loads] == [0, 0, 2, 2] and [b.scene for b in joined.bases] == [0, 1, 2]
    for k, scene in enumerate(scenes):
        alone = Impact([batch.ready[k]], SPAN, device="cpu", precision="float64", threads=1)
        alone.advance()
        mine, other = (item.ledger.energies() for item in (batch.scene_runs[k], alone.scene_runs[0]))
        assert [key for key in mine if mine[key].tobytes() != other[key].tobytes()] == []
        assert bool(mine["joint"][-1]) == bool(scene.rigid.joint_friction)
