"""Hinges as built: meshes of fork and eye, and what of them a pin in their holes takes."""

import math

import numpy as np
import pytest
from impacts import finished, momentum, result_of
from recipes import R
from scipy.integrate import quad
from test_joint import SOFT
from test_pin_limit import LENGTH, SIDE, extra_length

import warp_mca as mca
from warp_mca.geometry.lug import EYE, HOLE, SHOULDER, SLOT
from warp_mca.geometry.quality import check, doubled_nodes, edge_lengths, scaled_jacobian, volumes
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.handback import deformed_chain
from warp_mca.rigid.link import slender_link
from warp_mca.scene.ties import Pin


def lug_rod(**changes) -> mca.LugRod:
    return mca.LugRod(**{"radius": R, "length": 0.1, "tip": "flat", "axial": 6, **changes})


def slab(half: float) -> float:
    """Volume of a lug between two planes, with its hole [radius^3]."""
    section = half * math.sqrt(1.0 - half**2) + math.asin(half)
    ball = 0.5 * math.pi * (2.0 * half - 2.0 * half**3 / 3.0)
    return 2.0 * SHOULDER * section + ball - 2.0 * math.pi * HOLE**2 * half


def outside(half: float) -> float:
    """Volume of a lug outside of two planes."""
    ball = 2.0 * math.pi / 3.0
    before = quad(lambda y: 2.0 * math.sqrt((HOLE**2 - y**2) * (1.0 - y**2)), -HOLE, HOLE)[0]
    hole = before + ball * (1.0 - (1.0 - HOLE**2) ** 1.5)
    return math.pi * SHOULDER + ball - hole - slab(half)


@pytest.mark.parametrize(("kind", "volume"), [("eye", slab(EYE)), ("fork", outside(SLOT))])
def test_volumes_of_lugs_converge_to_those_of_solids(kind, volume):
    """By order 2, since facets lie within the round rod and outside of its hole."""
    errors = []
    for section in (8, 16):
        mesh = lug_rod(section=section, ring=section // 2, start=kind, end=kind).build()
        whole = math.pi * (0.1 / R - 2.0 * SHOULDER) + 2.0 * volume
        errors.append(1.0 - volumes(mesh).sum() / R**3 / whole)
    assert 0.0 < errors[1] < 0.003
    assert math.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.4)


@pytest.mark.parametrize(("start", "end"), [("eye", "fork"), ("fork", "flat"), ("flat", "eye")])
@pytest.mark.parametrize(("section", "ring"), [(4, 2), (6, 3), (12, 4), (14, 9)])
def test_meshes_are_sound(start, end, section, ring):
    mesh = lug_rod(section=section, ring=ring, start=start, end=end).build()
    check(mesh, "rod")
    assert doubled_nodes(mesh) == 0
    assert scaled_jacobian(mesh).min() > 0.36
    beyond = {"flat": 0.0, "eye": R, "fork": R * math.sqrt(1.0 - SLOT**2)}
    assert mesh.points[:, 0].min() == pytest.approx(-beyond[start], abs=1e-12)
    assert mesh.points[:, 0].max() == pytest.approx(0.1 + beyond[end], abs=1e-12)
    mirrored = mesh.points * [1.0, 1.0, -1.0]
    np.testing.assert_allclose(np.sort(mirrored, axis=0), np.sort(mesh.points, axis=0), rtol=0.0, atol=1e-12)
    for kind, name, x in ((start, "hole", 0.0), (end, "end_hole", 0.1)):
        assert (name in mesh.node_sets) == (kind != "flat")
        if kind != "flat":
            hole = mesh.points[mesh.surface(name)[0]] - [x, 0.0, 0.0]
            np.testing.assert_allclose(np.hypot(hole[..., 0], hole[..., 1]), HOLE * R, rtol=1e-12)
            inner = np.abs(hole[..., 2]) / R
            limits = (0.0, EYE) if kind == "eye" else (SLOT, math.sqrt(1.0 - HOLE**2))
            assert inner.min() >= limits[0] - 1e-12
            assert inner.max() == pytest.approx(limits[1], rel=0.05)


def test_lugs_leave_the_smallest_cell_of_a_rod_and_its_inertia():
    """About the hinge, the ball behind it makes up for what the eye lacks before it."""
    shape = {"radius": R, "length": 0.21, "section": 12, "ring": 4, "axial": 38, "focus_size": 0.33e-3}
    plain, lug = mca.Rod(**shape).build(), mca.LugRod(**shape).build()
    assert edge_lengths(lug).min() == pytest.approx(edge_lengths(plain).min(), rel=1e-9)
    ratios = []
    for power in (0, 2):
        moments = [
            volumes(mesh) @ np.linalg.norm(mesh.points[mesh.hexahedra].mean(axis=1)[:, :2], axis=1) ** power
            for mesh in (lug, plain)
        ]
        ratios.append(moments[0] / moments[1])
    assert ratios == pytest.approx([0.982, 1.0], abs=0.001)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"start": "ball"}, "LugRod.start = 'ball': choose flat, fork or eye"),
        ({"tip": "hemisphere", "end": "fork"}, "LugRod.end = 'fork': the rod ends in a hemisphere"),
        ({"length": 0.037, "end": "fork"}, r"LugRod.length = 0.037: lugs and tip need more than 0.0377 m"),
        ({"section": 2}, "LugRod.section = 2: fork and eye share the layers of cells"),
    ],
)
def test_what_has_no_shape_is_refused(changes, words):
    with pytest.raises(mca.RequestError, match=words):
        lug_rod(**changes)


def test_a_pin_takes_the_surfaces_of_both_holes():
    scene = mca.make_scene("two_link", hinge="lug", axial_OA=4, axial_AB=4, section=4, ring=2)
    meshes = mca.mesh(scene)
    ground, middle = scene.joints
    assert isinstance(ground, mca.Revolute)
    assert isinstance(middle, mca.Revolute)
    for mesh, joint, at, name in (
        ("OA", ground, ground.at, "hole"),
        ("OA", middle, middle.at, "end_hole"),
        ("AB", middle, middle.other_at, "hole"),
    ):
        assert joint.pin is not None
        assert joint.pin == Pin(0.3 * R, hole=True)
        weight = joint.pin.weights(meshes[mesh].points, at, joint.axis)
        np.testing.assert_array_equal(np.flatnonzero(weight), meshes[mesh].nodes(name))
        assert set(weight) == {0.0, 1.0}
    with pytest.raises(mca.RequestError, match=r"pin_radius = 0.005: with hinge=lug a pin fills its hole"):
        mca.make_scene("two_link", hinge="lug", pin_radius=0.005)


def test_a_hole_that_is_not_there_is_refused():
    geometry = lug_rod(section=4, ring=2)
    words = r"pin_radius = 0.005: 0 nodes of bar lie on such a hole.* give the hole's radius"
    with pytest.raises(mca.RequestError, match=words):
        extra_length(geometry, nodes="hole", pin_radius=0.005)


def test_a_hinge_goes_where_its_hole_goes():
    rod = lug_rod(section=4, ring=2).build()
    points = rod.points.copy()
    points[rod.nodes("hole")] += [2e-4, 0.0, 0.0]
    chain = Chain(links=(slender_link("OA", (0.1, 0.0), mass=1.0, hinge_out=(0.1, 0.0)),))
    before, after, masses = {"OA": rod.points}, {"OA": points}, {"OA": np.ones(len(points))}
    (moved,) = deformed_chain(chain, before, after, masses, (Pin(HOLE * R, hole=True),)).links
    assert moved.hinge_in == pytest.approx((2e-4, 0.0), abs=1e-15)
    assert moved.hinge_out == pytest.approx((0.1 - 2e-4, 0.0), abs=1e-15)


def test_fork_and_eye_turn_around_each_other_and_keep_momentum_and_energy():
    """Two rods that fold up and drift along z."""
    turning, length = 30.0, 0.1
    shape = {"section": 4, "ring": 2, "axial": 4}
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=lug_rod(start=start, end=end, **shape),
            material=SOFT,
            kinematics="finite",
            position=(x, 0.0, 0.0),
            velocity=(0.0, speed, 1.0),
            angular_velocity=(0.0, 0.0, spin),
        )
        for name, start, end, x, speed, spin in (
            ("a", "flat", "fork", 0.0, 0.0, turning),
            ("b", "eye", "flat", length, turning * length, -turning),
        )
    )
    hinge = {"at": (length, 0.0, 0.0), "other": "b", "nodes": "hole", "pin_radius": HOLE * R}
    scene = mca.Scene(
        name="rods",
        bodies=bodies,
        joints=(mca.Revolute(name="A", body="a", **hinge),),
        impact=mca.ImpactPhase(duration=2e-4, output_interval=1e-5),
    )
    impact = finished(scene, precision="float64")
    model, u, v = impact.solver.model, impact.state.u.numpy(), impact.state.v.numpy()
    scale = model.mass.sum()
    assert momentum(impact) == pytest.approx(model.mass @ model.V, abs=1e-13 * scale)
    before, after = (model.mass @ np.cross(x, w) for x, w in ((model.X, model.V), (model.X + u, v)))
    assert np.abs(before).max() > 0.1 * scale
    assert after == pytest.approx(before, abs=1e-13 * scale)
    assert result_of(impact).summary["energy_error"] < 1e-6
    first = slice(0, model.node_start["b"])
    gained = model.mass[first] @ (v - model.V)[first]
    assert result_of(impact).summary["joint_impulse"]["A"] == pytest.approx(gained, abs=1e-13 * scale)


def test_the_compliance_of_a_hole_has_a_limit():
    eyes = []
    for section in (4, 6):
        rod = lug_rod(radius=0.5 * SIDE, length=LENGTH, section=section, ring=section // 2, axial=4 * section)
        eyes.append(extra_length(rod, nodes="hole", pin_radius=rod.hole_radius))
    assert abs(eyes[1] - eyes[0]) < 0.06  # nodes on the axis: more than 0.3
