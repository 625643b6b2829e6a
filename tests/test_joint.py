"""Hinges and prescribed motion: momentum, reaction, coincidence, work."""

import numpy as np
import pytest

import warp_mca as mca
from warp_mca import solver
from warp_mca.handoff import hand_off
from warp_mca.model import build_model, nodal_masses
from warp_mca.simulation import mesh

SOFT = mca.Elastic(E=1e9, nu=0.2, rho=1000.0)
BAR = mca.Box(size=(0.1, 0.02, 0.02), divisions=(10, 2, 2), origin=(0.0, -0.01, -0.01))


def final_state(monkeypatch):
    """Displacements and velocities at the end of the next run."""
    state = {}

    def keep(self):
        state.update(u=self.u.numpy().copy(), v=self.v.numpy().copy(), model=self.model)
        return 0.0

    monkeypatch.setattr(solver.Solver, "max_plastic_strain", keep)
    return state


def test_hinged_pair_keeps_momentum_and_its_nodes_together(monkeypatch):
    state = final_state(monkeypatch)
    scene = mca.Scene(
        name="pair",
        bodies=(
            mca.Body(name="a", geometry=BAR, material=SOFT, velocity=(0.0, 1.0, 0.0)),
            mca.Body(name="b", geometry=BAR, material=SOFT, position=(0.1, 0.0, 0.0), velocity=(0.0, 0.3, 0.2)),
        ),
        joints=(mca.Revolute(name="A", body="a", at=(0.1, 0.0, 0.0), other="b"),),
        impact=mca.ImpactPhase(duration=3e-4, output_interval=1e-5, energy_tolerance=1.0),  # inelastic at the start
    )
    result = mca.run(scene, precision="float64")
    model, v = state["model"], state["v"]
    mass = 1000.0 * 0.1 * 0.02**2
    assert model.mass @ v == pytest.approx(mass * np.array([0.0, 1.3, 0.2]), abs=1e-13)
    assert len(model.joint_first) == 3
    for name in ("u", "v"):
        assert (state[name][model.joint_first] == state[name][model.joint_second]).all()
    taken = model.mass[: len(v) // 2] @ v[: len(v) // 2] - mass * np.array([0.0, 1.0, 0.0])
    assert result.summary["joint_impulse"]["A"] == pytest.approx(taken, abs=1e-12)


def test_spinning_bar_pulls_its_ground_hinge(monkeypatch):
    """Mean reaction m omega^2 L / 2 towards the hinge, which stays in place."""
    state = final_state(monkeypatch)
    omega, duration = 20.0, 6e-3
    scene = mca.Scene(
        name="spin",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT, angular_velocity=(0.0, 0.0, omega)),),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0)),),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-4),
    )
    result = mca.run(scene)
    mass, angle = 1000.0 * 0.1 * 0.02**2, omega * duration
    pull = mass * omega**2 * 0.05
    impulse = -pull / omega * np.array([np.sin(angle), 1.0 - np.cos(angle)])
    vibration = 0.02 * pull * duration  # of the bar, which starts without the stress of its spin
    assert result.summary["joint_impulse"]["O"][:2] == pytest.approx(impulse, abs=vibration)
    assert np.abs(state["u"][state["model"].joint_first]).max() == 0.0
    assert result.summary["energy_error"] < 1e-4


@pytest.mark.parametrize(
    ("other", "at", "match"),
    [
        (mca.Box(size=(0.1, 0.02, 0.02), divisions=(10, 2, 4), origin=(0.0, -0.01, -0.01)), (0.1, 0, 0), "coincide"),
        (BAR, (0.103, 0.0, 0.0), "0 nodes of a lie on this axis"),
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
    meshes = mesh(scene)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    model = build_model(scene, meshes, start.positions, start.velocities)
    assert model.X[model.joint_first][:, 2] == pytest.approx([-0.01, 0.01])


def test_pulled_end_moves_by_its_table_and_its_work_closes_the_ledger(monkeypatch):
    state = final_state(monkeypatch)
    scene = mca.Scene(
        name="pull",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT),),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        prescribed=(
            mca.Prescribed(body="bar", nodes="xmax", axis="x", times=(0.0, 2e-4, 4e-4), velocities=(0.0, 2.0, 0.0)),
        ),
        impact=mca.ImpactPhase(duration=6e-4, output_interval=1e-5),
    )
    result = mca.run(scene)
    end = state["model"].X[:, 0] > 0.0999
    assert state["u"][end][:, 0] == pytest.approx(0.5 * 2.0 * 4e-4, rel=1e-6)
    assert result.summary["energy"]["external_work"] > 0.01
    assert result.summary["energy_error"] < 1e-3


def test_fixed_nodes_that_move_do_work_too(monkeypatch):
    """The end goes on at 1 m/s and pulls the bar, which starts at that speed, against gravity."""
    state = final_state(monkeypatch)
    scene = mca.Scene(
        name="carry",
        bodies=(mca.Body(name="bar", geometry=BAR, material=SOFT, velocity=(1.0, 0.0, 0.0)),),
        fixed=(mca.Fixed(body="bar", nodes="xmax"),),
        gravity=(-1e4, 0.0, 0.0),
        impact=mca.ImpactPhase(duration=5e-4, output_interval=1e-5),
    )
    result = mca.run(scene)
    end = state["model"].X[:, 0] > 0.0999
    assert state["v"][end] == pytest.approx(np.broadcast_to([1.0, 0.0, 0.0], state["v"][end].shape), abs=1e-15)
    assert result.summary["energy_error"] < 1e-3
