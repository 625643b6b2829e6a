"""Owns the cases of closed loops of joints between whole bodies, and of what acts in their freedoms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.body_joints import SECOND, link, machine
from warp_mca.verify.case import Row, Setup, case, crossings

CRANK, COUPLER, ROCKER, GROUND = 0.2, 0.5, 0.4, 0.5  # lengths of the four-bar linkage [m]
THIN = (0.001, 0.01, 0.01)  # inertia of its links, of 1 kg each [kg m^2]
RATE = 10.0  # of the crank at first [rad/s]
G = 9.81  # [m/s^2]
ROTOR = {"mass": 1.0, "inertia": (0.1, 0.2, 0.25), "centre": (0.0, 0.0, 0.0)}
J = 0.25  # about z [kg m^2]


def four_bar(theta: float) -> tuple[float, float, Array]:
    """Angles of coupler and rocker [rad], and the end of the crank [m], at an angle of the crank."""
    P = CRANK * np.array([math.cos(theta), math.sin(theta)])
    x, y = GROUND - P[0], -P[1]
    L = math.hypot(x, y)
    coupler = math.atan2(y, x) + math.acos((COUPLER**2 + L**2 - ROCKER**2) / (2.0 * COUPLER * L))
    Q = P + COUPLER * np.array([math.cos(coupler), math.sin(coupler)])
    return coupler, math.atan2(Q[1], Q[0] - GROUND), P


def crank_motion(theta: float, rate: float, times: Array) -> Array:
    """Angle of the crank under gravity [rad], from M(theta) theta'' + M'(theta) theta'^2 / 2 = Q(theta)."""
    from scipy.integrate import solve_ivp

    def places(angle: float) -> Array:
        coupler, rocker, P = four_bar(angle)
        turns = 0.1 * np.array([angle, coupler, rocker])  # inertia of 0.01 kg m^2
        heads = [(math.cos(a), math.sin(a)) for a in (angle, coupler, rocker)]
        halves = 0.5 * np.array([CRANK, COUPLER, ROCKER])[:, None] * np.array(heads)
        centres = halves + np.array([(0.0, 0.0), P, (GROUND, 0.0)])
        return np.concatenate([centres.ravel(), turns])

    def slope(_: float, y: Array) -> list[float]:
        h = 1e-4
        low, mid, high = (places(y[0] + k * h) for k in (-1, 0, 1))
        first, second = (high - low) / (2.0 * h), (high - 2.0 * mid + low) / h**2
        return [y[1], float((-G * first[1:6:2].sum() - first @ second * y[1] ** 2) / (first @ first))]

    found = solve_ivp(slope, (0.0, times[-1]), [theta, rate], rtol=1e-10, atol=1e-10, t_eval=times)
    return found.y[0]


def bar(name: str, length: float, at: Array, angle: float, turn: float, way: Array) -> mca.Body:
    """A link in the xy plane, which turns at a rate while its origin moves."""
    more = {"mass": 1.0, "inertia": THIN, "centre": (0.5 * length, 0.0, 0.0), "rotation": (0.0, 0.0, angle)}
    moves = {"angular_velocity": (0.0, 0.0, turn), "velocity": (float(way[0]), float(way[1]), 0.0)}
    return link(name, (at[0], at[1], 0.0), **more, **moves)


@case(
    group="rigid",
    title="A four-bar linkage closes: its own equation in one angle, though hinges in space hold it three times over",
    reference="Lagrange's equation of the crank's angle, integrated by SciPy (Runge-Kutta of order 5).",
    elements=(),
)
def four_bar_loop(setup: Setup) -> list[Row]:
    """Bars of 0.2, 0.5 and 0.4 m swing under gravity for a second, once round and on."""
    theta, h = 1.0, 1e-6
    coupler, rocker, P = four_bar(theta)
    above, below = four_bar(theta + h), four_bar(theta - h)
    rates = [RATE * (a - b) / (2.0 * h) for a, b in zip(above[:2], below[:2], strict=True)]
    way = RATE * np.array([-P[1], P[0]])
    still = np.zeros(2)
    bodies = (
        bar("crank", CRANK, still, theta, RATE, still),
        bar("coupler", COUPLER, P, coupler, rates[0], way),
        bar("rocker", ROCKER, np.array([GROUND, 0.0]), rocker, rates[1], still),
    )
    own = {"nodes": None, "axis": (0.0, 0.0, 1.0)}
    joints = (
        mca.Revolute(name="O", body="crank", at=(0.0, 0.0, 0.0), **own),
        mca.Revolute(name="P", body="coupler", at=(0.0, 0.0, 0.0), other="crank", other_at=(CRANK, 0.0, 0.0), **own),
        mca.Revolute(name="D", body="rocker", at=(0.0, 0.0, 0.0), **own),
        mca.Revolute(name="Q", body="coupler", at=(COUPLER, 0, 0), other="rocker", other_at=(ROCKER, 0, 0), **own),
    )
    samples, off, shape = setup.choose((4000, 8000), (4000, 8000, 16000)), [], 0.0
    for steps in samples:
        result = setup.run(machine(bodies, joints, steps, gravity=(0.0, -G, 0.0)))
        found = theta + result["joint_O_q1_rad"]
        off.append(float(np.abs(found - crank_motion(theta, RATE, result.time)).max()))
        known = np.unwrap([four_bar(angle)[1] for angle in found])
        shape = float(np.abs(known - rocker - result["joint_D_q1_rad"]).max())
    sizes = tuple(1.0 / steps for steps in samples)
    return [
        Row("greatest difference of the crank's angle", 0.0, off, "rad", 1e-4, SECOND, sizes, 1.0),
        Row("rocker's angle at that of the crank", 0.0, (shape,), "rad", 1e-10, "round-off", scale=1.0),
    ]


@case(
    group="rigid",
    title="A slider-crank and a universal joint turn as their geometry says",
    reference="x = r cos(theta) + sqrt(l^2 - r^2 sin^2(theta)); tan(out) = cos(bend) tan(in).",
    elements=(),
)
def slider_and_cross(setup: Setup) -> list[Row]:
    """Crank 0.2 m, rod 0.5 m, free slider; two shafts that a cross joins at 0.6 rad."""
    r, rod = CRANK, COUPLER
    zero = np.zeros(2)
    bodies = (
        bar("crank", r, zero, math.pi / 2, RATE, zero),
        bar("rod", rod, np.array([0.0, r]), -math.asin(r / rod), 0.0, np.array([-r * RATE, 0.0])),
        link("slider", (math.sqrt(rod**2 - r**2), 0.0, 0.0), velocity=(-r * RATE, 0.0, 0.0), centre=(0.0, 0.0, 0.0)),
    )
    own = {"nodes": None, "axis": (0.0, 0.0, 1.0)}
    joints = (
        mca.Revolute(name="O", body="crank", at=(0.0, 0.0, 0.0), **own),
        mca.Revolute(name="P", body="rod", at=(0.0, 0.0, 0.0), other="crank", other_at=(r, 0.0, 0.0), **own),
        mca.Revolute(name="Q", body="rod", at=(rod, 0.0, 0.0), other="slider", **own),
        mca.Prismatic(name="S", body="slider", axis=(1.0, 0.0, 0.0)),
    )
    result = setup.run(machine(bodies, joints, 2000))
    theta, start = math.pi / 2 + result["joint_O_q1_rad"], math.sqrt(rod**2 - r**2)
    known = r * np.cos(theta) + np.sqrt(rod**2 - (r * np.sin(theta)) ** 2) - start
    slid = float(np.abs(result["joint_S_q1_m"] - known).max())
    out, bend = shafts(setup)
    return [
        Row("slider's way", 0.0, (slid,), "m", 1e-4, "round-off", scale=r),
        Row("angle of the shaft behind the cross", 0.0, (out,), "rad", 1e-3, "round-off", scale=bend),
    ]


def shafts(setup: Setup) -> tuple[float, float]:
    """Greatest difference of the second shaft's angle from what a cross between both gives [rad], and the bend."""
    bend = 0.6
    c, s = math.cos(bend), math.sin(bend)
    round_body = {"mass": 1.0, "inertia": (0.1, 0.1, 0.1), "centre": (0.0, 0.0, 0.0)}
    bodies = (
        link("in", angular_velocity=(RATE, 0.0, 0.0), **round_body),
        link("out", angular_velocity=(RATE * c * c, RATE * c * s, 0.0), **round_body),
    )
    joints = (
        mca.Articulation(name="I", body="in", freedoms=(mca.Freedom(axis=(1.0, 0.0, 0.0)),)),
        mca.Articulation(name="O", body="out", freedoms=(mca.Freedom(axis=(c, s, 0.0)),)),
        mca.Universal(name="X", body="out", other="in", axis=(0.0, 0.0, 1.0), second_axis=(-s, c, 0.0)),
    )
    result = setup.run(machine(bodies, joints, 4000))
    turned = result["joint_I_q1_rad"]
    known = np.unwrap(np.arctan2(c * np.sin(turned), np.cos(turned)))
    return float(np.abs(result["joint_O_q1_rad"] - known).max()), bend


@case(
    group="rigid",
    title="Two geared wheels, one with a spring and a rotor, swing as one; a pinion rolls with its carriage on a rack",
    reference="cos(w t), w^2 = r^2 k / (J_1 + r^2 (J_2 + A)); F t^2 / (2 m + J / R^2) / 2.",
    elements=(),
)
def gears(setup: Setup) -> list[Row]:
    """Wheels of 0.25 kg m^2 at a ratio of -2.5, for a second; a force of 40 N on a carriage of 1 kg, likewise."""
    ratio, k, A, far = -2.5, 40.0, 0.1, (1.0, 0.3, -0.2)
    felt = J + ratio**2 * (J + A)
    rate = math.sqrt(ratio**2 * k / felt)
    free, geared = mca.Freedom(), mca.Coupler(joint="A", ratio=ratio)
    sprung = mca.Freedom(stiffness=k, rest=-ratio, armature=A, follows=geared)
    hinges = (
        mca.Articulation(name="A", body="a", freedoms=(free,)),
        mca.Articulation(name="B", body="b", freedoms=(sprung,)),
    )
    samples, off = setup.choose((4000, 8000), (4000, 8000, 16000)), []
    for steps in samples:
        result = setup.run(machine((link("a", **ROTOR), link("b", far, **ROTOR)), hinges, steps))
        known = -1.0 + np.cos(rate * result.time)
        off.append(float(np.abs(result["joint_A_q1_rad"] - known).max()))
    radius, force = 0.1, 40.0
    push = mca.Freedom(kind="slide", axis=(1.0, 0.0, 0.0), motor=mca.Amplitude(times=(0.0,), values=(force,)))
    roll = mca.Freedom(follows=mca.Coupler(joint="A", ratio=-1.0 / radius))
    rack = (
        mca.Articulation(name="A", body="a", freedoms=(push,)),
        mca.Articulation(name="B", body="b", other="a", freedoms=(roll,)),
    )
    rolled = setup.run(machine((link("a", **ROTOR), link("b", **ROTOR)), rack, 1000))
    way = 0.5 * force / (2.0 + J / radius**2)
    return [
        Row("greatest difference of a wheel's angle", 0.0, off, "rad", 1e-5, SECOND,
            tuple(1.0 / steps for steps in samples), 1.0, 1.8),
        Row("carriage's way", way, (float(rolled["joint_A_q1_m"][-1]),), "m", 1e-5, SECOND),
        Row("pinion's angle", -way / radius, (float(rolled["joint_B_q1_rad"][-1]),), "rad", 1e-5, SECOND),
    ]  # fmt: skip


def rotor(setup: Setup, steps: int, speed: float, **freedom: Any) -> mca.Result:
    """A rotor of 0.25 kg m^2 on a hinge about z."""
    body = link("r", angular_velocity=(0.0, 0.0, speed), **ROTOR)
    joint = mca.Articulation(name="J", body="r", freedoms=(mca.Freedom(**freedom),))
    return setup.run(machine((body,), (joint,), steps))


@case(
    group="rigid",
    title="Limits, springs, dampers, friction, motors and rotors in the freedom of a joint",
    reference="Closed forms of a rotor on a hinge, and the period of a physical pendulum with a rotor in its hinge.",
    elements=(),
)
def joint_drives(setup: Setup) -> list[Row]:
    """A rotor of 0.25 kg m^2 over a second, with each of them in turn; J + A where a rotor turns with it."""
    steps = 10000
    stiff = rotor(setup, steps, 5.0, limits=(-0.1, 0.1), limit_stiffness=1e4)
    slow = rotor(setup, steps, 5.0, damping=0.5)
    rubbed = rotor(setup, steps, 5.0, friction=2.0)
    driven = rotor(setup, steps, 0.0, armature=0.1, motor=mca.Amplitude(times=(0.0, 1.0), values=(0.0, 3.0)))
    servo = rotor(setup, steps, 0.0, motor=mca.PositionServo(kp=25.0, kv=1.0, target=0.3))
    sprung = rotor(setup, steps, 0.0, stiffness=25.0, rest=0.2, armature=0.1)
    q = "joint_J_q1_rad"
    omega, decay = 10.0, 2.0  # sqrt(kp / J), kv / (2 J)
    damped = math.sqrt(omega**2 - decay**2)
    t = servo.time
    wave = np.cos(damped * t) + decay / damped * np.sin(damped * t)
    known = 0.3 * (1.0 - np.exp(-decay * t) * wave)
    swing = 0.2 * (1.0 - np.cos(math.sqrt(25.0 / 0.35) * sprung.time))
    hung = {"mass": 1.0, "inertia": (0.1, 0.2, 0.25), "centre": (0.0, -1.0, 0.0), "rotation": (0.0, 0.0, 1e-3)}
    hinge = mca.Articulation(name="J", body="r", freedoms=(mca.Freedom(armature=0.1),))
    pendulum = setup.run(machine((link("r", **hung),), (hinge,), 8000, 8.0, gravity=(0.0, -G, 0.0)))
    passed = crossings(pendulum.time, pendulum[q] + 1e-3, 0.0)
    period = 2.0 * math.pi * math.sqrt((1.0 + J + 0.1) / G)
    bounce = 0.1 + 5.0 * math.sqrt(J / 1e4)
    return [
        Row("turned back at a limit: energy lost", 0.0, (float(abs(stiff["E_kinetic"][-1] / 3.125 - 1.0)),), "-",
            1e-3, SECOND, scale=1.0),
        Row("greatest angle beyond a limit", bounce, (float(stiff[q].max()),), "rad", 1e-3, "rows of the history"),
        Row("angle with a damper", 5.0 * J / 0.5 * (1.0 - math.exp(-0.5 / J)), (float(slow[q][-1]),), "rad", 1e-3,
            SECOND),
        Row("angle at which friction stops it", 0.5 * J * 25.0 / 2.0, (float(rubbed[q][-1]),), "rad", 1e-3,
            "friction falls at rates of some 1e-3 rad/s"),
        Row("heat of friction", 0.5 * J * 25.0, (float(rubbed["E_joint"][-1]),), "J", 1e-3, "likewise"),
        Row("angle by a torque that grows, with a rotor", 0.5 / 0.35, (float(driven[q][-1]),), "rad", 1e-3, SECOND),
        Row("a servo's swing", 0.0, (float(np.abs(servo[q] - known).max()),), "rad", 1e-3, SECOND, scale=0.3),
        Row("a spring's swing, with a rotor", 0.0, (float(np.abs(sprung[q] - swing).max()),), "rad", 1e-3, SECOND,
            scale=0.2),
        Row("period of a pendulum with a rotor", period, (float(np.diff(passed[::2]).mean()),), "s", 1e-3, SECOND),
    ]  # fmt: skip
