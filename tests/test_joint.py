"""Hinges and prescribed motion: momentum, reaction, coincidence, work."""

import numpy as np
import pytest
from impacts import finished, momentum, result_of

import warp_mca as mca
from warp_mca.model.build import build_model
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handoff import hand_off

SOFT = mca.Elastic(E=1e9, nu=0.2, rho=1000.0)
HEAVY = mca.Elastic(E=1e9, nu=0.2, rho=3000.0)
SIZE = {"size": (0.1, 0.02, 0.02)}
BAR = mca.Box(**SIZE, divisions=(10, 2, 2), origin=(0.0, -0.01, -0.01))


def test_hinged_pair_keeps_momentum_and_its_nodes_together():
    scene = mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, material=SOFT, velocity=(0.0, 1.0, 0.0)),
            mca.Body(name="b", geometry=BAR, material=HEAVY, position=(0.1, 0.0, 0.0), velocity=(0.0, 0.3, 0.2)),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b"),),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=1e-5, energy_tolerance=1.0),  # inelastic at the start
    )
    impact = finished(scene, precision="float64")
    model, v = impact.solver.model, impact.state.v.numpy()
    mass = 1000.0 * 0.1 * 0.02**2
    assert momentum(impact) == pytest.approx(mass * np.array([0.0, 1.9, 0.6]), abs=1e-13)
    assert len(model.joint_first) == 3
    for array in (impact.state.u.numpy(), v):
        assert (array[model.joint_first] == array[model.joint_second]).all()
    taken = momentum(impact, 0, len(v) // 2) - mass * np.array([0.0, 1.0, 0.0])
    assert result_of(impact).summary["joint_impulse"]["A"] == pytest.approx(taken, abs=1e-12)


def test_spinning_bar_pulls_its_ground_hinge():
    """Mean reaction m omega^2 L / 2 towards the hinge, which stays in place."""
    omega, duration = 20.0, 6e-3
    scene = mca.Scene(
        name="spin",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT, angular_velocity=(0.0, 0.0, omega)),),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0)),),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-4),
    )
    impact = finished(scene)
    summary = result_of(impact).summary
    mass, angle = 1000.0 * 0.1 * 0.02**2, omega * duration
    pull = mass * omega**2 * 0.05
    impulse = -pull / omega * np.array([np.sin(angle), 1.0 - np.cos(angle)])
    vibration = 0.02 * pull * duration  # of the bar, which starts without the stress of its spin
    assert summary["joint_impulse"]["O"][:2] == pytest.approx(impulse, abs=vibration)
    assert np.abs(impact.state.u.numpy()[impact.solver.model.joint_first]).max() == 0.0
    assert summary["energy_error"] < 1e-4


def test_hinge_nodes_that_strike_a_wall_take_its_force_once():
    """Both bodies press there: the wall's impulse is the momentum that the pair loses, step for step."""
    wall = mca.RigidPlane(point=(0.1, 0.0, 0.0), normal=(-1.0, 0.0, 0.0))
    flying = {"material": SOFT, "velocity": (1.0, 0.0, 0.0)}
    scene = mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, **flying),
            mca.Body(name="b", geometry=BAR, position=(0.1, 0.0, 0.0), **flying),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b"),),
        contacts=tuple(
            mca.Contact(slave=mca.Surface(body=body, nodes=nodes), master=wall)
            for body, nodes in (("a", "xmax"), ("b", "xmin"))
        ),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-6),
    )
    impact = finished(scene, precision="float64")
    result, model = result_of(impact), impact.solver.model
    assert set(model.joint_first) < set(model.passes[0].slave)
    assert set(model.joint_second) < set(model.passes[1].slave)
    lost = model.mass @ model.V - momentum(impact)
    assert lost[0] > 0.1 * model.mass.sum()
    assert result.F_n.sum() * result.time[1] == pytest.approx(lost[0], rel=1e-12)


@pytest.mark.parametrize(
    ("other", "at", "match"),
    [
        (mca.Box(**SIZE, divisions=(10, 2, 4), origin=(0.0, -0.01, -0.01)), (0.1, 0, 0), "coincide"),
        (mca.Box(**SIZE, divisions=(10, 2, 2), origin=(0.0, -0.01, -0.012)), (0.1, 0, 0), "0.002 m apart"),
        (BAR, (0.103, 0.0, 0.0), "0 nodes of a lie on this axis"),
        (mca.Box(**SIZE, divisions=(10, 2, 2), origin=(0.0, -0.03, -0.01)), (0.1, 0, 0), "0 of b"),
    ],
)
def test_hinge_that_finds_no_pairs_is_refused(other, at, match):
    scene = mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, material=SOFT),
            mca.Body(name="b", geometry=other, material=SOFT, position=(0.1, 0.0, 0.0)),
        ),
        joints=(mca.Revolute(name="A", body="a", at=at, other="b"),),
        impact=mca.ImpactPhase(duration=1e-4),
    )
    with pytest.raises(mca.RequestError, match=f"Revolute A.*{match}"):
        mca.run(scene)


def test_only_the_outer_pairs_are_tied_on_request():
    scene = mca.Scene(
        name="end",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT),),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0), nodes="ends"),),
        impact=mca.ImpactPhase(duration=1e-4),
    )
    meshes = mca.mesh(scene)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    model = build_model(scene, meshes, start.positions, start.velocities)
    assert model.X[model.joint_first][:, 2] == pytest.approx([-0.01, 0.01])


def test_pulled_end_moves_by_its_table_and_its_work_closes_the_ledger():
    scene = mca.Scene(
        name="pull",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT),),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        prescribed=(
            mca.Prescribed(body="bar", nodes="xmax", axis="x", times=(0.0, 2e-4, 4e-4), velocities=(0.0, 2.0, 0.0)),
        ),
        impact=mca.ImpactPhase(duration=6e-4, output_interval=1e-5),
    )
    impact = finished(scene)
    summary, end = result_of(impact).summary, impact.solver.model.X[:, 0] > 0.0999
    assert impact.state.u.numpy()[end][:, 0] == pytest.approx(0.5 * 2.0 * 4e-4, rel=1e-6)
    assert summary["energy"]["external_work"] > 0.01
    assert summary["energy_error"] < 1e-3


def test_driven_nodes_follow_their_table_at_every_step():
    """Velocities at the middle of each step integrate a ramp exactly: u = a t^2 / 2."""
    scene = mca.Scene(
        name="ramp",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT),),
        prescribed=(mca.Prescribed(body="bar", nodes="xmin", axis="y", times=(0.0, 1.0), velocities=(0.0, 1e4)),),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-5),
    )
    impact = finished(scene)
    summary = result_of(impact).summary
    t = 1e-4 + summary["dt"]  # the last record takes one step more
    driven = impact.solver.model.X[:, 0] < 1e-4
    assert impact.state.u.numpy()[driven][:, 1] == pytest.approx(0.5 * 1e4 * t**2, rel=1e-10)
    assert summary["energy_error"] < 1e-4


def test_axes_of_a_node_follow_tables_of_their_own():
    """x by a ramp, y at constant speed, z at rest, all of one end; nothing else binds the bar."""
    tables = {"x": ((0.0, 1.0), (0.0, 1e4)), "y": ((0.0,), (0.3,))}
    scene = mca.Scene(
        name="axes",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT),),
        fixed=(mca.Fixed(body="bar", nodes="xmin", axes="z"),),
        prescribed=tuple(
            mca.Prescribed(body="bar", nodes="xmin", axis=axis, times=times, velocities=velocities)
            for axis, (times, velocities) in tables.items()
        ),
        impact=mca.ImpactPhase(duration=1e-4, output_interval=1e-5),
    )
    impact = finished(scene)
    summary = result_of(impact).summary
    t = 1e-4 + summary["dt"]
    end = impact.state.u.numpy()[impact.solver.model.X[:, 0] < 1e-4]
    assert end == pytest.approx(np.broadcast_to([0.5 * 1e4 * t**2, 0.3 * t, 0.0], end.shape), rel=1e-10, abs=0.0)
    assert summary["energy_error"] < 1e-3


def test_fixed_nodes_that_move_do_work_too():
    """The end goes on at 1 m/s and pulls the bar, which starts at that speed, against gravity."""
    scene = mca.Scene(
        name="carry",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT, velocity=(1.0, 0.0, 0.0)),),
        fixed=(mca.Fixed(body="bar", nodes="xmax"),),
        gravity=(-1e4, 0.0, 0.0),
        impact=mca.ImpactPhase(duration=5e-4, output_interval=1e-5),
    )
    impact = finished(scene)
    summary, end = result_of(impact).summary, impact.solver.model.X[:, 0] > 0.0999
    v = impact.state.v.numpy()[end]
    assert v == pytest.approx(np.broadcast_to([1.0, 0.0, 0.0], v.shape), abs=1e-15)
    assert summary["energy_error"] < 1e-3


def bound(**change):
    """Two bars on one hinge, bound in a further way."""
    pair = mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, material=SOFT),
            mca.Body(name="b", geometry=BAR, material=SOFT, position=(0.1, 0.0, 0.0)),
            mca.Body(name="c", geometry=BAR, material=SOFT, position=(0.1, 0.0, 0.0)),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b"),),
        impact=mca.ImpactPhase(duration=1e-5),
    )
    return mca.Scene(**{**vars(pair), **change})


def drive(nodes, axis="x"):
    return mca.Prescribed(body="a", nodes=nodes, axis=axis, times=(0.0,), velocities=(1.0,))


@pytest.mark.parametrize(
    ("change", "match"),
    [
        (
            {"fixed": (mca.Fixed(body="a", nodes="xmax"),)},
            r"joint is also fixed or driven, that of a at .*, by Revolute A and Fixed nodes xmax; bind",
        ),
        (
            {"prescribed": (drive("xmax"),)},
            r"fixed or driven, that of a at \(0\.1, .*, by Revolute A and Prescribed nodes xmax",
        ),
        ({"prescribed": (drive("xmin"), drive("ymin"))}, "bound twice"),
        ({"prescribed": (drive("xmin"),), "fixed": (mca.Fixed(body="a", nodes="xmin", axes="xy"),)}, "bound twice"),
        (
            {
                "joints": (
                    mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b"),
                    mca.Revolute(name="B", body="b", at=(0.0, 0.0, 0.0), other="c"),
                )
            },
            r"a node is tied twice, that of b at \(0\.1, .*\) m, by Revolute A and Revolute B; let one joint take it",
        ),
    ],
)
def test_nodes_bound_twice_are_refused(change, match):
    with pytest.raises(mca.RequestError, match=match):
        mca.run(bound(**change))


def test_drive_that_jumps_at_the_start_leaves_the_initial_energy_alone():
    scene = bound(joints=(), prescribed=(drive("xmin"),))
    energy = mca.run(scene, duration=1e-4).summary["energy"]
    assert abs(energy["initial"]) < 1e-3 * energy["kinetic"]
    assert abs(energy["error"]) < 1e-3 * energy["external_work"]
