"""Owns the case of a sphere that friction turns until it rolls."""

from __future__ import annotations

import numpy as np

import warp_mca as mca
from warp_mca.geometry.quality import volumes
from warp_mca.verify.case import SHAPES, Row, Setup, case
from warp_mca.verify.friction import COULOMB, impulse


@case(
    group="friction",
    title="A sphere that slides at first ends up rolling, at 5 v / 7 from 2 v / (7 mu g) on",
    reference=COULOMB + " Its moment of inertia is 2 m R^2 / 5.",
    elements=SHAPES,
)
def rolling_sphere(setup: Setup) -> list[Row]:
    """v = 10 m/s, mu = 0.3, g = 12000 m/s^2, R = 10 mm; half of the sphere is run, on a contact radius of 0.055 R.

    The sphere bounces a little, so time is counted by the normal impulse it has had, over its weight. How fast it
    slows down is taken from the first 60 % of sliding: towards its end a growing part of the contact sticks.
    """
    sections = setup.choose((4, 6), (6, 8, 12))
    v, mu, g, rho = 10.0, 0.3, 12000.0, 1000.0
    exact = 2.0 * v / (7.0 * mu * g)
    speed, time = [], []
    for section in sections:
        scene = setup.scene("rolling_sphere", section=section, pole_size=2.4e-3 / section)
        meshes = mca.mesh(scene)
        mass = rho * float(volumes(meshes["ball"]).sum())
        result = setup.run(scene, meshes=meshes)
        clock = np.cumsum(result.F_n) * (result.time[1] - result.time[0]) / (mass * g)
        of_ball = v + impulse(result) / mass
        speed.append(float(of_ball[clock > 1.15 * exact].mean()))
        sliding = clock < 0.6 * exact
        slope = np.polyfit(clock[sliding], of_ball[sliding], 1)[0]
        time.append((speed[-1] - v) / float(slope))
    lumped = "lumped masses raise the moment of inertia by 1.2 % (mesh of 6), the contact sinks by 0.3 % of R"
    follows = "follows from the change of speed, of which the error of the speed in the end is 2.5 times the share"
    return [
        Row("speed in the end", 5.0 / 7.0 * v, speed, "m/s", 0.01, lumped),
        Row("time of sliding", exact, time, "s", 0.03, follows),
    ]
