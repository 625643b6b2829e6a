"""Owns the tests of the hand-off to finite elements and back: what it keeps, where it puts bodies, what it refuses."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from warp_mca.base.errors import RequestError
from warp_mca.geometry.mesh import Mesh
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import hand_back
from warp_mca.rigid.handoff import HandOff, hand_off
from warp_mca.rigid.placement import link_placements
from warp_mca.rigid.scene_chain import chain_from_scene
from warp_mca.rigid.target import target_plane
from warp_mca.scene import Body, ImpactPhase, Revolute, RigidPhase, RigidPlane, Scene, Slide, Surface, Tip
from warp_mca.scene.materials import Elastic

LENGTH, RADIUS, HEIGHT = 0.21, 0.013, 0.37  # Table 1 [m]
ALUMINIUM = Elastic(E=70e9, nu=0.27, rho=2700.0)


def box(low, high, cells) -> tuple[Mesh, np.ndarray]:
    """A box of hexahedra with the set "top", and its lumped masses: an eighth of each cell's mass to each corner."""
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, cells, strict=True)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    number = np.arange(len(points)).reshape([n + 1 for n in cells])
    corners = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
    spans = [[slice(c, c + n) for c, n in zip(corner, cells, strict=True)] for corner in corners]
    hexahedra = np.stack([number[tuple(span)].ravel() for span in spans], axis=1).astype(np.int32)
    cell = ALUMINIUM.rho * math.prod((b - a) / n for a, b, n in zip(low, high, cells, strict=True))
    masses = np.bincount(hexahedra.ravel(), minlength=len(points)) * cell / 8.0
    top = np.flatnonzero(points[:, 1] == points[:, 1].max()).astype(np.int32)
    return Mesh(points, hexahedra, {"top": top}), masses


def two_link(*, inertia="mesh", shift=(0.0, 0.0, 0.0), plate=None, target=None, height=HEIGHT, **phase):
    """Table 1's manipulator with square rods; `shift` moves the second link's frame against its mesh."""
    built = {
        "OA": box((0.0, -0.013, -0.013), (LENGTH, 0.013, 0.013), (21, 2, 2)),
        "AB": box(np.add((0.0, -0.013, -0.013), shift), np.add((LENGTH, 0.013, 0.013), shift), (21, 2, 2)),
        "plate": box((-0.6, -0.05, -0.05), (0.6, 0.0, 0.05), (12, 1, 2)),
    }
    meshes = {name: mesh for name, (mesh, _) in built.items()}
    masses = {name: mass for name, (_, mass) in built.items()}
    bodies = [Body(name=name, geometry=meshes[name], material=ALUMINIUM) for name in ("OA", "AB")]
    bodies.append(
        plate or Body(name="plate", geometry=meshes["plate"], material=ALUMINIUM, position=(0.1, -height, 0.0))
    )
    rigid = {
        "theta": (0.5 * math.pi, 0.5 * math.pi),
        "theta_dot": (0.0, 0.0),
        "tip": Tip(body="AB", centre=tuple(np.add((LENGTH - RADIUS, 0.0, 0.0), shift)), radius=RADIUS),
        "target": target or Surface(body="plate", nodes="top"),
        "inertia": inertia,
    }
    scene = Scene(
        name="two_link",
        bodies=tuple(bodies),
        impact=ImpactPhase(duration=1e-3),
        rigid=RigidPhase(**(rigid | phase)),
        joints=(
            Revolute(name="A", body="AB", at=shift, other="OA", other_at=(LENGTH, 0.0, 0.0)),
            Revolute(name="O", body="OA", at=(0.0, 0.0, 0.0)),
        ),
        gravity=(0.0, -9.8, 0.0),
    )
    return scene, meshes, masses


def nodal_sums(state: HandOff, masses: dict, names=("OA", "AB")) -> tuple[np.ndarray, np.ndarray, float]:
    """Momentum, angular momentum about the world's origin and kinetic energy of nodes, one body after the other."""
    momentum = sum(masses[name] @ state.velocities[name] for name in names)
    angular = sum(masses[name] @ np.cross(state.positions[name], state.velocities[name]) for name in names)
    return momentum, angular, sum(0.5 * masses[name] @ (state.velocities[name] ** 2).sum(axis=1) for name in names)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (0.05, 0.02, 0.0)])
def test_mesh_inertia_keeps_momentum_and_energy(shift):
    scene, meshes, masses = two_link(shift=shift)
    state = hand_off(scene, meshes, masses)
    momentum, angular, energy = nodal_sums(state, masses)
    np.testing.assert_allclose(momentum[:2], state.rigid.momentum, rtol=1e-12)
    assert angular[2] == pytest.approx(state.rigid.angular_momentum, rel=1e-12)
    assert energy == pytest.approx(state.rigid.kinetic_energy, rel=1e-12)
    worst = max(state.momentum_mismatch, state.angular_momentum_mismatch, state.energy_mismatch)
    assert worst < 1e-12 and state.energy_drift < 1e-10
    assert state.nodes.kinetic_energy == pytest.approx(energy, rel=1e-14)
    work = 0.0  # of gravity since the start: both links lay level, upside down, and at rest
    for name, hinge in (("OA", 0.0), ("AB", shift[1])):
        start = hinge - meshes[name].points[:, 1]
        work += 9.8 * masses[name] @ (start - state.positions[name][:, 1])
    assert energy == pytest.approx(work, rel=1e-9)


def test_links_touch_the_plate_rigidly_and_share_their_hinge():
    scene, meshes, masses = two_link(shift=(0.05, 0.02, 0.0))
    state = hand_off(scene, meshes, masses)
    for name in ("OA", "AB"):
        body, X, V = meshes[name].points, state.positions[name], state.velocities[name]
        assert X.dtype == V.dtype == np.float64
        assert np.array_equal(X[:, 2], body[:, 2]) and not V[:, 2].any()
        assert np.allclose(np.linalg.norm(X - X[0], axis=1), np.linalg.norm(body - body[0], axis=1), rtol=0, atol=1e-15)
    outer, inner = meshes["OA"].points, meshes["AB"].points
    on_outer = np.flatnonzero(np.isclose(outer[:, 0], LENGTH) & np.isclose(outer[:, 1], 0.0))
    on_inner = np.flatnonzero(np.isclose(inner[:, 0], 0.05) & np.isclose(inner[:, 1], 0.02))
    assert len(on_outer) == len(on_inner) == 3
    assert np.abs(state.positions["OA"][on_outer] - state.positions["AB"][on_inner]).max() <= 1e-16
    np.testing.assert_allclose(state.velocities["OA"][on_outer], state.velocities["AB"][on_inner], rtol=0, atol=1e-15)
    centre, velocity = (part[0] for part in state.placements["AB"].place(np.array([scene.rigid.tip.centre])))
    assert centre[1] == pytest.approx(-HEIGHT + RADIUS, abs=1e-15)
    assert (state.v_t, -state.v_n) == pytest.approx((velocity[0], velocity[1]), rel=1e-15)
    np.testing.assert_allclose(state.contact_point, [centre[0], -HEIGHT, 0.0], atol=1e-15)


def test_nodes_on_the_hinge_coincide_bit_for_bit():
    state = hand_off(*two_link())
    corner = np.array([[0.0, 0.0, 0.013]])
    outer = state.placements["OA"].place(corner + np.array([LENGTH, 0.0, 0.0]))
    inner = state.placements["AB"].place(corner)
    assert all(np.array_equal(a, b) for a, b in zip(outer, inner, strict=True))
    assert np.array_equal(state.placements["OA"].place(corner)[0], corner)  # on the ground hinge


def test_slender_rods_give_table_1_and_report_their_mismatch():
    state = hand_off(*two_link(inertia="slender"))
    assert state.t_contact == pytest.approx(0.256018, abs=2e-6)
    np.testing.assert_allclose(np.degrees(state.theta), [19.0464, 36.4331], atol=5e-5)
    np.testing.assert_allclose(state.theta_dot, [-3.34456, -17.29906], atol=5e-6)
    assert (state.v_n, state.v_t) == pytest.approx((2.2531, 3.4057), abs=5e-5)
    assert 1e-4 < state.energy_mismatch < 0.05
    assert state.chain.links[0].mass == state.chain.links[1].mass == pytest.approx(2700 * 0.026**2 * LENGTH)


def test_plate_lies_under_the_tip_and_keeps_its_own_motion():
    scene, meshes, masses = two_link()
    plate = replace(scene.bodies[2], velocity=(0.8, 0.0, 0.0))
    scene = replace(scene, bodies=(*scene.bodies[:2], plate))
    state = hand_off(scene, meshes, masses)
    expected = meshes["plate"].points + np.array([state.contact_point[0], -HEIGHT, 0.0])
    np.testing.assert_allclose(state.positions["plate"], expected, rtol=0, atol=1e-15)
    assert (state.velocities["plate"] == [0.8, 0.0, 0.0]).all()
    still = hand_off(replace(scene, rigid=replace(scene.rigid, centre_target=False)), meshes, masses)
    moved = meshes["plate"].points + np.array([0.1 + 0.8 * still.t_contact, -HEIGHT, 0.0])
    np.testing.assert_allclose(still.positions["plate"], moved, rtol=0, atol=1e-15)
    assert still.t_contact == state.t_contact


def test_a_rising_plate_is_met_earlier_and_where_it_then_is():
    scene, meshes, masses = two_link()
    bodies = (*scene.bodies[:2], replace(scene.bodies[2], velocity=(0.0, 0.3, 0.0), position=(0.0, -0.5, 0.0)))
    state = hand_off(replace(scene, bodies=bodies), meshes, masses)
    level = -0.5 + 0.3 * state.t_contact
    assert state.contact_point[1] == pytest.approx(level, abs=1e-14)
    assert state.positions["plate"][:, 1].max() == pytest.approx(level, abs=1e-14)


def test_tilted_surface_and_rigid_plane_are_the_same_target():
    tilt = -0.2
    scene, meshes, masses = two_link()
    plate = replace(scene.bodies[2], rotation=(0.0, 0.0, tilt), position=(0.05, -HEIGHT, 0.0))
    scene = replace(scene, bodies=(*scene.bodies[:2], plate))
    seen = target_plane(scene, scene.rigid.target, meshes)
    normal = (-math.sin(tilt), math.cos(tilt), 0.0)
    np.testing.assert_allclose(seen.normal, normal, atol=1e-15)
    plane = RigidPlane(point=(0.05, -HEIGHT, 0.0), normal=tuple(3.0 * np.array(normal)))
    one = hand_off(scene, meshes, masses)
    other = hand_off(replace(scene, rigid=replace(scene.rigid, target=plane)), meshes, masses)
    assert one.t_contact == pytest.approx(other.t_contact, abs=1e-13)
    assert (one.v_n, one.v_t) == pytest.approx((other.v_n, other.v_t), abs=1e-11)
    speed = np.hypot(one.v_n, one.v_t)
    tip = one.placements["AB"].place(np.array([scene.rigid.tip.centre]))[1]
    assert speed == pytest.approx(np.linalg.norm(tip), rel=1e-14) and one.v_n > 0.0
    foot = one.contact_point - one.placements["plate"].origin
    assert np.linalg.norm(foot) < 1e-14  # the plate's origin, on its top, lies under the tip


def test_ground_hinge_follows_the_first_body():
    scene, meshes, masses = two_link()
    moved = replace(scene.bodies[0], position=(0.2, 0.1, 0.0), rotation=(0.0, 0.0, 0.5 * math.pi))
    ground = Revolute(name="O", body="OA", at=(0.03, 0.0, 0.0))
    chain = chain_from_scene(
        replace(scene, bodies=(moved, *scene.bodies[1:]), joints=(ground, scene.joints[0])), meshes, masses
    )
    np.testing.assert_allclose(chain.origin, (0.2, 0.13), atol=1e-15)
    assert chain.links[0].hinge_in == (0.03, 0.0)
    assert chain.links[0].hinge_out == pytest.approx((0.18, 0.0))
    assert chain.links[0].centre == pytest.approx((0.075, 0.0), abs=1e-15)


def test_without_a_rigid_phase_bodies_take_their_own_motion():
    mesh, masses = box((0.0, 0.0, 0.0), (0.1, 0.02, 0.03), (3, 1, 1))
    motion = {"velocity": (1.0, -2.0, 0.5), "angular_velocity": (0.3, 0.1, -4.0)}
    turned = Body(
        name="bar", geometry=mesh, material=ALUMINIUM, position=(1, 2, 3), rotation=(0, 0, 0.5 * math.pi), **motion
    )
    plain = Body(name="block", geometry=mesh, material=ALUMINIUM, position=(0, 0.5, 0))
    scene = Scene(name="free", bodies=(turned, plain), impact=ImpactPhase(duration=1e-3))
    state = hand_off(scene, {"bar": mesh, "block": mesh}, {"bar": masses, "block": masses})
    x, y, z = mesh.points.T
    np.testing.assert_allclose(state.positions["bar"], np.stack([1 - y, 2 + x, 3 + z], axis=1), atol=1e-15)
    spin = np.cross([0.3, 0.1, -4.0], state.positions["bar"] - [1, 2, 3])
    np.testing.assert_allclose(state.velocities["bar"], spin + np.array([1.0, -2.0, 0.5]), atol=1e-15)
    assert (
        np.array_equal(state.positions["block"], mesh.points + np.array([0, 0.5, 0]))
        and not state.velocities["block"].any()
    )
    assert state.t_contact == 0.0 and len(state.theta) == 0 and state.rigid is None and state.v_n is None


def chain_scene(count: int, **changes):
    """Boxes hinged in a row, listed out of order, above a rigid plane far below."""
    mesh, masses = box((0.0, -0.01, -0.01), (0.2, 0.01, 0.01), (4, 2, 2))
    names = [f"link{i}" for i in range(count)]
    joints = [
        Revolute(name=f"{b}-{a}", body=a, at=(0.2, 0.0, 0.0), other=b, other_at=(0.0, 0.0, 0.0))
        for a, b in pairwise(names)
    ]
    values = {
        "name": "chain",
        "bodies": tuple(Body(name=name, geometry=mesh, material=ALUMINIUM) for name in names),
        "impact": ImpactPhase(duration=1e-3),
        "joints": (*reversed(joints), Revolute(name="ground", body="link0", at=(0.0, 0.0, 0.0))),
        "rigid": RigidPhase(
            theta=tuple(np.linspace(1.2, 1.8, count)),
            theta_dot=(0.0,) * count,
            tip=Tip(body=names[-1], centre=(0.2, 0.0, 0.0), radius=0.01),
            target=RigidPlane(point=(0.0, -0.15 * count, 0.0)),
            t_max=1.0,
        ),
        "gravity": (0.0, -9.8, 0.0),
    }
    return Scene(**(values | changes)), dict.fromkeys(names, mesh), dict.fromkeys(names, masses)


def test_a_carriage_counts_neither_among_links_nor_among_their_nodes():
    scene, meshes, masses = chain_scene(2)
    slide = Slide(direction=(1.0, 0.0, 0.0), carriage_mass=0.5)
    state = hand_off(replace(scene, rigid=replace(scene.rigid, slide=slide)), meshes, masses)
    assert state.slides and abs(state.theta_dot[0]) > 0.1
    assert max(state.momentum_mismatch, state.angular_momentum_mismatch, state.energy_mismatch) < 1e-12
    np.testing.assert_array_equal(state.angles(state.theta), state.theta[1:])


def test_a_chain_of_four_keeps_momentum_and_closes_its_hinges():
    scene, meshes, masses = chain_scene(4)
    state = hand_off(scene, meshes, masses)
    assert [link.body for link in state.chain.links] == ["link0", "link1", "link2", "link3"]
    assert max(state.momentum_mismatch, state.angular_momentum_mismatch, state.energy_mismatch) < 1e-12
    points = meshes["link0"].points
    start = np.flatnonzero((points[:, 0] == 0.0) & (points[:, 1] == 0.0))
    end = np.flatnonzero((points[:, 0] == 0.2) & (points[:, 1] == 0.0))
    for inner, outer in pairwise(meshes):
        assert np.array_equal(state.positions[inner][end], state.positions[outer][start])
        assert np.array_equal(state.velocities[inner][end], state.velocities[outer][start])


def refuse(pattern: str, scene: Scene, meshes: dict, masses: dict) -> None:
    with pytest.raises(RequestError, match=pattern):
        hand_off(scene, meshes, masses)


def test_chains_that_are_none_are_refused():
    scene, meshes, masses = chain_scene(3)
    *joints, ground = scene.joints
    second = replace(ground, name="second", body="link2")
    refuse(r"one ground hinge", replace(scene, joints=(*joints, ground, second)), meshes, masses)
    refuse(r"ground = \[\]: .*one ground hinge", replace(scene, joints=tuple(joints)), meshes, masses)
    fork = Revolute(name="fork", body="link0", at=(0.1, 0.0, 0.0), other="link2")
    refuse(
        r"'fork'\]: the chain branches or closes a loop at body link0",
        replace(scene, joints=(joints[1], fork, ground)),
        meshes,
        masses,
    )
    twice = replace(joints[0], name="twice")
    refuse(r"'twice'\]: the chain branches", replace(scene, joints=(*joints, twice, ground)), meshes, masses)
    refuse(r"do not hang on the ground hinge", replace(scene, joints=(joints[0], ground)), meshes, masses)
    skew = replace(joints[0], axis=(0.0, 1.0, 0.0))
    refuse(r"axis = .*hinges about z", replace(scene, joints=(skew, joints[1], ground)), meshes, masses)


def test_rigid_phases_that_do_not_fit_are_refused():
    scene, meshes, masses = chain_scene(3)
    rigid = scene.rigid
    short = replace(rigid, theta=(1.0, 1.0), theta_dot=(0.0, 0.0))
    refuse(r"RigidPhase.theta = .*give 3 angles", replace(scene, rigid=short), meshes, masses)
    inner = replace(rigid, tip=replace(rigid.tip, body="link1"))
    refuse(r"must be on the last link, link2", replace(scene, rigid=inner), meshes, masses)
    deep = replace(rigid, target=RigidPlane(point=(0.0, -0.7, 0.0)))
    refuse(r"closest gap .* = 0\.0\d+: the tip never reaches .*lower H", replace(scene, rigid=deep), meshes, masses)
    over = replace(rigid, target=RigidPlane(point=(0.0, 0.5, 0.0)))
    refuse(r"overlaps the target at the start", replace(scene, rigid=over), meshes, masses)
    wall = replace(rigid, target=RigidPlane(normal=(0.0, 0.0, 1.0)))
    refuse(r"parallel to the hinges", replace(scene, rigid=wall), meshes, masses)
    refuse(r"leave the z component 0", replace(scene, gravity=(0.0, -9.8, 1.0)), meshes, masses)
    moving = (replace(scene.bodies[0], velocity=(1.0, 0.0, 0.0)), *scene.bodies[1:])
    refuse(r"link0.velocity = .*theta_dot", replace(scene, bodies=moving), meshes, masses)


def test_targets_that_are_no_plane_are_refused():
    scene, meshes, masses = two_link(target=Surface(body="plate", nodes="boundary"))
    refuse(r"target.nodes = 'boundary': the surface is not flat", scene, meshes, masses)
    scene, meshes, masses = two_link(target=Surface(body="OA", nodes="top"))
    refuse(r"must not be a link", scene, meshes, masses)
    scene, meshes, masses = two_link()
    spinning = replace(scene.bodies[2], angular_velocity=(0.0, 0.0, 1.0))
    refuse(r"must not turn", replace(scene, bodies=(*scene.bodies[:2], spinning)), meshes, masses)


def points_of(chain: Chain, meshes: dict) -> dict:
    return {link.body: meshes[link.body].points for link in chain.links}


@pytest.mark.parametrize("inertia", ["mesh", "slender"])
def test_rigid_motion_comes_back_unchanged(inertia):
    scene, meshes, masses = two_link(inertia=inertia, shift=(0.05, 0.02, 0.0))
    state = hand_off(scene, meshes, masses)
    back = hand_back(state.chain, points_of(state.chain, meshes), masses, state.positions, state.velocities)
    np.testing.assert_allclose(back.theta, state.theta, rtol=1e-12)
    np.testing.assert_allclose(back.theta_dot, state.theta_dot, rtol=1e-12)
    assert back.kinetic_energy == pytest.approx(state.nodes.kinetic_energy, rel=1e-12)
    assert back.vibration_energy < 1e-24 and max(np.abs(u).max() for u in back.displacements.values()) < 1e-15


def test_vibration_that_no_rigid_motion_carries_is_what_is_left():
    scene, meshes, masses = two_link()
    state = hand_off(scene, meshes, masses)
    V, energy = dict(state.velocities), 0.0
    for name in ("OA", "AB"):  # stretching across the axis, in pairs: no momentum, no moment about any hinge
        x, y, z = meshes[name].points.T
        shake = (3.0 * np.sin(40 * x) * y)[:, None] * state.placements[name].rotation[:, 1]
        shake[:, 2] = 0.1 * z
        V[name] = V[name] + shake
        energy += 0.5 * masses[name] @ (shake**2).sum(axis=1)
    back = hand_back(state.chain, points_of(state.chain, meshes), masses, state.positions, V)
    np.testing.assert_allclose(back.theta_dot, state.theta_dot, rtol=1e-12)
    assert back.vibration_energy == pytest.approx(energy, rel=1e-10)


def test_energies_of_any_motion_add_up_and_hinges_stay_closed():
    scene, meshes, masses = chain_scene(3)
    state, rng = hand_off(scene, meshes, masses), np.random.default_rng(1)
    X = {name: x + 1e-5 * rng.standard_normal(x.shape) for name, x in state.positions.items()}
    V = {name: v + rng.standard_normal(v.shape) for name, v in state.velocities.items()}
    total = sum(0.5 * masses[name] @ (V[name] ** 2).sum(axis=1) for name in V)
    turned = state.theta + 2 * math.pi
    back = hand_back(state.chain, points_of(state.chain, meshes), masses, X, V, near=turned)
    assert back.kinetic_energy + back.vibration_energy == pytest.approx(total, rel=1e-13)
    np.testing.assert_allclose(back.theta, turned, atol=1e-4)

    def misfit(theta):
        placed = rigid_shape(state.chain, theta, meshes)
        return sum(masses[name] @ ((X[name] - placed[name]) ** 2).sum(axis=1) for name in X)

    slope = [misfit(back.theta + 1e-6 * e) - misfit(back.theta - 1e-6 * e) for e in np.eye(3)]
    assert np.abs(slope).max() < 1e-9 * (misfit(back.theta + 1e-3) - misfit(back.theta))  # angles: least squares too


def rigid_shape(chain: Chain, theta: np.ndarray, meshes: dict) -> dict:
    placements = link_placements(chain, theta, np.zeros(len(theta)))
    return {name: placement.place(meshes[name].points)[0] for name, placement in placements.items()}
