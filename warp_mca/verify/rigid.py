"""Owns the cases of the rigid phase: the chain of rigid links, and its hand-off to finite elements and back."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from warp_mca.base.arrays import Array
from warp_mca.verify.case import SHAPES, Row, Setup, case

if TYPE_CHECKING:
    from warp_mca.rigid.chain import Chain
    from warp_mca.rigid.swing import Swing


SPAN = 1.0  # of the free swings [s]
ROUND_OFF = 1e-12


def slender_chain(count: int, gravity: float) -> Chain:
    """Equal slender rods of 0.21 m and 0.3 kg under `gravity` [m/s^2]."""
    from warp_mca.rigid.chain import Chain
    from warp_mca.rigid.link import slender_link

    length = 0.21
    links = tuple(slender_link(f"link{k}", (length, 0.0), mass=0.3, hinge_out=(length, 0.0)) for k in range(count))
    return Chain(links, gravity=(0.0, -gravity))


def crooked_chain(count: int, gravity: float) -> Chain:
    """Links of different mass and length, with centres and hinges off their axes, under `gravity` [m/s^2]."""
    from warp_mca.rigid.chain import Chain
    from warp_mca.rigid.link import Link

    links = tuple(
        Link(
            body=f"link{k}",
            mass=0.3 + 0.1 * k,
            centre=(0.08 + 0.01 * k, 0.02 * (-1.0) ** k),
            inertia=1e-3 * (1.0 + 0.3 * k),
            hinge_out=(0.2 - 0.02 * k, 0.03 * (-1.0) ** k),
        )
        for k in range(count)
    )
    return Chain(links, gravity=(0.0, -gravity))


def free_swing(chain: Chain, theta: Array, theta_dot: Array) -> Swing:
    """One second of the rigid phase, with nothing to touch."""
    from warp_mca.rigid.swing import swing

    return swing(chain, theta, theta_dot, lambda t, _: SPAN - t, t_max=2.0 * SPAN)


def mujoco_swing(chain: Chain, theta: Array, theta_dot: Array, samples: int, substeps: int) -> Array:
    """The same second by MuJoCo's Runge-Kutta method of order 4: angles [rad], shape (samples, link_count), float64.

    MuJoCo counts each hinge's angle from the link before it, anticlockwise about z, and from the x axis.
    """
    import mujoco

    text = ""
    for k, link in reversed(list(enumerate(chain.links))):
        before = chain.links[k - 1].hinge_out if k else (0.0, 0.0)
        I = link.inertia  # noqa: E741
        text = (
            f'<body pos="{before[0]!r} {before[1]!r} 0"><joint type="hinge" axis="0 0 1"/>'
            f'<inertial pos="{link.centre[0]!r} {link.centre[1]!r} 0" mass="{link.mass!r}" diaginertia="{I} {I} {I}"/>'
            f"{text}</body>"
        )
    step = SPAN / (samples - 1) / substeps
    option = f'timestep="{step!r}" integrator="RK4" gravity="{chain.gravity[0]!r} {chain.gravity[1]!r} 0"'
    xml = f'<mujoco><compiler autolimits="false"/><option {option}><flag contact="disable"/></option>'
    library: Any = mujoco
    model = library.MjModel.from_xml_string(f"{xml}<worldbody>{text}</worldbody></mujoco>")
    data = library.MjData(model)
    start = -theta - 0.5 * math.pi
    data.qpos[:] = np.diff(start, prepend=0.0)
    data.qvel[:] = np.diff(-theta_dot, prepend=0.0)
    found = [theta]
    for _ in range(samples - 1):
        library.mj_step(model, data, nstep=substeps)
        found.append(-np.cumsum(data.qpos) - 0.5 * math.pi)
    return np.array(found)


@case(
    group="rigid",
    title="Chains of 2 and 5 links swing for 1 s as an independent multibody code has it",
    reference="MuJoCo (Todorov, Erez and Tassa, IROS 2012), Runge-Kutta method of order 4.",
    needs="mujoco",
    elements=(),
)
def chain_mujoco(setup: Setup) -> list[Row]:
    """Two equal slender rods from rest, level; five crooked links that move already; g = 9.8 m/s^2."""
    chains = {
        2: (slender_chain(2, 9.8), np.array([0.5, 0.5]) * math.pi, np.zeros(2)),
        5: (crooked_chain(5, 9.8), np.array([1.2, 0.9, 0.3, -0.4, 0.8]), np.array([1.0, -2.0, 3.0, 0.0, -4.0])),
    }
    substeps = setup.choose((4, 8, 16), (2, 4, 8, 16))
    rows = []
    for count, (chain, theta, theta_dot) in chains.items():
        mine = free_swing(chain, theta, theta_dot)
        other = [mujoco_swing(chain, theta, theta_dot, len(mine.t), n) for n in substeps]
        why = "the other code's error, which falls with the fourth power of its time step"
        sizes = tuple(1.0 / n for n in substeps)
        what = f"largest difference of an angle, {count} links"
        off = [float(np.abs(angles - mine.theta_t).max()) for angles in other]
        rows.append(Row(what, 0.0, off, "rad", 2e-9, why, scale=1.0, sizes=sizes, least_order=3.7))
    return rows


@case(
    group="rigid",
    title="A swinging chain keeps its energy, and without gravity its angular momentum",
    reference="Conservation laws.",
    elements=(),
)
def chain_energy(setup: Setup) -> list[Row]:
    """Five crooked links for 1 s, with g = 9.8 m/s^2 and with none."""
    theta, theta_dot = np.array([1.2, 0.9, 0.3, -0.4, 0.8]), np.array([1.0, 2.0, 3.0, 0.0, 4.0])
    falling = free_swing(crooked_chain(5, 9.8), theta, theta_dot)
    chain = crooked_chain(5, 0.0)
    free = free_swing(chain, theta, theta_dot)
    momentum = [chain.angular_momentum(a, b) for a, b in zip(free.theta_t, free.theta_dot_t, strict=True)]
    worst = int(np.abs(np.array(momentum) - momentum[0]).argmax())
    why = "the integrator's relative tolerance of 1e-12 a step, over some hundred steps"
    change = "largest change of energy, over the largest kinetic energy"
    spin = "angular momentum about O without gravity, where it is farthest from its first value"
    dense = "the same, through the integrator's dense output"
    return [
        Row(change, 0.0, (falling.energy_drift,), "-", 1e-12, why, scale=1.0),
        Row("energy without gravity, likewise", 0.0, (free.energy_drift,), "-", 1e-12, why, scale=1.0),
        Row(spin, momentum[0], (momentum[worst],), "kg m^2/s", 1e-12, dense),
    ]


@case(
    group="rigid",
    title="Hand-off to finite elements and back keeps momenta and energy",
    reference="Conservation laws: lumped nodal masses carry what the links carried.",
    elements=SHAPES,
)
def handoff_conservation(setup: Setup) -> list[Row]:
    """The two-link manipulator at contact with inertia="mesh"; then back, with and without a vibration on top."""
    from warp_mca.accuracy.simulation import mesh
    from warp_mca.physics.elements.cells import nodal_masses
    from warp_mca.rigid.handback import hand_back
    from warp_mca.rigid.handoff import hand_off

    scene = setup.with_element(setup.scene("two_link", rigid_inertia="mesh", duration=1e-6))
    meshes = mesh(scene)
    result = setup.run(scene, meshes)
    masses = nodal_masses(scene, meshes)
    start = hand_off(scene, meshes, masses)
    chain = start.chain
    assert chain is not None
    names = [link.body for link in chain.links]
    points = {name: meshes[name].points for name in names}
    back = hand_back(chain, points, masses, start.positions, start.velocities, near=start.theta)
    shaken = {name: start.velocities[name] + vibration(points[name]) for name in names}
    after = hand_back(chain, points, masses, start.positions, shaken, near=start.theta)
    kinetic = sum(0.5 * masses[name] @ (shaken[name] ** 2).sum(axis=1) for name in names)
    spin = sum(masses[name] @ cross_z(start.positions[name] - [*chain.origin, 0.0], shaken[name]) for name in names)
    sideways = {name: start.velocities[name] + [0.0, 0.0, 0.3] for name in names}
    drift = hand_back(chain, points, masses, start.positions, sideways, near=start.theta)
    mass = sum(masses[name].sum() for name in names)
    mismatch = result.summary["handoff_mismatch"]
    rows = [
        _kept(f"hand-off: change of {key.replace('_', ' ')}", mismatch[key], 0.0, "-", scale=1.0)
        for key in ("momentum", "angular_momentum", "kinetic_energy")
    ]
    known = {
        "hand-back of a rigid motion: angle of AB": (back.theta[1], start.theta[1], "rad"),
        "hand-back of a rigid motion: angular velocity of AB": (back.theta_dot[1], start.theta_dot[1], "rad/s"),
        "with a vibration: kinetic energy, that of the rigid part and the rest": (
            after.kinetic_energy + after.vibration_energy,
            kinetic,
            "J",
        ),
        "with a vibration: angular momentum about O": (
            chain.angular_momentum(after.theta, after.theta_dot),
            spin,
            "kg m^2/s",
        ),
        "with 0.3 m/s across the plane: energy that does not fit": (drift.vibration_energy, 0.5 * mass * 0.3**2, "J"),
    }
    return rows + [_kept(name, *figures) for name, figures in known.items()]


def _kept(quantity: str, measured: float, exact: float, unit: str, scale: float | None = None) -> Row:
    """A figure that is kept to round-off."""
    why = "round-off of sums over the nodes"
    return Row(quantity, float(exact), (float(measured),), unit, ROUND_OFF, why, scale=scale)


def vibration(points: Array) -> Array:
    """A velocity field [m/s] that no rigid motion is, shape (node_count, 3), float64, for points in its frame."""
    x, y, z = (points / 0.1).T
    return 0.5 * np.column_stack([x * y + np.sin(x), x**2 - 0.2 * y, z * x])


def cross_z(r: Array, v: Array) -> Array:
    """z component of r x v for rows of r and v, shape (count,), float64."""
    return r[:, 0] * v[:, 1] - r[:, 1] * v[:, 0]
