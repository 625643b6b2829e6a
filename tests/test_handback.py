"""Owns the tests of the way back from nodes to rigid bodies: constrained bodies, driven bases, deformed shapes."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from warp_mca.geometry import Box
from warp_mca.rigid.body_motion import body_motion, held_axes
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import deformed_chain, hand_back
from warp_mca.rigid.link import mesh_link
from warp_mca.rigid.loads import Loads, Table
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.scene import Body, Fixed, ImpactPhase, Prescribed, Scene
from warp_mca.scene.materials import Elastic

BOX = Box(size=(0.2, 0.03, 0.04), divisions=(6, 2, 3), origin=(-0.1, -0.015, -0.02))
POINTS = BOX.build().points
MASSES = np.random.default_rng(0).uniform(0.5, 1.5, len(POINTS)) * 1e-3


def pose(seed: int) -> Placement:
    rng = np.random.default_rng(seed)
    return Placement(
        pivot=rng.uniform(-0.1, 0.1, 3),
        origin=rng.normal(size=3),
        rotation=Rotation.random(random_state=seed).as_matrix(),
        velocity=rng.normal(size=3),
        angular_velocity=rng.normal(size=3),
    )


def kinetic(V: np.ndarray, masses: np.ndarray = MASSES) -> float:
    return float(0.5 * masses @ (V**2).sum(axis=1))


def held(**axes: np.ndarray) -> np.ndarray:
    mask = np.zeros(POINTS.shape, dtype=bool)
    for axis, nodes in axes.items():
        mask[nodes, "xyz".index(axis)] = True
    return mask


def test_a_free_body_comes_back_with_its_six_motions():
    given = pose(1)
    X, V = given.place(POINTS)
    found = body_motion(POINTS, MASSES, X, V)
    again, speeds = found.placement.place(POINTS)
    np.testing.assert_allclose(again, X, atol=1e-15)
    np.testing.assert_allclose(speeds, V, atol=1e-14)
    np.testing.assert_allclose(found.placement.angular_velocity, given.angular_velocity, rtol=1e-12)
    assert found.vibration_energy < 1e-28 and found.drive_work == 0.0 and found.momenta.shape == (2, 6)


def test_a_free_body_keeps_its_momenta_and_splits_its_energy():
    rng = np.random.default_rng(2)
    X, V = pose(2).place(POINTS + 1e-5 * rng.normal(size=POINTS.shape))
    V = V + rng.normal(size=V.shape)
    found = body_motion(POINTS, MASSES, X, V)
    placed, rigid = found.placement.place(POINTS)
    np.testing.assert_allclose(MASSES @ rigid, MASSES @ V, rtol=1e-12)
    arms = placed - found.placement.origin
    spin, expected = (MASSES @ np.cross(arms, field) for field in (rigid, V))
    np.testing.assert_allclose(spin, expected, rtol=1e-12)
    np.testing.assert_allclose(found.momenta[0], found.momenta[1], rtol=1e-12)
    assert found.kinetic_energy + found.vibration_energy == pytest.approx(kinetic(V), rel=1e-13)
    away = X - placed  # the pose fits best: no rigid motion would bring the shape nearer
    assert np.abs(MASSES @ away).max() < 1e-15 and np.abs(MASSES @ np.cross(arms, away)).max() < 1e-16


def test_a_plate_whose_bottom_is_fixed_across_slides_along_x_alone():
    bottom = np.flatnonzero(POINTS[:, 1] == POINTS[:, 1].min())
    rng, mask = np.random.default_rng(3), held(y=bottom, z=bottom)
    wave = rng.normal(size=POINTS.shape) * ~mask
    X, V = POINTS + [0.3, -0.2, 0.0] + 1e-6 * wave, wave + np.array([0.7, 0.0, 0.0])
    found = body_motion(POINTS, MASSES, X, V, mask)
    speed = MASSES @ V[:, 0] / MASSES.sum()
    np.testing.assert_allclose(found.placement.velocity, [speed, 0.0, 0.0], rtol=1e-13, atol=1e-16)
    np.testing.assert_allclose(found.placement.rotation, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(found.placement.angular_velocity, 0.0, atol=1e-14)
    np.testing.assert_allclose(found.placement.place(POINTS)[0][:, 1:], POINTS[:, 1:] + [-0.2, 0.0], atol=1e-15)
    assert found.kinetic_energy == pytest.approx(0.5 * MASSES.sum() * speed**2, rel=1e-13)
    assert found.kinetic_energy + found.vibration_energy == pytest.approx(kinetic(V), rel=1e-13)
    assert found.momenta.shape == (2, 1) and found.drive_work == 0.0
    assert abs(found.momenta[0, 0]) == pytest.approx(abs(MASSES @ V[:, 0]), rel=1e-12)


def test_a_body_on_a_driven_base_moves_as_the_base_and_says_what_that_costs():
    bottom = np.flatnonzero(POINTS[:, 1] == POINTS[:, 1].min())
    rng, mask = np.random.default_rng(4), held(y=bottom, z=bottom)
    V = np.array([0.7, 0.3, 0.0]) + rng.normal(size=POINTS.shape) * ~mask
    found = body_motion(POINTS, MASSES, POINTS, V, mask)
    np.testing.assert_allclose(found.placement.velocity[1:], [0.3, 0.0], atol=1e-14)
    parts = found.kinetic_energy + found.vibration_energy + found.drive_work
    assert parts == pytest.approx(kinetic(V), rel=1e-13) and abs(found.drive_work) > 1e-6
    np.testing.assert_allclose(found.momenta[0], found.momenta[1], rtol=1e-12)


@pytest.mark.parametrize("deformed", [False, True])
def test_a_body_held_along_an_axis_turns_about_it_alone(deformed: bool):
    axis = np.flatnonzero((POINTS[:, 0] == -0.1) & (np.abs(POINTS[:, 1]) < 1e-12))
    assert len(axis) > 2
    rng, mask = np.random.default_rng(5), held(x=axis, y=axis, z=axis)
    shape = POINTS + (1e-7 * rng.normal(size=POINTS.shape) if deformed else 0.0)
    hinge = Placement(
        pivot=np.array([-0.1, 0.0, 0.0]),
        origin=np.array([0.2, 0.1, 0.0]),
        rotation=Rotation.from_rotvec([0.0, 0.0, 0.8]).as_matrix(),
        velocity=np.zeros(3),
        angular_velocity=np.array([0.0, 0.0, 2.0]),
    )
    X, V = hinge.place(shape)
    V[axis] = 0.0
    found = body_motion(shape, MASSES, X, V + 1e-3 * rng.normal(size=V.shape) * ~mask, mask)
    assert found.momenta.shape[1] == 1
    np.testing.assert_allclose(found.placement.angular_velocity, [0.0, 0.0, 2.0], atol=2e-3)
    np.testing.assert_allclose(found.placement.place(shape)[0], X, atol=1e-9 if deformed else 1e-13)
    np.testing.assert_allclose(found.placement.place(shape)[1][axis], 0.0, atol=1e-6 if deformed else 1e-12)


def test_a_body_that_is_held_all_over_rests():
    V = np.random.default_rng(6).normal(size=POINTS.shape)
    everything = np.arange(len(POINTS))
    end = everything[POINTS[:, 0] == -0.1]
    mask = held(x=end, y=end, z=end)
    found = body_motion(POINTS, MASSES, POINTS, V * ~mask, mask)
    assert found.momenta.shape == (2, 0) and found.kinetic_energy == 0.0
    assert found.vibration_energy == pytest.approx(kinetic(V * ~mask), rel=1e-14)


def test_held_axes_are_read_off_the_scene():
    mesh = BOX.build()
    body = Body(name="plate", geometry=mesh, material=Elastic(E=1e9, nu=0.3, rho=1e3))
    scene = Scene(
        name="s",
        bodies=(body,),
        impact=ImpactPhase(duration=1e-3),
        fixed=(Fixed(body="plate", nodes="ymin", axes="yz"),),
        prescribed=(Prescribed(body="plate", nodes="xmax", axis="x", times=(0.0,), velocities=(1.0,)),),
    )
    mask = held_axes(scene, {"plate": mesh})["plate"]
    low, right = mesh.nodes("ymin"), mesh.nodes("xmax")
    assert mask[low, 1:].all() and mask[right, 0].all() and mask.sum() == 2 * len(low) + len(right)


def links(count: int, points: np.ndarray = POINTS, **given) -> tuple[Chain, dict, dict]:
    names = [f"link{k}" for k in range(count)]
    hinges = {"hinge_in": (-0.1, 0.0), "hinge_out": (0.2, 0.01)}
    chain = Chain(tuple(mesh_link(name, points, MASSES, **hinges) for name in names), origin=(0.1, 0.3), **given)
    return chain, dict.fromkeys(names, points), dict.fromkeys(names, MASSES)


@pytest.mark.parametrize("slide", [None, (0.6, 0.8)])
@pytest.mark.parametrize("moving", [False, True])
def test_chain_and_plate_come_back_together(slide, moving):
    """A nodal motion of all bodies: energies add up, generalised momenta stay, a rigid motion comes back unchanged."""
    table = Table(np.array([0.0, 1.0]), np.array([[0.2, 0.1], [1.0, -0.5]]))
    none = np.zeros(3)
    loads = Loads(friction=none, damping=none, friction_rate=1.0, torques=(None,) * 3, base_velocity=table)
    chain, points, masses = links(3, slide=slide, carriage_mass=0.05 if slide else 0.0, loads=loads if moving else None)
    q, v = np.array([0.3, 0.5, 1.0, 2.9]), np.array([0.4, -1.0, 2.0, 3.0])
    q, v = (q, v) if slide else (q[1:], v[1:])
    placements = {**link_placements(chain.moved_to(0.4), q, v), "plate": pose(9)}
    points, masses = {**points, "plate": POINTS}, {**masses, "plate": MASSES}
    X = {name: placement.place(points[name])[0] for name, placement in placements.items()}
    V = {name: placement.place(points[name])[1] for name, placement in placements.items()}
    carriage = (q[0], v[0]) if slide else (0.0, 0.0)
    back = hand_back(chain, points, masses, X, V, t=0.4, carriage=carriage)
    np.testing.assert_allclose(back.theta, q, rtol=1e-12)
    np.testing.assert_allclose(back.theta_dot, v, rtol=1e-11)
    assert (
        back.vibration_energy < 1e-26
        and max(np.abs(u).max() for u in back.displacements.values()) < 1e-14
        and back.chain.loads is chain.loads
    )

    rng = np.random.default_rng(8)
    X = {name: x + 1e-5 * rng.normal(size=x.shape) for name, x in X.items()}
    V = {name: w + 0.3 * rng.normal(size=w.shape) for name, w in V.items()}
    back = hand_back(chain, points, masses, X, V, t=0.4, carriage=(carriage[0], carriage[1] + 0.1))
    total = sum(kinetic(w) for w in V.values())
    if slide:
        base = table.at(0.4) if moving else np.zeros(2)
        total += 0.5 * 0.05 * ((base + (v[0] + 0.1) * np.array(slide)) ** 2).sum()
    assert back.kinetic_energy + back.vibration_energy + back.drive_work == pytest.approx(total, rel=1e-12)
    assert (abs(back.drive_work) > 1e-6) == moving
    np.testing.assert_allclose(back.momenta[0], back.momenta[1], rtol=1e-12, atol=1e-15)
    rigid = {name: placement.place(points[name])[1] for name, placement in back.placements.items()}
    own = sum(kinetic(w) for w in rigid.values())
    own += 0.5 * 0.05 * ((base + back.theta_dot[0] * np.array(slide)) ** 2).sum() if slide else 0.0
    assert back.kinetic_energy == pytest.approx(own, rel=1e-12)
    name = "link1"
    world = back.placements[name].place(points[name] + back.displacements[name])[0]
    np.testing.assert_allclose(world, X[name], atol=1e-15)


def test_a_bent_shape_swings_on_with_the_momentum_of_its_nodes():
    bent = POINTS.copy()
    bent[:, 1] += 0.3 * (POINTS[:, 0] + 0.1) ** 2  # 12 mm at the end
    chain, points, masses = links(2)
    shapes = dict.fromkeys(points, bent)
    moved = deformed_chain(chain, points, shapes, masses, (None, None))
    np.testing.assert_allclose(moved.links[0].hinge_in, (-0.1, 0.0), atol=1e-15)
    np.testing.assert_allclose(moved.links[0].hinge_out, (0.2, 0.01), atol=1e-15)  # off the mesh's nodes
    on_node = replace(chain, links=tuple(replace(link, hinge_out=(0.2, 0.0)) for link in chain.links))
    moved = deformed_chain(on_node, points, shapes, masses, (None, None))
    np.testing.assert_allclose(moved.links[0].hinge_out, (0.2, 0.012), atol=1e-15)
    q, v = np.array([0.4, 1.0]), np.array([2.0, -3.0])
    placed = link_placements(moved, q, v)
    X, V = ({name: placed[name].place(bent)[k] for name in points} for k in (0, 1))
    back = hand_back(moved, shapes, masses, X, V)
    np.testing.assert_allclose(back.theta, q, rtol=1e-12)
    np.testing.assert_allclose(back.theta_dot, v, rtol=1e-12)
    momentum = sum(masses[name] @ V[name] for name in points)
    np.testing.assert_allclose(back.chain.momentum(q, v), momentum[:2], rtol=1e-12)
    assert back.chain.links[0].centre != pytest.approx(chain.links[0].centre, abs=1e-4)


def test_bodies_without_a_chain_come_back_too():
    X, V = pose(3).place(POINTS)
    back = hand_back(None, {"a": POINTS}, {"a": MASSES}, {"a": X}, {"a": V})
    assert back.chain is None and len(back.theta) == 0
    assert back.kinetic_energy == pytest.approx(kinetic(V), rel=1e-12)
