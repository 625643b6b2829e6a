"""Hinges with pins: clusters of nodes around the axis keep one point and one axis, momentum, and energy."""

from dataclasses import replace

import numpy as np
import pytest
from chains import BASE, TORQUE, impact, motion_at_end, ready, rigid_end
from chains import bars as bars_in_a_row
from impacts import finished, momentum, prepared, result_of
from scipy.spatial.transform import Rotation
from scipy.special import ellipj, ellipk
from test_cycle import scene as cycling
from test_joint import SOFT
from test_joint_loads import ALL, SLIDE

import warp_mca as mca
from warp_mca.base.rotation import mean_pose
from warp_mca.phases.cycle import Cycle
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import Settings

SIZE = (0.1, 0.02, 0.02)
ORIGIN = (0.0, -0.01, -0.01)
TURNING = 30.0  # of each bar, in opposite directions [rad/s]


def bar(name, divisions, **change):
    box = mca.Box(size=SIZE, divisions=divisions, origin=ORIGIN)
    return mca.Body(name=name, geometry=box, material=SOFT, kinematics="finite", **change)


def bars(divisions=(10, 4, 2), other=(10, 4, 2), duration=2e-3, **change):
    """Two bars on a hinge at (0.1, 0, 0) that fold up, drift along z and turn about x."""
    speed = np.cross((0.0, 0.0, TURNING), (0.1, 0.0, 0.0))
    return mca.Scene(
        name="bars",
        bodies=(
            bar("a", divisions, angular_velocity=(5.0, 0.0, TURNING), velocity=(0.0, 0.0, 1.0)),
            bar(
                "b",
                other,
                position=(0.1, 0.0, 0.0),
                angular_velocity=(5.0, 0.0, -TURNING),
                velocity=(0.0, float(speed[1]), 1.0),
            ),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b", nodes="pin", pin_radius=0.008),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 20.0),
        **change,
    )


def poses(impact):
    """Point and axis of the first hinge as each of its clusters carries it, shape (2, 2, 3)."""
    model, (item, *_) = impact.solver.model, impact.solver.model.couplings
    x, found = model.X + impact.state.u.numpy(), []
    turns = Rotation.from_quat(impact.state.couplings.orientation.numpy()[0])
    for k, (start, end) in enumerate(((item.start, item.middle), (item.middle, item.end))):
        nodes = model.joint_first[start:end]
        weights = item.weight[start - item.start : end - item.start] * model.mass[nodes]
        _, centre, R = mean_pose(model.X[nodes], x[nodes], weights)
        assert turns[k].as_matrix() == pytest.approx(R, abs=2e-5)  # strain within the cluster lets them drift apart
        found.append((centre + turns[k].apply(item.arm[k]), turns[k].apply(item.axis)))
    return np.array(found)


@pytest.mark.parametrize("other", [(10, 4, 2), (7, 6, 3)], ids=["equal meshes", "meshes that do not match"])
def test_bars_on_a_pin_keep_momentum_angular_momentum_and_energy(other):
    impact = finished(bars(other=other), precision="float64")
    result, model = result_of(impact), impact.solver.model
    u, v = impact.state.u.numpy(), impact.state.v.numpy()
    scale = model.mass.sum()
    assert momentum(impact) == pytest.approx(model.mass @ model.V, abs=1e-14 * scale)
    before, after = (model.mass @ np.cross(x, w) for x, w in ((model.X, model.V), (model.X + u, v)))
    assert np.abs(before).max() > 0.1 * scale
    assert after == pytest.approx(before, abs=1e-14 * scale)
    (point, axis), (other_point, other_axis) = poses(impact)
    assert point == pytest.approx(other_point, abs=1e-15)
    assert axis == pytest.approx(other_axis, abs=1e-12)
    assert 1.0 - axis[2] > 1e-5  # it has turned
    assert result.summary["energy_error"] < 1e-6
    end = model.node_start["b"]
    gained = momentum(impact, 0, end) - model.mass[:end] @ model.V[:end]
    assert result.summary["joint_impulse"]["A"] == pytest.approx(gained, abs=1e-14 * scale)


def test_a_bar_on_a_ground_pin_is_a_pendulum():
    """sin(phi / 2) = k sn(K(k) - t sqrt(m g d / I)) with k = sin(phi_0 / 2), from rest at the angle phi_0."""
    gravity, angle = 2e3, 1.0
    rotation = (0.0, 0.0, angle - 0.5 * np.pi)  # along -y, tilted to +x
    scene = mca.Scene(
        name="pendulum",
        bodies=(bar("bar", (6, 4, 1), rotation=rotation),),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0), nodes="pin", pin_radius=0.008),),
        gravity=(0.0, -gravity, 0.0),
        impact=mca.ImpactPhase(duration=0.012, output_interval=1e-4),
    )
    impact = finished(scene, precision="float64")
    result, mass = result_of(impact), impact.solver.model.mass
    X, x = impact.solver.model.X, impact.solver.model.X + impact.state.u.numpy()
    arm = mass @ X / mass.sum()
    inertia = mass @ (X[:, :2] ** 2).sum(axis=1)
    pace = np.sqrt(mass.sum() * gravity * np.linalg.norm(arm) / inertia)
    t = result.summary["simulated_time"] + result.summary["dt"]
    sine = np.sin(0.5 * angle) * ellipj(ellipk(np.sin(0.5 * angle) ** 2) - pace * t, np.sin(0.5 * angle) ** 2)[0]
    middle = mass @ x / mass.sum()
    assert np.arctan2(middle[0], -middle[1]) == pytest.approx(2.0 * np.arcsin(sine), abs=1e-3)
    assert pace * t > 2.0  # it has swung to the other side
    assert result.summary["energy_error"] < 1e-5
    (place,) = impact.state.couplings.place.numpy()
    assert place == pytest.approx(np.zeros(3), abs=1e-13)


def pinned(**given):
    """Bars in a row on pins, which go on from a rigid phase."""
    scene = bars_in_a_row(**given)
    return replace(scene, joints=tuple(replace(joint, nodes="pin", pin_radius=0.012) for joint in scene.joints))


@pytest.mark.parametrize(
    "given",
    [{}, {"torques": (TORQUE,)}, {"joint_friction": (0.2, 0.1)}, {"base_motion": BASE}, {"slide": SLIDE}, ALL],
    ids=["free", "torque", "friction", "base", "slide", "all"],
)
def test_pins_go_on_as_the_rigid_phase_would(given):
    found = impact(pinned(theta_dot=(-3.0, 4.0), **given))
    found.advance()
    begin, ledger = found.ready[0].start, found.scene_runs[0].ledger
    end, back = rigid_end(begin), motion_at_end(found)
    near = 1e-4 * np.abs(end.theta_dot).max()
    np.testing.assert_allclose(back.theta_dot, end.theta_dot, rtol=0.0, atol=near)
    assert ledger.exchange_error < 1e-6


def test_a_stored_state_with_pins_goes_on_to_the_same_bits(tmp_path):
    whole, paused, fresh = (impact(pinned()) for _ in range(3))
    whole.advance()
    paused.advance(until=123)
    paused.save(tmp_path / "state")
    fresh.load(tmp_path / "state")
    fresh.advance()
    assert fresh.state.differences(whole.state) == []
    assert np.abs(whole.state.couplings.orientation.numpy()[..., 2]).max() > 1e-3


def test_threads_give_the_same_bits_with_pins(short_ranges):
    one, two = (impact(pinned(elements=40), threads=threads) for threads in (1, 2))
    assert two.solver.threads == 2
    for found in (one, two):
        found.advance(until=60)
    assert two.state.differences(one.state) == []


def test_scenes_side_by_side_give_what_each_gives_alone():
    scenes = [pinned(theta_dot=rates) for rates in ((-3.0, 4.0), (1.0, 2.0))]
    both, alone = impact(*scenes), [impact(scene) for scene in scenes]
    for found in (both, *alone):
        found.solver.step(found.state, 50)
    v = np.concatenate([found.state.v.numpy() for found in alone])
    np.testing.assert_allclose(both.state.v.numpy(), v, rtol=0.0, atol=1e-13)


def test_permanent_shapes_keep_their_hinges_from_impact_to_impact():
    """A three-link arm strikes twice: momenta pass from phase to phase, and no pin pulls before the second touch."""
    scene = cycling("three_link", joint_nodes="pin", pin_radius=0.008, rigid_inertia="mesh")
    run = Cycle(scene, None, Request(span=1.5e-3, settings=Settings("cpu", "float64", 1)))
    run.run()
    impacts = run.story.impacts
    assert len(impacts) == 2
    for part in impacts:
        assert part.back is not None
        rigid, nodes = part.back.momenta
        assert rigid == pytest.approx(nodes, abs=1e-14 * np.abs(nodes).max())
        assert part.impact.scene_runs[0].ledger.exchange_error < 1e-4
    assert impacts[1].jump == pytest.approx(0.0, abs=1e-14)


def test_what_pins_cannot_do_is_refused():
    scene = bars()
    (pin,) = scene.joints
    for change, words in (
        ({"pin_radius": None}, r"pin_radius = None: give the radius of the pin"),
        ({"pin_radius": -1.0}, r"pin_radius = -1.0: give a finite number above 0"),
        ({"nodes": "axis"}, r'pin_radius = 0.008: it needs nodes="pin"; leave it out'),
        ({"nodes": "ball"}, r"nodes = 'ball': choose axis, ends, pin or hole"),
    ):
        with pytest.raises(mca.RequestError, match=words):
            replace(pin, **change)
    for change, words in (
        ({"pin_radius": 0.001}, r"Revolute A.pin_radius = 0.001: 3 nodes of a lie within it, on one line"),
        ({"other_at": (0.0, 0.001, 0.0)}, r"Revolute A.at = .*: it is 0.001 m from other_at"),
    ):
        with pytest.raises(mca.RequestError, match=words):
            prepared(replace(scene, joints=(replace(pin, **change),)))
    with pytest.raises(
        mca.RequestError, match=r"a node is tied twice, that of a at .* m, by Revolute A and Revolute B"
    ):
        prepared(replace(scene, joints=(pin, replace(pin, name="B"))))
    with pytest.raises(mca.RequestError, match=r"Slide.carriage_mass = 0.0: a pin needs a carriage with mass"):
        ready(pinned(slide=replace(SLIDE, carriage_mass=0.0)))
