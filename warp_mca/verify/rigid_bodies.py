"""Owns the cases of rigid bodies in the impact phase: tops, pendulums, and a rigid ball on an elastic block."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from warp_mca.scenes.spinning_top import inertia
from warp_mca.verify.case import Row, Setup, case, crossings
from warp_mca.verify.hinges import LENGTH, SPAN, THETA, THETA_DOT, rigid_pendulum
from warp_mca.verify.impact import FINITE, HERTZ, STEEL, hertz, peak_and_duration

RATE = 20.0  # of the tops' precession [rad/s]
ROUND_OFF = 1e-12
SECOND = "the scheme is of order 2 in the step"


def _precession(result: mca.Result) -> tuple[float, float]:
    """Rate at which the velocity of the top's end turns about z [rad/s], and its greatest part along z, as a share."""
    vx, vy, vz = (result[f"tip_v{axis}"] for axis in "xyz")
    angle = np.unwrap(np.arctan2(vy, vx))
    return float(np.polyfit(result.time, angle, 1)[0]), float(np.abs(vz).max() / np.hypot(vx, vy).mean())


def _tops(setup: Setup, heavy: bool) -> tuple[list[mca.Result], tuple[float, ...]]:
    """Runs with smaller and smaller steps, and the lengths of these in relation to each other."""
    samples = setup.choose((3000, 6000), (3000, 6000, 12000))  # rows, each a step
    found = [setup.run(setup.scene("spinning_top", heavy=heavy, samples=count)) for count in samples]
    return found, tuple(1.0 / count for count in samples)


@case(
    group="rigid",
    title="A rigid body turns freely: its axis precesses about the angular momentum, which it keeps",
    reference="Goldstein, Classical Mechanics, chapter 5: the axis of a symmetric top turns at L / I_1.",
    elements=(),
)
def free_top(setup: Setup) -> list[Row]:
    """A box of 0.2 m x 0.2 m x 0.1 m, 2700 kg/m^3, tilted by 0.4 rad; its axis turns at 20 rad/s, twice round."""
    results, sizes = _tops(setup, heavy=False)
    rate, _ = zip(*map(_precession, results), strict=True)
    _, across, _ = inertia(0.2, 0.1, 2700.0, 2)
    spin = [np.array(result.summary["rigid_bodies"]["top"]["spin"]) for result in results]
    off = [float(np.linalg.norm(L - [0.0, 0.0, across * RATE])) for L in spin]
    kinetic = [result["E_kinetic"] for result in results]
    change = [float(np.abs(K - K[0]).max()) for K in kinetic]
    steady = "round-off: the scheme precesses steadily too"
    return [
        Row("rate of precession", RATE, rate, "rad/s", 5e-6, SECOND, sizes=sizes, least_order=1.9),
        Row("change of the angular momentum", 0.0, off, "kg m^2/s", ROUND_OFF, "round-off", scale=across * RATE),
        Row("greatest change of the kinetic energy", 0.0, change, "J", ROUND_OFF, steady, scale=float(kinetic[-1][0])),
    ]


@case(
    group="rigid",
    title="A heavy top on a ball joint precesses steadily",
    reference="Goldstein, Classical Mechanics, chapter 5: I_3 w_3 W - I_1 W^2 cos(tilt) = m g l.",
    elements=(),
)
def heavy_top(setup: Setup) -> list[Row]:
    """The box of `free_top` stands on the middle of its lower face; g = 9.8 m/s^2."""
    results, sizes = _tops(setup, heavy=True)
    rate, nodding = zip(*map(_precession, results), strict=True)
    vertical = "vertical speed of the top's end over its speed"
    return [
        Row("rate of precession", RATE, rate, "rad/s", 5e-6, SECOND, sizes=sizes, least_order=1.9),
        Row(vertical, 0.0, nodding, "-", 5e-6, SECOND, scale=1.0, sizes=sizes, least_order=1.9),
    ]


@case(
    group="rigid",
    title="A rigid bar swings on a hinge as far as 2 rad",
    reference="Period 4 K(sin(a / 2)) / w_0 with the complete elliptic integral K and w_0^2 = m g l / I of the nodes.",
    elements=(),
)
def rigid_pendulum_period(setup: Setup) -> list[Row]:
    """1 m x 0.1 m x 0.1 m, let go at rest at 2 rad; two whole periods between passages of the lowest point."""
    from scipy.special import ellipk

    samples = setup.choose((8000, 16000), (8000, 16000, 32000))
    results = [setup.run(setup.scene("pendulum", samples=count)) for count in samples]
    period, drift = [], []
    for result in results:
        passed = crossings(result.time, result["tip_vy"], 0.0)
        # the tip moves level at the lowest point and at the ends of its way: every fourth zero is a period
        period.append(float(passed[5] - passed[1]))
        drift.append(float(np.abs(result["E_total_error"]).max()))
    mass = 2700.0 * 1.0 * 0.1**2
    # nodes of n cells along a have a^2 / 12 (1 + 2 / n^2) about the middle
    about = mass * ((1.0 + 2.0 / 4**2) / 12.0 + 0.1**2 / 12.0 * 1.5 + 0.25)
    exact = 4.0 * float(ellipk(math.sin(1.0) ** 2)) * math.sqrt(about / (mass * 9.8 * 0.5))
    sizes = tuple(1.0 / count for count in samples)
    fall = mass * 9.8 * 0.5
    return [
        Row("period", exact, period, "s", 2e-5, SECOND, sizes=sizes, least_order=1.9),
        Row("greatest error of the energy", 0.0, drift, "J", 1e-4, SECOND, scale=fall, sizes=sizes, least_order=1.9),
    ]


@case(
    group="rigid",
    title="Two rigid bodies on hinges swing as the chain of rigid links does",
    reference="The rigid chain, verified by itself above.",
    elements=(),
)
def rigid_double_pendulum(setup: Setup) -> list[Row]:
    """The links of `fe_double_pendulum`, rigid: one of them has two hinges, which are solved together; 0.4 s."""
    from warp_mca.accuracy.simulation import mesh
    from warp_mca.physics.elements.cells import nodal_masses

    start = {"theta_OA": THETA[0], "theta_AB": THETA[1], "rate_OA": THETA_DOT[0], "rate_AB": THETA_DOT[1]}
    samples = setup.choose((2000, 4000), (2000, 4000, 8000))
    scenes = [
        setup.scene("double_pendulum", rigid=True, length=LENGTH, duration=SPAN, samples=count, **start)
        for count in samples
    ]
    meshes = mesh(scenes[0])
    _, _, kinetic = rigid_pendulum(meshes, nodal_masses(scenes[0], meshes))
    results = [setup.run(scene, meshes) for scene in scenes]
    sizes = tuple(1.0 / count for count in samples)
    ends = [float(result["E_kinetic"][-1]) for result in results]
    sideways = [float(result.summary["joint_impulse"]["O"][2]) for result in results]
    whole = float(np.linalg.norm(results[-1].summary["joint_impulse"]["O"]))
    plane = "round-off: the links stay in their plane"
    return [
        Row("kinetic energy at the end", kinetic, ends, "J", 5e-6, SECOND, sizes=sizes, least_order=1.9),
        Row("impulse of hinge O along z", 0.0, sideways, "N s", ROUND_OFF, plane, scale=whole),
    ]


@case(
    group="rigid",
    title="A rigid sphere strikes a steel block: Hertz's force, and that of spheres which are stiffer and stiffer",
    reference=HERTZ,
)
def rigid_ball(setup: Setup) -> list[Row]:
    """The sphere and the block of `hertz_block`; elastic spheres have 10 and 40 times the block's Young's modulus."""
    section = 4 if setup.level == "quick" else 6
    parameters = {"target": "block", "section": section, "pole_size": 1.2e-3 / section, "pole_layers": section + 1}

    def figures(**more: object) -> tuple[float, float]:
        return peak_and_duration(setup.run(setup.scene("hertz_sphere", **parameters, **more)))

    force, duration = figures(rigid_sphere=True)
    ratios = (10.0, 40.0)
    stiff = [figures(E_ratio=ratio) for ratio in ratios]
    exact = hertz(1.0, STEEL)
    sizes = tuple(1.0 / ratio for ratio in ratios)
    near = "the elastic sphere shares the deformation in proportion to 1 / E"
    limit = setup.by_element(0.025, tet4=0.05)
    peaks = "peak force of stiff elastic spheres beside the rigid one's"
    durations = "duration of stiff elastic spheres' contact beside the rigid one's"
    return [
        Row("peak force F_max of the rigid sphere", exact[0], (force,), "N", limit, FINITE),
        Row("duration of the rigid sphere's contact", exact[1], (duration,), "s", limit, FINITE),
        Row(peaks, force, [item[0] for item in stiff], "N", 0.02, near, sizes=sizes, least_order=0.7),
        Row(durations, duration, [item[1] for item in stiff], "s", 0.02, near, sizes=sizes),
    ]
