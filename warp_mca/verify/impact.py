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


@case(
    group="impact",
    title="A rod strikes a longer one end on: force rho c A v / 2 during 2 L1 / c, restitution L1 / L2",
    reference="One-dimensional wave theory: Johnson, Contact Mechanics (1985), section 11.2.",
    catches=("reaction_halved", "contact_soft"),
)
def coaxial_rods(setup: Setup) -> list[Row]:
    """L1 = 0.5 m, L2 = 1 m, section 40 mm square, E = 200 GPa, rho = 7800 kg/m^3, v = 2 m/s; no Poisson effect.

    The speed of the short rod's centre of mass follows from the impulse; that of the long rod's is the mean at its
    middle over a whole period 2 L2 / c of its free waves, so that the two do not share an error.
    """
    counts = setup.choose((40, 80), (40, 80, 160))
    length, v, c = 0.5, 2.0, math.sqrt(200e9 / 7800.0)
    exact = 0.5 * 7800.0 * c * 0.04**2 * v
    mass, transit = 7800.0 * 0.04**2 * length, 2.0 * length / c
    force, duration, short, restitution = [], [], [], []
    for count in counts:
        result = setup.run(setup.scene("coaxial_rods", axial=count))
        plateau = (result.time > 0.25 * transit) & (result.time < 0.75 * transit)
        force.append(float(result.F_n[plateau].mean()))
        half = crossings(result.time, result.F_n, 0.5 * exact)
        duration.append(float(half[-1] - half[0]))
        impulse = float(result.F_n.sum() * (result.time[1] - result.time[0]))
        short.append(v - impulse / mass)
        period = result.time > result.time[-1] - 2.0 * transit
        restitution.append((float(result["plate_vx"][period].mean()) - short[-1]) / v)
    sizes = tuple(length / count for count in counts)
    front = "dispersion smears the front over (L h^2)^(1/3), so errors fall as h^(2/3)"
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
            exact=transit,
            measured=tuple(duration),
            unit="s",
            tolerance=0.03,
            why=front,
            sizes=sizes,
            least_order=0.5,
        ),
        Row(
            quantity="speed v1 of the short rod afterwards",
            exact=0.0,
            measured=tuple(short),
            unit="m/s",
            tolerance=0.01,
            why=front,
            sizes=sizes,
            scale=v,
            least_order=0.5,
        ),
        Row(
            quantity="restitution e",
            exact=0.5,
            measured=tuple(restitution),
            unit="-",
            tolerance=0.03,
            why=front,
            sizes=sizes,
            least_order=0.5,
        ),
    ]
