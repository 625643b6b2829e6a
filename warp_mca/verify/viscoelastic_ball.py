"""Owns the case of a viscoelastic ball that strikes a rigid plane, beside the integral of Lee, Radok and Ting."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case

RADIUS, SPEED, E, NU, RHO = 0.01, 0.01, 3e6, 0.3, 1100.0  # as slow beside its waves as steel at 1 m/s
G, TAU = (0.3, 0.2), (1e-3, 4e-3)  # of both moduli, so that Poisson's ratio stays


def contact_force(duration: float, steps: int) -> tuple[Array, Array]:
    """Time [s] and force [N] of a ball of point mass, shapes (steps,): its motion, integrated by itself.

    While the circle of contact grows, F = c int E*(t - s) d(delta^(3/2)), c = 4/3 sqrt(R) (Lee and Radok, J. Appl.
    Mech. 27 (1960) 438). While it shrinks the integral ends at t1, when the circle was as large before:
    int from t1 to t of E*(t - s) d delta = 0 (Ting, J. Appl. Mech. 33 (1966) 845).
    """
    mass, dt = 4.0 / 3.0 * math.pi * RADIUS**3 * RHO, duration / steps
    time = dt * np.arange(steps)
    middle = time + 0.5 * dt
    relaxing = 1.0 - np.sum([g * (1.0 - np.exp(-middle / tau)) for g, tau in zip(G, TAU, strict=True)], axis=0)
    modulus = E / (1.0 - NU**2) * relaxing  # by the time from the middle of a step to a later step's end
    delta, power, force = np.zeros(steps), np.zeros(steps), np.zeros(steps)
    v, top, steps_back = SPEED, 0, np.zeros(0)
    for n in range(1, steps):
        delta[n] = delta[n - 1] + dt * v
        power[n] = max(delta[n], 0.0) ** 1.5
        grows = top == n - 1 and delta[n] >= delta[top]
        end = n
        if grows:
            top = n
        else:  # from the last step back
            steps_back = np.cumsum((np.diff(delta[: n + 1]) * modulus[:n][::-1])[::-1])[::-1]
            before = np.flatnonzero(steps_back[:top] >= 0.0)
            end = int(before[-1]) if len(before) else 0
        weights = modulus[:n][::-1][:end]
        force[n] = 4.0 / 3.0 * math.sqrt(RADIUS) * float((np.diff(power[: end + 1]) * weights).sum())
        if not grows and 0 < end < top:  # the share of the step in which the circle was as large
            one, other = steps_back[end], steps_back[end + 1]
            share = one / (one - other)
            force[n] += 4.0 / 3.0 * math.sqrt(RADIUS) * share * (power[end + 1] - power[end]) * modulus[n - 1 - end]
        v -= dt * force[n] / mass
        if not grows and end == 0:
            break
    return np.asarray(time, dtype=np.float64), force


@case(
    group="impact",
    title="A viscoelastic ball strikes a rigid plane: force, its time, and the speed of rebound",
    reference="Lee and Radok, J. Appl. Mech. 27 (1960) 438, and Ting, J. Appl. Mech. 33 (1966) 845, integrated apart.",
    elements=("hex8",),
)
def viscoelastic_ball(setup: Setup) -> list[Row]:
    """R = 10 mm, 10 mm/s, E = 3 MPa at an instant, of which half relaxes in 1 and 4 ms; contact lasts some 6 ms."""
    section, left, most = setup.choose((8, 0.03, 0.05), (12, 0.02, 0.03))
    patch = {"section": section, "pole_size": 1.2e-3 / section}
    scene = setup.scene("hertz_sphere", v=SPEED, E=E, nu=NU, rho=RHO, **patch)
    soft = mca.Prony(elastic=mca.Elastic(E=E, nu=NU, rho=RHO), g=G, tau=TAU, k=G)
    bodies = tuple(dataclasses.replace(body, material=soft, exact_mass=True) for body in scene.bodies)
    result = setup.run(dataclasses.replace(scene, bodies=bodies))
    time, force = contact_force(scene.impact.duration, 4000)
    found = 4.0 * result.F_n  # of a quarter
    impulse, known = (float(np.trapezoid(f, t)) for f, t in ((found, result.time), (force, time)))
    mass = 4.0 / 3.0 * math.pi * RADIUS**3 * RHO
    worst = float(np.abs(np.interp(result.time, time, force) - found).max())
    late = "the force begins a cell's sag late, as that of an elastic ball on this mesh does"
    why = "a sphere is stiffer than the half-space that the theory takes it for, by a share of order a / R = 0.04"
    return [
        Row("greatest force", float(force.max()), [float(found.max())], "N", left, why),
        Row("its time", float(time[force.argmax()]), [float(result.time[found.argmax()])], "s", left, why),
        Row("speed after it", known / mass - SPEED, [impulse / mass - SPEED], "m/s", left, why),
        Row("greatest difference of force", 0.0, [worst], "N", most, late, scale=float(force.max())),
    ]
