"""Owns the cases of laws of friction on blocks: a coefficient that decays with speed, and a cap on the shear stress."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.verify.case import SHAPES, Row, Setup, case, crossings
from warp_mca.verify.friction import GRAVITY, MASS, MU, SPEED, impulse, sunk

KINETIC = 0.1  # of both blocks on DecayingFriction, beside MU at rest [-]
DECAY, SHARP = 2.0, 500.0  # of the block that slides to rest, and of that on a spring [s/m]


def with_law(scene: mca.Scene, law: mca.DecayingFriction | mca.ShearCap) -> mca.Scene:
    """The scene with this law of friction in its contact."""
    return dataclasses.replace(scene, contacts=(dataclasses.replace(scene.contacts[0], friction=law),))


@case(
    group="friction",
    elements=SHAPES,
    title="A block slides to rest as its coefficient of friction rises from near mu_k to mu_s",
    reference=(
        "dv/dt = -g (mu_k + (mu_s - mu_k) exp(-d v)), so that mu_k exp(d v) + mu_s - mu_k falls by exp(-mu_k g d t); "
        "the distance by quadrature. Law: Oden and Martins, Comput. Methods Appl. Mech. Eng. 52 (1985) 527."
    ),
)
def decaying_friction(setup: Setup) -> list[Row]:
    """v = 1 m/s, mu_s = 0.3, mu_k = 0.1, d = 2 s/m, g = 300 m/s^2, 0.2 kg."""
    rest = MU - KINETIC

    def time_to(speed: float) -> float:
        fall = (KINETIC * math.exp(DECAY * SPEED) + rest) / (KINETIC * math.exp(DECAY * speed) + rest)
        return math.log(fall) / (KINETIC * GRAVITY * DECAY)

    speeds = np.linspace(0.0, SPEED, 2001)
    way = float(np.trapezoid([time_to(speed) for speed in speeds], speeds))
    distance, halved, slow, heat = [], [], [], []
    for count in setup.choose((1, 2), (1, 2, 4)):
        law = mca.DecayingFriction(kinetic=KINETIC, decay=DECAY)
        scene = sunk(setup, with_law(setup.scene("sliding_block", cells=count), law), MASS * GRAVITY)
        result = setup.run(scene, duration=1.2 * time_to(0.0))
        speed = SPEED + impulse(result) / MASS
        distance.append(float(np.trapezoid(speed, result.time)))
        halved.append(float(crossings(result.time, speed, 0.5 * SPEED)[0]))
        slow.append(float(crossings(result.time, speed, 0.1 * SPEED)[0]))
        heat.append(float(result["E_friction"][-1]))
    springs = "the tangential springs stretch by 0.01 % of the way, and the block swings on them in the end"
    bounce = "the block bounces a little as it slides"
    return [
        Row("time to half of the speed", time_to(0.5 * SPEED), halved, "s", 0.0005, bounce),
        Row("time to a tenth of it", time_to(0.1 * SPEED), slow, "s", 0.0005, bounce),
        Row("distance", way, distance, "m", 0.0005, bounce),
        Row("heat", 0.5 * MASS * SPEED**2, heat, "J", 0.0002, springs),
    ]


@case(
    group="friction",
    elements=SHAPES,
    title="A block on a belt and a spring sticks and slips in turn where friction at rest is greater than in motion",
    reference=(
        "Rigid mass m on a spring k under mu(v - dx/dt) F_n from the state in which it is torn off, x = mu_s F_n / k "
        "and dx/dt = v, integrated until dx/dt = v again; then x grows with v to mu_s F_n / k. For sharp decay the "
        "amplitude is the root of ((mu_s - mu_k) F_n / k)^2 + (v / omega)^2."
    ),
)
def stick_slip_cycle(setup: Setup) -> list[Row]:
    """The block of `stick_slip` with mu_s F_n = 1 N, mu_k = mu_s / 3 and d = 500 s/m; sharp decay gives 2 % less."""
    force, stiffness, v = 1.0, 2e4, 0.1
    exact = _cycle(force, stiffness, 2e-3 * (1.0 + 0.004 / 3.0), v)
    found: dict[str, list[float]] = {name: [] for name in exact}
    for count in setup.choose((4,), (4, 8)):
        law = mca.DecayingFriction(kinetic=KINETIC, decay=SHARP)
        scene = sunk(setup, with_law(setup.scene("stick_slip", cells=count), law), force / MU)
        result = setup.run(scene, duration=1.5e-3 + 1.3 * exact["period"])
        way = np.cumsum(result["tip_vx"]) * (result.time[1] - result.time[0])
        turns = crossings(result.time, result["tip_vx"], 0.0)
        reached = np.interp(turns, result.time, way)
        warmed = np.interp(turns, result.time, result["E_friction"])
        found["amplitude"].append(0.5 * float(reached[0] - reached[1]))
        found["period"].append(float(turns[2] - turns[0]))
        found["heat"].append(float(warmed[2] - warmed[0]))
    why = "waves in the block and the spring move the contact while it sticks, which lowers the limit a little"
    units = {"amplitude": "m", "period": "s", "heat": "J"}
    return [Row(f"{name} of a cycle", exact[name], found[name], units[name], 0.005, why) for name in exact]


def _cycle(force: float, stiffness: float, mass: float, v: float) -> dict[str, float]:
    """Amplitude [m], period [s] and heat [J] of a cycle of sticking and slipping with mu_s F_n = `force` [N]."""
    from scipy.integrate import solve_ivp

    def motion(t: float, y: Any) -> list[float]:
        slip = v - y[1]
        friction = force / MU * (KINETIC + (MU - KINETIC) * math.exp(-SHARP * abs(slip)))
        return [y[1], (math.copysign(friction, slip) - stiffness * y[0]) / mass, friction * abs(slip)]

    def caught(t: float, y: Any) -> float:
        return y[1] - v if y[0] < force / stiffness else -1.0

    caught.terminal, caught.direction = True, 1.0  # pyright: ignore[reportFunctionMemberAccess]
    begin, span = [force / stiffness, v - 1e-6, 0.0], 10.0 * math.sqrt(mass / stiffness)
    slip = solve_ivp(motion, (0.0, span), begin, events=caught, rtol=1e-9, atol=1e-13, max_step=span / 1e4)
    x, _, heat = slip.y
    stuck = (force / stiffness - x[-1]) / v
    return {"amplitude": 0.5 * float(np.ptp(x)), "period": float(slip.t[-1] + stuck), "heat": float(heat[-1])}


@case(
    group="friction",
    elements=SHAPES,
    title="A block that is pressed hard slides under a constant shear stress, however much it weighs",
    reference="Friction tau_max A where mu p is greater: over m v^2 / (2 tau_max A), in m v / (tau_max A).",
)
def capped_friction(setup: Setup) -> list[Row]:
    """v = 1 m/s, A = 0.01 m^2, tau_max = 1.2 kPa: 1/3 and 1/6 of mu p, by twice and four times the weight."""
    cap, area = 1200.0, 0.01
    friction = cap * area
    exact = MASS * SPEED / friction
    rows = []
    for times in (2, 4):
        gravity = times * GRAVITY
        scene = with_law(setup.scene("sliding_block", cells=2, g=gravity), mca.ShearCap(tau_max=cap))
        result = setup.run(sunk(setup, scene, MASS * gravity), duration=1.2 * exact)
        speed = SPEED + impulse(result) / MASS
        slides = speed > 0.1 * SPEED
        name = f"under {times} m g"
        force = (float(-result.F_t[slides][1:].mean()),)
        distance, heat = (float(np.trapezoid(speed, result.time)),), (float(result["E_friction"][-1]),)
        stretch = "springs stretch at first, and the block bounces a little"
        swing = "the block swings on the tangential springs in the end"
        rows += [
            Row(
                f"friction {name}",
                friction,
                force,
                "N",
                5e-5,
                stretch,
            ),
            Row(f"distance {name}", 0.5 * SPEED * exact, distance, "m", 0.0005, swing),
            Row(f"heat {name}", 0.5 * MASS * SPEED**2, heat, "J", 0.0002, swing),
        ]
    return rows
