"""Ties of bodies that move: slaves a gap off their faces take place and velocity there, and nothing heats."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from impacts import begun, momentum, prepared

import warp_mca as mca

SOFT = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
SIDE = 0.01


def blocks(
    gap: float, spin: tuple[float, float, float], slip: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> mca.Scene:
    """Two blocks along x that turn as one about the origin; the finer one, `gap` off, moves with `slip`, too."""
    bodies = []
    for name, cells, x in (("coarse", (2, 2, 2), -SIDE), ("fine", (2, 3, 3), gap)):
        place = np.array([x, 0.3 * SIDE, -0.2 * SIDE])
        velocity = np.cross(spin, place) + (slip if name == "fine" else np.zeros(3))
        box = mca.Box(size=(SIDE, SIDE, SIDE), divisions=cells)
        moving = {"velocity": tuple(velocity.tolist()), "angular_velocity": spin}
        bodies.append(mca.Body(name=name, geometry=box, material=SOFT, position=tuple(place.tolist()), **moving))
    tie = mca.Tie(slave=mca.Surface(body="fine", nodes="xmin"), master=mca.Surface(body="coarse", nodes="xmax"))
    impact = mca.ImpactPhase(duration=1e-4, output_interval=1e-5)
    return mca.Scene(name="turning blocks", bodies=tuple(bodies), ties=(tie,), impact=impact)


@pytest.mark.parametrize("gap", [0.0, 3e-9, 2e-6, -2e-6, 2e-4])
@pytest.mark.parametrize("spin", [(0.0, 0.0, 400.0), (5.0, -80.0, 30.0)])
def test_bodies_that_turn_as_one_go_on_as_one(gap: float, spin: tuple[float, float, float]):
    scene = blocks(gap, spin)
    impact = begun(scene, precision="float64")
    model, before = impact.solver.model, momentum(impact)
    assert np.abs(model.V - np.cross(spin, model.X)).max() < 1e-12 * np.abs(model.V).max()
    assert model.mass.sum() == pytest.approx(2.0 * SOFT.rho * SIDE**3, rel=1e-12)  # though cells fill the gap
    impact.advance()
    assert np.linalg.norm(momentum(impact) - before) < 1e-12 * np.linalg.norm(before)
    energy = impact.scene_runs[0].ledger.energy()
    kinetic = 0.5 * float(model.mass @ (np.cross(spin, model.X) ** 2).sum(axis=1))
    assert energy["initial"] == pytest.approx(kinetic, rel=1e-12)
    stretch = SOFT.rho * float(np.dot(spin, spin)) * (2.0 * SIDE) ** 2 / SOFT.E  # strain of whirling, at most
    assert energy["elastic"] < stretch * kinetic
    assert impact.scene_runs[0].ledger.kept.energy_error < 1e-5


def tube(inner: float, outer: float, around: int, along: int, turn: float = 0.0) -> mca.Mesh:
    """Hexahedra between two cylinders of the z axis, SIDE long, with node sets `in` and `out`."""
    angle, radius, height = (
        turn + 2.0 * np.pi * np.arange(around) / around,
        (inner, outer),
        np.linspace(0, SIDE, along + 1),
    )
    points = [(r * np.cos(a), r * np.sin(a), z) for z in height for r in radius for a in angle]
    ring = np.stack([np.arange(around), (np.arange(around) + 1) % around], axis=1)
    quad = np.concatenate([ring[:, :1], ring[:, :1] + around, ring[:, 1:] + around, ring[:, 1:]], axis=1)
    layer = np.concatenate([quad, quad + 2 * around], axis=1)
    cells = np.concatenate([layer + 2 * around * k for k in range(along)]).astype(np.int32)
    outside = (np.arange(len(points)) // around) % 2 == 1
    sets = {"in": np.flatnonzero(~outside).astype(np.int32), "out": np.flatnonzero(outside).astype(np.int32)}
    return mca.Mesh(points=np.array(points), hexahedra=cells, node_sets=sets)


def bush(fine: int, coarse: int, gap: float, spin: tuple[float, float, float]) -> mca.Scene:
    """A round bush in a ring of fewer cells, which turn as one."""
    meshes = {"bush": tube(0.005, 0.01, fine, 3), "ring": tube(0.01, 0.02, coarse, 2, turn=0.1)}
    moving = {"material": SOFT, "velocity": (2.0, 0.0, 1.0), "angular_velocity": spin}
    tie = mca.Tie(slave=mca.Surface(body="bush", nodes="out"), master=mca.Surface(body="ring", nodes="in"), gap=gap)
    return mca.Scene(
        name="bush",
        bodies=tuple(mca.Body(name=name, geometry=mesh, **moving) for name, mesh in meshes.items()),
        ties=(tie,),
        impact=mca.ImpactPhase(duration=5e-5, output_interval=1e-5),
    )


@pytest.mark.parametrize(("fine", "coarse", "gap"), [(24, 17, 0.05), (40, 12, 0.1)])
def test_a_round_bush_turns_with_the_ring_around_it(fine: int, coarse: int, gap: float):
    """The nodes of the bush lie off the chords of the ring by their rise, pi / 4n of the chord at most."""
    result = mca.run(bush(fine, coarse, gap, (20.0, 30.0, 300.0)))
    rise = 0.01 * (1.0 - np.cos(np.pi / coarse))
    assert 0.5 * rise < result.summary["ties"][0]["gap"] <= rise * (1.0 + 1e-9)
    whirling = SOFT.rho * (300.0 * 0.02) ** 2 / SOFT.E  # strain, at most
    assert result.summary["energy"]["elastic"] < whirling * result.summary["energy"]["initial"]
    assert result.summary["energy_error"] < 1e-6
    assert all("moment of inertia" in warning for warning in result.warnings)


@pytest.mark.parametrize("gap", [1e-7, -2e-5])
def test_a_link_of_parts_swings_into_the_impact_with_a_gap(gap: float):
    """What the chain had before is what the nodes have, as moved onto the faces."""
    scene = mca.make_scene("two_link", fine_length=0.04, joint_nodes="axis", rigid_inertia="mesh")
    link = scene.body("AB")
    assert isinstance(link.geometry, mca.Parts)
    rod, fine = link.geometry.parts
    apart = dataclasses.replace(fine, at=(fine.at[0] + gap, *fine.at[1:]))
    link = dataclasses.replace(link, geometry=mca.Parts(parts=(rod, apart)))
    bodies = tuple(link if body.name == "AB" else body for body in scene.bodies)
    ready = prepared(dataclasses.replace(scene, bodies=bodies))
    model = ready.model
    assert model.ties.facts[0]["gap"] == pytest.approx(abs(gap), rel=1e-5)
    links = slice(model.node_start["OA"], model.node_start["AB"] + len(ready.meshes["AB"].points))
    kinetic = 0.5 * float(model.mass[links] @ (model.V[links] ** 2).sum(axis=1))
    assert ready.start.rigid is not None
    assert kinetic == pytest.approx(ready.start.rigid.kinetic_energy, rel=1e-12)
    assert ready.start.energy_mismatch < 1e-12 and ready.warnings == ()


def test_a_slave_may_slip_as_far_as_turning_explains():
    """In one motion, a slave 0.2 mm off its place moves against it with 400 rad/s times 0.2 mm = 0.08 m/s at most."""
    spin, gap = (0.0, 0.0, 400.0), 2e-4
    prepared(blocks(gap, spin, (0.0, -0.16 + 1e-6, 0.0)))  # against the 0.08 m/s of the gap, to -0.08
    with pytest.raises(mca.RequestError, match=r"node \d+ of fine by 0.082 m/s.*gap of 0.0002 m explains 0.08 m/s"):
        prepared(blocks(gap, spin, (0.0, 2e-3, 0.0)))


@pytest.mark.parametrize("slip", [(1.0, 0.0, 0.0), (0.0, 1e-3, 0.0)])
def test_a_slave_that_moves_against_its_master_is_refused(slip: tuple[float, float, float]):
    with pytest.raises(mca.RequestError, match="give tied bodies one motion"):
        prepared(blocks(0.0, (0.0, 0.0, 100.0), slip))


def test_bodies_that_turn_differently_are_refused_however_fast_others_are():
    scene = blocks(0.0, (0.0, 0.0, 0.0))
    turning = dataclasses.replace(scene.bodies[1], angular_velocity=(1e-2, 0.0, 0.0))
    bullet = mca.Body(name="bullet", geometry=mca.Box(size=(SIDE, SIDE, SIDE), divisions=(1, 1, 1)), material=SOFT)
    bullet = dataclasses.replace(bullet, position=(1.0, 0.0, 0.0), velocity=(500.0, 0.0, 0.0))
    with pytest.raises(mca.RequestError, match="give tied bodies one motion"):
        prepared(dataclasses.replace(scene, bodies=(scene.bodies[0], turning, bullet)))


def test_a_slave_off_all_faces_is_named_as_its_body_numbers_it():
    scene = blocks(0.0, (0.0, 0.0, 0.0))
    box = mca.Box(size=(SIDE, 2.0 * SIDE, SIDE), divisions=(2, 6, 3))
    tall = dataclasses.replace(scene.bodies[1], geometry=box, rotation=(0.0, 0.0, 0.01))
    mesh = box.build()
    edge = np.flatnonzero(np.isclose(mesh.points[:, 0], 0.0) & np.isclose(mesh.points[:, 1], 2.0 * SIDE))
    with pytest.raises(mca.RequestError) as error:
        prepared(dataclasses.replace(scene, bodies=(scene.bodies[0], tall)))
    named = [f"node {k} of fine, at (0, 0.02, {mesh.points[k, 2]:.4g}) m in the body's frame" for k in edge]
    assert any(name in str(error.value) for name in named) and "lies 0.01 m off the faces" in str(error.value)
