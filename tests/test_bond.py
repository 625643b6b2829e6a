"""Bonds of a contact: they hold both ways, fail at their strength, and leave an ordinary contact behind."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import SHORT_RANGES, begun, finished, momentum, prepared, result_of

import warp_mca as mca
from warp_mca.phases.impact import Impact
from warp_mca.scene.model_file import load, save

STIFF = mca.Elastic(E=2e9, nu=0.0, rho=1000.0)
SIDE = 0.01
MU = 0.3  # in all scenes with the same kernels


def halves(
    bond: mca.Bond,
    *,
    sets: tuple[str, str] = ("xmax", "xmin"),
    material: mca.Elastic = STIFF,
    motion: dict[str, Any] | None = None,
    duration: float = 1e-4,
    contact: dict[str, Any] | None = None,
    **more: Any,
) -> mca.Scene:
    """Two blocks along x that meet at x = 0, the finer one glued to the other."""
    bodies = []
    for name, x, divisions in (("fine", -SIDE, (2, 4, 4)), ("coarse", 0.0, (2, 2, 2))):
        mesh = mca.Box(size=(SIDE,) * 3, divisions=divisions, origin=(x, -0.5 * SIDE, -0.5 * SIDE)).build()
        every = {**mesh.node_sets, "every": np.arange(len(mesh.points), dtype=np.int32)}
        geometry = dataclasses.replace(mesh, node_sets=every)
        bodies.append(mca.Body(name=name, geometry=geometry, material=material, **(motion or {})))
    slave, master = (mca.Surface(body=b.name, nodes=nodes) for b, nodes in zip(bodies, sets, strict=True))
    axes = {"normal": (-1.0, 0.0, 0.0), "tangent": (0.0, 1.0, 0.0)}
    return mca.Scene(
        name="glued",
        bodies=tuple(bodies),
        contacts=(mca.Contact(slave=slave, master=master, bond=bond, **axes, **(contact or {})),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 500.0),
        **more,
    )


def pulled(bond: mca.Bond, velocity: tuple[float, float], **more: Any) -> mca.Scene:
    """All nodes of the finer block move with a velocity in x and y [m/s], those of the other stand."""

    def driven(axis: str, speed: float) -> mca.Prescribed:
        return mca.Prescribed(body="fine", nodes="every", axis=axis, times=(0.0,), velocities=(speed,))

    held = (mca.Fixed(body="coarse", nodes="every"), mca.Fixed(body="fine", nodes="every", axes="z"))
    drives = tuple(driven(axis, speed) for axis, speed in zip("xy", velocity, strict=True))
    return halves(bond, fixed=held, prescribed=drives, **more)


@pytest.mark.parametrize(("sets", "mu"), [(("xmax", "xmin"), MU), (("boundary", "boundary"), 0.0)])
def test_a_bar_pulled_apart_fails_at_its_strength(sets: tuple[str, str], mu: float):
    """Whole skins hold each other at x = 0 as the two ends do."""
    ends = mca.Prescribed(body="coarse", nodes="xmax", axis="x", times=(0.0, 5e-5), velocities=(0.0, 1.0))
    held = (mca.Fixed(body="fine", nodes="xmin"),)
    scene = halves(mca.Bond(normal=1e6), sets=sets, fixed=held, prescribed=(ends,), duration=1.5e-4, contact={"mu": mu})
    result = mca.run(scene, precision="float64")
    failed = result.summary["bonds"]["fine–coarse"]
    assert failed["nodes"] == failed["failed"] == 25
    assert result.F_n.min() == pytest.approx(-1e6 * SIDE**2, rel=0.02)
    at = int(result.F_n.argmin())
    assert result.time[at] <= failed["first_failure"]["time"] <= result.time[at + 1] + 1e-9
    assert failed["first_failure"]["at"][0] == 0.0
    stiffness = 2.0 * STIFF.E / 2.0 / (0.5 * SIDE)  # 2 E* over both layers, for each area [Pa/m]
    lost = result.summary["energy"]["contact_loss"]
    assert lost >= 0.98 * 0.5 * 1e12 * SIDE**2 / stiffness and result.F_n[-1] == 0.0
    assert result.summary["energy_error"] < 1e-4


@pytest.mark.parametrize("angle", [0.0, 0.5, 1.0, np.pi / 2])
def test_tension_and_shear_fail_together(angle: float):
    """The force k v t of a spring has the angle of the velocity, and fails on the ellipse of both strengths."""
    normal, shear = 2e6, 1e6
    velocity = (-np.cos(angle), np.sin(angle))
    result = mca.run(
        pulled(mca.Bond(normal=normal, shear=shear), velocity, duration=3e-5, contact={"mu": MU}), precision="float64"
    )
    ratio = np.hypot(result.F_n / normal, result.F_t / shear).max() / SIDE**2
    assert ratio == pytest.approx(1.0, abs=0.02)
    assert result.summary["bonds"]["fine–coarse"]["failed"] == 25
    assert result.summary["energy_error"] < 1e-6


def test_a_bond_that_shear_broke_goes_on_as_contact_with_friction():
    """Pressed by k d and then driven along: half of the strength would hold it, and mu F_n is left."""
    bond = mca.Bond(normal=1e6, shear=1e6)
    stiffness = 2.0 * STIFF.E / 2.0 / (0.5 * SIDE)  # 2 E* over both layers, for each area [Pa/m]
    depth = 0.8e6 / stiffness
    ends = tuple(
        mca.Prescribed(body="fine", nodes="every", axis=axis, times=times, velocities=speeds)
        for axis, times, speeds in (
            ("x", (0.0, 1e-6, 1.1e-6), (depth / 1.05e-6, depth / 1.05e-6, 0.0)),
            ("y", (2e-6, 2.1e-6), (0.0, 2.0)),
        )
    )
    held = (mca.Fixed(body="coarse", nodes="every"), mca.Fixed(body="fine", nodes="every", axes="z"))
    scene = halves(bond, duration=2e-5, fixed=held, prescribed=ends, contact={"mu": MU})
    result = mca.run(scene, precision="float64")
    broken = result.time > result.summary["bonds"]["fine–coarse"]["last_failure"]["time"] + 1e-6
    assert 50 < broken.sum() < 450
    assert result.F_n[result.time > 2e-6] == pytest.approx(0.8e6 * SIDE**2, rel=3e-3)
    assert np.ptp(result.F_n[result.time > 2e-6]) < 1e-6  # also as it breaks
    assert np.abs(result.F_t).max() == pytest.approx(1e6 * SIDE**2, rel=0.02)
    assert np.abs(result.F_t[broken][-20:]) == pytest.approx(MU * 0.8e6 * SIDE**2, rel=3e-3)
    assert result.summary["energy_error"] < 1e-4


def test_glued_blocks_that_turn_keep_momentum_angular_momentum_and_energy():
    """Bonds stretch by far more than the search for faces looks ahead: reactions must not be lost."""
    spin, stiff = (40.0, 60.0, 900.0), mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
    motion = {"kinematics": "finite", "angular_velocity": spin, "velocity": (3.0, -2.0, 1.0)}
    scene = halves(mca.Bond(), material=stiff, motion=motion, duration=2e-3, contact={"penalty": 3e-5, "mu": MU})
    impact = begun(scene, precision="float64")
    model, before = impact.solver.model, momentum(impact)
    turning = (model.mass[:, None] * np.cross(model.X, model.V)).sum(axis=0)
    impact.advance()
    assert np.linalg.norm(momentum(impact) - before) < 1e-11 * np.linalg.norm(before)
    u, v = impact.state.u.numpy(), impact.state.v.numpy()
    place = model.X + u - 0.5 * impact.solver.dt * v  # at the half step
    after = (model.mass[:, None] * np.cross(place, v)).sum(axis=0)
    assert np.linalg.norm(after - turning) < 1e-13 * np.linalg.norm(turning)
    (own,) = (item for item in model.passes if item.bonds is not None)
    x = (model.X + u)[own.slave] - np.einsum("sk,ski->si", own.bonds.weight, (model.X + u)[own.face[own.bonds.face]])
    assert np.linalg.norm(x, axis=1).max() > 0.3 * SIDE / 2  # of a face's edge
    assert impact.scene_runs[0].ledger.kept.energy_error < 1e-4


BREAKING = pulled(mca.Bond(normal=2e6, shear=1e6), (-1.0, 0.5), duration=3e-5, contact={"mu": MU})


def test_a_breaking_bond_repeats_in_a_batch_on_threads_and_from_a_state(monkeypatch, tmp_path: Path):
    """Beside a scene without a bond, too."""
    alone = finished(BREAKING)
    plain = dataclasses.replace(BREAKING.contacts[0], bond=None)
    both = begun(BREAKING, dataclasses.replace(BREAKING, contacts=(plain,)), BREAKING)
    both.advance()
    for k in (0, 2):
        assert all(
            np.array_equal(a, b, equal_nan=True) for a, b in zip(figures_of(alone, 0), figures_of(both, k), strict=True)
        )
    assert "bonds" not in result_of(both, 1).summary and result_of(both, 1).F_n.min() == 0.0
    assert result_of(both, 2).summary["bonds"] == result_of(alone).summary["bonds"]
    for name, length in SHORT_RANGES.items():
        monkeypatch.setattr(name, length)
    threaded = begun(BREAKING, threads=2)
    threaded.advance(until=alone.state.steps // 2)
    threaded.save(tmp_path / "half.state")
    again = begun(BREAKING, threads=2)
    again.load(tmp_path / "half.state")
    again.advance()
    assert alone.state.differences(again.state) == []
    assert result_of(again).summary["bonds"] == result_of(alone).summary["bonds"]


def figures_of(impact: Impact, index: int) -> list[np.ndarray]:
    found = result_of(impact, index)
    return [*found.history.values(), *(contact.force for contact in found.contacts)]


def test_bonds_of_several_rates_fail_at_their_strength():
    scene = dataclasses.replace(BREAKING, prescribed=(), fixed=(BREAKING.fixed[0],))
    ends = mca.Prescribed(body="fine", nodes="xmin", axis="x", times=(0.0, 5e-5), velocities=(0.0, -1.0))
    grown = mca.Box(size=(SIDE,) * 3, divisions=(8, 4, 4), origin=(-SIDE, -0.5 * SIDE, -0.5 * SIDE))
    bodies = (dataclasses.replace(scene.bodies[0], geometry=grown), scene.bodies[1])
    impact = mca.ImpactPhase(duration=1e-4, output_interval=2e-7)
    result = mca.run(dataclasses.replace(scene, bodies=bodies, prescribed=(ends,), impact=impact), multi_rate=2)
    assert result.summary["bonds"]["fine–coarse"]["failed"] == 25
    assert result.F_n.min() == pytest.approx(-2e6 * SIDE**2, rel=0.02)


def test_a_model_file_keeps_bonds(tmp_path: Path):
    ready = prepared(BREAKING)
    save(tmp_path / "bond.mca", BREAKING, ready.meshes)
    assert load(tmp_path / "bond.mca").scene.contacts == BREAKING.contacts


def test_nodes_off_the_faces_are_moved_onto_them_or_left_free():
    """Of a slave that reaches 2 mm beyond the master, the middle rows are glued; 0.1 mm of gap is closed."""
    box = mca.Box(size=(SIDE, 1.4 * SIDE, SIDE), divisions=(1, 7, 4), origin=(-SIDE - 1e-4, -0.7 * SIDE, -0.5 * SIDE))
    scene = halves(mca.Bond())
    ready = prepared(
        dataclasses.replace(scene, bodies=(dataclasses.replace(scene.bodies[0], geometry=box), scene.bodies[1]))
    )
    item = next(item for item in ready.model.passes if item.bonds is not None)
    y, glued = ready.model.X[item.slave, 1], item.bonds.face >= 0
    assert (glued == (np.abs(y) < 0.0051)).all() and glued.sum() == 30
    assert ready.model.X[item.slave[glued], 0] == pytest.approx(0.0, abs=1e-18)
    assert ready.model.X[item.slave[~glued], 0] == pytest.approx(-1e-4)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({"master": mca.RigidPlane()}, r"Contact\.bond = .*: a rigid plane has no faces to glue to"),
        ({"two_way": True}, r"Contact\.bond = .*: the slave's nodes alone are glued"),
        ({"bond": 1.0}, r"Contact\.bond = 1\.0: give a Bond or None"),
    ],
)
def test_contacts_that_cannot_have_a_bond_are_refused(change: dict[str, Any], what: str):
    with pytest.raises(mca.RequestError, match=what):
        dataclasses.replace(BREAKING.contacts[0], **change)


def test_bonds_that_would_hold_nothing_or_places_that_move_are_refused():
    apart = dataclasses.replace(BREAKING.bodies[0], position=(-1e-3, 0.0, 0.0))
    with pytest.raises(mca.RequestError, match=r"^Contact fine–coarse: Bond\.gap = 0\.05: no slave node lies on"):
        prepared(dataclasses.replace(BREAKING, bodies=(apart, BREAKING.bodies[1])))
    with pytest.raises(mca.RequestError, match=r"Bond\.normal = 0"):
        mca.Bond(normal=0.0)


@pytest.mark.gpu
@pytest.mark.parametrize("sets", [("xmax", "xmin"), ("boundary", "boundary")])
def test_bonds_break_on_a_gpu_as_on_the_cpu(sets: tuple[str, str]):
    scene = pulled(mca.Bond(normal=2e6, shear=1e6), (-1.0, 0.5), duration=3e-5, contact={"mu": MU}, sets=sets)
    host, device, again = (mca.run(scene, device=name, precision="float64") for name in ("cpu", "cuda:0", "cuda:0"))
    assert host.summary["bonds"]["fine–coarse"]["failed"] == device.summary["bonds"]["fine–coarse"]["failed"] == 25
    assert device.F_n == pytest.approx(host.F_n, abs=1e-3 * np.abs(host.F_n).max())
    assert all(np.array_equal(device[name], again[name], equal_nan=True) for name in device.history)


def test_a_bond_that_never_fails_has_no_dashpots_of_bodies_at_rest():
    """They took a third of the step of a phone's tied glass, which nothing bounces on."""
    gravity = (0.0, 0.0, -9.81)
    models = [prepared(halves(bond, gravity=gravity)).model for bond in (mca.Bond(), mca.Bond(normal=1e6))]
    assert [item.damping > 0.0 for model in models for item in model.passes if item.leads] == [False, True]
    assert models[0].stable.dt > models[1].stable.dt
