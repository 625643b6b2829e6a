"""Edges of skins that cross between nodes: first touch, what is conserved, crossings that go on, and who has none."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import finished, momentum, result_of
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.physics.contact.skin_edges import EdgePass

L, W = 0.06, 0.01
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
UPON_EDGE = Rotation.from_rotvec([math.pi / 4, 0, 0])
H = W * math.sqrt(2) / 2  # from the middle of a bar that stands on its edge to that edge


def bar(name: str, turn: Rotation, middle: tuple, velocity: tuple, cells: tuple, **more) -> mca.Body:
    place = np.array(middle) - turn.apply([L / 2, W / 2, W / 2])
    geometry = mca.Box(size=(L, W, W), divisions=cells)
    rotation = tuple(turn.as_rotvec().tolist())
    return mca.Body(
        name=name,
        geometry=geometry,
        material=STEEL,
        rotation=rotation,
        position=tuple(place),
        velocity=velocity,
        **more,
    )


def crossed(
    along: int, across: int, *, turn: float = 90.0, velocity: tuple = (0.0, -5.0, 0.0), duration: float = 1.5e-4,
    rigid: bool = False, at: tuple = (0.001, 0.0023), **contact,
) -> mca.Scene:  # fmt: skip
    """Two square bars upon their edges, 20 um apart, of which the upper one is turned and falls."""
    upper = Rotation.from_rotvec([0.0, math.radians(turn), 0.0]) * UPON_EDGE
    cells = (along, across, across)
    bodies = (
        bar("low", UPON_EDGE, (0.0, -H, 0.0), (0.0, 0.0, 0.0), cells, rigid=rigid),
        bar("top", upper, (at[0], H + 2e-5, at[1]), velocity, cells),
    )
    skins = (mca.Surface(body=name, nodes="boundary") for name in ("top", "low"))
    meet = mca.Contact(slave=next(skins), master=next(skins), **contact)
    return mca.Scene(
        name="crossed",
        bodies=bodies,
        contacts=(meet,),
        impact=mca.ImpactPhase(duration=duration, output_interval=1e-6),
    )


def spin(impact) -> np.ndarray:
    """Angular momentum about the origin, between positions and velocities half a step apart [kg m^2/s]."""
    model = impact.solver.model
    x, v = model.X + impact.state.u.numpy(), impact.state.v.numpy()
    return (model.mass[:, None] * np.cross(x, v)).sum(axis=0)


@pytest.mark.parametrize(("mu", "couple"), [(0.0, 2e-4), (0.2, 1e-3)])  # friction acts on both sides of the overlap
@pytest.mark.parametrize(("along", "across", "two_way"), [(7, 1, False), (13, 2, True)])
def test_edges_touch_where_they_are_and_keep_momentum_and_energy(
    along: int, across: int, two_way: bool, mu: float, couple: float
):
    scene = crossed(along, across, two_way=two_way, mu=mu, velocity=(2.0, -5.0, 0.0))
    impact = finished(scene, precision="float64")
    result, model = result_of(impact), impact.solver.model
    assert result.summary["contacts"][0][0] == pytest.approx(4e-6, abs=1.1e-6)
    assert result.summary["energy_error"] < 1e-3
    assert result.summary["max_penetration"] < 1e-4
    first = (model.mass[:, None] * model.V).sum(axis=0)
    assert momentum(impact, 0, model.node_count) == pytest.approx(first, abs=1e-12 * np.linalg.norm(first))
    before = (model.mass[:, None] * np.cross(model.X, model.V)).sum(axis=0)
    assert spin(impact) == pytest.approx(before, abs=couple * np.linalg.norm(before))


def test_a_crossing_that_slides_over_nodes_goes_on():
    """Without friction the impulse has no part along the edges, and no crossing is lost on its way over eight nodes."""
    still, moves = (
        result_of(finished(crossed(25, 4, velocity=v, at=(-0.004, 0.0023)))).contacts[0]
        for v in ((0.0, -5.0, 0.0), (80.0, -5.0, 0.0))
    )
    assert moves.force.sum(axis=0)[1] == pytest.approx(still.force.sum(axis=0)[1], rel=0.05)
    assert abs(moves.force.sum(axis=0)[0]) < 0.03 * abs(moves.force.sum(axis=0)[1])


@pytest.mark.parametrize("off", [0.0, 2e-6])  # from the node
@pytest.mark.parametrize(("one", "other"), [(0, 1), (1, 0), (0, 0)], ids=["master's", "slave's", "both"])
def test_a_crossing_that_begins_at_a_node_is_as_strong_as_between_nodes(one: int, other: int, off: float):
    """The node lies behind both faces beside the other edge, so that these alone would push it aside, or nothing."""

    def struck(x: float, z: float):
        result = result_of(finished(crossed(6, 2, at=(x, z), duration=7e-5)))
        return result.summary["contacts"][0][0], result.contacts[0].force.sum(axis=0)

    start, impulse = struck(0.0023 * one + off, 0.0023 * other + off)
    expected, between = struck(0.0023 * one + 1e-4, 0.0023 * other + 1e-4)
    assert start == expected
    assert impulse == pytest.approx(between, abs=0.04 * np.linalg.norm(between))


HEAD_ON = pytest.mark.parametrize("axis", [(0.0, 1.0, 1.0), (1.0, 1.0, 1.0)], ids=["edge", "corner"])


def head_on(axis: tuple, off: float, aside: float, general: bool, **contact) -> mca.Scene:
    """A cube that falls on another with its edge or corner, so far off a node of this and so fast aside."""
    turn, _ = Rotation.align_vectors([[0.0, -1.0, 0.0]], [axis])
    middle, velocity = (off, W * math.hypot(*axis) / 2 + 1e-7, 0.3 * off), (0.0, -3.0, aside)
    cube = mca.Box(size=(W, W, W), divisions=(4, 4, 4), origin=(-W / 2, -W / 2, -W / 2))
    bodies = (
        mca.Body(name="low", geometry=cube, material=STEEL, position=(0.0, -W / 2, 0.0)),
        mca.Body(
            name="top",
            geometry=cube,
            material=STEEL,
            position=middle,
            rotation=tuple(turn.as_rotvec().tolist()),
            velocity=velocity,
        ),
    )
    low, top = (mca.Surface(body=name, nodes="boundary") for name in ("low", "top"))
    meet = mca.ContactAll(**contact) if general else mca.Contact(slave=low, master=top, two_way=True, **contact)
    phase = mca.ImpactPhase(duration=3e-5, output_interval=1e-6)
    return mca.Scene(name="head_on", bodies=bodies, contacts=(meet,), impact=phase)


@HEAD_ON
@pytest.mark.parametrize(  # distance from a node, speed aside
    ("off", "aside", "most"), [(0.0, 0.0, 1e-3), (1e-7, 0.0, 5e-3), (1e-5, 0.0, 5e-3), (0.0, 0.1, 1e-2)]
)
@pytest.mark.parametrize("general", [False, True])
def test_an_edge_or_a_corner_that_meets_a_node_head_on_is_not_pushed_aside(
    axis: tuple, off: float, aside: float, most: float, general: bool
):
    """The node is behind two or three faces alike, each of which alone would push it along its own normal."""
    impact = finished(head_on(axis, off, aside, general))
    pushed = momentum(impact, 0, len(impact.solver.model.X) // 2)
    assert abs(pushed[1]) > 0.3 * STEEL.rho * W**3 * 3.0
    assert math.hypot(pushed[0], pushed[2]) < most * abs(pushed[1])


@HEAD_ON
@pytest.mark.parametrize("general", [False, True])
def test_a_node_that_an_edge_or_a_corner_meets_head_on_does_not_rub(axis: tuple, general: bool):
    """It comes nearer to the edge along both faces, which is no slip."""
    result = mca.run(head_on(axis, 1e-6, 0.0, general, mu=0.3))
    assert result["E_friction"][-1] < 2e-3 * result["E_kinetic"][0]
    assert result.summary["energy_error"] < 1e-3


def test_an_edge_meets_a_rigid_bar():
    result = result_of(finished(crossed(7, 1, rigid=True)))
    assert result.summary["contacts"][0][0] == pytest.approx(4e-6, abs=1.1e-6)
    assert result.summary["energy_error"] < 1e-3


def test_a_batch_gives_the_bits_of_its_scenes_and_may_mix_bodies_with_and_without_edges():
    scenes = [crossed(7, 1, turn=turn, duration=3e-5) for turn in (90.0, 60.0)]
    alone = [mca.run(scene, threads=1) for scene in scenes]
    for one, other in zip(mca.run_batch(scenes, threads=1), alone, strict=True):
        assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in other.history)


def passes(slave: mca.Body, master: mca.Body) -> list:
    surfaces = [mca.Surface(body=body.name, nodes="boundary") for body in (slave, master)]
    scene = mca.Scene(
        name="two",
        bodies=(slave, master),
        contacts=(mca.Contact(slave=surfaces[0], master=surfaces[1]),),
        impact=mca.ImpactPhase(duration=1e-6),
    )
    from impacts import prepared

    return list(prepared(scene).model.passes)


def ball(name: str, x: float, fine: int) -> mca.Body:
    geometry = mca.Sphere(radius=0.01, section=fine, ring=fine, pole_layers=fine)
    return mca.Body(name=name, geometry=geometry, material=STEEL, position=(x, 0.0, 0.0))


def test_round_bodies_of_fine_cells_have_no_edges_that_may_cross():
    assert not any(isinstance(item, EdgePass) for item in passes(ball("a", 0.0, 8), ball("b", 0.03, 8)))
    assert any(isinstance(item, EdgePass) for item in passes(ball("a", 0.0, 2), ball("b", 0.03, 2)))


def test_where_the_slave_is_coarser_the_nodes_of_both_are_kept_out():
    plate = mca.Body(name="plate", geometry=mca.Box(size=(L, W, L), divisions=(2, 1, 2)), material=STEEL)
    fine = ball("ball", 0.1, 4)
    assert [item.sign for item in passes(plate, fine) if item.leads or item.sign < 0.0] == [1.0, -1.0]
    assert [item.sign for item in passes(fine, plate) if item.leads or item.sign < 0.0] == [1.0]


def test_a_general_contact_has_the_crossings_of_a_listed_pair():
    from dataclasses import replace

    scene = crossed(7, 1, two_way=True, duration=6e-5)
    listed, everything = mca.run(scene), mca.run(replace(scene, contacts="all"))
    assert listed.summary["F_n_max"] > 5e3
    assert everything.summary["F_n_max"] == pytest.approx(listed.summary["F_n_max"], rel=0.02)
    assert everything.summary["energy_error"] < 1e-3


@pytest.mark.gpu
@pytest.mark.parametrize("scene", [crossed(13, 2, mu=0.3), crossed(7, 1, turn=40.0, rigid=True)], ids=["mu", "rigid"])
def test_a_device_gives_the_motion_of_the_cpu_and_the_same_bits_twice(scene: mca.Scene) -> None:
    cpu, cuda, again = (mca.run(scene, device=device) for device in ("cpu", "cuda:0", "cuda:0"))
    assert all(np.array_equal(cuda[name], again[name], equal_nan=True) for name in cuda.history)
    for name in ("F_n_N", "E_kinetic", "E_friction"):
        assert cuda[name] == pytest.approx(cpu[name], abs=1e-4 * max(np.abs(cpu[name]).max(), 1e-9))
