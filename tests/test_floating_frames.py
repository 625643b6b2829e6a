"""Floating frames: they change forces by rounding alone, keep the energy of what turns, and are chosen by need."""

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun, prepared
from scipy.spatial.transform import Rotation
from test_architecture import everything
from test_multi_rate import graded

import warp_mca as mca
from warp_mca.phases.impact import Impact
from warp_mca.physics.floating.frames import with_floating_frames
from warp_mca.step.solver import Solver

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
FLOWING = mca.J2Bilinear(E=STEEL.E, nu=0.3, rho=STEEL.rho, sigma_y=400e6, E_t=2e9)
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
LONG = 0.26  # [s]
SPIN = 20.0  # [rad/s]


def bar(element: str = "hex8", material: mca.Elastic = STEEL, fixed: str = "", rigid: bool = False) -> mca.Scene:
    """A bar of steel in a phase so long that rounding would heat it if it turned."""
    geometry = mca.Box(size=(0.01, 0.1, 0.01), divisions=(2, 6, 2), origin=(-0.005, -0.05, -0.005))
    return mca.Scene(
        name="bar",
        bodies=(mca.Body(name="bar", geometry=geometry, material=material, element=element, rigid=rigid),),
        fixed=(mca.Fixed(body="bar", nodes=fixed),) if fixed else (),
        impact=mca.ImpactPhase(duration=LONG),
    )


def set_spinning(impact: Impact, angle: float) -> None:
    """Turn the bodies about the origin, by `angle` so far, without strain but for that of centrifugal forces."""
    axis, X = np.array([0.6, 0.0, 0.8]), impact.solver.model.X
    turn = Rotation.from_rotvec(angle * axis)
    x = turn.apply(X)
    impact.state.floating.rotation.assign(np.tile(turn.as_quat(), (impact.solver.floating.count, 1)))
    impact.state.u.assign(x - X)
    impact.state.v.assign(np.cross(SPIN * axis, x))


def energy_won(impact: Impact, steps: int) -> float:
    """Share by which the kinetic energy grows [-] in so many steps, with a record at each twentieth."""
    mass, state, energy = impact.solver.model.mass, impact.state, []
    for count in (0, steps):
        for _ in range(count // 20):
            impact.solver.record_and_step(state, 20)
        energy.append(0.5 * float(mass @ (state.v.numpy() ** 2).sum(axis=1)))
    return energy[1] / energy[0] - 1.0


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("element", ["hex8", "hex8r", "tet4", "tet10"])
def test_a_turned_bar_keeps_its_energy(element, device):
    """Within 1e-5 in 0.26 s, which take 130 times as many steps; heat grows with these, at an angle that stays.

    In the world frame it grows by 7e-4 and more in 4000 of them.
    """
    impact = begun(bar(element), device=device)
    set_spinning(impact, 1.5)
    assert abs(energy_won(impact, 4000)) < 5e-8


def ridden() -> mca.Scene:
    """A scene with each kind of node, of which a rigid body carries some."""
    scene = everything()
    weld = mca.Weld(name="R", body="tied", nodes="zmin", other="rigid", other_nodes="zmax")
    bodies = [replace(body, position=(0.0, 0.0, 0.19)) if body.rigid else body for body in scene.bodies]
    return replace(scene, bodies=tuple(bodies), joints=(*scene.joints, weld))


@pytest.mark.parametrize("device", DEVICES)
def test_frames_that_turn_as_they_like_change_no_motion(device):
    """Free, tied, driven, absorbing and ridden nodes and sliders of strained bodies."""
    scene = ridden()
    model = prepared(scene).model
    turned = with_floating_frames(model, [scene], LONG, "mixed")
    assert turned.floating is not None
    count, rng = len(scene.bodies), np.random.default_rng(5)
    u = 0.02 * model.X @ rng.normal(size=(3, 3))
    seen = []
    for one in (model, turned):
        solver = Solver(one, device=device, precision="mixed", dt=0.5 * model.stable.dt)
        state = solver.new_state()
        state.u.assign(u)
        solver.compile()
        solver.begin(state)
        solver.start(state)
        state.floating.rotation.assign(
            Rotation.from_rotvec(rng.normal(size=(count, 3))).as_quat()[: solver.floating.count]
        )
        before = state.v.numpy().copy()
        solver.step(state, 1)
        seen.append(state.v.numpy() - before)
    assert 0.0 < np.abs(seen[1] - seen[0]).max() < 1e-3 * np.abs(seen[0]).max()


def hinged() -> mca.Scene:
    """Two bars that turn about the hinge between them."""
    geometry = mca.Box(size=(0.01, 0.1, 0.01), divisions=(3, 9, 3), origin=(-0.005, 0.0, -0.005))
    spin = {"geometry": geometry, "material": STEEL, "angular_velocity": (0.0, 0.0, SPIN)}
    hinge = mca.Revolute(name="A", body="low", at=(-0.005, 0.1, 0.0), other="high", other_at=(-0.005, 0.0, 0.0))
    return mca.Scene(
        name="hinged",
        bodies=(
            mca.Body(name="low", position=(0.0, -0.1, 0.0), velocity=(0.1 * SPIN, 0.0, 0.0), **spin),
            mca.Body(name="high", **spin),
        ),
        joints=(hinge,),
        impact=mca.ImpactPhase(duration=LONG),
    )


def test_runs_repeat_bit_for_bit(short_ranges, tmp_path):
    """By two threads, in a batch, and by a state that is read back; frames have turned with their bodies then."""
    whole, first, rest = (begun(hinged()) for _ in range(3))
    threads, batch = begun(hinged(), threads=2), begun(hinged(), hinged())
    assert threads.solver.threads == 2
    first.advance(300)
    first.save(tmp_path / "state")
    rest.load(tmp_path / "state")
    for impact in (whole, threads, rest, batch):
        impact.advance(500)
    assert whole.state.differences(threads.state) == whole.state.differences(rest.state) == []
    u, rotation = whole.state.u.numpy(), whole.state.floating.rotation.numpy()
    assert np.array_equal(batch.state.u.numpy(), np.concatenate([u, u]))
    assert np.array_equal(batch.state.floating.rotation.numpy(), np.concatenate([rotation, rotation]))
    turned = np.tile([0.0, 0.0, SPIN * whole.solver.dt * 500], (2, 1))
    assert Rotation.from_quat(rotation).as_rotvec() == pytest.approx(turned, rel=0.02, abs=1e-5)


@pytest.mark.parametrize(
    ("scene", "span", "precision", "chosen"),
    [
        (bar(), LONG, "mixed", True),
        (bar(), LONG, "float64", False),
        (bar(), 5e-3, "mixed", False),
        (bar(fixed="ymin"), LONG, "mixed", False),
        (bar(rigid=True), LONG, "mixed", False),
        (hinged(), LONG, "mixed", True),
    ],
)
def test_frames_are_chosen_where_rounding_would_heat(scene, span, precision, chosen):
    model = with_floating_frames(prepared(scene, duration=span).model, [scene], span, precision)
    assert (model.floating is not None) == chosen


def test_elements_with_steps_of_their_own_have_no_frames():
    geometry = graded((0.02, 0.1, 0.02), (1, 24, 1), 16.0)
    scene = replace(bar(), bodies=(replace(bar().bodies[0], geometry=geometry),))
    for multi_rate, chosen in ((None, True), (2, False)):
        model = prepared(scene, duration=LONG, multi_rate=multi_rate).model
        assert (with_floating_frames(model, [scene], LONG, "mixed").floating is not None) == chosen
