"""Owns the cases of damping: ring-down at a loss factor, Rayleigh's damping ratios, and an oscillator of a spring."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import SHAPES, Row, Setup, case
from warp_mca.verify.vibration import ALUMINIUM, timoshenko_frequencies


def decaying_modes(time: Array, value: Array, guesses: tuple[float, ...], ratio: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and damping ratios [-] of the sum of decaying waves and a constant that fits a curve best.

    Args:
        time: [s], shape (count,).
        value: the curve, shape (count,).
        guesses: near the frequencies [Hz].
        ratio: near the damping ratios [-].
    """
    from scipy.optimize import least_squares

    w = 2.0 * np.pi * np.array(guesses)

    def left_over(x: Array) -> Array:
        share, damping = x.reshape(2, -1)
        waves = np.exp((1j - damping) * share * w * time[:, None])
        basis = np.column_stack([np.real(waves), np.imag(waves), np.ones(len(time))])
        return value - basis @ np.linalg.lstsq(basis, value, rcond=None)[0]

    start = np.concatenate([np.ones(len(w)), np.full(len(w), ratio)])
    found = least_squares(left_over, start, xtol=1e-12, ftol=1e-14, gtol=1e-14).x.reshape(2, -1)
    return found[0] * guesses, found[1]


@case(
    group="elements",
    title="A cantilever rings down at its loss factor",
    reference="A complex modulus E (1 + i eta): damping ratio eta / 2 of every mode within the band.",
)
def ring_down(setup: Setup) -> list[Row]:
    """L = 1 m, depth 0.1 m, half width 25 mm, E = 70 GPa, nu = 0; sudden weight, eta = 0.05 from f_1 / 2 to 10 f_1."""
    meshes, eta, depth = setup.choose(((20, 2),), ((20, 2), (40, 4))), 0.05, 0.1
    G, rho = ALUMINIUM.shear_modulus, ALUMINIUM.rho
    beam = {"length": 1.0, "depth": depth, "E": ALUMINIUM.E, "G": G, "rho": rho, "shear": 5.0 / 6.0}
    modes = timoshenko_frequencies(**beam, count=3)
    damping = mca.Damping(body="bar", loss_factor=eta, band=(0.5 * modes[0], 10.0 * modes[0]))
    sag = 1e-3 * 8.0 * ALUMINIUM.E * depth**2 / (12.0 * rho)
    ratios, lost = [], []
    for axial, deep in meshes:
        wide = setup.by_element(1, tet4=deep // 2)
        shape = {"depth": depth, "axial": axial, "deep": deep, "wide": wide, "sag": sag, "samples": 600}
        scene = setup.scene("cantilever", duration=5.0 / modes[0], **shape)
        result = setup.run(dataclasses.replace(scene, loads=(damping,)))
        _, found = decaying_modes(result.time, result["tip_vy"], modes[:2], 0.5 * eta)
        ratios.append(float(found[0]))
        lost.append(result.summary["energy"]["error"] / result.summary["energy"]["external_work"])
    why = "the branches keep to 1 % of the loss factor; moduli that rise with the frequency let a free vibration decay "
    why += "faster by eta / pi = 1.6 %"
    closed = "the sum of what is booked is off by rounding and the kick of the first half step"
    return [
        Row("damping ratio of the first mode", 0.5 * eta, ratios, "-", 0.03, why),
        Row("imbalance of the ledger", 0.0, lost, "-", 1e-3, closed, scale=1.0),
    ]


@case(
    group="elements",
    title="A bar clamped at one end rings down at Rayleigh's damping ratios",
    reference="xi = alpha / (2 w) + beta w / 2; Rayleigh, The Theory of Sound (1877), section 97.",
    elements=SHAPES,
)
def rayleigh_bar(setup: Setup) -> list[Row]:
    """L = 0.2 m, 20 mm x 20 mm, E = 70 GPa, nu = 0; sudden push along x; xi = 0.02 of the first mode."""
    count, length = 10 if setup.level == "quick" else 20, 0.2
    c = ALUMINIUM.wave_speeds["bar"]
    first = c / (4.0 * length)
    w = 2.0 * np.pi * first
    rows = []
    for name, own in (
        ("mass", mca.Damping(body="bar", mass=0.04 * w)),
        ("stiffness", mca.Damping(body="bar", stiffness=0.04 / w)),
    ):
        bar = {"length": length, "depth": 0.02, "width": 0.01, "axial": count, "deep": 2, "sag": 0.0, "samples": 400}
        scene = setup.scene("cantilever", push=1e-4 * c**2 / length, duration=5.0 / first, **bar)
        result = setup.run(dataclasses.replace(scene, loads=(own,)))
        modes = tuple((2 * k + 1) * first for k in range(4))
        _, found = decaying_modes(result.time, result["tip_vx"], modes, 0.02)
        why = "lumped masses lower the frequency by some 0.1 %; stiffness reads the rate of half a step before"
        rows.append(Row(f"damping ratio by {name}", 0.02, [float(found[0])], "-", 0.01, why))
    return rows


@case(
    group="rigid",
    title="A rigid block on a spring and a dashpot is a damped oscillator",
    reference="x = v_0 / w_d exp(-xi w t) sin(w_d t), w^2 = k / m, w_d^2 = w^2 (1 - xi^2).",
    elements=(),
)
def sprung_block(setup: Setup) -> list[Row]:
    """A cube of 10 mm of steel, k = 100 N/m, xi = 0.1; it starts at 1 m/s, two periods."""
    steel, side, k, xi = mca.Elastic(E=210e9, nu=0.3, rho=7800.0), 0.01, 100.0, 0.1
    m = steel.rho * side**3
    w = math.sqrt(k / m)
    box = mca.Box(size=(side, side, side), divisions=(2, 2, 2), origin=(-0.5 * side, -0.5 * side, -0.5 * side))
    body = mca.Body(name="a", geometry=box, material=steel, rigid=True, velocity=(1.0, 0.0, 0.0))
    ends = {"body": "a", "at": (0.0, 0.0, 0.0), "other_at": (0.05, 0.0, 0.0)}
    spring = mca.Spring(name="s", stiffness=k, damping=2.0 * xi * m * w, **ends)
    span = 4.0 * math.pi / w
    impact = mca.ImpactPhase(duration=span, output_interval=span / 200.0)
    scene = mca.Scene(name="sprung_block", bodies=(body,), loads=(spring,), impact=impact)
    result = mca.run(scene, device=setup.device, precision=setup.precision)
    t, w_d = result.time, w * math.sqrt(1.0 - xi**2)
    x = np.exp(-xi * w * t) * np.sin(w_d * t) / w_d
    v = np.exp(-xi * w * t) * (np.cos(w_d * t) - xi * w / w_d * np.sin(w_d * t))
    off = float(np.abs(result["spring_s_m"] + x).max())
    taken = 0.5 * m * (1.0 - v[-1] ** 2) - 0.5 * k * x[-1] ** 2
    why = "central differences raise the frequency by (w dt)^2 / 24, with w dt = 0.1 at most"
    stored = 0.5 * k * x[-1] ** 2
    return [
        Row("greatest error of the displacement", 0.0, [off], "m", 1e-3, why, scale=1.0 / w),
        Row("energy that the dashpot took", taken, [float(result["E_damping"][-1])], "J", 2e-3, why),
        Row("energy in the spring", stored, [float(result["E_spring"][-1])], "J", 2e-3, why, scale=0.5 * m),
    ]
