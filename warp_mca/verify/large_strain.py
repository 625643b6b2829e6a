"""Owns the case of plastic flow at large strain, off the axes of the strain: logarithmic strain, integrated apart."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.material import NU, SIGMA_Y, SIZE, E, imposed_course, integrated_stress

STRAIN = 0.08  # greatest axial strain [-]


def _slope_of_log(C: Array, T: Array) -> Array:
    """Derivative of the logarithm at each C in the direction T, shapes (count, 3, 3): the corner of matrices of twice
    the size, ln B = 2 artanh((B - I) (B + I)^-1) as a series, for stretches between a half and two."""
    both, identity = np.zeros((len(C), 6, 6)), np.eye(6)
    both[:, :3, :3] = both[:, 3:, 3:] = C
    both[:, :3, 3:] = T
    power = np.linalg.solve(both + identity, both - identity)
    square, half = power @ power, np.zeros_like(both)
    for odd in range(1, 60, 2):
        half += power / odd
        power = power @ square
    return 2.0 * half[:, :3, 3:]


def _exact_course(F: Array, time: Array, beta: float, every: int) -> tuple[Array, float]:
    """Stress xx, yy, zz, xy, yz, xz [Pa] in every `every`-th row, and the work per volume done in all of them [J/m^3].

    T of the strain ln(F^T F) / 2, whose plastic part is taken off it, gives F (d ln C / d C : T) F^T / J.

    Args:
        F: deformation gradients, shape (row_count, 3, 3), in rows close enough for a cubic spline.
        time: of the rows [s].
        beta: share of isotropic hardening.
        every: step between the rows of the stress.
    """
    K = E / (3.0 * (1.0 - 2.0 * NU))
    C = np.swapaxes(F, 1, 2) @ F
    squared, axes = np.linalg.eigh(C)
    strain = axes @ (0.5 * np.log(squared)[:, :, None] * np.swapaxes(axes, 1, 2))
    growth = np.trace(strain, axis1=1, axis2=2)  # ln J
    deviator = strain - growth[:, None, None] / 3.0 * np.eye(3)
    T = integrated_stress(deviator, time, beta)
    work = float((0.5 * (T[1:] + T[:-1]) * np.diff(deviator, axis=0)).sum() + 0.5 * K * growth[-1] ** 2)
    f, growth = F[::every], growth[::every, None, None]
    slope = _slope_of_log(C[::every], T[::every] / SIGMA_Y) * SIGMA_Y
    stress = (f @ slope @ np.swapaxes(f, 1, 2) + K * growth * np.eye(3)) / np.exp(growth)
    return stress[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], work


@cache
def _known(course: str, rows: int) -> tuple[Array, float]:
    """Stress [Pa] in the rows of a run, and work [J]: rates do not matter, so that all runs share them."""
    scene = mca.make_scene("strained_element", course=course, strain=STRAIN, size=SIZE, duration=1.0)
    time = np.linspace(0.0, 1.0, 10 * (rows - 1) + 1)
    stress, work = _exact_course(imposed_course(scene, time), time, 0.5, every=10)
    return stress, work * SIZE**3


@case(
    group="material",
    title="Large tension and shear, in turn and around, give stress and work of the integrated rate equations",
    reference="Logarithmic strain with additive plastic strain: Miehe, Apel and Lambrecht, Comput. Meth. Appl. Mech. "
    "Engng 191 (2002) 5383; its rates integrated by an explicit Runge-Kutta method, the slope of the logarithm by "
    "that of a block matrix.",
)
def large_tension_torsion(setup: Setup) -> list[Row]:
    """One element, strain and shear / sqrt(3) up to 8 %, forty times the yield strain; beta = 0.5."""
    durations = setup.choose((4e-3, 16e-3), (1e-3, 4e-3, 16e-3))
    rows = []
    for course in ("in turn", "around"):
        worst, work, steps, known = [], [], [], 0.0
        for duration in durations:
            scene = setup.scene("strained_element", course=course, strain=STRAIN, size=SIZE, duration=duration)
            bodies = tuple(dataclasses.replace(body, kinematics="finite") for body in scene.bodies)
            scene = dataclasses.replace(scene, bodies=bodies)
            result = setup.run(scene)
            exact, known = _known(course, len(result.time))
            worst.append(float(np.abs(result.paths[0].stress[:, 1] - exact).max()))
            work.append(float(result.summary["energy"]["external_work"]))
            steps.append(result.summary["dt"] / duration)
        order = 0.9
        left = (steps[-2] / steps[-1]) ** order - 1.0
        why = f"what order {order:g} in the step leaves of the change from the run before: the direction of flow turns"
        limits = (worst[-2] - worst[-1]) / left / SIGMA_Y, abs(work[-1] - work[-2]) / left / known
        more = {"sizes": tuple(steps), "least_order": order}
        greatest, share = f"greatest error of any component of stress, {course}", why + "; a share of the yield stress"
        rows += [
            Row(greatest, 0.0, worst, "Pa", limits[0], share, scale=SIGMA_Y, **more),
            Row(f"work of the driven nodes, {course}", known, work, "J", limits[1], why, **more),
        ]
    return rows
