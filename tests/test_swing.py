"""Owns the tests of swings from any state, to any gap or a given time, and of the gaps of nodes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from warp_mca.geometry import Box
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.link import Link, slender_link
from warp_mca.rigid.placement import Placement, link_placements
from warp_mca.rigid.plain_chain import acceleration_of, end_point
from warp_mca.rigid.swing import swing, swing_until
from warp_mca.rigid.target import TargetPlane, TurningPlane, moving_plane, node_gap
from warp_mca.rigid.touch import Gap
from warp_mca.scene import Surface

G, LENGTH = 9.8, 0.5
UP = np.array([0.0, 1.0, 0.0])


def pendulum() -> Chain:
    return Chain((slender_link("rod", (LENGTH, 0.0), mass=2.0),))


def pair() -> Chain:
    links = (
        slender_link("OA", (0.3, 0.0), mass=1.0, hinge_out=(0.3, 0.0)),
        slender_link("AB", (0.2, 0.0), mass=0.5, hinge_in=(0.04, 0.01)),
    )
    return Chain(links, origin=(0.1, 0.2))


def height(offset: float) -> Gap:
    """Of the pendulum's end over its lowest point, less an offset [m]."""
    return lambda _t, theta: LENGTH - LENGTH * math.cos(theta[0]) - offset


def floor(level: float, velocity: float = 0.0) -> TargetPlane:
    return TargetPlane(point=level * UP, normal=UP, velocity=velocity * UP)


def test_a_swing_in_two_parts_is_the_swing():
    chain = pair()
    whole = swing_until(chain, (1.0, 0.5), (0.0, 2.0), (), t_end=0.6)
    first = swing_until(chain, (1.0, 0.5), (0.0, 2.0), (), t_end=0.23)
    rest = swing_until(chain, first.theta, first.theta_dot, (), t_start=first.t_end, t_end=0.6)
    assert (whole.ended_by, rest.t[0], rest.t_end, whole.touched) == ("t_end", 0.23, 0.6, None)
    np.testing.assert_allclose(rest.theta, whole.theta, atol=1e-10)
    np.testing.assert_allclose(rest.theta_dot, whole.theta_dot, atol=1e-10)
    assert whole.energy_drift < 1e-11


def test_the_first_of_several_gaps_ends_the_swing():
    gaps = (height(-1.0), height(0.1), height(0.05))
    run = swing_until(pendulum(), (1.0,), (0.0,), gaps, t_start=2.0, t_end=4.0)
    assert (run.ended_by, run.touched) == ("touch", 1)
    assert run.theta[0] == pytest.approx(math.acos(1.0 - 0.1 / LENGTH), rel=1e-12)
    assert run.t_end == pytest.approx(swing(pendulum(), (1.0,), (0.0,), gaps[1], 5.0).t_end + 2.0, rel=1e-13)


def test_time_that_is_up_is_no_error():
    run = swing(pendulum(), (1.0,), (0.0,), height(0.1), 5.0, t_end=0.05)
    assert (run.ended_by, run.t_end, run.t[-1]) == ("t_end", 0.05, 0.05)
    assert run.closest[0] == pytest.approx(height(0.1)(0.0, run.theta)) and run.closest[1] == 0.05


def flight(start: float, speed: float) -> tuple[Chain, Gap]:
    """A chain that turns evenly, and the gap of a ball that starts so and falls with 10 m/s^2."""
    clock = Chain((slender_link("rod", (LENGTH, 0.0), mass=2.0),), gravity=(0.0, 0.0))
    return clock, lambda t, _theta: start + speed * t - 5.0 * t * t


@pytest.mark.parametrize("start", [0.0, 1e-16, -1e-16, -1e-6])
@pytest.mark.parametrize("speed", [0.01, 0.5])
def test_a_gap_that_opens_at_the_start_touches_when_it_closes_again(start: float, speed: float):
    clock, gap = flight(start, speed)
    run = swing_until(clock, (0.0,), (2.0,), (gap,), t_end=1.0)
    back = (speed + math.sqrt(speed**2 + 20.0 * start)) / 10.0
    assert run.ended_by == "touch"
    assert run.t_end == pytest.approx(back, rel=1e-9)


def test_a_gap_that_never_opens_touches_when_it_begins_to_shrink():
    clock, gap = flight(-1e-3, 0.1)  # rises by 0.5 mm
    run = swing_until(clock, (0.0,), (2.0,), (gap,), t_end=1.0)
    assert run.ended_by == "touch" and run.t_end == pytest.approx(0.01, abs=1e-9)


def test_a_gap_that_is_closed_and_shrinks_ends_the_swing_at_once():
    clock, gap = flight(-1e-6, -0.1)
    run = swing_until(clock, (0.3,), (2.0,), (height(-1.0), gap), t_end=1.0)
    assert (run.ended_by, run.touched, run.t_end, run.theta[0], len(run.t)) == ("touch", 1, 0.0, 0.3, 1)

    def kink(t, _theta):  # one node leaves, another comes
        return min(t - 0.7, 0.5 * (0.7 - t))

    run = swing_until(clock, (0.3,), (2.0,), (kink,), t_start=0.7, t_end=1.0)
    assert (run.touched, run.t_end) == (0, 0.7)


@pytest.mark.parametrize("index", [0, 1])
@pytest.mark.parametrize("normal", [(0.0, 1.0, 0.0), (-0.2, 0.9, 0.3)])
def test_node_gap_is_the_least_over_all_nodes(index: int, normal: tuple):
    rng, chain = np.random.default_rng(index), pair()
    points = rng.normal(size=(4000, 3)) * [0.1, 0.02, 0.02]
    unit = np.array(normal) / np.linalg.norm(normal)
    plane = TargetPlane(point=np.array([0.1, -0.4, 0.2]), normal=unit, velocity=np.array([0.3, 0.2, -0.1]))
    gap = node_gap(chain, index, points, plane)
    for _ in range(20):
        t, theta = rng.uniform(0.0, 2.0), rng.uniform(-3.0, 3.0, 2)
        X, _ = link_placements(chain, theta, np.zeros(2))[chain.links[index].body].place(points)
        assert gap(t, theta) == pytest.approx(((X - plane.point - t * plane.velocity) @ unit).min(), abs=1e-14)


def test_touch_of_a_node_on_a_rising_floor_by_hand():
    chain = pendulum()
    ring = np.linspace(0.0, 2.0 * math.pi, 200, endpoint=False)
    points = np.column_stack([LENGTH + 0.01 * np.cos(ring), 0.01 * np.sin(ring), 0.0 * ring])
    run = swing_until(chain, (1.0,), (0.0,), (node_gap(chain, 0, points, floor(-0.6, 0.3)),), t_end=3.0)
    d = np.array([-math.sin(run.theta[0]), -math.cos(run.theta[0])])
    f = np.array([math.cos(run.theta[0]), -math.sin(run.theta[0])])
    lowest = (points[:, 0] * d[1] + points[:, 1] * f[1]).min()
    assert lowest == pytest.approx(-0.6 + 0.3 * run.t_end, abs=1e-13) and run.t_end > 0.2


def test_gap_of_thousands_of_nodes_is_as_quick_as_that_of_a_few():
    rng = np.random.default_rng(3)
    points = rng.uniform(-1.0, 1.0, (20000, 3)) * [0.1, 0.01, 0.01]
    gap = node_gap(pair(), 1, points, floor(-0.5))
    held = [cell.cell_contents for cell in gap.__closure__ if isinstance(cell.cell_contents, np.ndarray)]
    assert max(array.size for array in held) < 200


def test_plane_of_a_body_that_turns_stays_on_its_surface():
    omega = np.array([0.1, 0.2, 0.7])
    placement = Placement(
        pivot=np.array([0.1, 0.0, 0.0]),
        origin=np.array([1.0, 2.0, 0.0]),
        rotation=np.eye(3),
        velocity=np.array([0.5, -1.0, 0.0]),
        angular_velocity=omega,
    )
    mesh = Box(size=(0.2, 0.03, 0.1), divisions=(2, 1, 1)).build()
    corner = mesh.points[mesh.points[:, 1] == 0.03]
    plane = moving_plane(mesh, Surface(body="box", nodes="ymax"), placement, 0.4)
    assert isinstance(plane, TurningPlane)
    X, _ = placement.after(0.3).place(corner)
    point, normal = plane.at(0.7)
    np.testing.assert_allclose((X - point) @ normal, 0.0, atol=1e-15)
    still = moving_plane(mesh, Surface(body="box", nodes="ymax"), replace(placement, angular_velocity=np.zeros(3)), 0.4)
    assert isinstance(still, TargetPlane)
    np.testing.assert_allclose(still.at(0.4)[0][1], 2.03, atol=1e-15)


@pytest.mark.parametrize("slide", [None, (0.6, 0.8)])
@pytest.mark.parametrize("count", [1, 2, 3, 6, 8])
def test_accelerations_in_plain_numbers_are_those_of_the_chain(count: int, slide: tuple[float, float] | None):
    """Of any centres, hinges and gravity, with and without forces."""
    draw = np.random.default_rng(count).uniform
    links = tuple(
        Link(
            body=f"{k}",
            mass=draw(0.5, 2.0),
            centre=tuple(draw(-1, 1, 2)),
            inertia=draw(0.1, 1.0),
            hinge_out=tuple(draw(-1, 1, 2)),
        )
        for k in range(count)
    )
    chain = Chain(links=links, gravity=(1.3, -9.8), slide=slide, carriage_mass=0.7 if slide else 0.0)
    plain = acceleration_of(chain)
    for _ in range(20):
        theta, rates, force = draw(-3.0, 3.0, (3, chain.coordinate_count))
        for given in (None, force):
            expected = chain.acceleration(theta, rates, given)
            assert end_point(chain, (0.4, -0.2))(theta) == pytest.approx(
                chain.at(count - 1, (0.4, -0.2), theta, rates)[0], rel=1e-12, abs=1e-12
            )
            assert plain(theta, rates, given) == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.abs(expected).max())


def test_the_acceleration_of_a_pendulum_and_what_has_none():
    """theta'' = -3 g sin(theta) / (2 l) of a rod; a link without inertia about its hinge, and an angle without end."""
    theta = np.array([0.3])
    assert acceleration_of(pendulum())(theta, np.ones(1), None) == pytest.approx(
        -1.5 * G / LENGTH * np.sin(theta), rel=1e-14
    )
    empty = Chain(links=(Link(body="a", mass=1.0, centre=(0.0, 0.0), inertia=0.0),))
    with pytest.raises(np.linalg.LinAlgError):
        acceleration_of(empty)(theta, np.zeros(1), None)
    with np.errstate(invalid="ignore"):
        assert np.isnan(acceleration_of(pendulum())(np.array([math.inf]), np.zeros(1), None)).all()
