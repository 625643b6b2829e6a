"""Forces on masters that are closed surfaces, which have no normal of their own, from any side."""

from dataclasses import replace

import numpy as np
import pytest
from impacts import begun, finished, momentum, result_of

import warp_mca as mca

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
R, V = 0.01, 2.0
BALL = mca.Sphere(radius=R, section=4, ring=2, pole_layers=3)
QUARTER = np.pi / 2.0
TOWARDS = {
    "x": (0.0, 0.0, 0.0),
    "y": (0.0, 0.0, QUARTER),
    "z": (0.0, -QUARTER, 0.0),
}  # where the first ball's pole looks
AWAY = {"x": (0.0, 0.0, np.pi), "y": (0.0, 0.0, -QUARTER), "z": (0.0, QUARTER, 0.0)}


def balls(axis: str = "x", slave: str = "pole", master: str = "surface", gap: float = 0.0, **contact) -> mca.Scene:
    """A ball flies along an axis, pole first, into the pole of another at the origin."""
    n = np.eye(3)["xyz".index(axis)]
    at, velocity = tuple(-(2.0 * R + gap) * n), tuple(V * n)
    first = mca.Body(name="a", geometry=BALL, material=STEEL, position=at, velocity=velocity, rotation=TOWARDS[axis])
    second = mca.Body(name="b", geometry=BALL, material=STEEL, rotation=AWAY[axis])
    meet = mca.Contact(
        slave=mca.Surface(body="a", nodes=slave), master=mca.Surface(body="b", nodes=master), penalty=3.0, **contact
    )
    impact = mca.ImpactPhase(duration=7e-5 + gap / V, energy_tolerance=0.05)
    return mca.Scene(name="balls", bodies=(first, second), contacts=(meet,), impact=impact)


def impulse(result: mca.Result, column: str = "F_n_N") -> float:
    """Sum of a force over time [N s]."""
    return float(result[column].sum() * (result.time[1] - result.time[0]))


NODES = len(mca.mesh(balls())["b"].points)


@pytest.fixture(scope="module")
def pole() -> mca.Result:
    """The same impact on a master that is open."""
    return mca.run(balls(master="pole"))


@pytest.mark.parametrize("axis", ["x", "y", "z"])
@pytest.mark.parametrize(("slave", "master"), [("pole", "surface"), ("boundary", "boundary"), ("boundary", "pole")])
def test_forces_of_a_closed_master_are_those_of_its_pole_from_any_side(axis, slave, master, pole):
    impact = finished(balls(axis, slave, master))
    result, gained = result_of(impact), momentum(impact, NODES, 2 * NODES)
    assert gained["xyz".index(axis)] == pytest.approx(np.linalg.norm(gained), rel=1e-3)
    assert impulse(result) == pytest.approx(np.linalg.norm(gained), rel=2e-3)
    assert result.F_n == pytest.approx(pole.F_n, abs=0.01 * pole.F_n.max())
    for key in ("contact_duration", "F_n_first_peak", "F_n_max"):
        assert result.summary[key] == pytest.approx(pole.summary[key], rel=0.01)
    assert np.abs(result["F_t_N"]).max() < 0.03 * result.F_n.max()


def test_the_normal_force_of_two_closed_surfaces_does_not_ask_where_they_meet():
    """The second ball lies 30 degrees beside the way of the first, which begins 1 mm away from it."""
    scene = balls(slave="boundary", gap=1e-3)
    aside = replace(scene.bodies[0], position=(-np.sqrt(3.0) * R - 1e-3, R, 0.0))
    longer = replace(scene.impact, duration=6e-4)
    impact = finished(replace(scene, bodies=(aside, scene.bodies[1]), impact=longer))
    gained = np.linalg.norm(momentum(impact, NODES, 2 * NODES))
    assert gained > 0.03
    assert impulse(result_of(impact)) == pytest.approx(gained, rel=1e-3)


@pytest.mark.parametrize("nodes", ["pole", "boundary"])
def test_friction_and_two_ways_on_a_closed_master(nodes):
    def rubbing(slave: str, master: str) -> mca.Scene:
        scene = balls(slave=slave, master=master, mu=0.2, two_way=True)
        aside = replace(scene.bodies[0], velocity=(V, 1.0, 0.0))
        return replace(scene, bodies=(aside, scene.bodies[1]))

    open_one, closed = mca.run(rubbing("pole", "pole")), mca.run(rubbing(nodes, "boundary"))
    assert impulse(open_one, "F_t_N") < -0.05 * impulse(open_one)
    for column in ("F_n_N", "F_t_N"):
        assert closed[column] == pytest.approx(open_one[column], abs=0.01 * open_one.F_n.max())


def test_each_contact_of_each_scene_of_a_batch_counts_by_itself():
    """A ball catches up with one that meets a third: both closed, in one scene open."""

    def row(axis: str, master: str) -> mca.Scene:
        scene = balls(axis, "boundary", master)
        (first, second), (meet,) = scene.bodies, scene.contacts
        twice = {key: tuple(2.0 * np.array(getattr(first, key))) for key in ("position", "velocity")}
        behind = replace(meet, master=mca.Surface(body="c", nodes=master), two_way=False)  # the rear of a is coarse
        return replace(scene, bodies=(first, second, replace(first, name="c", **twice)), contacts=(meet, behind))

    impact = begun(row("x", "surface"), row("y", "pole"), row("z", "boundary"))
    impact.advance()
    for k in range(3):
        a, b, c = (momentum(impact, NODES * (3 * k + i), NODES * (3 * k + i + 1))[k] for i in range(3))
        before = 2.0 / 3.0 * (a + b + c)  # of the ball behind
        assert impulse(result_of(impact, k)) == pytest.approx(b + before - c, rel=5e-3)


def block_and_plate(thickness: float, *, gap: float, speed: float, closed: bool = True, **contact) -> mca.Scene:
    """A soft block above a stiff plate whose foot is held, of 5 mm cells."""
    soft, stiff = mca.Elastic(E=1e7, nu=0.3, rho=1000.0), mca.Elastic(E=10e9, nu=0.3, rho=7850.0)
    block = mca.Box(size=(0.02, 0.02, 0.02), divisions=(4, 4, 4), origin=(-0.01, 0.0, -0.01))
    plate = mca.Box(size=(0.04, thickness, 0.04), divisions=(8, 1, 8), origin=(-0.02, -thickness, -0.02))
    bodies = (
        mca.Body(name="block", geometry=block, material=soft, position=(1e-3, gap, 1.2e-3), velocity=(0, -speed, 0)),
        mca.Body(name="plate", geometry=plate, material=stiff),
    )
    slave, master = ("boundary", "boundary") if closed else ("ymin", "ymax")
    meet = mca.Contact(
        slave=mca.Surface(body="block", nodes=slave), master=mca.Surface(body="plate", nodes=master), **contact
    )
    held = mca.Fixed(body="plate", nodes="ymin")
    impact = mca.ImpactPhase(duration=5e-4, output_interval=1e-6)
    return mca.Scene(name="thin", bodies=bodies, contacts=(meet,), fixed=(held,), impact=impact)


@pytest.mark.parametrize("contact", [{}, {"mu": 0.3}, {"two_way": True}], ids=str)
@pytest.mark.parametrize("thickness", [1e-3, 2e-3])
def test_nodes_deeper_than_half_a_thin_plate_are_pushed_back_the_way_they_came(thickness: float, contact: dict):
    """The far side, then the nearer, let them through."""
    closed, open_one = (
        mca.run(block_and_plate(thickness, gap=1e-5, speed=14.0, closed=closed, **contact)) for closed in (True, False)
    )
    assert closed.summary["max_penetration"] > 0.6e-3
    assert closed.F_n == pytest.approx(open_one.F_n, abs=0.03 * open_one.F_n.max())


@pytest.mark.parametrize("thickness", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("gap", [0.0, 0.3e-3, 1e-3, 2e-3])
def test_nothing_happens_in_front_of_a_thin_plate(thickness: float, gap: float):
    """At first, nodes of which a search found the far side alone were pulled through."""
    scene = block_and_plate(thickness, gap=gap, speed=0.0)
    result = mca.run(replace(scene, impact=mca.ImpactPhase(duration=1e-5)))
    assert (result.F_n == 0.0).all()
    assert result.summary["max_penetration"] == 0.0
    batch = mca.run_batch([replace(scene, impact=mca.ImpactPhase(duration=1e-5))] * 2)
    assert all((one.F_n == 0.0).all() for one in batch)


def test_bodies_that_overlap_at_the_start_are_pushed_apart():
    scene = block_and_plate(5e-3, gap=-1e-4, speed=0.0, initial_overlap="press")
    result = mca.run(replace(scene, impact=mca.ImpactPhase(duration=2e-4, output_interval=2e-6)))
    assert result.F_n.max() > 1.0


@pytest.mark.parametrize("cause", ["driven", "falling"])
def test_bodies_that_start_from_rest_are_searched_as_often_as_they_become_fast(cause: str):
    """At the speed that tables and gravity give them, they outran the search between two outputs."""
    at_rest = block_and_plate(5e-3, gap=1e-3, speed=0.0)
    driven = mca.Prescribed(body="block", nodes="ymax", axis="y", times=(0.0, 1e-4), velocities=(0.0, -12.0))
    scene = (
        replace(at_rest, prescribed=(driven,), impact=mca.ImpactPhase(duration=4e-4, output_interval=1e-4))
        if cause == "driven"
        else replace(at_rest, gravity=(0.0, -1e4, 0.0), impact=mca.ImpactPhase(duration=8e-4, output_interval=2e-4))
    )
    assert mca.run(scene).F_n.max() > 100.0


SOFT, HARD = mca.Elastic(E=1e9, nu=0.3, rho=1e3), mca.Elastic(E=1e12, nu=0.3, rho=1e6)


def groove(fold: float) -> mca.Mesh:
    """A plate of 10 mm cells whose top rises from x = 0 to both sides, at `fold` to the level."""
    plate = mca.Box(size=(0.06, 0.02, 0.04), divisions=(6, 2, 4), origin=(-0.03, -0.02, -0.01)).build()
    rise = np.abs(plate.points[:, 0]) * np.tan(fold)
    return replace(plate, points=plate.points + np.outer(rise, [0.0, 1.0, 0.0]))


@pytest.mark.parametrize("degrees", [5.0, 15.0, 30.0])
def test_a_block_that_falls_into_a_groove_gains_no_energy(degrees: float):
    """Edge down: of two faces that its nodes lay beside the shallower pushed them, and energy grew tenfold."""
    block = mca.Box(size=(0.02, 0.02, 0.02), divisions=(4, 4, 4))
    bodies = (
        mca.Body(
            name="block",
            geometry=block,
            material=SOFT,
            position=(0, 1e-5, 0),
            rotation=(0, 0, np.pi / 4),
            velocity=(0, -3, 0),
        ),
        mca.Body(name="plate", geometry=groove(np.radians(degrees)), material=HARD),
    )
    meet = mca.Contact(
        slave=mca.Surface(body="block", nodes="boundary"), master=mca.Surface(body="plate", nodes="ymax")
    )
    impact = mca.ImpactPhase(duration=3e-4, output_interval=2e-6, energy_tolerance=10.0)
    held = mca.Fixed(body="plate", nodes="ymin")
    result = mca.run(mca.Scene(name="groove", bodies=bodies, contacts=(meet,), fixed=(held,), impact=impact))
    assert result.F_n.max() > 100.0
    assert result.summary["energy_error"] < 0.1  # was 1.8 and 9.2 at 5 and 15 degrees


@pytest.mark.parametrize("clearance", [1e-5, 5e-5, 9e-5])
def test_a_block_that_flies_above_a_box_meets_nothing(clearance: float):
    """Sides of the box reached out above its top, by 1 % of their edges."""
    bodies = (
        mca.Body(
            name="block",
            geometry=mca.Box(size=(0.02, 0.02, 0.02), divisions=(2, 2, 2), origin=(-0.0205, clearance, 0.0)),
            material=SOFT,
            velocity=(10.0, 0.0, 0.0),
        ),
        mca.Body(
            name="box",
            geometry=mca.Box(size=(0.04, 0.02, 0.04), divisions=(4, 2, 4), origin=(0.0, -0.02, -0.01)),
            material=HARD,
        ),
    )
    meet = mca.Contact(
        slave=mca.Surface(body="block", nodes="boundary"), master=mca.Surface(body="box", nodes="boundary")
    )
    impact = mca.ImpactPhase(duration=4e-4, output_interval=1e-5)
    result = mca.run(mca.Scene(name="flight", bodies=bodies, contacts=(meet,), impact=impact))
    assert (result.F_n == 0.0).all()
