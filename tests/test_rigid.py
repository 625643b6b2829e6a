"""Owns the tests of the rigid chain and its swing: Eq. (5) and Table 1 of the paper, closed forms, refusals."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

from warp_mca.base.errors import RequestError
from warp_mca.rigid.chain import Chain, link_axes
from warp_mca.rigid.link import Link, mesh_link, slender_link
from warp_mca.rigid.swing import swing

LENGTH, RADIUS, HEIGHT = 0.21, 0.013, 0.37  # Table 1 [m]
HORIZONTAL = (0.5 * math.pi, 0.5 * math.pi)


def slender_pair(mass: float = 0.3) -> Chain:
    first = slender_link("OA", (LENGTH, 0.0), mass=mass, hinge_out=(LENGTH, 0.0))
    return Chain((first, slender_link("AB", (LENGTH, 0.0), mass=mass)))


def crooked_chain(count: int) -> Chain:
    """Links with centres and hinges off their axes."""
    rng = np.random.default_rng(count)
    links = [
        Link(
            body=f"link{i}",
            mass=rng.uniform(0.1, 0.5),
            centre=tuple(rng.uniform(-0.1, 0.2, 2)),
            inertia=rng.uniform(1e-4, 1e-3),
            hinge_out=tuple(rng.uniform(-0.1, 0.3, 2)),
        )
        for i in range(count)
    ]
    return Chain(tuple(links), origin=(0.3, -0.2), gravity=(1.5, -9.8))


def sphere_gap(chain: Chain, centre: float, height: float):
    """Gap of a sphere of Table 1's radius on the last link to the plane y = -height."""
    rest = np.zeros(len(chain.links))
    return lambda _t, theta: chain.at(len(rest) - 1, (centre, 0.0), theta, rest)[0][1] + height - RADIUS


def lagrangian(chain: Chain, theta: np.ndarray, theta_dot: np.ndarray) -> float:
    """T - V from the positions and velocities of the centres of mass, with complex numbers for the plane."""
    hinge, hinge_rate, total = complex(*chain.origin), 0.0j, 0.0
    for link, angle, rate in zip(chain.links, theta, theta_dot, strict=True):
        turn = np.exp(-1j * (angle + 0.5 * np.pi))
        spin = -1j * rate * turn
        centre = hinge + turn * complex(*link.centre)
        speed = hinge_rate + spin * complex(*link.centre)
        total += 0.5 * link.mass * abs(speed) ** 2 + 0.5 * link.inertia * rate**2
        total += link.mass * (chain.gravity[0] * centre.real + chain.gravity[1] * centre.imag)
        hinge, hinge_rate = hinge + turn * complex(*link.hinge_out), hinge_rate + spin * complex(*link.hinge_out)
    return total


def test_angle_grows_clockwise():
    d, f = link_axes(np.array(0.3))
    assert np.allclose(d, [-math.sin(0.3), -math.cos(0.3)]) and d[0] * f[1] - d[1] * f[0] == pytest.approx(1.0)
    chain = Chain((slender_link("rod", (1.0, 0.0), mass=1.0),))
    point, velocity = chain.at(0, (1.0, 0.0), np.array([0.0]), np.array([2.0]))
    assert np.allclose(point, [0.0, -1.0], atol=1e-15)
    assert np.allclose(velocity, [-2.0, 0.0], atol=1e-15)  # a link that hangs down moves to -x: omega_z = -2
    assert chain.angular_momentum(np.array([0.0]), np.array([2.0])) == pytest.approx(-2.0 / 3.0, rel=1e-14)


def test_two_slender_rods_obey_equation_5():
    rng = np.random.default_rng(5)
    mass, g, inertia = 0.3, 9.8, 0.3 * LENGTH**2
    chain = slender_pair(mass)
    for _ in range(20):
        (a, b), (da, db) = theta, theta_dot = rng.uniform(-3, 3, 2), rng.uniform(-20, 20, 2)
        M = inertia / 6 * np.array([[8, 3 * math.cos(a - b)], [3 * math.cos(a - b), 2]])
        C = inertia / 2 * np.array([db**2 * math.sin(a - b), da**2 * math.sin(b - a)])
        G = mass * g * LENGTH / 2 * np.array([3 * math.sin(a), math.sin(b)])
        np.testing.assert_allclose(chain.mass_matrix(theta), M, rtol=1e-13, atol=1e-17)
        np.testing.assert_allclose(chain.rate_force(theta, theta_dot), C, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(chain.gravity_force(theta), G, rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(chain.acceleration(theta, theta_dot), -np.linalg.solve(M, C + G), rtol=1e-11)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_crooked_links_obey_the_differentiated_lagrangian(count):
    chain, h = crooked_chain(count), 1e-4
    rng = np.random.default_rng(7)
    q, v, unit = rng.uniform(-3, 3, count), rng.uniform(-4, 4, count), np.eye(count)

    def momentum(q, v):  # dL/dv: exact, L is quadratic in v
        return np.array([(lagrangian(chain, q, v + e) - lagrangian(chain, q, v - e)) / 2 for e in unit])

    def slope(function, direction):  # fourth-order central difference along the state
        a, b = (
            function(h * direction) - function(-h * direction),
            function(2 * h * direction) - function(-2 * h * direction),
        )
        return (8 * a - b) / (12 * h)

    force = np.array([slope(lambda s: lagrangian(chain, q + s, v), e) for e in unit])
    convected = slope(lambda s: momentum(q + s, v), v)
    M = np.array([momentum(q, e) - momentum(q, 0 * e) for e in unit])
    np.testing.assert_allclose(chain.mass_matrix(q), M, rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(chain.acceleration(q, v), np.linalg.solve(M, force - convected), rtol=1e-9)
    total = sum(link.mass for link in chain.links)  # the chain measures its potential from the ground hinge
    energy = chain.kinetic_energy(q, v) - chain.potential_energy(q) + total * np.dot(chain.gravity, chain.origin)
    assert energy == pytest.approx(lagrangian(chain, q, v), rel=1e-12)


def test_momenta_and_reactions_of_a_crooked_chain():
    chain, h = crooked_chain(3), 1e-4
    rng = np.random.default_rng(9)
    q, v = rng.uniform(-3, 3, 3), rng.uniform(-4, 4, 3)
    a, weight = chain.acceleration(q, v), sum(link.mass for link in chain.links) * np.array(chain.gravity)

    def along(t):  # the motion to second order about the state: rates of momenta are exact there
        return q + t * v + 0.5 * t**2 * a, v + t * a

    rate = (chain.momentum(*along(h)) - chain.momentum(*along(-h))) / (2 * h)
    np.testing.assert_allclose(chain.base_force(q, v, a) + weight, rate, rtol=1e-5)  # Newton, whole chain
    turning = (chain.angular_momentum(*along(h)) - chain.angular_momentum(*along(-h))) / (2 * h)
    moment = 0.0
    for i, link in enumerate(chain.links):
        x, y = chain.at(i, link.centre, q, v)[0] - chain.origin
        moment += link.mass * (x * chain.gravity[1] - y * chain.gravity[0])
    assert turning == pytest.approx(moment, rel=1e-5)  # Euler, about the ground hinge, where no moment acts


def test_table_1_with_slender_rods():
    chain = slender_pair()
    run = swing(chain, HORIZONTAL, (0.0, 0.0), sphere_gap(chain, LENGTH - RADIUS, HEIGHT), 5.0)
    _, velocity = chain.at(1, (LENGTH - RADIUS, 0.0), run.theta, run.theta_dot)
    assert run.t_end == pytest.approx(0.256018, abs=2e-6)
    np.testing.assert_allclose(np.degrees(run.theta), [19.0464, 36.4331], atol=5e-5)
    np.testing.assert_allclose(run.theta_dot, [-3.34456, -17.29906], atol=5e-6)
    np.testing.assert_allclose(velocity, [3.4057, -2.2531], atol=5e-5)
    assert run.energy_drift < 1e-10
    assert run.t[0] == 0.0 and run.t[-1] == run.t_end
    np.testing.assert_allclose(run.theta_t[-1], run.theta, rtol=1e-15)


def test_table_1_with_solid_cylinders():
    rho, disc = 2700.0, math.pi * RADIUS**2

    def cylinder(length):  # mass, centre, inertia about its centre across the axis
        mass = rho * disc * length
        return mass, 0.5 * length, mass * (length**2 / 12 + RADIUS**2 / 4)

    m1, c1, i1 = cylinder(LENGTH)
    m2, c2, i2 = cylinder(LENGTH - RADIUS)
    m3, c3 = rho * 2 / 3 * math.pi * RADIUS**3, LENGTH - RADIUS + 3 / 8 * RADIUS
    i3 = m3 * RADIUS**2 * (2 / 5 - 9 / 64)
    centre = (m2 * c2 + m3 * c3) / (m2 + m3)
    inertia = i2 + i3 + m2 * (c2 - centre) ** 2 + m3 * (c3 - centre) ** 2
    first = Link(body="OA", mass=m1, centre=(c1, 0.0), inertia=i1, hinge_out=(LENGTH, 0.0))
    chain = Chain((first, Link(body="AB", mass=m2 + m3, centre=(centre, 0.0), inertia=inertia)))
    run = swing(chain, HORIZONTAL, (0.0, 0.0), sphere_gap(chain, LENGTH - RADIUS, HEIGHT), 5.0)
    _, velocity = chain.at(1, (LENGTH - RADIUS, 0.0), run.theta, run.theta_dot)
    assert run.t_end == pytest.approx(0.25513, abs=1e-4)
    assert -velocity[1] == pytest.approx(2.277, abs=5e-3)
    assert velocity[0] == pytest.approx(3.450, abs=6e-3)


@pytest.mark.parametrize("amplitude", [0.1, 1.5, 3.0])
def test_pendulum_period_is_the_elliptic_integral(amplitude):
    chain = Chain((slender_link("rod", (0.5, 0.0), mass=2.0),))
    run = swing(chain, (amplitude,), (0.0,), lambda _t, theta: theta[0], 5.0)  # a quarter of the period
    quarter = math.sqrt(2 * 0.5 / (3 * 9.8)) * ellipk(math.sin(0.5 * amplitude) ** 2)
    assert run.t_end == pytest.approx(quarter, rel=1e-11)


def test_five_links_keep_their_energy():
    chain = crooked_chain(5)
    run = swing(chain, np.linspace(0.5, 2.5, 5), np.linspace(-3, 4, 5), lambda t, _theta: 1.0 - t, 2.0)
    assert run.t_end == pytest.approx(1.0, abs=1e-15)
    assert run.energy_drift < 1e-10


def test_five_links_without_gravity_keep_their_angular_momentum():
    chain = Chain(crooked_chain(5).links, gravity=(0.0, 0.0))
    theta, theta_dot = np.linspace(0.5, 2.5, 5), np.linspace(-3, 4, 5)
    run = swing(chain, theta, theta_dot, lambda t, _theta: 1.0 - t, 2.0)
    before, after = chain.angular_momentum(theta, theta_dot), chain.angular_momentum(run.theta, run.theta_dot)
    assert after == pytest.approx(before, rel=1e-10)


def test_a_dip_within_one_step_is_found():
    chain = Chain((slender_link("rod", (0.5, 0.0), mass=2.0),))
    lowest = 2e-9  # the tip grazes the plane for 0.05 ms, far less than a step
    run = swing(chain, (1.0,), (0.0,), lambda _t, theta: 0.5 - 0.5 * math.cos(theta[0]) - lowest, 1.0)
    assert run.theta[0] == pytest.approx(math.acos(1 - 2 * lowest), rel=1e-6)


def test_mesh_link_sums_nodal_masses():
    points = np.array([[1.0, 1.0, 5.0], [3.0, 1.0, -5.0], [1.0, 2.0, 0.0]])
    link = mesh_link("rod", points, np.array([1.0, 1.0, 2.0]), hinge_in=(1.0, 1.0))
    assert (link.mass, link.centre) == (4.0, (0.5, 0.5))
    assert link.inertia == pytest.approx(1 * 0.5 + 1 * 2.5 + 2 * 0.5)
    with pytest.raises(RequestError, match=r"nodal masses of rod = \(2,\)"):
        mesh_link("rod", points, np.ones(2))


def test_a_tip_that_cannot_arrive_is_told_how_near_it_came():
    chain = Chain((slender_link("rod", (0.5, 0.0), mass=2.0),))
    with pytest.raises(RequestError, match=r"0\.09999.*never reaches.*closest at t = 0\.3089.*lower H"):
        swing(chain, (1.0,), (0.0,), sphere_gap(chain, 0.5, 0.6 + RADIUS), 1.2)
    with pytest.raises(RequestError, match="still closing, so a later"):
        swing(chain, (1.0,), (0.0,), sphere_gap(chain, 0.5, 0.5), 0.1)


def test_a_tip_that_overlaps_at_the_start_is_refused():
    chain = slender_pair()
    with pytest.raises(RequestError, match=r"overlaps the target at the start by 0\.003"):
        swing(chain, HORIZONTAL, (0.0, 0.0), sphere_gap(chain, LENGTH, 0.01), 1.0)


def test_a_tip_that_touches_at_the_start_and_closes_is_in_contact_at_once():
    chain = Chain((slender_link("rod", (0.5, 0.0), mass=2.0),))
    run = swing(chain, (1.0,), (-2.0,), lambda _t, theta: theta[0] - 1.0, 1.0)
    assert run.t_end == 0.0 and run.theta[0] == 1.0 and run.energy_drift == 0.0
