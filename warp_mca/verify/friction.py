"""Owns the cases of friction on blocks, which slide and stick as Coulomb's law says."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.verify.case import SHAPES, Row, Setup, case, crossings

COULOMB = "Coulomb's law and the motion of a rigid body."
MASS, MU, GRAVITY, SPEED = 0.2, 0.3, 300.0, 1.0  # of sliding_block and block_on_belt [kg, -, m/s^2, m/s]


def impulse(result: mca.Result) -> NDArray[np.float64]:
    """Impulse of the tangential force up to each row [N s], shape (row_count,), float64."""
    return np.cumsum(result.F_t) * (result.time[1] - result.time[0])  # row 0 holds the first step alone


def springs(setup: Setup, scene: mca.Scene) -> float:
    """Stiffness of all springs of the scene's contact together [N/m]: it depends on the faces of the element."""
    from warp_mca.model.build import build_model
    from warp_mca.physics.elements.cells import nodal_masses
    from warp_mca.rigid.handoff import hand_off

    scene = setup.with_element(scene)
    meshes = mca.mesh(scene)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    model = build_model(scene, meshes, start.positions, start.velocities)
    return float(sum(item.stiffness.sum() for item in model.passes))


def sunk(setup: Setup, scene: mca.Scene, load: float) -> mca.Scene:
    """The scene with its body as deep in the plane y = 0 as its springs ask for under `load` [N]."""
    body = dataclasses.replace(scene.bodies[0], position=(0.0, -load / springs(setup, scene), 0.0))
    return dataclasses.replace(scene, bodies=(body,))


def slid(time: NDArray[np.float64], slip: NDArray[np.float64]) -> float:
    """Time at which the slip [m/s] would end, by the line through its middle 80 %.

    The end itself is blurred by swings on the contact springs, in which the slip passes zero at any of several rows.
    """
    middle = (slip < 0.9 * slip[0]) & (slip > 0.1 * slip[0])
    if np.count_nonzero(middle) < 2:
        return math.nan
    slope, start = np.polyfit(time[middle], slip[middle], 1)
    return float(-start / slope)


@case(
    group="friction",
    title="A block slides to rest: over v^2 / (2 mu g), in v / (mu g), and all its energy becomes heat",
    reference=COULOMB,
    elements=SHAPES,
)
def sliding_block(setup: Setup) -> list[Row]:
    """v = 1 m/s, mu = 0.3, g = 300 m/s^2, 0.2 kg; the speed is that of the centre of mass, out of the impulse."""
    cells = setup.choose((1, 2), (1, 2, 4))
    distance, time, heat = [], [], []
    for count in cells:
        result = setup.run(sunk(setup, setup.scene("sliding_block", cells=count), MASS * GRAVITY))
        speed = SPEED + impulse(result) / MASS
        distance.append(float(np.trapezoid(speed, result.time)))
        time.append(slid(result.time, speed))
        heat.append(float(result["E_friction"][-1]))
    springs = "the tangential springs stretch by 0.015 % of the way, and the block swings on them in the end"
    line = "of the line through the middle 80 % of the speed; the block bounces a little as it slides"
    return [
        Row("distance", SPEED**2 / (2.0 * MU * GRAVITY), distance, "m", 0.0005, springs),
        Row("time", SPEED / (MU * GRAVITY), time, "s", 0.001, line),
        Row("heat", 0.5 * MASS * SPEED**2, heat, "J", 0.0002, springs),
    ]


@case(
    group="friction",
    title="A belt takes a block along: at its speed after v / (mu g); half its work is heat, half motion",
    reference=COULOMB,
    elements=SHAPES,
)
def block_on_belt(setup: Setup) -> list[Row]:
    """As `sliding_block`, seen from the ground on which the block was at rest."""
    cells = setup.choose((1, 2), (1, 2, 4))
    time, speed, heat, work, rest = [], [], [], [], []
    exact = SPEED / (MU * GRAVITY)
    for count in cells:
        result = setup.run(sunk(setup, setup.scene("block_on_belt", cells=count), MASS * GRAVITY))
        of_block = impulse(result) / MASS
        caught = crossings(result.time, of_block, SPEED)
        time.append(slid(result.time, SPEED - of_block))
        first, last = caught[[0, 2 * ((len(caught) - 1) // 2)]] if len(caught) > 2 else (math.nan, math.nan)
        carried = (result.time > first) & (result.time < last)  # whole swings
        speed.append(float(of_block[carried].mean()) if carried.any() else math.nan)
        rest.append(float(result.F_t[carried].mean()) if carried.any() else math.nan)
        heat.append(float(result["E_friction"][-1]))
        work.append(float(result.summary["energy"]["external_work"]))
    swing = "the block swings on its contact springs"
    line = "of the line through the middle 80 % of the slip; the block bounces a little as it slides"
    modes = setup.by_element(swing, tet4=swing + ", in more than one mode: the mean is not over whole ones")
    return [
        Row("time", exact, time, "s", 0.001, line),
        Row("speed then", SPEED, speed, "m/s", setup.by_element(0.0005, tet4=0.0015), modes),
        Row("friction F_t then", 0.0, rest, "N", 0.02, swing, scale=MU * MASS * GRAVITY),
        Row("heat", 0.5 * MASS * SPEED**2, heat, "J", 0.0002, swing),
        Row("work of the belt", MASS * SPEED**2, work, "J", 0.005, swing + ": mu g / omega is 0.5 % of its speed"),
    ]


@case(
    group="friction",
    title="Friction's energy is its force times the slip",
    reference="The work of a force; a spring at its limit mu F_n holds mu^2 / (1 + mu^2) of its contact's energy.",
    elements=SHAPES,
)
def friction_work(setup: Setup) -> list[Row]:
    """The block of `block_on_belt`, held, while the belt slides at v = 1 m/s: slip is the belt's way.

    The work done over the second half of the run, from when all springs slip, is compared.
    """
    result = setup.run(sunk(setup, setup.scene("block_on_belt", cells=1, held=True), MASS * GRAVITY))
    half = len(result.time) // 2
    work = SPEED * (impulse(result)[-1] - impulse(result)[half])
    heat = result["E_friction"][-1] - result["E_friction"][half]
    stored = MU**2 / (1.0 + MU**2) * (result["E_contact"][-1] - result["E_contact"][half])
    sums = "the force is summed by rectangles, the heat by trapezoids"
    stretch = "the springs are stretched first, over 0.015 % of the way"
    share = (float(result["E_friction"][-1] / (MU * MASS * GRAVITY * SPEED * result.time[-1])),)
    return [
        Row("heat and springs' energy over force times slip", 1.0, (float((heat + stored) / work),), "-", 2e-5, sums),
        Row("heat over mu m g v t", 1.0, share, "-", 0.0005, stretch),
    ]


@case(
    group="friction",
    title="Sticking contact gives all of its elastic energy back, at the frequency of its springs",
    reference="Rigid mass on springs: omega = sqrt(k / m), k = penalty K A^2 / V a node, of equal faces.",
    elements=SHAPES,
)
def sticking_energy(setup: Setup) -> list[Row]:
    """10 periods at 80 % of the limit of friction; height and so normal force are held."""
    cells = setup.choose((2, 4), (2, 4, 8))
    omega, kept, heat = [], [], []
    exact = 0.0
    for count in cells:
        penalty = setup.by_element(0.001, tet4=0.001 / 1.5)  # half of a cube's face, a sixth of its volume: A^2 / V
        scene = setup.scene("sticking_block", cells=count, penalty=penalty)
        material = scene.body("block").material
        assert isinstance(material, mca.Elastic)
        edge = 0.01
        stiffness = 0.001 * material.bulk_modulus * edge * (count + 1) ** 2
        exact = math.sqrt(stiffness / (material.rho * count**2 * edge**3))
        result = setup.run(scene)
        turns = crossings(result.time, result["tip_vx"], 0.0)
        omega.append(math.pi * (len(turns) - 1) / float(turns[-1] - turns[0]) / exact)
        energy = result["E_kinetic"] + result["E_internal"] + result["E_contact"]
        moving = float(result["E_kinetic"][0])
        kept.append(float(np.abs(energy - energy[0]).max()) / moving)
        heat.append(float(result["E_friction"][-1]) / moving)
    yields = "the block itself yields by 0.1 % of what its springs do"
    single = "elements in single precision"
    return [
        Row("frequency over sqrt(k / m)", 1.0, omega, "-", 0.001, yields),
        Row("energy lost or won over that of the motion", 0.0, kept, "-", 1e-5, single, scale=1.0),
        Row("heat over the energy of the motion", 0.0, heat, "-", 1e-12, "nothing slips: rounding alone", scale=1.0),
    ]


@case(
    group="friction",
    title="A block on a belt and a spring: it sticks until the spring's force is mu F_n, then swings about that",
    reference=(
        "Rigid mass m on a spring k: it sticks for mu F_n / (k v), then x = mu F_n / k + (v / omega) sin(omega t), "
        "omega = sqrt(k / m), whose speed is the belt's again after 2 pi / omega; heat mu F_n v 2 pi / omega by then."
    ),
    elements=SHAPES,
)
def stick_slip(setup: Setup) -> list[Row]:
    """v = 0.1 m/s, mu F_n = 1 N, k = 20 kN/m, m = 2 g and a third of the spring's 0.008 g."""
    cells = setup.choose((4, 8), (4, 8, 16))
    force, stiffness, v = 1.0, 2e4, 0.1
    omega = math.sqrt(stiffness / (2e-3 * (1.0 + 0.004 / 3.0)))
    slowed = 20.0 * math.sqrt(0.004 * 2e-3 / stiffness)  # half of the time in which the spring's end is slowed
    stuck, period, amplitude, heat = [], [], [], []
    for count in cells:
        result = setup.run(sunk(setup, setup.scene("stick_slip", cells=count), force / MU))
        interval = result.time[1] - result.time[0]
        way = np.cumsum(result["tip_vx"]) * interval
        row = int(np.flatnonzero(result["stick_fraction"] > 0.0)[0])
        row += int(np.flatnonzero(result["stick_fraction"][row:] == 0.0)[0])
        first = float(result.time[row]) - 1.5 * interval  # the last node let go in the interval before
        turns = crossings(result.time, result["tip_vx"], 0.0)
        reached = np.interp(turns[:2], result.time, way)
        stuck.append(first - slowed)
        period.append(float(turns[2] - turns[0]))
        amplitude.append(0.5 * float(reached[0] - reached[1]))
        warmed = np.interp([first, first + 2.0 * math.pi / omega], result.time, result["E_friction"])
        heat.append(float(warmed[1] - warmed[0]))
    why = "contact stretches by 0.01 %, few waves stay in the spring"
    heated = force * v * 2.0 * math.pi / omega
    return [
        Row("time for which it sticks", force / (stiffness * v), stuck, "s", 0.005, "read to half of 0.5 %"),
        Row("period of the swing", 2.0 * math.pi / omega, period, "s", 0.0001, "speed is straight between rows"),
        Row("amplitude", v / omega, amplitude, "m", 0.0005, why),
        Row("heat in the first swing", heated, heat, "J", 0.0002, "its start is read to a row"),
    ]
