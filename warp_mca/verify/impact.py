"""Owns the cases of impact: rods and spheres whose contact force and duration are known."""

from __future__ import annotations

import math

from warp_mca.verify.case import Row, Setup, case, crossings


@case(
    group="impact",
    title="A rod strikes a rigid wall: force rho c A v during 2 L / c",
    reference="One-dimensional wave theory: Johnson, Contact Mechanics (1985), section 11.2.",
    catches=("pressure_halved",),
)
def rod_on_wall(setup: Setup) -> list[Row]:
    """L = 2 m, A = 0.2 m^2, E = 200 GPa, rho = 7800 kg/m^3, v = 1.5 m/s; no Poisson effect, so waves are plane."""
    counts = setup.choose((20, 40), (40, 80, 160))
    c = math.sqrt(200e9 / 7800.0)
    exact = 7800.0 * c * 0.2 * 1.5
    force, duration = [], []
    for count in counts:
        result = setup.run(setup.scene("rod_on_wall", axial=count, section=max(1, count // 10)))
        plateau = (result.time > 0.5 * 2.0 / c) & (result.time < 1.5 * 2.0 / c)
        force.append(float(result.F_n[plateau].mean()))
        half = crossings(result.time, result.F_n, 0.5 * exact)
        duration.append(float(half[-1] - half[0]))
    sizes = tuple(2.0 / count for count in counts)
    return [
        Row(
            quantity="force F",
            exact=exact,
            measured=tuple(force),
            unit="N",
            tolerance=0.002,
            why="its mean over the middle half of contact leaves out the oscillations behind the front",
            sizes=sizes,
        ),
        Row(
            quantity="duration at F / 2",
            exact=2.0 * 2.0 / c,
            measured=tuple(duration),
            unit="s",
            tolerance=0.02,
            why="the front is smeared over an element or two, of 40 along the rod",
            sizes=sizes,
        ),
    ]
