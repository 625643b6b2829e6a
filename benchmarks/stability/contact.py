"""Owns the axes of contact: friction, balls, speeds at which bodies could pass through each other."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis


@axis(
    group="contact",
    title="Coefficient of friction",
    reference="A block at given height slides at 1 m/s until friction stops it: F_t = μ F_n, path m v² / (2 μ F_n).",
    values=(0.0, 1e-3, 0.1, 1.0, 3.0, 10.0),
    quick=(0.0, 10.0),
)
def friction(value: float, element: str) -> Trial:
    """The block of `sticking_block`, so fast that its tangential springs are short beside its path."""
    depth, mu = 1e-5, value
    scene = mca.make_scene("sticking_block", mu=max(mu, 1e-3), depth=depth)
    material = scene.bodies[0].material
    assert isinstance(material, mca.Elastic)
    cells, edge = 4, 0.01
    springs = 0.001 * material.bulk_modulus * edge * (cells + 1) ** 2
    mass = material.rho * cells**2 * edge**3
    normal = springs * depth
    v = 20.0 * max(mu, 0.1) * depth * math.sqrt(springs / mass)  # stops in 20 times the springs' time
    slide = v * mass / (max(mu, 0.1) * normal)
    duration = 0.7 * slide
    scene = replace(
        scene,
        bodies=(replace(scene.bodies[0], velocity=(v, 0.0, 0.0)),),
        contacts=tuple(replace(item, mu=mu) for item in scene.contacts),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 200.0),
    )

    def read(result: mca.Result) -> list[Figure]:
        late = result.time > 0.4 * duration
        normal = float(result.F_n[1:].mean())  # of the element's own springs
        speed = v - mu * normal * duration / mass
        heat = 0.5 * mass * (v**2 - speed**2)
        return [
            Figure("friction", -float(result.F_t[late].mean()), mu * normal, 0.01, max(mu, 1e-3) * normal),
            Figure("speed at the end", float(result["tip_vx"][-20:].mean()), speed, 0.06, v),
            Figure("heat", result.summary["energy"]["friction"], heat, 0.05, 0.5 * mass * v**2),
        ]

    return Trial(scene, read)


BALL = "A ball of 10 mm strikes at 1 m/s, 3 cells over the patch's radius: peak and duration by Hertz's theory"


def ball(
    *,
    E: float = 210e9,
    nu: float = 0.3,
    rho: float = 7850.0,
    v: float = 1.0,
    radius: float = 0.01,
    tolerance: float = 0.08,
    **more: Any,
) -> Trial:
    """`hertz_sphere` with springs that follow E / (1 - nu²), as by default."""
    parameters = {"E": E, "nu": nu, "rho": rho, "v": v, "radius": radius, **more}
    modulus = E / (1.0 - nu**2)
    mass = 4.0 / 3.0 * math.pi * radius**3 * rho
    ratio = float(more.get("E_ratio", 1.0))
    if more.get("target") == "block":
        modulus *= ratio / (1.0 + ratio)
    else:
        modulus *= ratio
    reach = (15.0 * mass * v**2 / (16.0 * modulus * math.sqrt(radius))) ** 0.4
    force, duration = 4.0 / 3.0 * modulus * math.sqrt(radius) * reach**1.5, 2.868 * reach / v
    patch = math.sqrt(reach * radius)
    scene = mca.make_scene("hertz_sphere", pole_size=patch / 3.0, section=4, pole_layers=5, **parameters)
    scene = replace(
        scene,
        contacts=(replace(scene.contacts[0], penalty=None),),
        impact=mca.ImpactPhase(duration=1.5 * duration, output_interval=duration / 400.0),
    )

    def read(result: mca.Result) -> list[Figure]:
        spans = result.summary["contacts"]
        length = spans[-1][1] - spans[0][0] if spans else math.nan
        return [
            Figure("peak force", 4.0 * float(result.F_n.max()), force, tolerance),
            Figure("duration", length, duration, 1.5 * tolerance),
        ]

    return Trial(scene, read)


@axis(
    group="contact",
    title="Ball: Young's modulus [GPa]",
    reference=f"{BALL}, on a rigid plane.",
    values=(0.7, 70.0, 7000.0),
)
def ball_modulus(value: float, element: str) -> Trial:
    """As `ball`."""
    return ball(E=1e9 * value)


@axis(
    group="contact",
    title="Ball: Poisson's ratio",
    reference=f"{BALL}, on a rigid plane.",
    values=(-0.5, 0.0, 0.45),
)
def ball_poisson(value: float, element: str) -> Trial:
    """As `ball`."""
    return ball(nu=value)


@axis(
    group="contact",
    title="Ball: speed [m/s]",
    reference=f"{BALL}, on a rigid plane.",
    values=(1.0, 10.0, 100.0),
)
def ball_speed(value: float, element: str) -> Trial:
    """As `ball`."""
    return ball(v=value)


@axis(
    group="contact",
    title="Ball: radius [m]",
    reference=f"{BALL}, on a rigid plane.",
    values=(1e-6, 1e3),
)
def ball_size(value: float, element: str) -> Trial:
    """As `ball`."""
    return ball(radius=value)


@axis(
    group="contact",
    title="Ball on a block: Young's modulus of the ball over the block's",
    reference=f"{BALL}, on a block; at sqrt(ratio) m/s where the ball is soft.",
    values=(1e-2, 1.0, 1e2),
)
def ball_ratio(value: float, element: str) -> Trial:
    """As `ball`."""
    return ball(E_ratio=value, target="block", v=min(1.0, math.sqrt(value)))


@axis(
    group="contact",
    title="Speed [m/s] at which a rod strikes a plate of one cell, a tenth as thick as long the rod is",
    reference="Same section and material, no Poisson effect: the plate flies off with the rod's speed, F t = ρ A h v.",
    values=(1e-4, 1.0, 100.0, 1000.0, 3000.0, 10000.0),
    quick=(1e-4, 3000.0),
)
def thin_plate(value: float, element: str) -> Trial:
    """As `flyer`."""
    return flyer(v=value, thickness=0.01)


@axis(
    group="contact",
    title="Thickness of a plate of one cell over the length of the rod that strikes it at 1,000 m/s",
    reference="As before, after a flight of five lengths.",
    values=(1e-3, 1e-2, 0.1, 1.0),
)
def thinner_plate(value: float, element: str) -> Trial:
    """As `flyer`."""
    return flyer(v=1000.0, thickness=0.1 * value, gap=0.5)


def flyer(*, v: float, thickness: float, gap: float = 0.0, two_way: bool = False) -> Trial:
    """A rod of 0.1 m that strikes a plate of the same section and one cell."""
    E, rho, side, length = 200e9, 7800.0, 0.02, 0.1
    c = math.sqrt(E / rho)
    material = mca.Elastic(E=E, nu=0.0, rho=rho)
    rod = mca.Box(size=(length, side, side), divisions=(20, 2, 2), origin=(-length - gap, 0.0, 0.0))
    plate = mca.Box(size=(thickness, side, side), divisions=(1, 2, 2))
    surfaces = mca.Surface(body="rod", nodes="xmax"), mca.Surface(body="plate", nodes="xmin")
    duration = gap / v + 3.0 * length / c
    scene = mca.Scene(
        name="flyer",
        bodies=(
            mca.Body(name="rod", geometry=rod, material=material, velocity=(v, 0.0, 0.0)),
            mca.Body(name="plate", geometry=plate, material=material),
        ),
        contacts=(mca.Contact(slave=surfaces[0], master=surfaces[1], two_way=two_way),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 200.0),
        target=mca.Point(body="plate", at=(0.5 * thickness, 0.0, 0.0)),
    )

    def read(result: mca.Result) -> list[Figure]:
        impulse = float(result.F_n.sum() * (result.time[1] - result.time[0]))
        return [Figure("impulse", impulse, rho * side**2 * thickness * v, 0.25)]

    return Trial(scene, read)
