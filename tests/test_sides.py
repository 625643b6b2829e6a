"""Masters whose sides meet at sharp edges: folds, edges of solids, and bodies that lie flush."""

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun, finished, momentum, result_of
from sharp_edges import HARD, SOFT, STEEL, H, bars, frame, in_frame, roof

import warp_mca as mca
from warp_mca.physics.contact.sides import MAX_SIDES, face_geometry, find_sides, stiffest_edge


def sides(mesh: mca.Mesh, nodes: str = "boundary") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of each face of a surface the side, and the directions of the normals; and the faces."""
    face, _ = mesh.surface(nodes)
    area, normal = face_geometry(mesh.points, face)
    return find_sides(face, normal), normal / area[:, None], face


def fly(scene: mca.Scene, **settings) -> tuple[mca.Result, np.ndarray]:
    """A run, and the mean velocity [m/s] that it leaves the first body with."""
    impact = finished(scene, **settings)
    end = list(impact.solver.model.node_start.values())[1]
    return result_of(impact), momentum(impact, 0, end) / impact.solver.model.mass[:end].sum()


def test_a_box_has_three_sides_and_a_ball_one():
    side, normal, _ = sides(mca.Box(size=(0.03, 0.02, 0.01), divisions=(3, 2, 2)).build())
    axis = np.abs(normal).argmax(axis=1)
    assert sorted(set(zip(axis.tolist(), side.tolist(), strict=True))) == sorted(
        (k, side[axis == k][0]) for k in range(3)
    )
    assert set(side) == {0, 1, 2}
    assert not sides(mca.Sphere(radius=0.01, section=2, ring=2, pole_layers=2).build())[0].any()


def test_sides_of_tetrahedra_and_of_a_surface_as_rough_as_can_be():
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(4, 4, 4))
    body = mca.Body(name="box", geometry=box, material=STEEL, element="tet4")
    mesh = mca.mesh(mca.Scene(name="tets", bodies=(body,), impact=mca.ImpactPhase(duration=1.0)))["box"]
    side, normal, _ = sides(mesh)
    assert len(side) == 12 * 16
    assert all(len(set(side[np.abs(normal[:, k]) > 0.9])) == 1 for k in range(3))
    fan = np.random.default_rng(1).normal(size=(40, 3))
    rough = find_sides(np.array([[0, k + 1, k + 2, k + 2] for k in range(40)], np.int32), fan)
    assert rough.max() < MAX_SIDES


def test_sides_that_meet_in_a_point_alone_differ():
    """As opposite sides of a pyramid do, all of which may press a node that its point meets."""
    X = np.array([(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (-1.0, 1.0, 1.0), (-1.0, 1.0, -1.0), (1.0, 1.0, -1.0)])
    face = np.array([(0, 1 + k, 1 + (k + 1) % 4, 1 + (k + 1) % 4) for k in range(4)], np.int32)
    assert len(set(find_sides(face, face_geometry(X, face)[1]))) == 4


@pytest.mark.parametrize("kind", ["L", "U"])
def test_springs_of_a_right_fold_add_no_stiffness(kind: str):
    mesh = frame(kind)
    face, _ = mesh.surface("every")
    assert stiffest_edge(face, face_geometry(mesh.points, face)[1]) == pytest.approx(1.0)


@pytest.mark.parametrize("opening", [30.0, 330.0])
def test_springs_of_both_sides_of_an_edge_add_up(opening: float):
    """In a groove with walls at 30 degrees, and at the edge of a blade of 30 degrees, which a node meets head-on."""
    half = np.radians(0.5 * opening)
    X = np.array([(s * np.sin(half), np.cos(half), z) for z in (0.0, 1.0) for s in (-1.0, 0.0, 1.0)])
    X[[1, 4], :2] = 0.0
    face = np.array([[0, 3, 4, 1], [1, 4, 5, 2]], np.int32)
    assert stiffest_edge(face, face_geometry(X, face)[1]) == pytest.approx(1.0 + np.cos(np.radians(30.0)))


@pytest.mark.parametrize(
    "scene",
    [
        {},
        {"cells": 1},
        {"cells": 2, "penalty": 10.0},
        {"aside": 3.3e-3},
        {"aside": 1e-6},
        {"width": 0.02},
        {"along": 3.0},
        {"along": 3.0, "mu": 0.3, "two_way": True},
    ],
    ids=str,
)
def test_closed_bars_that_meet_end_on_part_as_open_ones_do(scene: dict):
    """Nodes on the rim went over to the sides: bars of one cell passed into each other, of three kept 0.87 m/s."""
    (open_one, v), (closed, w) = (fly(bars(closed, **scene)) for closed in (False, True))
    assert w == pytest.approx(v, abs=0.01)
    assert closed.F_n == pytest.approx(open_one.F_n, abs=0.02 * open_one.F_n.max())
    assert not any("sharp edge" in warning for warning in closed.warnings)


@pytest.mark.parametrize("contact", [{}, {"mu": 0.3}], ids=str)
@pytest.mark.parametrize(
    ("kind", "masters", "v"),
    [
        ("L", ("floor", "left"), (-3.0, -3.0, 0.0)),
        ("U", ("floor", "left", "right"), (0.0, -3.0, 0.0)),
        ("C", ("floor", "left", "back"), (-3.0, -3.0, -3.0)),
    ],
)
def test_sides_of_one_surface_press_as_contacts_with_each_do(kind, masters, v, contact):
    """In an exact fit, 16 % of the energy was lost."""
    (apart, each), (one, all_of_it) = (fly(in_frame(kind, m, v, **contact)) for m in (masters, ("every",)))
    assert np.linalg.norm(each) > 2.0
    assert all_of_it == pytest.approx(each, abs=0.01)
    assert one.summary["energy_error"] < 2e-3 + apart.summary["energy_error"]
    assert one.summary["max_penetration"] == pytest.approx(apart.summary["max_penetration"], rel=0.02)


@pytest.mark.parametrize("degrees", [55.0, 72.0, 90.0, 110.0])
def test_nodes_that_slide_over_an_edge_keep_the_energy(degrees: float):
    sliding = roof(degrees, position=(0.012, 1e-5, 0.0), velocity=(20.0, -3.0, 0.0), penalty=1.0, two_way=False)
    result, v = fly(sliding)
    assert result.summary["energy_error"] < 1e-3
    assert v[0] == pytest.approx(20.0, abs=0.03)
    assert v[1] == pytest.approx(2.52, abs=0.01)


@pytest.mark.parametrize("speed", [20.0, 100.0])
@pytest.mark.parametrize("mu", [0.0, 0.3])
def test_a_node_in_front_of_one_side_is_let_go_by_all_others(mu: float, speed: float):
    """Nodes that slid over the edge were still as deep in the side before it, and were pressed on it 20 um away.

    Slow ones are still beside a face of that side then; of fast ones it has no face near them any more.
    """
    scene = roof(60.0, position=(0.012, 1e-5, 0.0), velocity=(speed, -3.0, 0.0), mu=mu)
    impact = begun(replace(scene, impact=replace(scene.impact, time_step_scale=0.6 if speed < 50.0 else 0.9)))
    slave, spring = impact.solver.contacts[0].slave.numpy(), impact.state.contacts[0].spring
    across = np.array([np.cos(np.radians(30.0)), np.sin(np.radians(30.0)), 0.0])  # normal of the flank
    pressed_after = np.zeros(len(slave), dtype=int)
    passed = np.zeros(len(slave), dtype=bool)
    for step in range(60):
        x = (impact.solver.model.X + impact.state.u.numpy())[slave]  # that the springs of this step are for
        impact.advance(step + 1)
        outside = (x[:, 1] < 0.0) & ((x - [0.02, 0.0, 0.0]) @ across > 1e-6)
        presses = spring.face.numpy().reshape(len(slave), -1)[outside] >= 0
        assert (spring.held.numpy().reshape(len(slave), -1)[outside][~presses] == 0.0).all()
        pressed_after[outside] += presses.any(axis=1)
        passed |= outside
    assert passed.sum() >= 5
    assert pressed_after.max() <= 1  # step, in which a fast node comes over the edge


@pytest.mark.parametrize(("degrees", "told"), [(48.0, True), (55.0, False)])
def test_nodes_that_go_round_an_edge_within_a_side_are_told(degrees: float, told: bool):
    result = mca.run(roof(degrees, position=(0.012, 1e-5, 0.0), velocity=(20.0, -3.0, 0.0)))
    assert any("around a sharp edge" in warning for warning in result.warnings) == told


def test_an_edge_that_drags_over_a_plane_does_not_catch_on_its_nodes():
    """Nodes of the plane run into the side of the edge, and are nearer to its other side then."""
    tilted = roof(90.0, position=(0.02, 2e-3, 0.001), velocity=(0.0, -3.0, 0.0), rotation=0.15, two_way=True)
    longer = replace(tilted, impact=replace(tilted.impact, duration=1.5e-3))
    result, v = fly(longer)
    assert result.summary["energy_error"] < 5e-3
    assert np.linalg.norm(v) < 0.3


@pytest.mark.parametrize(
    ("element", "gap"), [("hex8", 5e-7), ("hex8", 5e-6), ("hex8", 4e-5), ("tet4", 5e-6), ("tet10", 5e-6)]
)
@pytest.mark.parametrize("speed", [5.0, 100.0])
def test_a_block_flies_past_a_box_flush_with_its_flanks(speed: float, gap: float, element: str):
    """The flank, at no distance, hid that the top has the node in front of it as well: its edge was struck."""
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=mca.Box(size=(H * n, 4 * H, 4 * H), divisions=(n, 4, 4), origin=origin),
            material=material,
            velocity=(v, 0.0, 0.0),
            element=element,
        )
        for name, n, origin, material, v in (
            ("block", 4, (-0.0605, gap, -2 * H), SOFT, speed),
            ("box", 8, (-8 * H, -4 * H, -2 * H), HARD, 0.0),
        )
    )
    meet = mca.Contact(
        slave=mca.Surface(body="block", nodes="boundary"), master=mca.Surface(body="box", nodes="boundary")
    )
    impact = mca.ImpactPhase(duration=0.03 / speed, output_interval=3e-4 / speed)
    result = mca.run(mca.Scene(name="flight", bodies=bodies, contacts=(meet,), impact=impact))
    assert (result.F_n == 0.0).all()


def test_scenes_of_a_batch_with_unlike_numbers_of_sides_give_the_bits_that_they_give_alone():
    scenes = [bars(True), bars(False), bars(True, aside=1e-3)]
    alone = [mca.run(scene, threads=1) for scene in scenes]
    for one, other in zip(mca.run_batch(scenes, threads=1), alone, strict=True):
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in other.history)


def test_threads_and_frames_do_not_change_a_bit():
    scene = in_frame("U", ("every",), (0.0, -3.0, 0.0), mu=0.3, two_way=True)
    one, two = (mca.run(scene, threads=count) for count in (1, 2))
    assert all(np.array_equal(one[name], two[name], equal_nan=True) for name in one.history)


@pytest.mark.parametrize(
    "scene",
    [
        in_frame("L", ("every",), (-3.0, -2.5, 0.0), mu=0.3),
        in_frame("C", ("every",), (-3.0, -2.7, -2.4), mu=0.3, two_way=True, initial_overlap="press"),
        roof(55.0, position=(0.012, 1e-5, 0.0), velocity=(20.0, -3.0, 0.0)),
    ],
    ids=["two walls", "three walls", "roof"],
)
def test_searching_more_often_does_not_change_a_bit(scene, monkeypatch):
    """Which faces are listed beyond those that touch depends on when was searched, which differs between devices."""
    histories = []
    for apart in (1, 3, 4):
        monkeypatch.setattr("warp_mca.phases.division.MOST_INTERVALS", apart)
        impact = replace(scene.impact, duration=min(scene.impact.duration, 1e-4))
        histories.append(mca.run(replace(scene, impact=impact)).history)
    assert all(np.array_equal(h[name], histories[0][name], equal_nan=True) for h in histories for name in h)
