"""Owns the axes of the material: yield stress, tangent modulus, Poisson's ratio in flow, strain."""

from __future__ import annotations

import math

import numpy as np

import warp_mca as mca
from benchmarks.stability.axis import Figure, Trial, axis
from warp_mca.verify.material import displacement

E = 200e9
BLOCK = "One cell pulled to a strain of 1 % and pushed to -1 %: the bilinear loop in closed form"


def loop(
    *, nu: float = 0.3, sigma_y: float = 400e6, E_t: float = 20e9, beta: float = 0.5, stroke: float = 4e-3
) -> Trial:
    """A block of one cell, pulled and pushed in strokes [s] that keep it in equilibrium."""
    scene = mca.make_scene("metal_block", strokes=2, stroke=stroke, nu=nu, sigma_y=sigma_y, E_t=E_t, beta=beta)

    def read(result: mca.Result) -> list[Figure]:
        along = displacement(scene.prescribed[0], result.time) / 0.01
        stress, work = bilinear(along, sigma_y, E_t, beta)
        found = result.paths[0].stress[:, 1, 0].astype(np.float64)
        scale = float(np.abs(stress).max())
        figures = [Figure("stress", float(np.abs(found - stress).max()), 0.0, 0.02, scale)]
        if work[-1] > 0.0:
            figures.append(Figure("plastic work", result.summary["energy"]["plastic"], work[-1] * 0.01**3, 0.01))
        else:
            figures.append(Figure("plastic work", result.summary["energy"]["plastic"], 0.0, 0.01, scale * 0.01 * 1e-6))
        return figures

    return Trial(scene, read)


def bilinear(strain: np.ndarray, sigma_y: float, E_t: float, beta: float) -> tuple[np.ndarray, np.ndarray]:
    """Stress [Pa] and plastic work per volume [J/m^3] of the one-dimensional material over a history of strain."""
    H = E * E_t / (E - E_t)
    stress, work = np.zeros(len(strain)), np.zeros(len(strain))
    plastic = length = total = 0.0
    for i, e in enumerate(strain):
        trial = E * (e - plastic)
        centre, radius = (1.0 - beta) * H * plastic, sigma_y + beta * H * length
        excess = abs(trial - centre) - radius
        if excess > 0.0:
            way = math.copysign(1.0, trial - centre)
            step = excess / (E + H)
            plastic, length = plastic + way * step, length + step
            total += 0.5 * step * (way * (centre + way * radius) + way * E * (e - plastic))
        stress[i], work[i] = E * (e - plastic), total
    return stress, work


@axis(
    group="material",
    title="Yield stress [MPa]",
    reference=f"{BLOCK}, E = 200 GPa, E_t = 20 GPa.",
    values=(1.0, 10.0, 400.0, 1e4, 1e24, 1e294),
    quick=(1.0, 1e294),
)
def yield_stress(value: float, element: str) -> Trial:
    """As `loop`."""
    return loop(sigma_y=1e6 * value)


@axis(
    group="material",
    title="Tangent modulus over Young's modulus",
    reference=f"{BLOCK}, yield stress 400 MPa.",
    values=(0.0, 1e-6, 0.1, 0.5, 0.9, 0.99, 0.999999),
    quick=(0.0, 0.99),
)
def tangent(value: float, element: str) -> Trial:
    """As `loop`."""
    return loop(E_t=E * value)


@axis(
    group="material",
    title="Tangent modulus over Young's modulus, kinematic hardening, yield stress 1 MPa",
    reference=f"{BLOCK}.",
    values=(0.0, 0.1, 0.9, 0.99),
)
def tangent_soft(value: float, element: str) -> Trial:
    """As `loop`."""
    return loop(E_t=E * value, sigma_y=1e6, beta=0.0)


@axis(
    group="material",
    title="Poisson's ratio with plastic flow",
    reference=f"{BLOCK}, yield stress 400 MPa, E_t = 20 GPa.",
    values=(-0.9, -0.5, 0.0, 0.45, 0.49, 0.499, 0.4999),
    quick=(-0.9, 0.4999),
)
def poisson_plastic(value: float, element: str) -> Trial:
    """As `loop`."""
    return loop(nu=value)
