"""Owns the tests of what drives a chain: moving and sliding bases, joint friction and torques, and their energy."""

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.rigid.chain import Chain
from warp_mca.rigid.flow import flow
from warp_mca.rigid.link import Link, slender_link
from warp_mca.rigid.loads import Loads, Table
from warp_mca.rigid.swing import swing_until

MASS, LENGTH, G = 2.0, 0.5, 9.8
INERTIA = MASS * LENGTH**2 / 3.0


def loads(count: int, **given) -> Loads:
    none = {"friction": np.zeros(count), "damping": np.zeros(count), "friction_rate": 1e-2, "torques": (None,) * count}
    return Loads(**{**none, **given})


def table(times, values) -> Table:
    return Table(np.array(times, dtype=float), np.array(values, dtype=float))


def rod(gravity: float = 0.0, **given) -> Chain:
    return Chain((slender_link("rod", (LENGTH, 0.0), mass=MASS),), gravity=(0.0, -gravity), **given)


def crooked_chain(count: int, **given) -> Chain:
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
    return Chain(tuple(links), origin=(0.3, -0.2), gravity=(1.5, -9.8), **given)


BASE = table([0.0, 0.4, 1.0], [[0.3, -0.2], [1.0, 0.4], [-0.5, 0.1]])


def base_at(t: float) -> tuple[complex, complex]:
    """Way and velocity of BASE at time t in [0, 0.4], by hand."""
    a = complex(0.7, 0.6) / 0.4
    return complex(0.3, -0.2) * t + 0.5 * a * t**2, complex(0.3, -0.2) + a * t


def lagrangian(chain: Chain, t: float, q: np.ndarray, v: np.ndarray, base: bool) -> float:
    """T - V in the ground's frame from positions and velocities, with complex numbers for the plane."""
    way, speed = base_at(t) if base else (0j, 0j)
    hinge, hinge_rate, g = complex(*chain.origin) + way, speed, complex(*chain.gravity)
    total = 0.0
    if chain.slide is not None:
        hinge, hinge_rate = hinge + q[0] * complex(*chain.slide), hinge_rate + v[0] * complex(*chain.slide)
        total += chain.carriage_mass * (0.5 * abs(hinge_rate) ** 2 + (g.conjugate() * hinge).real)
    for link, angle, rate in zip(chain.links, chain.angles(q), chain.angles(v), strict=True):
        turn = np.exp(-1j * (angle + 0.5 * np.pi))
        spin = -1j * rate * turn
        centre, velocity = hinge + turn * complex(*link.centre), hinge_rate + spin * complex(*link.centre)
        total += 0.5 * link.mass * abs(velocity) ** 2 + 0.5 * link.inertia * rate**2
        total += link.mass * (g.conjugate() * centre).real
        hinge, hinge_rate = hinge + turn * complex(*link.hinge_out), hinge_rate + spin * complex(*link.hinge_out)
    return total


@pytest.mark.parametrize("slide", [None, (0.6, 0.8)])
@pytest.mark.parametrize("base", [False, True])
def test_driven_chains_obey_the_differentiated_lagrangian(slide, base):
    """d/dt dL/dv - dL/dq = Q, with Q the derivative of the torques' and the friction's power by the rates."""
    count, t, h, torque = 3, 0.15, 1e-4, 0.7
    given = loads(
        count,
        friction=np.array([0.2, 0.0, 0.1]),
        damping=np.array([0.01, 0.02, 0.0]),
        friction_rate=0.5,
        torques=(None, table([0.0, 1.0], [torque, torque]), None),
        base_velocity=BASE if base else None,
    )
    chain = crooked_chain(count, slide=slide, carriage_mass=0.4 if slide else 0.0, loads=given)
    rng, size = np.random.default_rng(7), chain.coordinate_count
    q, v, unit = rng.uniform(-3, 3, size), rng.uniform(-4, 4, size), np.eye(size)

    def momentum(t, q, v):  # dL/dv: exact, L is quadratic in v
        up, down = ([lagrangian(chain, t, q, v + s * e, base) for e in unit] for s in (1.0, -1.0))
        return 0.5 * np.subtract(up, down)

    def slope(function):  # fourth-order central difference
        return (8 * (function(h) - function(-h)) - (function(2 * h) - function(-2 * h))) / (12 * h)

    force = np.array([slope(lambda s, e=e: lagrangian(chain, t, q + s * e, v, base)) for e in unit])
    convected = slope(lambda s: momentum(t + s, q + s * v, v))
    M = np.array([momentum(t, q, e) - momentum(t, q, 0 * e) for e in unit])
    rates = np.diff(chain.angles(v), prepend=0.0)
    joint = -given.damping * rates - given.friction * np.tanh(rates / 0.5) + [0.0, torque, 0.0]
    Q = np.append(np.zeros(size - count), joint - np.append(joint[1:], 0.0))
    np.testing.assert_allclose(chain.mass_matrix(q), M, rtol=1e-12, atol=1e-14)
    found = flow(chain, t)(t, np.concatenate([q, v, np.zeros(3)]))[size : 2 * size]
    np.testing.assert_allclose(found, np.linalg.solve(M, force - convected + Q), rtol=1e-8)


def test_energy_balance_closes_with_all_loads_at_once():
    given = loads(
        3,
        friction=np.array([0.05, 0.02, 0.03]),
        damping=np.array([0.01, 0.02, 0.005]),
        friction_rate=0.1,
        torques=(table([0.1, 0.3], [0.5, -0.2]), None, table([0.0, 0.2, 0.5], [0.0, 0.3, 0.0])),
        base_velocity=BASE,
    )
    chain = crooked_chain(3, slide=(0.8, -0.6), carriage_mass=0.3, loads=given)
    q, v = np.array([0.0, 0.5, 1.0, 1.5]), np.array([0.4, -2.0, 3.0, 1.0])
    run = swing_until(chain, q, v, (), t_start=0.35, t_end=0.55)
    assert run.energy_drift < 1e-9
    assert run.work_t[-1, 1] > 0.01 and abs(run.work_t[-1, 0]) > 0.01 and abs(run.work_t[-1, 2]) > 0.01
    end, first = chain.moved_to(0.55), chain.moved_to(0.35)
    lifted = -chain.mass * np.subtract(end.origin, first.origin) @ chain.gravity
    change = end.kinetic_energy(run.theta, run.theta_dot) - first.kinetic_energy(q, v)
    change += end.potential_energy(run.theta) - first.potential_energy(q) + lifted
    assert change == pytest.approx(run.work_t[-1, 0] + run.work_t[-1, 2] - run.work_t[-1, 1], rel=1e-9)


def test_a_constant_torque_turns_a_rod_evenly_faster():
    run = swing_until(rod(loads=loads(1, torques=(table([0.0], [0.3]),))), (0.1,), (0.2,), (), t_end=0.7)
    alpha = 0.3 / INERTIA
    assert run.theta[0] == pytest.approx(0.1 + 0.2 * 0.7 + 0.5 * alpha * 0.7**2, rel=1e-12)
    assert run.work_t[-1, 0] == pytest.approx(0.3 * (run.theta[0] - 0.1), rel=1e-12)


def test_coulomb_friction_stops_a_rod_and_turns_its_energy_to_heat():
    """w' = -(tau / I) tanh(w / w_0): sinh(w / w_0) falls as exp(-tau t / (I w_0)); it rests after some I w / tau."""
    torque, rate, w0 = 0.4, 2.0, 0.05
    chain = rod(loads=loads(1, friction=np.array([torque]), friction_rate=w0))
    t = 0.7
    run = swing_until(chain, (0.0,), (rate,), (), t_end=t)
    log_sinh = rate / w0 + math.log1p(-math.exp(-2.0 * rate / w0)) - math.log(2.0) - torque * t / (INERTIA * w0)
    assert run.theta_dot[0] == pytest.approx(w0 * math.asinh(math.exp(log_sinh)), rel=1e-9)
    stopped = swing_until(chain, (0.0,), (rate,), (), t_end=1.5 * INERTIA * rate / torque)
    assert abs(stopped.theta_dot[0]) < 1e-3 * rate
    assert stopped.theta[0] == pytest.approx(0.5 * INERTIA * rate**2 / torque, rel=2e-3)  # less w_0's trace
    assert stopped.work_t[-1, 1] == pytest.approx(0.5 * INERTIA * rate**2, rel=1e-6)


def test_a_joint_at_rest_holds_a_torque_below_its_friction():
    chain = rod(loads=loads(1, friction=np.array([0.4]), torques=(table([0.0], [0.3]),)))
    run = swing_until(chain, (0.0,), (0.0,), (), t_end=0.5)
    assert run.theta_dot[0] == pytest.approx(1e-2 * math.atanh(0.75), rel=1e-6)  # it creeps at w_0 artanh(tau / tau_C)


def test_viscous_damping_decays_exponentially():
    run = swing_until(rod(loads=loads(1, damping=np.array([0.2]))), (0.0,), (3.0,), (), t_end=0.9)
    assert run.theta_dot[0] == pytest.approx(3.0 * math.exp(-0.2 * 0.9 / INERTIA), rel=1e-11)


def test_inner_friction_keeps_the_angular_momentum():
    chain = Chain(crooked_chain(2).links, gravity=(0.0, 0.0), loads=loads(2, friction=np.array([0.0, 0.1])))
    q, v = np.array([0.3, 0.9]), np.array([1.0, 5.0])
    run = swing_until(chain, q, v, (), t_end=0.3)
    before, after = chain.angular_momentum(q, v), chain.angular_momentum(run.theta, run.theta_dot)
    assert after == pytest.approx(before, rel=1e-10) and run.work_t[-1, 1] > 1e-3


def test_an_even_acceleration_of_the_base_is_tilted_gravity():
    a = np.array([3.0, -2.0])
    moving = rod(G, loads=loads(1, base_velocity=table([0.0, 2.0], [[0.5, 0.1], [0.5 + 2 * a[0], 0.1 + 2 * a[1]]])))
    tilted = Chain(moving.links, gravity=(-a[0], -G - a[1]))
    one = swing_until(moving, (1.0,), (0.3,), (), t_end=0.8)
    other = swing_until(tilted, (1.0,), (0.3,), (), t_end=0.8)
    np.testing.assert_allclose(one.theta, other.theta, rtol=1e-11)
    np.testing.assert_allclose(one.theta_dot, other.theta_dot, rtol=1e-11)
    tip, velocity = moving.moved_to(0.8).at(0, (LENGTH, 0.0), one.theta, one.theta_dot)
    still, relative = tilted.at(0, (LENGTH, 0.0), other.theta, other.theta_dot)
    np.testing.assert_allclose(tip, still + np.array([0.5, 0.1]) * 0.8 + 0.5 * a * 0.8**2, rtol=1e-11)
    np.testing.assert_allclose(velocity, relative + np.array([0.5, 0.1]) + a * 0.8, rtol=1e-11)


def test_a_pendulum_on_a_carriage_keeps_its_momentum_along_the_rail():
    chain = rod(G, slide=(1.0, 0.0), carriage_mass=0.7)
    run = swing_until(chain, (0.0, 1.2), (0.5, 0.0), (), t_end=0.9)
    before = chain.momentum(np.array([0.0, 1.2]), np.array([0.5, 0.0]))[0] + 0.7 * 0.5
    after = chain.momentum(run.theta, run.theta_dot)[0] + 0.7 * run.theta_dot[0]
    assert after == pytest.approx(before, rel=1e-11) and run.energy_drift < 1e-11


def test_small_swings_on_a_carriage_have_their_closed_period():
    """omega^2 = (m + M) g c / ((m + M) I - m^2 c^2), I about the hinge, c the centre's distance."""
    carriage, c = 0.7, 0.5 * LENGTH
    chain = rod(G, slide=(1.0, 0.0), carriage_mass=carriage)
    total = MASS + carriage
    omega = math.sqrt(total * MASS * G * c / (total * INERTIA - MASS**2 * c**2))
    run = swing_until(chain, (0.0, 1e-4), (0.0, 0.0), (lambda _t, q: q[1],), t_end=2.0)
    assert run.ended_by == "touch" and run.t_end == pytest.approx(0.5 * math.pi / omega, rel=1e-7)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"joint_friction": (0.1,)}, "joint_friction = .*give 2 numbers, one for each link"),
        ({"joint_damping": (0.1, -0.1)}, "joint_damping = .*0 or above"),
        ({"friction_rate": 0.0}, "friction_rate = .*above 0"),
        ({"torques": (mca.Slide(),)}, r"torques\[0\] = .*give a JointTorque"),
        ({"slide": 1.0}, "slide = 1.0: give a Slide or None"),
        ({"base_motion": (1.0, 0.0)}, "base_motion = .*give a BaseMotion or None"),
    ],
)
def test_loads_that_do_not_fit_are_refused(change, message):
    tip = mca.Tip(body="b", centre=(0.1, 0.0, 0.0), radius=0.01)
    with pytest.raises(RequestError, match=message):
        mca.RigidPhase(theta=(1.0, 1.0), theta_dot=(0.0, 0.0), tip=tip, target=mca.RigidPlane(), **change)
