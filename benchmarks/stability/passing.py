"""Owns the axes of bodies that go through each other: without a contact, between nodes, and through themselves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis

SOFT = mca.Elastic(E=2e9, nu=0.3, rho=1200.0)
W = 0.01  # width of the bodies [m]


def _box(name: str, size: tuple[float, float, float], cells: tuple[int, int, int], **start: Any) -> mca.Body:
    geometry = mca.Box(size=size, divisions=cells, origin=tuple(-0.5 * s for s in size))
    return mca.Body(name=name, geometry=geometry, material=SOFT, **start)


def _impact(duration: float) -> mca.ImpactPhase:
    return mca.ImpactPhase(duration=duration, output_interval=duration / 200.0)


@axis(
    group="through each other",
    title="Cells along the edges of a cube that meets another one, without a contact between them",
    reference="Equal elastic cubes of 10 mm meet at 20 m/s: the one that strikes keeps none of its speed.",
    values=(1, 2, 4),
    elements=("hex8",),
)
def no_contact(value: int, element: str) -> Trial:
    """The scene without the contact that would make it right."""
    cells = (value, value, value)
    bodies = (
        _box("a", (W, W, W), cells),
        _box("b", (W, W, W), cells, position=(0.0, 1.1 * W, 0.0), velocity=(0.0, -20.0, 0.0)),
    )
    probe = mca.Probe(name="b", body="b", at=(0.0, 0.0, 0.0))
    scene = mca.Scene(name="cubes", bodies=bodies, impact=_impact(1e-3), probes=(probe,))
    return Trial(scene, lambda found: [Figure("speed", float(found.probes[0].velocity[-1, 1]), 0.0, 0.1, 20.0)])


@axis(
    group="through each other",
    title="Cells along bars whose edges cross",
    reference="Two square bars, 60 mm long and 10 mm wide, fall on each other at 5 m/s with an edge, at right angles "
    "and between their nodes, in contact of both skins: they touch after 4 µs.",
    values=(7, 13, 25),
    elements=("hex8",),
)
def crossed_edges(value: int, element: str) -> Trial:
    """Contact of nodes and faces does not see edges that cross."""
    low, half = Rotation.from_rotvec([math.pi / 4, 0.0, 0.0]), W / math.sqrt(2.0)
    top = Rotation.from_rotvec([0.0, math.pi / 2, 0.0]) * low
    size, cells = (6.0 * W, W, W), (value, (value + 1) // 6, (value + 1) // 6)
    turns = [tuple(turn.as_rotvec().tolist()) for turn in (low, top)]
    bodies = (
        _box("a", size, cells, position=(0.0, -half, 0.0), rotation=turns[0]),
        _box("b", size, cells, position=(0.0, half + 2e-5, 0.0), rotation=turns[1], velocity=(0.0, -5.0, 0.0)),
    )
    sides = [mca.Surface(body=name, nodes="boundary") for name in ("b", "a")]
    contact = mca.Contact(slave=sides[0], master=sides[1], two_way=True)
    scene = mca.Scene(name="edges", bodies=bodies, contacts=(contact,), impact=_impact(1e-3))

    def read(found: mca.Result) -> list[Figure]:
        touches = found.summary["contacts"]
        return [Figure("first touch", touches[0][0] if touches else found.time[-1], 4e-6, 1.0)]

    return Trial(scene, read)


@axis(
    group="through each other",
    title="Way of a leg of a clip towards the other one, over the gap between them",
    reference="The end of the upper leg of a U of strips, 1 mm thick and 4 mm apart, is driven down.",
    values=(0.75, 1.7),
    elements=("hex8",),
)
def clip(value: float, element: str) -> Trial:
    """Nothing keeps parts of a body apart."""
    gap, thick = 4e-3, 1e-3
    duration = value * gap / 10.0
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=200e6, E_t=1e9)
    scene = mca.Scene(
        name="clip",
        bodies=(mca.Body(name="clip", geometry=_clip(gap, thick), material=metal, kinematics="finite"),),
        fixed=(mca.Fixed(body="clip", nodes="foot"),),
        prescribed=(mca.Prescribed(body="clip", nodes="end", axis="y", times=(0.0,), velocities=(-10.0,)),),
        probes=(mca.Probe(name="end", body="clip", nodes="end"),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 200.0, energy_tolerance=0.05),
    )

    def read(found: mca.Result) -> list[Figure]:
        inside = 1.5 * thick - float(found.probes[0].position[-1, 1])  # of the end's middle, below the lower leg's top
        return [Figure("overlap", max(0.0, inside), 0.0, 0.05, gap)]

    return Trial(scene, read)


def _clip(gap: float, thick: float) -> mca.Mesh:
    """Two legs of 20 mm along x, and a web that joins them at x = 0, one cell thick."""
    xs = np.append(0.0, np.linspace(thick, 0.02, 12))
    ys = np.array([0.0, thick, *np.linspace(thick, thick + gap, 5)[1:], 2.0 * thick + gap])
    grid = mca.Box(size=(1.0, 1.0, 0.006), divisions=(len(xs) - 1, len(ys) - 1, 2)).build()
    i, j = (np.rint(grid.points[:, k] * (len(at) - 1)).astype(int) for k, at in enumerate((xs, ys)))
    points = np.stack([xs[i], ys[j], grid.points[:, 2]], axis=1)
    middle = points[grid.hexahedra].mean(axis=1)
    kept = (middle[:, 0] < thick) | (middle[:, 1] < thick) | (middle[:, 1] > thick + gap)
    nodes, cells = np.unique(grid.hexahedra[kept], return_inverse=True)
    points = points[nodes]
    end = (points[:, 0] > 0.02 - 1e-9) & (points[:, 1] > thick + gap - 1e-9)
    sets = {"end": np.flatnonzero(end).astype(np.int32), "foot": np.flatnonzero(points[:, 1] < 1e-9).astype(np.int32)}
    return mca.Mesh(
        points, cells.reshape(-1, 8).astype(np.int32), sets, {"body": np.arange(kept.sum(), dtype=np.int32)}
    )
