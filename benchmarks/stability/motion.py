"""Owns the axes of long motion: free flight and spin, swings of millions of steps, rotations of rigid bodies."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis


def spin(rate: float, turns: float, *, E: float = 70e9, nu: float = 0.3, rows: int = 400) -> Trial:
    """One cell of 10 mm that turns freely; it keeps its kinetic energy, as its strain is small."""
    half = 0.005
    cube = mca.Box(size=(2.0 * half, 2.0 * half, 2.0 * half), divisions=(1, 1, 1), origin=(-half, -half, -half))
    material = mca.Elastic(E=E, nu=nu, rho=2700.0)
    duration = turns * 2.0 * math.pi / rate
    scene = mca.Scene(
        name="spin",
        bodies=(mca.Body(name="cube", geometry=cube, material=material, angular_velocity=(0.0, 0.0, rate)),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / rows),
    )

    def read(result: mca.Result) -> list[Figure]:
        energy = result.summary["energy"]
        stretch = 2700.0 * (rate * half) ** 2 / E  # of the order of strain over kinetic energy
        heat = energy["elastic"] + energy["hourglass"]
        return [
            Figure("kinetic energy", energy["kinetic"], energy["initial"], 0.01 + 4.0 * stretch),
            Figure("strain energy", heat, 0.0, 0.01 + 4.0 * stretch, energy["initial"]),
        ]

    return Trial(scene, read)


@axis(
    group="motion",
    title="Rate of a free cell [rad/s], 1,000 turns",
    reference="One aluminium cell of 10 mm turns freely and keeps its kinetic energy.",
    values=(1e4, 3e4, 1e5, 3e5, 1e6),
    quick=(1e5,),
)
def spin_rate(value: float, element: str) -> Trial:
    """As `spin`."""
    return spin(value, 1000.0)


@axis(
    group="motion",
    title="Speed of a body in flight [m/s], a thousand lengths from the origin",
    reference="A cube of 8 cells flies for a millisecond, free of stress.",
    values=(1e-4, 1.0, 1000.0, 1e6),
)
def flight(value: float, element: str) -> Trial:
    """Stress and strain of a body that only flies, as shares of what an impact at 1 m/s would give."""
    cube = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    material = mca.Elastic(E=200e9, nu=0.3, rho=7800.0)
    body = mca.Body(
        name="cube", geometry=cube, material=material, position=(10.0, 10.0, 0.0), velocity=(value, 0.0, 0.0)
    )
    scene = mca.Scene(
        name="flight",
        bodies=(body,),
        impact=mca.ImpactPhase(duration=1e-3, output_interval=1e-5),
        tip=mca.Point(body="cube", at=(0.0, 0.0, 0.0)),
    )

    def read(result: mca.Result) -> list[Figure]:
        wave = value / material.wave_speeds["bar"]
        return [
            Figure("speed", float(result["tip_vx"][-1]), value, 1e-6),
            Figure("strain", result.summary["max_strain"], 0.0, 0.01, wave),
        ]

    return Trial(scene, read)


@axis(
    group="motion",
    title="Steps of a free swing, about",
    reference="One aluminium cell of 0.1 m, hinged at an edge, swings through 57° to either side; period by the "
    "complete elliptic integral.",
    values=(168_000, 1_680_000, 20_000_000),
    level="long",
)
def free_swing(value: int, element: str) -> Trial:
    """A compound pendulum of the eight nodes' masses, or those of six tetrahedra's."""
    from scipy.special import ellipk

    side, g, amplitude = 0.1, 9.8, 1.0
    cube = mca.Box(size=(side, side, side), divisions=(1, 1, 1))
    material = mca.Elastic(E=70e9, nu=0.3, rho=2700.0)
    body = mca.Body(name="bar", geometry=cube, material=material, rotation=(0.0, 0.0, amplitude - 0.75 * math.pi))
    # equal masses: 1/2 of them at `side`, 1/4 at its diagonal from the hinge
    inertia, arm = 0.5 * side**2 + 0.25 * 2.0 * side**2, 0.5 * math.sqrt(2.0) * side
    period = 4.0 * math.sqrt(inertia / (g * arm)) * float(ellipk(math.sin(0.5 * amplitude) ** 2))
    dt = 7.38e-6 if element == "tet4" else 1.119e-5
    duration = value * dt
    rows = max(400, min(200_000, int(20.0 * duration / period)))
    scene = mca.Scene(
        name="free_swing",
        bodies=(body,),
        joints=(mca.Revolute(name="O", body="bar", at=(0.0, 0.0, 0.0)),),
        gravity=(0.0, -g, 0.0),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / rows),
        tip=mca.Point(body="bar", at=(side, side, 0.0)),
    )

    def read(result: mca.Result) -> list[Figure]:
        energy = result.summary["energy"]
        drop = 2700.0 * side**3 * g * arm * (1.0 - math.cos(amplitude))
        heat = energy["elastic"] + energy["hourglass"]
        speed = np.hypot(result["tip_vx"], result["tip_vy"])
        peak = math.sqrt(2.0 * drop / (2700.0 * side**3 * inertia)) * math.sqrt(2.0) * side
        return [
            Figure("greatest speed", float(speed[-100:].max()), peak, 0.02),
            Figure("strain energy", heat, 0.0, 0.01, drop),
        ]

    return Trial(scene, read)


@axis(
    group="motion",
    title="Turns of a rigid body",
    reference="An aluminium plate turns about its third axis, tilted by 0.2 rad: it keeps its energy and the speed "
    "of its end; 450 steps for each turn of its axis.",
    values=(100, 1_000, 10_000),
    level="long",
    elements=("hex8",),
)
def rigid_turns(value: int, element: str) -> Trial:
    """The free top of `spinning_top`, so many turns of its precession."""
    scene = mca.make_scene("spinning_top", turns=float(value), samples=2000, tilt=0.2)

    def read(result: mca.Result) -> list[Figure]:
        energy = result.summary["energy"]
        speed = np.sqrt(sum(result[f"tip_v{axis}"] ** 2 for axis in "xyz"))
        return [
            Figure("kinetic energy", energy["kinetic"], energy["initial"], 1e-3),
            Figure("speed of its end", float(speed[-50:].mean()), float(speed[:50].mean()), 1e-2),
        ]

    return Trial(scene, read)
