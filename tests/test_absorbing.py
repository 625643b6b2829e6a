"""Owns the tests of absorbing boundaries: closed forms, energy, bodies that move, batches, what is refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import begun, figures, finished, prepared, result_of

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.physics.absorbing.nodes import NORMAL, TANGENTIAL
from warp_mca.scene import model_file
from warp_mca.scenes import two_link
from warp_mca.verify.absorbing import reflected_share

METAL = mca.Elastic(E=70e9, nu=0.25, rho=2700.0)
C_P, C_S = METAL.wave_speeds["dilatational"], METAL.wave_speeds["shear"]
SIDE, LENGTH = 1e-3, 20e-3
DRIFT = (3.0, -2.0, 1.0)


def column(axis: str = "x", speed: float = 1.0, centre: Any = None, **more: Any) -> mca.Scene:
    """A column along x between planes of symmetry, one end driven along an axis from rest, the other one absorbing."""
    box = mca.Box(size=(LENGTH, SIDE, SIDE), divisions=(20, 1, 1))
    across = "".join(letter for letter in "xyz" if letter != axis)
    rise = 5e-6
    return mca.Scene(
        name="column",
        bodies=(mca.Body(name="column", geometry=box, material=METAL),),
        fixed=tuple(mca.Fixed(body="column", nodes=nodes, axes=across) for nodes in ("ymin", "ymax")),
        prescribed=(
            mca.Prescribed(body="column", nodes="xmin", axis=axis, times=(0.0, rise), velocities=(0.0, speed)),
        ),
        absorbing=(mca.Absorbing(body="column", nodes="xmax", centre=centre),),
        impact=replace(mca.ImpactPhase(duration=30e-6, output_interval=1e-6), **more),
    )


def drop(drift: tuple[float, float, float] = (0.0, 0.0, 0.0), **changes: Any) -> mca.Scene:
    """A small box strikes a larger one near its edge, whose sides absorb and are touched too; both may drift along."""
    small = mca.Box(size=(4e-3, 4e-3, 4e-3), divisions=(2, 2, 2), origin=(3.1e-3, 0.0, 1.0e-3))
    large = mca.Box(size=(8e-3, 6e-3, 8e-3), divisions=(4, 3, 4), origin=(0.0, -6e-3, 0.0))
    middle = (5e-3, 0.0, 3e-3)
    fall = (drift[0], drift[1] - 2.0, drift[2])
    falling = mca.Body(name="small", geometry=small, material=METAL, velocity=fall, position=(0.0, 1e-7, 0.0))
    kept = {
        "name": "drop",
        "bodies": (falling, mca.Body(name="large", geometry=large, material=METAL, velocity=drift)),
        "contacts": (
            mca.Contact(
                slave=mca.Surface(body="large", nodes="ymax"), master=mca.Surface(body="small", nodes="ymin"), mu=0.3
            ),
        ),
        "absorbing": tuple(
            mca.Absorbing(body="large", nodes=nodes, centre=middle) for nodes in ("ymin", "xmin", "xmax", "zmin")
        ),
        "gravity": (0.0, -9.8, 0.0),
        "impact": mca.ImpactPhase(duration=5e-6, output_interval=2.5e-7),
        "tip": mca.Point(body="large", at=(8e-3, -6e-3, 0.0)),
    }
    return mca.Scene(**(kept | changes))


@pytest.mark.parametrize(("axis", "c"), [("x", C_P), ("y", C_S)])
def test_a_driven_column_gives_away_power_and_momentum_of_a_plane_wave(axis: str, c: float):
    """Once all of it moves with v, the far end gives away rho c A v^2 and rho c A v each second, at any stable step."""
    impact = finished(column(axis, time_step_scale=1.0), precision="float64")
    found, k = result_of(impact), "xyz".index(axis)
    late, force = found.time > 20e-6, METAL.rho * c * SIDE**2
    np.testing.assert_allclose(np.gradient(found["E_absorbed"], found.time)[late], force, rtol=5e-3)
    np.testing.assert_allclose(np.diff(found["E_absorbed"][late]).mean() / 1e-6, force, rtol=5e-4)
    impulse = found.summary["absorbed_impulse"]["column"]
    given = METAL.rho * SIDE**2 * (c * (30e-6 - 2.5e-6) - LENGTH)  # of the wave, less what the column holds
    assert impulse[k] == pytest.approx(given, rel=2e-3)
    assert np.abs(np.delete(impulse, k)).max() < 1e-9 * given
    assert found.summary["energy_error"] < 1e-11
    assert found.summary["energy"]["absorbed"] == found["E_absorbed"][-1]


def test_dashpots_of_faces_add_up_at_edges_and_overlapping_sets_count_once():
    box = mca.Box(size=(2e-3, 3e-3, 4e-3), divisions=(2, 3, 2))
    sets = [mca.Absorbing(body="box", nodes=nodes) for nodes in ("xmax", "boundary", "ymin")]
    bodies = (mca.Body(name="box", geometry=box, material=METAL, rotation=(0.0, 0.0, 0.5)),)
    scene = mca.Scene(name="box", bodies=bodies, absorbing=(sets[0],), impact=mca.ImpactPhase(duration=1e-6))
    one = prepared(scene).model.absorbing
    n = np.array([np.cos(0.5), np.sin(0.5), 0.0])
    expected = METAL.rho * 12e-6 * (C_P * np.outer(n, n) + C_S * (np.eye(3) - np.outer(n, n)))
    np.testing.assert_allclose(one.damping.sum(axis=0), expected, rtol=1e-12, atol=1e-12 * expected.max())
    assert not one.sprung
    every = prepared(replace(scene, absorbing=tuple(sets))).model.absorbing
    areas = np.array([[24e-6, 0, 0], [0, 16e-6, 0], [0, 0, 12e-6]]).diagonal()
    assert np.trace(every.damping.sum(axis=0)) == pytest.approx(METAL.rho * areas.sum() * (C_P + 2.0 * C_S), rel=1e-12)
    assert len(every.node) == 36 - 2  # all but those inside


@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10"])
def test_dashpots_and_springs_around_a_ball_add_up_to_their_means(element: str):
    """Over a sphere, the mean of n n^T is I / 3: a few percent of the area is lost to flat faces."""
    ball = mca.Sphere(radius=0.01)
    scene = mca.Scene(
        name="ball",
        bodies=(mca.Body(name="ball", geometry=ball, material=METAL, element=element, position=(1.0, 2.0, 3.0)),),
        absorbing=(mca.Absorbing(body="ball", nodes="surface", centre=(0.0, 0.0, 0.0)),),
        impact=mca.ImpactPhase(duration=1e-6),
    )
    found, area = prepared(scene).model.absorbing, 4.0 * np.pi * 1e-4
    for matrices, mean in (
        (found.damping, METAL.rho * (C_P + 2.0 * C_S) / 3.0),
        (found.stiffness, METAL.shear_modulus / 0.01 * (NORMAL + 2.0 * TANGENTIAL) / 3.0),
    ):
        np.testing.assert_allclose(matrices.sum(axis=0) / (area * mean), np.eye(3), atol=0.03)


def test_springs_hold_a_steady_load():
    """A column pushed on slowly and then held: its springs carry S u, its dashpots nothing."""
    scene = column(speed=1.0, duration=120e-6, output_interval=2e-6, centre=(0.0, 0.5 * SIDE, 0.5 * SIDE))
    times, velocities = (0.0, 20e-6, 40e-6), (0.0, 1.0, 0.0)
    drive = replace(scene.prescribed[0], times=times, velocities=velocities)
    impact = finished(replace(scene, prescribed=(drive,)), precision="float64")
    area, way = SIDE**2, 20e-6
    bar = METAL.rho * C_P**2 * area / LENGTH
    spring = NORMAL * METAL.shear_modulus / LENGTH * area
    load = way / (1.0 / bar + 1.0 / spring)
    u = impact.state.u.numpy()[impact.solver.model.absorbing.node, 0]
    np.testing.assert_allclose(u, load / spring, rtol=2e-3)
    energy = impact.scene_runs[0].ledger.energy()
    assert energy["elastic"] == pytest.approx(0.5 * load**2 / bar, rel=5e-3)
    assert energy["absorbed"] > 0.5 * load**2 / spring
    assert impact.scene_runs[0].ledger.kept.energy_error < 1e-12


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_boundaries_absorb_relative_to_the_motion_of_the_body(precision: str):
    """Nodes that are touched, at edges and corners: the same in a frame that moves, with closed energy."""
    still, moving = (finished(drop(drift), precision=precision) for drift in ((0.0, 0.0, 0.0), DRIFT))
    exact = 1e-9 if precision == "float64" else 1e-3
    one, other = result_of(still), result_of(moving)
    assert one["E_absorbed"][-1] > 0.05 * one["E_kinetic"][0]
    scale = one["E_absorbed"].max()
    np.testing.assert_allclose(other["E_absorbed"], one["E_absorbed"], atol=exact * scale)
    np.testing.assert_allclose(other.F_n, one.F_n, atol=exact * one.F_n.max())
    way = moving.state.u.numpy() - still.state.u.numpy()
    drift = still.state.steps * still.solver.dt * np.array(DRIFT)
    np.testing.assert_allclose(way, np.broadcast_to(drift, way.shape), rtol=exact)
    errors = [item.scene_runs[0].ledger.kept.energy_error for item in (still, finished(drop(absorbing=())))]
    assert max(errors) < 1e-5


def test_a_body_that_moves_as_it_did_feels_nothing():
    scene = drop(DRIFT, contacts=(), gravity=(0.0, 0.0, 0.0))
    impact = finished(scene, precision="float64")
    large = impact.solver.model.node_start["large"]
    np.testing.assert_allclose(impact.state.v.numpy()[large:], np.tile(DRIFT, (100, 1)), rtol=1e-12)
    assert abs(impact.scene_runs[0].ledger.energy()["absorbed"]) < 1e-20
    assert "E_absorbed" not in result_of(finished(replace(scene, absorbing=()))).history


def test_the_stable_step_is_that_without_dashpots_and_springs_lower_it_a_little():
    scene = drop()
    scene = replace(scene, contacts=(replace(scene.contacts[0], penalty=1.0),))
    bare = replace(scene, absorbing=tuple(replace(item, centre=None) for item in scene.absorbing))
    steps = [prepared(item).model.stable.dt for item in (replace(scene, absorbing=()), bare, scene)]
    assert steps[0] == steps[1] > steps[2] > 0.8 * steps[0]


def test_scenes_of_a_batch_absorb_as_they_do_alone():
    scenes = drop(), drop(absorbing=()), drop(DRIFT, gravity=(0.0, 0.0, 0.0))
    batch, alone = begun(*scenes), [finished(scene) for scene in scenes]
    batch.advance()
    for k, impact in enumerate(alone):
        one, found = result_of(impact), result_of(batch, k)
        assert set(one.history) == set(found.history)
        assert [name for name in one.history if not np.array_equal(one[name], found[name], equal_nan=True)] == []
        assert one.summary.get("absorbed_impulse") == found.summary.get("absorbed_impulse")


def test_a_stored_state_goes_on_to_the_same_bits(tmp_path: Path):
    whole, found = finished(drop()), begun(drop())
    found.advance(until=20)
    found.save(tmp_path / "state")
    other = begun(drop())
    other.load(tmp_path / "state")
    other.advance()
    assert other.state.differences(whole.state) == []
    one, expected = figures(other), figures(whole)
    assert [name for name in expected if one[name].tobytes() != expected[name].tobytes()] == []


def chip_on_slab() -> mca.Scene:
    """A chip of fine cells strikes a slab of coarse ones that an absorbing side holds against gravity."""
    slab = mca.Box(size=(0.06, 0.06, 0.02), divisions=(6, 6, 4))
    chip = mca.Box(size=(0.005, 0.005, 0.005), divisions=(4, 4, 4), origin=(0.028, 0.027, 0.02001))
    steel = mca.Elastic(E=200e9, nu=0.3, rho=7850.0)
    top = mca.Surface(body="slab", nodes="zmax")
    return mca.Scene(
        name="slab",
        bodies=(
            mca.Body(name="slab", geometry=slab, material=steel),
            mca.Body(name="chip", geometry=chip, material=steel, velocity=(0.0, 0.0, -10.0)),
        ),
        contacts=(mca.Contact(slave=mca.Surface(body="chip", nodes="zmin"), master=top, penalty=0.2),),
        absorbing=(mca.Absorbing(body="slab", nodes="zmin"),),
        gravity=(0.0, 0.0, -1e6),
        impact=mca.ImpactPhase(duration=1.5e-4, output_interval=5e-6, energy_tolerance=10.0),
    )


def test_sides_of_slow_elements_absorb_what_they_do_with_one_rate():
    """Dashpots that acted in the steps of the chip took up 2 % more, without end."""
    one, several = (mca.run(chip_on_slab(), multi_rate=rate) for rate in (None, 3))
    assert several.summary["multi_rate"] == 3
    assert several["E_absorbed"][-1] == pytest.approx(one["E_absorbed"][-1], rel=2e-4)
    error = several["E_total_error"]
    assert np.ptp(error[10:]) < 5e-6 * one["E_absorbed"][-1]


@pytest.mark.gpu
def test_sides_of_slow_elements_on_a_gpu():
    cpu, cuda, again = (mca.run(chip_on_slab(), device=name, multi_rate=3) for name in ("cpu", "cuda:0", "cuda:0"))
    for name in ("F_n_N", "E_kinetic", "E_internal", "E_absorbed"):
        np.testing.assert_allclose(cuda[name], cpu[name], atol=1e-4 * np.abs(cpu[name]).max())
    assert all(np.array_equal(cuda[name], again[name], equal_nan=True) for name in cuda.history)


@pytest.mark.gpu
@pytest.mark.parametrize(("precision", "tolerance"), [("mixed", 1e-3), ("float64", 1e-7)])
def test_a_device_absorbs_what_the_cpu_does(precision: str, tolerance: float):
    cpu, cuda, again = (mca.run(drop(), device=name, precision=precision) for name in ("cpu", "cuda:0", "cuda:0"))
    for name in ("F_n_N", "E_absorbed"):
        np.testing.assert_allclose(cuda[name], cpu[name], atol=tolerance * np.abs(cpu[name]).max())
    assert all(np.array_equal(cuda[name], again[name], equal_nan=True) for name in cuda.history)


def test_nodes_whose_motion_is_given_have_no_dashpots():
    held = tuple(mca.Fixed(body="large", nodes=nodes) for nodes in ("ymin", "xmin"))
    bare = drop(absorbing=tuple(mca.Absorbing(body="large", nodes=nodes) for nodes in ("xmin", "xmax")))
    count = [len(prepared(replace(bare, fixed=fixed)).model.absorbing.node) for fixed in ((), held)]
    assert count == [40, 20 - 5]
    moving = prepared(replace(bare, bodies=(bare.bodies[0], replace(bare.bodies[1], velocity=DRIFT)), fixed=held))
    assert len(moving.model.absorbing.node) == 20 - 5
    (slide,) = (mca.Fixed(body="large", nodes="ymax", axes="y"),)
    damping = prepared(replace(bare, fixed=(slide,))).model.absorbing.damping
    assert (damping[:, 1, 1] == 0.0).sum() == 10 and not damping[damping[:, 1, 1] == 0.0][:, 1].any()


REFUSED = {
    "turns": (
        {"bodies": (drop().bodies[0], replace(drop().bodies[1], angular_velocity=(0.0, 0.0, 1.0)))},
        "Absorbing.body = 'large': large turns at the start",
    ),
    "driven": (
        {"prescribed": (mca.Prescribed(body="large", nodes="ymin", axis="x", times=(0.0,), velocities=(1.0,)),)},
        "Absorbing.nodes = 'ymin, xmin, xmax, zmin': a node there is driven along some axes only",
    ),
    "tied": (
        {"joints": (mca.Prismatic(name="P", body="large", nodes="ymin", axis=(1.0, 0.0, 0.0)),)},
        "Absorbing.nodes = .* or tied by a joint; bind other nodes of large",
    ),
    "set": ({"absorbing": (mca.Absorbing(body="large", nodes="side"),)}, "node set = 'side': the mesh has"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_absorb_is_refused(name: str):
    changes, words = REFUSED[name]
    with pytest.raises(RequestError, match=words):
        prepared(drop(**changes))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: mca.Absorbing(body="b", nodes=3), r"Absorbing.nodes = 3"),  # type: ignore[arg-type]
        (lambda: mca.Absorbing(body="b", nodes="n", centre=(0.0, 1.0)), r"Absorbing.centre = "),  # type: ignore[arg-type]
        (
            lambda: drop(absorbing=(mca.Absorbing(body="b", nodes="n"),)),
            r"Absorbing.body = 'b': the scene's",
        ),
        (lambda: two_link.build(plate_absorbs="ends", t_end=1.0), r"Scene.t_end = 1.0: .*leave t_end out"),
    ],
)
def test_bad_values_are_named(make: Any, words: str):
    with pytest.raises(RequestError, match=words):
        make()


def test_a_model_file_keeps_absorbing_boundaries(tmp_path: Path):
    scene = drop()
    model_file.save(tmp_path / "drop.mca", scene, mca.mesh(scene))
    assert model_file.load(tmp_path / "drop.mca").scene.absorbing == scene.absorbing


def test_the_plate_of_two_link_absorbs_at_its_ends_or_all_round():
    none, ends, every = (two_link.build(plate_absorbs=name) for name in ("none", "ends", "all"))
    assert none.absorbing == () and none.fixed == ends.fixed != every.fixed == ()
    assert [item.nodes for item in ends.absorbing] == ["xmin", "xmax"]
    assert {item.nodes for item in every.absorbing} == {"xmin", "xmax", "zmin", "zmax", "bottom"}


def test_theory_sends_back_nothing_at_right_angles_and_all_at_grazing_ones():
    """Energy is kept: between, the flux of what is sent back is that of a boundary that takes some of it up."""
    for wave, c in (("P", C_P), ("S", C_S)):
        shares = reflected_share(wave, np.sin(np.radians([0.0, 30.0, 60.0, 89.9])) / c, METAL.wave_speeds)
        assert shares[0] < 1e-20 and shares[-1] > 0.98
        assert (np.diff(shares) > 0.0).all()
