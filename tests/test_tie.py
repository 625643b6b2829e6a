"""Ties of meshes that do not match: what they keep, what they pass on, what they refuse."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from impacts import SHORT_RANGES, Displaced, begun, figures, finished, momentum, prepared, result_of

import warp_mca as mca
from warp_mca.geometry.face_projection import project, shape
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.step.solver import Solver

SOFT = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
SIDE = 0.01


def bar(
    fine: int = 4,
    coarse: int = 2,
    *,
    apart: float = 0.0,
    swapped: bool = False,
    fixed: tuple[mca.Fixed, ...] = (),
    prescribed: tuple[mca.Prescribed, ...] = (),
    spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    speed: tuple[float, float, float] = (0.0, 0.0, 0.0),
    duration: float = 2e-5,
    **more: object,
) -> mca.Scene:
    """Two blocks along x, the first with the finer mesh, tied at x = 0."""
    one = mca.Box(size=(SIDE, SIDE, SIDE), divisions=(2, fine, fine), origin=(-SIDE, -0.5 * SIDE, -0.5 * SIDE))
    other = dataclasses.replace(one, divisions=(2, coarse, coarse), origin=(apart, -0.5 * SIDE, -0.5 * SIDE))
    slave, master = mca.Surface(body="fine", nodes="xmax"), mca.Surface(body="coarse", nodes="xmin")
    if swapped:
        slave, master = master, slave
    return mca.Scene(
        name="tied bar",
        bodies=tuple(
            mca.Body(name=name, geometry=box, material=SOFT, velocity=speed, angular_velocity=spin)
            for name, box in (("fine", one), ("coarse", other))
        ),
        ties=(mca.Tie(slave=slave, master=master),),
        fixed=fixed,
        prescribed=prescribed,
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 10.0),
        **more,  # pyright: ignore[reportArgumentType]
    )


def test_a_spinning_bar_keeps_momentum_angular_momentum_and_energy():
    scene = bar(3, 2, spin=(40.0, 60.0, 90.0), speed=(3.0, -2.0, 1.0), duration=1e-4)
    impact = begun(scene, precision="float64")
    model, before = impact.solver.model, momentum(impact)
    turning = (model.mass[:, None] * np.cross(model.X, model.V)).sum(axis=0)
    impact.advance()
    assert np.linalg.norm(momentum(impact) - before) < 1e-12 * np.linalg.norm(before)
    u, v = impact.state.u.numpy(), impact.state.v.numpy()
    place = model.X + u - 0.5 * impact.solver.dt * v  # at the half step
    after = (model.mass[:, None] * np.cross(place, v)).sum(axis=0)
    assert np.linalg.norm(after - turning) < 1e-11 * np.linalg.norm(turning)
    ties = model.ties
    off = (model.X + u)[ties.slave] - ties.place(model.X + u)
    assert np.abs(off).max() < 1e-14 * np.abs(u).max() + 1e-16
    assert impact.scene_runs[0].ledger.kept.energy_error < 1e-6


def test_carried_mass_keeps_the_total_and_its_centre():
    for fine, coarse in ((4, 2), (3, 2)):
        scene = bar(fine, coarse)
        ready = prepared(scene)
        rho = 1000.0
        assert ready.model.mass.sum() == pytest.approx(2.0 * rho * SIDE**3, rel=1e-12)
        assert np.abs(ready.model.mass @ ready.model.X).max() < 1e-15
        assert (ready.model.mass[ready.model.ties.slave] == 0.0).all()
        assert (np.delete(ready.model.mass, ready.model.ties.slave) > 0.0).all()


def stiffness(model) -> np.ndarray:
    """Of all elements at rest [N/m], by differences, shape (3 node_count, 3 node_count)."""
    displaced = Displaced(Solver(model, device="cpu", precision="float64", dt=1e-9))
    u, step, columns = np.zeros_like(model.X), 1e-9, []
    for j in range(u.size):
        u.flat[j] = step
        columns.append(-displaced.forces(u).ravel() / step)
        u.flat[j] = 0.0
    return np.array(columns)


def reduced(model) -> tuple[np.ndarray, np.ndarray]:
    """Matrix from the free nodes to all, and the free nodes."""
    ties, count = model.ties, len(model.X)
    free = np.setdiff1d(np.arange(count), ties.slave)
    T = np.eye(count)
    T[ties.slave] = 0.0
    for k in range(4):
        np.add.at(T, (ties.slave, ties.master[:, k]), ties.weight[:, k])
    return np.kron(T[:, free], np.eye(3)), free


@pytest.mark.parametrize("lift", [1.0, 1.1])
def test_the_stable_step_is_below_that_of_the_tied_elements(lift):
    """With lift = 1.1 nodes of the slave lie beyond the edges of the master's faces, with negative shape functions."""
    scene = bar(2, 1)
    box = scene.bodies[0].geometry
    assert isinstance(box, mca.Box)
    wide = dataclasses.replace(box, size=(SIDE, lift * SIDE, SIDE), origin=(-SIDE, -0.5 * lift * SIDE, -0.5 * SIDE))
    bodies = (dataclasses.replace(scene.bodies[0], geometry=wide), scene.bodies[1])
    ready = prepared(dataclasses.replace(scene, bodies=bodies))
    model = ready.model
    assert (model.ties.weight.min() < 0.0) == (lift > 1.0)
    T, free = reduced(model)
    root = np.sqrt(np.repeat(model.mass[free], 3))
    K = T.T @ stiffness(model) @ T / np.outer(root, root)
    exact = 2.0 / np.sqrt(np.linalg.eigvalsh(0.5 * (K + K.T)).max())
    assert 0.7 * exact < model.stable.dt <= exact
    mass = np.concatenate([*nodal_masses(ready.scene, ready.meshes).values()])  # of each body without the tie
    spring = np.zeros(len(mass))
    spring[model.ties.slave] = 1e6  # [N/m]
    pressed = K + T.T @ np.diag(np.repeat(spring, 3)) @ T / np.outer(root, root)
    greatest = np.linalg.eigvalsh(0.5 * (pressed + pressed.T)).max()
    added = model.ties.shared(spring / mass, mass).max()
    assert added < 0.6 * (spring / mass).max()
    assert greatest <= (2.0 / model.stable.dt) ** 2 + added


def test_a_constant_stress_passes_a_tie_of_nested_faces():
    """Forces of the elements under uniaxial stress balance at the masters: exactly where fine faces do not cross."""
    off = {}
    for fine, coarse in ((4, 2), (3, 2)):
        model = prepared(bar(fine, coarse)).model
        u = 1e-6 * model.X * [1.0, -0.3, -0.3]
        force = Displaced(Solver(model, device="cpu", precision="float64", dt=1e-9)).forces(u)
        carried = model.ties.carried(force)[model.ties.carriers]
        off[fine] = np.abs(carried).max() / (1e9 * 1e-6 * (SIDE / coarse) ** 2)
    assert off[4] < 1e-6
    assert 0.1 < off[3] < 0.3  # as the shape functions of the coarse face bend within a fine one


def test_contact_forces_on_slaves_reach_their_masters():
    """The tied face's own edge touches: what the plane takes is the impulse of the bodies."""
    plane = mca.RigidPlane(point=(0.0, -0.5 * SIDE, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="fine", nodes="ymin"), master=plane)
    impact = finished(bar(speed=(0.0, -1.0, 0.0), contacts=(contact,), duration=1e-5), precision="float64")
    model, result = impact.solver.model, result_of(impact)
    force = impact.state.contacts[0].spring.force.numpy()[np.isin(model.passes[0].slave, model.ties.slave)]
    assert (force[:, 1] > 0.0).all() and len(force) == 5
    gained = momentum(impact)[1] + model.mass.sum()
    taken = float(result.F_n.sum() * np.diff(result.time)[0])
    assert gained == pytest.approx(taken, rel=1e-6)


def shortened(patch: pytest.MonkeyPatch) -> None:
    for name, length in SHORT_RANGES.items():
        patch.setattr(name, length)


def test_a_tied_run_repeats_bit_for_bit_alone_in_a_batch_and_on_threads(monkeypatch):
    scene = bar(3, 2, spin=(0.0, 60.0, 90.0), speed=(3.0, -2.0, 1.0))
    alone = finished(scene)
    both = begun(scene, scene)
    both.advance()
    count = alone.solver.model.node_count
    assert all((both.state.v.numpy()[k * count :][:count] == alone.state.v.numpy()).all() for k in range(2))
    shortened(monkeypatch)
    threaded = finished(scene, threads=2)
    assert alone.state.differences(threaded.state) == []
    pairs = zip(figures(alone).values(), figures(threaded).values(), strict=True)
    assert all(np.array_equal(a, b, equal_nan=True) for a, b in pairs)


def test_parts_of_one_body_are_tied_and_a_model_file_keeps_them(tmp_path: Path):
    from warp_mca.accuracy.simulation import mesh
    from warp_mca.scene.model_file import load, save

    scene = bar()
    parts = mca.Parts(
        parts=tuple(
            mca.Part(name=body.name, geometry=body.geometry, at=(0.01, 0.0, 0.0))  # pyright: ignore[reportArgumentType]
            for body in scene.bodies
        )
    )
    one = mca.Body(name="bar", geometry=parts, material={"body": SOFT}, velocity=(1.0, 0.0, 0.0))
    tie = mca.Tie(slave=mca.Surface(body="bar", nodes="fine.xmax"), master=mca.Surface(body="bar", nodes="coarse.xmin"))
    joined = dataclasses.replace(scene, bodies=(one,), ties=(tie,))
    meshes = mesh(joined)
    assert meshes["bar"].cell_count == len(meshes["bar"].cell_sets["body"]) == 40
    save(tmp_path / "bar.mca", joined, meshes)
    stored = load(tmp_path / "bar.mca")
    assert stored.scene.ties == (tie,)
    apart, together = prepared(scene).model, prepared(stored.scene, stored.meshes).model
    assert np.array_equal(apart.ties.master, together.ties.master)
    assert np.allclose(apart.mass, together.mass, rtol=1e-12)
    result = mca.run(stored.scene, meshes=stored.meshes)
    assert result.summary["ties"][0]["nodes"] == 25
    assert result.summary["ties"][0]["size_ratio"] == pytest.approx(2.0)
    assert result.warnings == ()


def test_a_coarser_slave_is_warned_of():
    (warning,) = mca.run(bar(swapped=True)).warnings
    assert "2 times as wide" in warning and "swap slave and master" in warning


@pytest.mark.parametrize(
    ("scene", "what"),
    [
        (bar(apart=1e-3), r"lies 0.001 m off the faces of xmin of coarse"),
        (
            bar(fixed=(mca.Fixed(body="fine", nodes="xmax", axes="x"),)),
            r"^Tie fine:xmax–coarse:xmin: a slave node is fixed .*; fix the masters, too",
        ),
        (
            bar(prescribed=(mca.Prescribed(body="coarse", nodes="xmin", axis="x", times=(0.0,), velocities=(0.0,)),)),
            "^Tie fine:xmax–coarse:xmin: a tied node is also in a joint or driven",
        ),
        (bar(joints=(mca.Weld(name="W", body="fine", nodes="xmax"),)), "a tied node is also in a joint or driven"),
    ],
)
def test_bad_ties_are_refused(scene, what):
    with pytest.raises(mca.RequestError, match=what):
        prepared(scene)


def test_bodies_that_move_apart_and_slaves_tied_twice_are_refused():
    scene = bar()
    moving = dataclasses.replace(scene.bodies[0], velocity=(1.0, 0.0, 0.0))
    with pytest.raises(mca.RequestError, match="give tied bodies one motion"):
        prepared(dataclasses.replace(scene, bodies=(moving, scene.bodies[1])))
    with pytest.raises(
        mca.RequestError, match=r"^Tie fine:xmax–coarse:xmin.slave = 'xmax': some of these nodes are tied twice, by Tie"
    ):
        prepared(dataclasses.replace(scene, ties=scene.ties * 2))


def test_a_slave_may_be_fixed_where_all_its_masters_are():
    planes = tuple(mca.Fixed(body=body, nodes="ymin", axes="y") for body in ("fine", "coarse"))
    impact = finished(bar(fixed=planes, speed=(1.0, 0.0, 0.0)))
    low = np.isclose(impact.solver.model.X[:, 1], -0.5 * SIDE)
    assert (impact.state.u.numpy()[low, 1] == 0.0).all()


@pytest.mark.parametrize("apart", [1e-4, -1e-4])
def test_slaves_are_put_on_the_faces_and_bodies_keep_their_mass(apart):
    model = prepared(bar(apart=apart)).model
    assert model.X[model.ties.slave, 0] == pytest.approx(apart, rel=1e-12)
    assert model.mass.sum() == pytest.approx(2.0 * SOFT.rho * SIDE**3, rel=1e-12)


def test_points_project_on_skew_faces_and_triangles():
    points = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.1], [2.5, 1.0, 0.0], [0.0, 1.5, -0.1], [5.0, 0.0, 0.0]])
    faces = np.array([[0, 1, 2, 3], [1, 4, 2, 2]], dtype=np.int32)
    weight = np.stack([shape(np.array(0.3), np.array(-0.4)), [0.2, 0.5, 0.3, 0.0]])
    at = np.einsum("pc,pci->pi", weight, points[faces])
    found = project(at, points, faces)
    assert found.face.tolist() == [0, 1]
    assert np.abs(np.einsum("pc,pci->pi", found.weight, points[faces]) - at).max() < 1e-12
    assert found.distance.max() < 1e-12 and found.beyond.max() == 0.0
    beside = project(np.array([[5.2, -0.1, 0.0]]), points, faces)
    assert beside.weight.sum() == pytest.approx(1.0, abs=1e-15) and beside.beyond[0] > 0.05


def test_a_nested_plate_fills_the_plate_and_passes_constant_stress():
    plate = mca.NestedPlate(length=0.2, width=0.06, height=0.03, core=(6, 6), core_size=1e-3, shell=2, extension=3)
    body = mca.Body(name="plate", geometry=plate, material=SOFT)
    ties = tuple(
        mca.Tie(slave=mca.Surface(body="plate", nodes=slave), master=mca.Surface(body="plate", nodes=master))
        for slave, master in plate.tied
    )
    impact = mca.ImpactPhase(duration=1e-5)
    model = prepared(mca.Scene(name="plate", bodies=(body,), ties=ties, impact=impact)).model
    assert len(ties) > 1 and [fact["size_ratio"] for fact in model.ties.facts] == pytest.approx([3.0] * len(ties))
    assert model.mass.sum() == pytest.approx(1000.0 * 0.2 * 0.06 * 0.03, rel=1e-12)
    u = 1e-6 * model.X * [1.0, -0.3, -0.3]
    force = model.ties.carried(Displaced(Solver(model, device="cpu", precision="float64", dt=1e-9)).forces(u))
    x = model.X[:, 0]
    inner = np.abs(x) < 0.1 - 1e-9
    assert np.abs(force[inner]).max() < 1e-7 * np.abs(force).max()
    assert force[x > 0.1 - 1e-9, 0].sum() == pytest.approx(-1e9 * 1e-6 * 0.06 * 0.03, rel=1e-5)


def test_bad_plates_and_parts_are_refused():
    plate: dict[str, Any] = {"length": 0.2, "width": 0.06, "height": 0.03}
    with pytest.raises(mca.RequestError, match=r"NestedPlate.core = \(4, 6\): give multiples of 3"):
        mca.NestedPlate(**plate, core=(4, 6))
    with pytest.raises(mca.RequestError, match="multiples of 4, with ratio = 2"):
        mca.NestedPlate(**plate, core=(6, 8), core_depth=2, ratio=2)
    part = mca.Part(name="a", geometry=mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)))
    with pytest.raises(mca.RequestError, match="each with a name of its own"):
        mca.Parts(parts=(part, part))


def test_tied_bodies_relax_together():
    from warp_mca.phases.residual import Relaxation
    from warp_mca.phases.settings import Settings

    held = tuple(mca.Fixed(body=body, nodes="ymin", axes="xyz") for body in ("fine", "coarse"))
    model = prepared(bar(fixed=held)).model
    relaxation = Relaxation(model, Settings(device="cpu", precision="float64", threads=1))
    u = 1e-5 * np.sin(1e3 * model.X[:, [1, 2, 0]])
    u[model.fixed_axes == 7] = 0.0
    shape = relaxation.settle(u, relaxation.solver.new_state())
    assert 0.0 <= shape.elastic < 1e-4 * relaxation._energy(u)
    assert np.abs(shape.u[model.ties.slave] - model.ties.place(shape.u)).max() == 0.0


def test_a_link_is_not_tied_to_another_body():
    scene = mca.make_scene("two_link")
    tie = mca.Tie(slave=mca.Surface(body="AB", nodes="start"), master=mca.Surface(body="OA", nodes="end"))
    with pytest.raises(mca.RequestError, match="a link of the rigid phase is one body; make both meshes Parts of it"):
        prepared(dataclasses.replace(scene, ties=(tie,)))


def test_two_link_takes_tied_rods_and_a_nested_plate_and_swings_with_them():
    tied = {"plate_mesh": "nested", "fine_length": 0.04, "joint_nodes": "axis", "rigid_inertia": "mesh"}
    scene = mca.make_scene("two_link", **tied)
    assert [tie.slave.nodes for tie in scene.ties] == ["outside0", "outside1", "outside2", "fine.start"]
    ready = prepared(scene)
    assert ready.model.element_count < 5000
    start = ready.start
    assert max(start.momentum_mismatch, start.angular_momentum_mismatch, start.energy_mismatch) < 1e-12
    assert ready.warnings == ()
    with pytest.raises(mca.RequestError, match=r"fine_length = 0.3: give a length between"):
        mca.make_scene("two_link", fine_length=0.3)
