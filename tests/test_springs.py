"""Springs and dashpots between points beside closed forms: rigid and flexible bodies, the ground; tables; refusals."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import begun, finished, momentum, result_of
from outside import goes_on
from scipy.integrate import solve_ivp

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
SIDE = 0.01
M = STEEL.rho * SIDE**3
BLOCK = mca.Body(
    name="a", geometry=mca.Box(size=(SIDE,) * 3, divisions=(2, 2, 2), origin=(-0.5 * SIDE,) * 3), material=STEEL
)
RIGID = replace(BLOCK, rigid=True)
K = 100.0
W = math.sqrt(K / M)
CENTRE = (0.0, 0.0, 0.0)
SPRING = mca.Spring(name="s", body="a", at=CENTRE, other_at=(0.05, 0.0, 0.0), stiffness=K)
WHOLE_STEP = mca.ImpactPhase(duration=1e-4, output_interval=1e-5, time_step_scale=1.0, energy_tolerance=1e-2)
# a bilinear spring, soft in extension, that pushes hard; and a dashpot that closes hard
TABLE = {"elongations": (-1.0, 0.0, 1e-3, 2e-3), "forces": (-200.0, 0.0, 0.05, 0.15)}
DAMPER = {"speeds": (-1.0, 0.0, 1.0), "damping_forces": (-0.2, 0.0, 0.05)}


def hung(*springs: mca.Spring, periods: float = 2.0, bodies: tuple = (RIGID,), **change: Any) -> mca.Scene:
    """Blocks on springs."""
    span = periods * 2.0 * math.pi / W
    impact = mca.ImpactPhase(duration=span, output_interval=span / 200.0, energy_tolerance=1e-3)
    tip = mca.Point(body="a", at=CENTRE)
    scene = mca.Scene(name="hung", bodies=bodies, loads=springs, impact=impact, tip=tip)
    return replace(scene, **change)


def moving(body: mca.Body, vx: float, **change: Any) -> mca.Body:
    return replace(body, velocity=(vx, 0.0, 0.0), **change)


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
@pytest.mark.parametrize("precision", ["mixed", "float64"])
@pytest.mark.parametrize("damping", [0.0, 0.1, 0.5])
def test_a_rigid_block_on_a_spring_is_a_damped_oscillator(damping: float, precision: str, device: str):
    """x = v_0 / w_d exp(-xi w t) sin(w_d t), to 1e-3 of its amplitude; energies by closed form, the ledger closes."""
    scene = hung(replace(SPRING, damping=2.0 * damping * M * W), bodies=(moving(RIGID, 1.0),))
    result = result_of(finished(scene, precision=precision, device=device))
    t, w_d = result.time, W * math.sqrt(1.0 - damping**2)
    x = np.exp(-damping * W * t) * np.sin(w_d * t) / w_d
    assert np.abs(-result["spring_s_m"] - x).max() < 1e-3 / W
    v = np.exp(-damping * W * t) * (np.cos(w_d * t) - damping * W / w_d * np.sin(w_d * t))
    assert np.abs(result["tip_vx"] - v).max() < 2e-3
    T = -K * x - 2.0 * damping * M * W * v
    assert np.abs(result["spring_s_N"] - T)[1:].max() < 2e-3 * K / W
    assert np.abs(result["E_spring"] - 0.5 * K * x**2).max() < 2e-3 * 0.5 * M
    taken = 0.5 * M * (1.0 - v**2) - 0.5 * K * x**2
    assert np.abs(result["E_damping"] - taken).max() < 2e-3 * 0.5 * M
    assert abs(result.summary["energy"]["error"]) < 1e-4 * 0.5 * M


@pytest.mark.parametrize("times", [10.0, 1e4])
def test_a_stiff_dashpot_stops_a_rigid_block_after_its_way(times: float):
    """m v_0 / c, though rows are far apart; the dashpot takes all energy, which is there from the start."""
    c = times * M * W
    scene = hung(replace(SPRING, stiffness=0.0, damping=c), bodies=(moving(RIGID, 1.0),))
    scene = replace(scene, impact=mca.ImpactPhase(duration=200.0 * M / c, output_interval=50.0 * M / c))
    result = result_of(finished(scene, precision="float64"))
    way = result["spring_s_m"][0] - result["spring_s_m"][-1]
    assert way == pytest.approx(M / c, rel=3e-3)
    energy = result.summary["energy"]
    assert (energy["initial"], energy["damping"]) == pytest.approx((0.5 * M, 0.5 * M), rel=3e-3)


def test_two_masses_swing_against_each_other_and_keep_their_momentum():
    """w^2 = k (1/m + 1/M) of a rigid block and one of three times its mass, between node sets and points."""
    heavy = replace(RIGID, name="b", material=replace(STEEL, rho=3.0 * STEEL.rho), position=(0.04, 0.0, 0.0))
    spring = replace(SPRING, other="b", other_at=None, other_nodes="xmin")
    run = finished(hung(spring, bodies=(moving(RIGID, 1.0), heavy)), precision="float64")
    result = result_of(run)
    w = W * math.sqrt(4.0 / 3.0)
    relative = -np.sin(w * result.time) / w
    assert np.abs(result["spring_s_m"] - relative).max() < 1e-3 / w
    np.testing.assert_allclose(momentum(run), [M, 0.0, 0.0], rtol=1e-9, atol=1e-15)


def test_points_off_the_centre_turn_a_rigid_block():
    """A torsion pendulum: two springs across, at +-r, turn it with w^2 = 2 k r^2 / J."""
    r = 0.5 * SIDE
    springs = [
        replace(SPRING, name=name, at=(x, 0.0, 0.0), other_at=(x, 1.0, 0.0), direction=(0.0, 1.0, 0.0))
        for name, x in (("l", -r), ("r", r))
    ]
    run = begun(hung(*springs, periods=0.5), precision="float64")
    model = run.solver.model
    J = float(model.rigid_bodies[0].inertia[2, 2])
    rate = 1.0  # small angles
    run.state.rigid.spin.assign([[0.0, 0.0, J * rate]])
    run.advance()
    result, w = result_of(run), math.sqrt(2.0 * K * r * r / J)
    t = result.time
    # the first step takes the spin at t = -dt / 2
    angle = rate / w * np.sin(w * t)
    assert np.abs(result["spring_l_m"] - r * np.sin(angle)).max() < 2e-3 * r / w
    assert np.abs(result["spring_r_m"] + result["spring_l_m"]).max() < 1e-6 * r / w


@pytest.mark.parametrize(("inertia", "z"), [((1e-5, 1e-5, 1e-5), 0.1), ((2e-6, 8e-6, 1e-5), 0.0)], ids=("cube", "flat"))
def test_points_of_a_body_without_geometry_may_lie_anywhere(inertia: tuple[float, float, float], z: float):
    """A spring and a probe far outside the brick that stands for its inertia: beside the equations of motion."""
    m, J, k, anchor, arm = 0.1, inertia[2], 2e3, np.array([0.12, 0.03]), np.array([0.05, 0.02])

    def turned(angle: float) -> np.ndarray:
        c, s = math.cos(angle), math.sin(angle)
        return np.array([[c, -s], [s, c]]) @ arm

    def rates(_: float, y: np.ndarray) -> np.ndarray:
        r = turned(y[2])
        between = anchor - y[:2] - r
        length = np.linalg.norm(between)
        T = k * (length - np.linalg.norm(anchor - arm)) * between / length
        return np.array([*y[3:], *(T / m), (r[0] * T[1] - r[1] * T[0]) / J])

    span, v, rate = 0.01, (-2.0, 1.0), 30.0
    end = solve_ivp(rates, (0.0, span), [0.0, 0.0, 0.0, *v, rate], rtol=1e-9, atol=1e-12).y[:, -1]
    body = mca.Body(
        name="a", rigid=True, mass=m, inertia=inertia, velocity=(*v, 0.0), angular_velocity=(0.0, 0.0, rate)
    )
    spring = mca.Spring(name="s", body="a", at=(*arm, 0.0), other_at=(*anchor, 0.0), stiffness=k)
    impact = mca.ImpactPhase(duration=span, output_interval=span / 50.0)
    probe = mca.Probe(name="p", body="a", at=(*arm, z))
    result = mca.run(mca.Scene(name="free", bodies=(body,), loads=(spring,), impact=impact, probes=(probe,)))
    assert result.probes[0].position[-1] == pytest.approx([*(end[:2] + turned(end[2])), z], abs=2e-5)
    assert result.summary["energy_error"] < 1e-3


def test_a_point_too_far_from_a_flat_body_is_refused():
    body = mca.Body(name="a", rigid=True, mass=0.1, inertia=(1e-5, 1e-5, 2e-5))
    spring = mca.Spring(name="s", body="a", at=(0.0, 0.0, 0.5), other_at=(0.0, 0.0, 1.0), stiffness=1.0)
    impact = mca.ImpactPhase(duration=1e-3, output_interval=1e-4)
    with pytest.raises(mca.RequestError, match=r"body a is too thin or too small, by its inertia, for a point so far"):
        mca.run(mca.Scene(name="flat", bodies=(body,), loads=(spring,), impact=impact))


@pytest.mark.parametrize("element", ["hex8i", "tet4"])
def test_a_flexible_block_on_a_soft_spring_swings_as_a_rigid_one(element: str):
    """By the mass centre of its nodes, so that no wave goes through it; and by a face, to 1e-3 of the amplitude."""
    for ends in ({"nodes": "boundary"}, {"nodes": "xmax"}):
        spring = replace(SPRING, at=None, other_at=(0.05, 0.0, 0.0), **ends)
        body = replace(moving(BLOCK, 1e-3), element=element)
        scene = hung(spring, bodies=(body,), periods=0.05)
        result = result_of(finished(scene, precision="float64"))
        x = 1e-3 * np.sin(W * result.time) / W
        assert np.abs(-result["spring_s_m"] - x).max() < 2e-3 * x.max()


def test_a_preload_and_a_length_shift_the_swing():
    """Let go, a block swings about where its preload, or a free length, puts it: by (1 - cos w t)."""
    for change, shift in (({"preload": 2.0}, 2.0 / K), ({"length": 0.04}, 0.01), ({"preload": -1.0}, -1.0 / K)):
        result = result_of(finished(hung(replace(SPRING, **change)), precision="float64"))
        start = result["spring_s_m"][0]
        assert result["spring_s_N"][0] == pytest.approx(K * shift, rel=1e-9)
        x = shift * (1.0 - np.cos(W * result.time))
        assert np.abs(start - result["spring_s_m"] - x).max() < 1e-3 * abs(shift)
        assert abs(result.summary["energy"]["error"]) < 1e-3 * 0.5 * K * shift**2


@pytest.mark.parametrize("damping", [0.0, 0.2 * M * W])
def test_a_preload_alone_is_a_constant_force(damping: float):
    """v = P / c (1 - exp(-c t / m)), or P t / m; the spring gives P times the way."""
    pull, c = 2.0, damping
    spring = replace(SPRING, stiffness=0.0, preload=pull, damping=c, direction=(1.0, 0.0, 0.0))
    result = result_of(finished(hung(spring, periods=0.1), precision="float64"))
    t = result.time
    v = pull / c * -np.expm1(-c * t / M) if c else pull * t / M
    assert np.abs(result["tip_vx"] - v)[1:].max() < 2e-3 * v[-1]
    way = result["spring_s_m"][0] - result["spring_s_m"]
    assert result["E_spring"] == pytest.approx(-pull * way, abs=1e-9)
    assert abs(result.summary["energy"]["error"]) < 1e-3 * 0.5 * M * v[-1] ** 2
    assert result.summary["energy_error"] < 1e-3  # of what the spring gave, though that is nothing at the start


def test_a_dashpot_has_the_speed_of_its_own_time_whatever_else_moves_its_point():
    """A block falls through oil: g m / c (t - m / c (1 - exp(-c t / m))), to 1e-4, in steps of 0.007 m / c."""
    g, c = 9.81, 4.0 * M * W
    times = 8.0 * M / c
    dashpot = replace(SPRING, stiffness=0.0, damping=c, direction=(1.0, 0.0, 0.0))
    impact = mca.ImpactPhase(duration=times, output_interval=times / 40.0)
    scene = hung(dashpot, gravity=(-g, 0.0, 0.0), impact=impact)
    run = finished(scene, precision="float64")
    assert c * run.solver.dt / M > 0.005
    result = result_of(run)
    t, way = result.time, result["spring_s_m"] - result["spring_s_m"][0]
    exact = g * M / c * (t + M / c * np.expm1(-c * t / M))
    assert np.abs(way - exact).max() < 1e-4 * exact[-1]


def test_a_dashpot_at_one_node_slows_a_whole_body():
    """By exp(-c t / m), to 1e-3, though its elements hold that node back: a lag would tell of the node alone."""
    c = 0.005 * M * math.sqrt(STEEL.E / STEEL.rho) / SIDE
    span = 0.5 * M / c
    dashpot = replace(SPRING, at=(0.5 * SIDE, 0.0, 0.0), stiffness=0.0, damping=c)
    impact = mca.ImpactPhase(duration=span, output_interval=span / 20.0)
    result = mca.run(hung(dashpot, bodies=(moving(BLOCK, 1.0),), impact=impact), device="cpu", precision="float64")
    assert result["E_damping"][-1] == pytest.approx(0.5 * M * -math.expm1(-1.0), rel=1e-3)


def test_strong_dashpots_at_one_node_are_stable_at_the_whole_stable_step():
    """Three of them, as their decay and as the frequency of the elements decide."""
    for c in (1e2, 1e4, 1e6):
        dashpots = [replace(SPRING, name=n, at=(0.5 * SIDE,) * 3, stiffness=0.0, damping=c) for n in "abc"]
        dt = begun(hung(*dashpots, bodies=(BLOCK,), impact=WHOLE_STEP)).solver.model.stable.dt
        impact = replace(WHOLE_STEP, duration=400.0 * dt, output_interval=40.0 * dt)
        run = begun(hung(*dashpots, bodies=(moving(BLOCK, 1.0),), impact=impact), precision="float64")
        run.advance()
        assert run.stopped == [None]
        assert abs(result_of(run).summary["energy"]["error"]) < 1e-2 * 0.5 * M


def test_a_direction_may_point_either_way():
    """It pulls its points together, whichever way its direction is given."""
    made = [
        mca.run(hung(replace(SPRING, direction=(sign, 0.0, 0.0), preload=1.0), periods=0.1)) for sign in (1.0, -1.0)
    ]
    for name in ("spring_s_N", "spring_s_m", "E_spring"):
        assert made[0][name].tobytes() == made[1][name].tobytes()


def test_tables_of_force_and_of_damping_agree_with_an_integration_of_their_own():
    """m x'' = T(-x, -x'), by SciPy: extension and compression, the ends of the table passed, stiff and soft parts."""
    spring = replace(SPRING, stiffness=0.0, **TABLE, **DAMPER)
    result = result_of(finished(hung(spring, bodies=(moving(RIGID, -0.3),), periods=2.0), precision="float64"))

    def tension(e: float, rate: float) -> float:
        x, y = TABLE["elongations"], TABLE["forces"]
        k = int(np.clip(np.searchsorted(x, e) - 1, 0, len(x) - 2))
        spring = y[k] + (y[k + 1] - y[k]) / (x[k + 1] - x[k]) * (e - x[k])
        return spring + (0.2 if rate < 0.0 else 0.05) * rate

    found = solve_ivp(
        lambda _t, s: (s[1], tension(-s[0], -s[1]) / M),
        (0.0, result.time[-1]),
        (0.0, -0.3),
        t_eval=result.time,
        rtol=1e-9,
        atol=1e-13,
        max_step=1e-4,
    )
    e = -found.y[0]
    assert e.max() > TABLE["elongations"][2] and e.min() < -1e-5
    assert np.abs(result["spring_s_m"] - e).max() < 1e-3 * np.abs(e).max()
    assert abs(result.summary["energy"]["error"]) < 2e-3 * result.summary["energy"]["initial"]


def test_a_spring_that_turns_with_its_points_gives_no_spin():
    """A rigid block on a spring to a flexible one, both across their line: momentum and spin of all stay."""
    other = replace(BLOCK, name="b", position=(0.04, 0.0, 0.0), velocity=(0.0, 0.5, 0.0))
    spring = replace(SPRING, other="b", other_at=None, other_nodes="xmin", at=(0.002, 0.003, 0.0), damping=0.1)
    for first in (RIGID, BLOCK):
        body = replace(first, velocity=(0.0, -0.5, 0.2))
        run = begun(hung(spring, bodies=(body, other), periods=0.05), precision="float64")
        before = momentum(run), _spin(run)
        run.advance()
        assert run.stopped == [None]
        np.testing.assert_allclose(momentum(run), before[0], atol=1e-12 * M)
        np.testing.assert_allclose(_spin(run), before[1], atol=1e-7 * np.linalg.norm(before[1]))


def _spin(run: Any) -> np.ndarray:
    """Angular momentum about the origin at the latest half step."""
    model, v = run.solver.model, run.state.v.numpy()
    x = model.X + run.state.u.numpy() - 0.5 * run.solver.dt * v
    return model.mass @ np.cross(x, v)


def test_the_stable_step_counts_springs():
    """Noise on a stiff spring at one node, at the whole stable step: energy stays."""
    spring = replace(SPRING, at=(0.5 * SIDE,) * 3, stiffness=1e10, damping=10.0)
    run = begun(hung(spring, bodies=(moving(BLOCK, 1.0),), impact=WHOLE_STEP), precision="float64")
    plain = begun(hung(bodies=(BLOCK,), impact=WHOLE_STEP)).solver.model.stable.dt
    assert run.solver.model.stable.dt < 0.5 * plain
    run.advance()
    assert run.stopped == [None]


@pytest.mark.parametrize("body", [RIGID, BLOCK], ids=("rigid", "flexible"))
def test_a_point_mass_slows_the_swing_and_has_weight(body: mca.Body):
    """w^2 = k / (m + m_p), at a point and on a set; hung by gravity, it shifts the rest by (m + m_p) g / k."""
    for where in ({"at": (0.001, 0.0, 0.0)}, {"nodes": "boundary"}):
        mass = mca.PointMass(body="a", mass=3.0 * M, **where)
        periods = 1.0 if body.rigid else 0.05
        spring = replace(SPRING, at=None, nodes="boundary")
        scene = hung(spring, bodies=(body,), masses=(mass,), gravity=(-9.81, 0.0, 0.0), periods=periods)
        result = result_of(finished(scene, precision="float64"))
        assert result.summary["bodies"]["a"]["mass"] == pytest.approx(4.0 * M, rel=1e-12)
        w, shift = 0.5 * W, 4.0 * M * 9.81 / K
        x = shift * (1.0 - np.cos(w * result.time))
        tolerance = 1e-3 if body.rigid else 5e-3  # the mass set lags behind the mean of the surface
        assert np.abs(result["spring_s_m"] - x).max() < tolerance * x.max()


def test_point_masses_that_do_not_fit_are_refused():
    for given, message in (
        ({"mass": 0.0, "at": CENTRE}, r"PointMass of a.mass = 0.0: give a finite number above 0"),
        ({"mass": 1.0}, r"PointMass of a.at = None: give either a point"),
        ({"mass": 1.0, "at": CENTRE, "nodes": "xmin"}, r"PointMass of a.at = .*: give either a point"),
    ):
        with pytest.raises(mca.RequestError, match=message):
            mca.PointMass(body="a", **given)
    with pytest.raises(mca.RequestError, match=r"PointMass of a.at = .*: this point lies .* outside the body a"):
        mca.run(hung(SPRING, masses=(mca.PointMass(body="a", mass=1.0, at=(1.0, 0.0, 0.0)),)))
    with pytest.raises(mca.RequestError, match=r"PointMass.body = 'c': the scene's bodies are a"):
        hung(SPRING, masses=(mca.PointMass(body="c", mass=1.0, at=CENTRE),))


def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(tmp_path: Path):
    spring = replace(SPRING, at=None, nodes="xmax", damping=0.1, **TABLE, stiffness=0.0)
    mass = mca.PointMass(body="a", mass=M, nodes="xmax")
    goes_on(hung(spring, bodies=(moving(BLOCK, 1.0),), masses=(mass,), periods=0.01), tmp_path)


def test_a_batch_gives_each_scene_its_springs():
    scenes = [hung(replace(SPRING, stiffness=k * K), bodies=(moving(RIGID, 1.0),), periods=0.2) for k in (1.0, 2.0)]
    for result, scene in zip(mca.run_batch(scenes), scenes, strict=True):
        alone = mca.run(scene)
        for name in ("spring_s_N", "spring_s_m", "E_spring"):
            np.testing.assert_allclose(result[name], alone[name], rtol=5e-3, atol=1e-3 * np.abs(alone[name]).max())
    with pytest.raises(mca.RequestError, match=r"Scene.loads = '2 Spring': scenes of a batch have as many"):
        mca.run_batch([scenes[0], replace(scenes[1], loads=(SPRING, replace(SPRING, name="t")))])


def test_several_rates_swing_as_one():
    body = moving(BLOCK, 1e-3)
    scene = hung(replace(SPRING, at=None, nodes="xmax"), bodies=(body,), periods=0.02)
    one, several = mca.run(scene), mca.run(scene, multi_rate=2)
    np.testing.assert_allclose(several["spring_s_m"], one["spring_s_m"], atol=1e-4 * np.abs(one["spring_s_m"]).max())


def test_the_summary_lists_springs():
    result = mca.run(hung(SPRING, bodies=(moving(RIGID, 1.0),), periods=1.0))
    own = result.summary["springs"]["s"]
    assert own["force_max"] == pytest.approx(K / W, rel=1e-2) and own["force_min"] == pytest.approx(-K / W, rel=1e-2)
    assert own["elongation_max"] == result["spring_s_m"].max()


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"stiffness": 0.0}, r"Spring s.stiffness = 0.0: nothing pulls; give it"),
        ({"stiffness": -1.0}, r"Spring s.stiffness = -1.0: give a number from 0"),
        ({"at": None}, r"Spring s.at = None: give either a point by at="),
        ({"nodes": "xmax"}, r"Spring s.at = \(0.0, 0.0, 0.0\): give either"),
        ({"other_at": None}, r"Spring s.other_at = None: give its place"),
        ({"other_nodes": "xmax"}, r"Spring s.other_nodes = 'xmax': the ground has none"),
        ({"other": "b", "other_at": None}, r"Spring s.other_at = None: give either a point by other_at="),
        ({"length": -0.1}, r"Spring s.length = -0.1: points are never so near"),
        ({"direction": (0.0, 0.0, 0.0)}, r"Spring s.direction = \(0.0, 0.0, 0.0\): give a direction other than zero"),
        ({"elongations": (0.0, 1.0), "forces": (0.0, 1.0)}, r"Spring s.stiffness = 100.0: leave it out"),
        ({"stiffness": 0.0, "elongations": (0.0, 1.0), "forces": (0.0,)}, r"Spring s.forces = \(0.0,\): give two"),
        ({"stiffness": 0.0, "elongations": (1.0, 0.0), "forces": (0.0, 1.0)}, r"Spring s.elongations = .*increasing"),
        ({"speeds": (0.0, 1.0), "damping_forces": (0.0, -1.0)}, r"Spring s.damping_forces = .*a dashpot resists"),
    ],
)
def test_springs_that_are_none_are_refused(given: dict, message: str):
    with pytest.raises(mca.RequestError, match=message):
        replace(SPRING, **given)


@pytest.mark.parametrize(
    ("springs", "message"),
    [
        ((SPRING, SPRING), r"Spring.name = 's': another spring has it"),
        ((replace(SPRING, other_at=CENTRE),), r"Spring s.direction = None: its points lie in one place"),
        ((replace(SPRING, at=(1.0, 0.0, 0.0)),), r"Spring s.at = \(1.0, 0.0, 0.0\): this point lies .* m outside"),
        ((replace(SPRING, other="c"),), r"Spring s.other = 'c': the scene's bodies are a"),
        ((replace(SPRING, at=None, nodes="none"),), r"Spring s.nodes of body a, node set = 'none'"),
    ],
)
def test_springs_that_do_not_fit_are_refused(springs: tuple, message: str):
    with pytest.raises(mca.RequestError, match=message):
        mca.run(hung(*springs))


def test_the_preload_of_a_bolt_is_back_after_an_elastic_impact():
    """A bolt as a spring through a clamped sleeve: settled, struck, rung down; what is left is within 1 %."""
    bar = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
    box = mca.Box(size=(0.04, 0.01, 0.01), divisions=(8, 2, 2))
    sleeve = mca.Body(name="a", geometry=box, material=bar)
    small = mca.Box(size=(0.005, 0.01, 0.01), divisions=(1, 2, 2), origin=(0.0405, 0.0, 0.0))
    striker = mca.Body(name="b", geometry=small, material=bar, velocity=(-2.0, 0.0, 0.0))
    bolt = mca.Spring(name="bolt", body="a", nodes="xmin", other="a", other_nodes="xmax", stiffness=5e5, preload=100.0)
    own = math.sqrt(bar.E / bar.rho) / 0.08
    damping = mca.Damping(body="a", loss_factor=0.2, band=(0.5 * own, 20.0 * own))
    hit = mca.Contact(slave=mca.Surface(body="b", nodes="xmin"), master=mca.Surface(body="a", nodes="xmax"))
    scene = mca.Scene(
        name="bolt",
        bodies=(sleeve, striker),
        fixed=(mca.Fixed(body="a", nodes="xmin"),),
        contacts=(hit,),
        loads=(bolt, damping),
        phases=(mca.Settle(),),
        impact=mca.ImpactPhase(duration=3e-3, output_interval=1e-5),
    )
    result = mca.run(scene)
    force = result["spring_bolt_N"][result.time >= 0.0]
    k = bar.E * 0.01**2 / 0.04  # of the sleeve, but for its clamped end: 5 % stiffer
    assert force[0] == pytest.approx(100.0 * k / (k + 5e5), rel=0.02)
    assert np.ptp(force) > 0.1 * force[0] and result.F_n.max() > 10.0
    np.testing.assert_allclose(force[-50:], force[0], rtol=0.01)
