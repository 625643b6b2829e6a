"""Owns plain scenes that must run at defaults: bars, balls, blocks and rods that drop on a plane or on each other."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

import warp_mca as mca

KINDS = ("bar", "ball", "block", "rod")
MATERIALS = {
    "steel": (210e9, 0.3, 7850.0),
    "aluminium": (70e9, 0.33, 2700.0),
    "nylon": (2.5e9, 0.39, 1150.0),
    "cork-like": (1e9, 0.0, 1000.0),
}
WAVES = 10.0  # times that a wave goes to and fro in the longest body, at least
HERTZ = 2.5  # times the duration of contact of balls
ROCKING = 4.0  # times as long, where a body is tilted
ROWS = 300
FLAT = 1e-6  # of the width, within which nodes lie equally low
NORMAL, MIRROR = np.array([0.0, 1.0, 0.0]), np.diag([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Plain:
    """A scene of the family `default`, and what it is made of."""

    scene: mca.Scene
    facts: dict[str, object]


def default(seed: int) -> Plain:
    """The scene of a seed: a drop on a plane, a drop on an equal or another body, or a mirrored pair."""
    rng = np.random.default_rng([99, seed])
    kind = str(rng.choice(KINDS))
    what = str(rng.choice(["plane", "pair", "other"], p=[0.4, 0.3, 0.3]))
    material = str(rng.choice(list(MATERIALS)))
    width = 0.01 * math.exp(rng.uniform(math.log(0.5), math.log(2.0)))
    cells = int(rng.integers(2, 7))
    mu = 0.0 if rng.random() < 0.3 else round(float(rng.uniform(0.0, 0.5)), 3)
    speed = round(math.exp(rng.uniform(0.0, math.log(10.0))), 2)
    tilt = 0.0 if rng.random() < 0.5 else round(float(rng.uniform(0.02, 0.7)), 3)
    gap = width * math.exp(rng.uniform(math.log(1e-4), math.log(1e-2)))
    E, nu, rho = MATERIALS[material]
    turn = Rotation.from_rotvec(tilt * _level(rng)) * Rotation.from_rotvec(rng.uniform(0.0, math.pi) * NORMAL)
    body = mca.Body(
        name="one",
        geometry=_geometry(rng, kind, width, cells),
        material=mca.Elastic(E=E, nu=nu, rho=rho),
        rotation=tuple((turn * _upright(kind)).as_rotvec().tolist()),
        velocity=(0.0, -speed, 0.0),
    )
    master: mca.Surface | mca.RigidPlane = mca.RigidPlane()
    bodies = [body.place_on(master, gap)]
    if what != "plane":
        bodies.append(_partner(rng, what, width, cells, bodies[0]))
        master = mca.Surface(body="other", nodes="boundary")
    two_way = bool(what != "plane" and rng.random() < 0.5)
    contact = mca.Contact(
        slave=mca.Surface(body="one", nodes="boundary"), master=master, mu=mu, two_way=two_way or None
    )
    duration = _duration(bodies, kind, speed, gap, width, tilt)
    scene = mca.Scene(
        name=f"default {seed}",
        bodies=tuple(bodies),
        contacts=(contact,),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / ROWS),
    )
    facts = {"kinds": [kind, what], "material": material, "mu": mu, "speed": speed, "tilt": tilt, "two_way": two_way}
    return Plain(scene, facts | {"cells": [item.geometry.build().cell_count for item in bodies]})


def _level(rng: np.random.Generator) -> np.ndarray:
    angle = rng.uniform(0.0, 2.0 * math.pi)
    return np.array([math.cos(angle), 0.0, math.sin(angle)])


def _upright(kind: str) -> Rotation:
    """Bars and balls stand with their axis, or pole, down; blocks and rods lie."""
    return Rotation.from_rotvec([0.0, 0.0, -0.5 * math.pi]) if kind in ("bar", "ball") else Rotation.identity()


def _geometry(rng: np.random.Generator, kind: str, width: float, cells: int):
    """A recipe with so many cells across it."""
    if kind == "ball":
        section = 2 * max(1, cells // 2)
        return mca.Sphere(radius=0.5 * width, section=section, ring=max(1, cells // 2), pole_layers=max(2, cells // 2))
    if kind == "rod":
        length = width * rng.uniform(2.0, 5.0)
        section = 2 * max(1, cells // 3)
        axial = max(2, round(length / width * cells))
        return mca.Rod(
            radius=0.5 * width, length=length, tip="flat", section=section, ring=max(1, cells // 3), axial=axial
        )
    along = rng.uniform(3.0, 8.0) if kind == "bar" else rng.uniform(0.5, 2.0)
    across = cells if kind == "block" else max(1, cells // 2)
    size = (along * width, width, width * (1.0 if kind == "bar" else rng.uniform(0.5, 2.0)))
    divisions = tuple(max(1, round(length / width * across)) for length in size)
    return mca.Box(size=size, divisions=divisions, origin=(0.0, -0.5 * width, -0.5 * size[2]))


def _partner(rng: np.random.Generator, what: str, width: float, cells: int, body: mca.Body) -> mca.Body:
    """The mirror image that comes towards the body, with as many cells or others, or a block at rest right below it."""
    if what == "pair":
        factor = rng.uniform(0.5, 2.0) if rng.random() < 0.5 else 1.0
        own = np.diag([1.0, 1.0, -1.0])  # all recipes are symmetric about z = 0
        turn = MIRROR @ Rotation.from_rotvec(body.rotation).as_matrix() @ own
        return replace(
            body,
            name="other",
            geometry=body.geometry.refined(factor),
            rotation=tuple(Rotation.from_matrix(turn).as_rotvec().tolist()),
            position=tuple((MIRROR @ body.position).tolist()),
            velocity=tuple(-v for v in body.velocity),
        ).place_on(mca.RigidPlane(normal=(0.0, -1.0, 0.0)))
    side, count = width * rng.uniform(2.0, 4.0), int(rng.integers(2, 9))
    block = mca.Box(
        size=(side, width, side),
        divisions=(count, max(1, count // 2), count),
        origin=(-0.5 * side, 0.0, -0.5 * side),
    )
    points = Rotation.from_rotvec(body.rotation).apply(body.geometry.build().points) + body.position
    low = points[:, 1] < points[:, 1].min() + FLAT * width
    x, _, z = points[low].mean(axis=0).tolist()
    still = (0.0, 0.0, 0.0)
    return replace(body, name="other", geometry=block, rotation=still, velocity=still, position=(x, -width, z))


def _duration(bodies: list[mca.Body], kind: str, speed: float, gap: float, width: float, tilt: float) -> float:
    """Of waves to and fro, or of the contact of balls after Hertz, behind the gap [s]."""
    material = bodies[0].material
    length = max(max(getattr(b.geometry, "size", (getattr(b.geometry, "length", width),))) for b in bodies)
    time = WAVES * 2.0 * length / material.wave_speeds["bar"]
    if kind == "ball":
        mass, stiff = material.rho * math.pi / 6.0 * width**3, material.E / (1.0 - material.nu**2)
        time = max(time, HERTZ * 2.87 * (mass**2 / (0.5 * width * stiff**2 * speed)) ** 0.2)
    return gap / speed + time * (ROCKING if tilt and kind != "ball" else 1.0)
