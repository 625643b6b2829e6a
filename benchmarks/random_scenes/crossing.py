"""Owns the scenes of two bodies that must meet: their pose, aim, motion, material and contact, all from a seed."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import warp_mca as mca
from benchmarks.random_scenes.placing import chord, travel
from benchmarks.random_scenes.shapes import KINDS, Shape, finer, shape

Array = NDArray[np.float64]
NAMES = ("one", "other")
FAMILIES = {  # kinds of bodies, and sizes of cells as shares of the partner's width, of the slave and of the master
    "crossing": (KINDS, (0.1, 3.0), (0.1, 3.0)),
    "edges": (("square rod", "blade", "box"), (0.1, 3.0), (0.1, 3.0)),
    "coarse slave": (KINDS, (1.0, 3.0), (0.1, 1.0)),
}
MOST = 1_500  # cells of a body
FEW = 250  # of one that is run with finer cells too
LOT = 10  # one scene in so many is run with finer cells
STEEL, ALUMINIUM = (210e9, 0.3, 7850.0), (70e9, 0.33, 2700.0)
ROWS = 400
PASSES = 1.25  # times the way on which bodies would pass each other that a run lasts
REACH = 3.0  # times the thickness of both bodies that this way is at most
FRAMES, MOST_FRAMES = (30, 200), 300  # least of most scenes and of those run with finer cells, most of all
FRAME = 0.12  # of the least thickness that bodies move between two frames


@dataclass(frozen=True)
class Random:
    """A random scene and what its judge needs to know of it.

    Attributes:
        scene: to run.
        family: one of FAMILIES.
        seed: that it follows from.
        facts: what it is made of, for the table.
        shapes: of the two bodies.
        direction: along which the second body approaches the first one [-], shape (3,).
        least: least thickness of the two bodies [m].
        frames: of the run that the judge looks at.
    """

    scene: mca.Scene
    family: str
    seed: int
    facts: dict[str, object]
    shapes: tuple[Shape, ...]
    direction: Array
    least: float
    frames: int


def crossing(seed: int, family: str = "crossing", times: int = 1) -> Random:
    """The scene of a seed.

    Args:
        seed: 0 or above.
        family: one of FAMILIES.
        times: cells along each edge of a cell.
    """
    kinds, *sizes = FAMILIES[family]
    rng = np.random.default_rng([list(FAMILIES).index(family), seed])
    names = [str(rng.choice(kinds)) for _ in NAMES]
    widths = 0.005 * np.exp(rng.uniform(0.0, math.log(4.0), 2))
    slave = int(rng.integers(2))
    ratios = [math.exp(rng.uniform(*np.log(sizes[int(k != slave)]))) for k in range(2)]
    most = FEW if seed % LOT == 0 else MOST
    shapes = tuple(shape(rng, names[k], widths[k], ratios[k] * widths[1 - k], most) for k in range(2))
    direction = Rotation.random(random_state=int(rng.integers(2**31))).apply([0.0, 0.0, 1.0])
    turns = [_pose(rng, item, direction, sign) for item, sign in zip(shapes, (-1.0, 1.0), strict=True)]
    points = [turn.apply(item.mesh.points) for turn, item in zip(turns, shapes, strict=True)]
    aims = [_inside(rng, item, place) for item, place in zip(shapes, points, strict=True)]
    gap = widths.min() * math.exp(rng.uniform(math.log(0.002), math.log(0.1)))
    points[0], points[1] = points[0] - aims[0], points[1] - aims[1]
    way = travel(points[1], shapes[1].triangles, points[0], shapes[0].triangles, direction) - gap
    spans = [np.diff(chord(p, s.triangles, np.zeros(3), direction))[0] for p, s in zip(points, shapes, strict=True)]
    least = min(item.least for item in shapes)
    path = min(gap + sum(spans), gap + REACH * sum(item.least for item in shapes))
    speed = math.exp(rng.uniform(math.log(15.0), math.log(50.0)))
    share = 0.0 if rng.random() < 0.5 else rng.uniform(0.1, 0.9)  # of the speed that the first body has
    velocities = (-share * speed * direction, (1.0 - share) * speed * direction)
    places = (-aims[0], way * direction - aims[1])
    bodies = tuple(
        mca.Body(
            name=NAMES[k],
            geometry=finer(shapes[k].mesh, times) if times > 1 else shapes[k].mesh,
            **_material(rng),
            rotation=tuple(turns[k].as_rotvec().tolist()),
            position=tuple(places[k].tolist()),
            velocity=tuple(velocities[k].tolist()),
        )
        for k in range(2)
    )
    contacts, how = _contact(rng, slave)
    duration = PASSES * path / speed
    scene = mca.Scene(
        name=f"{family} {seed}",
        bodies=bodies,
        contacts=contacts,
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / ROWS),
    )
    cells = [body.geometry.cell_count for body in bodies]
    facts = {"kinds": names, "cells": cells, "ratios": [round(r, 3) for r in ratios], "speed": round(speed, 2), **how}
    fewest = FRAMES[seed % LOT == 0]
    frames = int(np.clip(PASSES * path / (FRAME * least), fewest, MOST_FRAMES))
    return Random(scene, family, seed, facts, shapes, direction, least, frames)


def _pose(rng: np.random.Generator, item: Shape, direction: Array, sign: float) -> Rotation:
    """Any pose, or one in which long bodies cross the way, or a blade's edge looks along `sign` times the direction."""
    free = Rotation.random(random_state=int(rng.integers(2**31)))
    roll, lean, wanted = rng.uniform(0.0, 2.0 * math.pi), rng.normal(0.0, 0.15), rng.random() < 0.6
    if not wanted or item.kind in ("ball", "box"):
        return free
    if item.kind == "blade":
        turn, _ = Rotation.align_vectors([sign * direction], [item.edge])
        return Rotation.from_rotvec(lean * free.apply([1.0, 0.0, 0.0])) * Rotation.from_rotvec(roll * direction) * turn
    across = np.cross(direction, free.apply([1.0, 0.0, 0.0]))
    across /= np.linalg.norm(across)
    if item.kind == "ring":  # it stands on its rim
        across = np.cross(across, direction)
    turn, _ = Rotation.align_vectors([across], [item.long])
    return Rotation.from_rotvec(lean * free.apply([1.0, 0.0, 0.0])) * turn * Rotation.from_rotvec(roll * item.long)


def _inside(rng: np.random.Generator, item: Shape, points: Array) -> Array:
    """A place well within the body: in a cell near its middle, of all the more likely where it is large."""
    cells = points[item.mesh.hexahedra]
    volume = np.prod(np.ptp(item.mesh.points[item.mesh.hexahedra], axis=1), axis=1)
    weight = rng.dirichlet(np.full(8, 4.0))
    return weight @ cells[rng.choice(len(cells), p=volume / volume.sum())]


def _material(rng: np.random.Generator) -> dict[str, object]:
    E, nu, rho = STEEL if rng.random() < 0.5 else ALUMINIUM
    plastic, sigma_y = rng.random() < 0.4, round(float(rng.uniform(2e8, 6e8)), -6)
    if not plastic:
        return {"material": mca.Elastic(E=E, nu=nu, rho=rho)}
    return {
        "material": mca.J2Bilinear(E=E, nu=nu, rho=rho, sigma_y=sigma_y, E_t=0.02 * E),
        "kinematics": "finite",
    }


def _contact(rng: np.random.Generator, slave: int) -> tuple[tuple[mca.Contact, ...], dict[str, object]]:
    """One contact of both skins; where general contact is drawn, that, as soon as the package has it."""
    two_way, general = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    mu = 0.0 if rng.random() < 0.4 else round(float(rng.uniform(0.05, 0.5)), 3)
    skins = [mca.Surface(body=name, nodes="boundary") for name in NAMES]
    if general and hasattr(mca, "ContactAll"):
        return (mca.ContactAll(mu=mu),), {"contact": "all", "mu": mu}
    contact = mca.Contact(slave=skins[slave], master=skins[1 - slave], mu=mu, two_way=two_way or None)
    return (contact,), {"contact": "two-way" if two_way else "listed", "slave": NAMES[slave], "mu": mu}
