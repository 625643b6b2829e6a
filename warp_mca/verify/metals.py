"""Owns the cases of the laws of metals: hardening, rates and heat in one element, beside an integration apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.driven import SIZE, driven_cube, imposed, turned
from warp_mca.verify.large_strain import slope_of_log

STEEL: dict[str, Any] = {"E": 200e9, "nu": 0.3, "rho": 7800.0}
METALS: dict[str, mca.Elastic] = {
    "Voce": mca.J2Voce(**STEEL, sigma_y=400e6, Q=200e6, b=30.0, H=1e9),
    "table": mca.J2Table(**STEEL, plastic_strain=(0.0, 0.005, 0.03, 0.2), stress=(400e6, 480e6, 550e6, 700e6)),
    "Cowper-Symonds": mca.CowperSymonds(
        **STEEL, plastic_strain=(0.0, 0.02, 0.2), stress=(250e6, 300e6, 450e6), D=40.4, q=5.0
    ),
    "Johnson-Cook": mca.JohnsonCook(  # 4340 steel
        **STEEL, A=792e6, B=510e6, n=0.26, C=0.014, m=1.03, T_melt=1793.0, c_p=477.0
    ),
    "Chaboche": mca.Chaboche(**STEEL, sigma_y=250e6, C=(60e9, 5e9), gamma=(400.0, 30.0), Q=100e6, b=10.0),
}
STRAIN = {"corotational": 0.01, "finite": 0.04}  # greatest axial strain [-]
_TABLE = 600  # entries of the velocity tables


def static_stress(metal: Any, p: float, work: float) -> tuple[float, float]:
    """Radius of the yield surface without effect of the rate, and its slope over p [Pa]; work [J/m^3]."""
    if isinstance(metal, mca.J2Table):
        x, y = metal.plastic_strain, metal.stress
        k = min(int(np.searchsorted(x, p, side="right")), len(x) - 1)
        slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1]) if p < x[-1] else 0.0
        return float(np.interp(p, x, y)), slope
    if isinstance(metal, mca.JohnsonCook):
        start = metal.T_room if metal.T_start is None else metal.T_start
        T = start + metal.beta * work / (metal.rho * metal.c_p)
        hot = max(0.0, (T - metal.T_room) / (metal.T_melt - metal.T_room))
        return (metal.A + metal.B * max(p, 0.0) ** metal.n) * (1.0 - hot**metal.m), 0.0
    left = metal.Q * math.exp(-metal.b * p)
    H = metal.H if isinstance(metal, mca.J2Voce) else 0.0
    return metal.sigma_y + metal.Q - left + H * p, metal.b * left + H


def _plastic_rate(metal: Any, q: float, p: float, work: float) -> float | None:
    """Rate of p [1/s] at which the flow stress is q, of laws with rates; None of others."""
    sigma = static_stress(metal, p, work)[0]
    if isinstance(metal, mca.CowperSymonds):
        return metal.D * max(q / sigma - 1.0, 0.0) ** metal.q
    if isinstance(metal, mca.JohnsonCook):
        return metal.rate_0 * math.exp(min((q / sigma - 1.0) / metal.C, 50.0)) if q > sigma else 0.0
    return None


def integrated(metal: Any, strain: Array, time: Array) -> tuple[Array, Array, Array]:
    """Deviatoric stress [Pa], p [-] and plastic work [J/m^3] over a course of deviatoric strain: rates, integrated.

    Args:
        metal: one of the laws of this file.
        strain: without trace, shape (row_count, 3, 3), in rows close enough for a cubic spline.
        time: of the rows [s].
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    G, speed = metal.shear_modulus, CubicSpline(time, strain).derivative()
    pairs = list(zip(metal.C, metal.gamma, strict=True)) if isinstance(metal, mca.Chaboche) else []
    scale = np.concatenate([np.full(9 + 9 * len(pairs), 1e9), [1.0, 1e9]])

    def rates(t: float, scaled: Array) -> Array:
        """Of stress, back stresses, p and plastic work, over `scale`."""
        state = scale * scaled
        S, back = state[:9].reshape(3, 3), state[9:-2].reshape(-1, 3, 3)
        p, work = state[-2:]
        e_dot, xi = speed(t), S - back.sum(axis=0)
        size = math.sqrt(1.5 * float((xi * xi).sum()))
        n = 1.5 * xi / max(size, 1.0)
        p_dot = _plastic_rate(metal, size, p, work)
        if p_dot is None:
            radius, slope = static_stress(metal, p, work)
            slope += sum(C - gamma * float((n * X).sum()) for (C, gamma), X in zip(pairs, back, strict=True))
            flows = size >= radius * (1.0 - 1e-9)
            p_dot = max(0.0, 2.0 * G * float((n * e_dot).sum()) / (3.0 * G + slope)) if flows else 0.0
        moved = [p_dot * (C / 1.5 * n - gamma * X) for (C, gamma), X in zip(pairs, back, strict=True)]
        parts = [2.0 * G * (e_dot - p_dot * n), *moved, [p_dot, p_dot * float((S * n).sum())]]
        return np.concatenate([np.ravel(part) for part in parts]) / scale

    rated = _plastic_rate(metal, 0.0, 0.0, 0.0) is not None
    more: dict[str, Any] = {"method": "LSODA"} if rated else {"max_step": float(time[-1]) / 400.0}
    found = (
        solve_ivp(rates, (0.0, float(time[-1])), np.zeros(len(scale)), t_eval=time, rtol=1e-7, atol=1e-9, **more).y
        * scale[:, None]
    )
    return found[:9].T.reshape(-1, 3, 3), found[-2], found[-1]


def _stretch(course: str, s: Array) -> tuple[Array, Array]:
    """Axial strain and shear over the share s of the duration, as shares of the greatest strain."""
    if course == "cyclic":
        return np.sin(3.0 * np.pi * s), np.zeros_like(s)
    if course == "shear":
        return np.zeros_like(s), s
    return np.sin(2.0 * np.pi * s), 1.0 - np.cos(2.0 * np.pi * s)


def driven_element(metal: mca.Elastic, course: str, duration: float, kinematics: Any = "corotational") -> mca.Scene:
    """A cube, stretched by e along x, by -e / 2 along y and z, sheared by sqrt(3) e in xy; "turned" turns it, too."""
    s = np.linspace(0.0, 1.0, _TABLE + 1)
    axial, shear = (STRAIN[kinematics] * part for part in _stretch(course, s))
    U = np.zeros((len(s), 3, 3))
    U[:, 0, 0], U[:, 1, 1], U[:, 2, 2] = 1.0 + axial, 1.0 - 0.5 * axial, 1.0 - 0.5 * axial
    U[:, 0, 1] = U[:, 1, 0] = 0.5 * math.sqrt(3.0) * shear
    return driven_cube(metal, turned(U) if course == "turned" else U, duration, kinematics=kinematics)


def exact_course(metal: Any, F: Array, time: Array, finite: bool, every: int) -> tuple[Array, float]:
    """Stress xx, yy, zz, xy, yz, xz [Pa] in each `every`-th row, and the plastic work at the end [J/m^3].

    Small strain is U - I of F = Q U; the logarithmic one is ln U, with the stress conjugate to it.
    """
    left, stretch, right = np.linalg.svd(F)
    Q, identity = left @ right, np.eye(3)
    measure = np.log(stretch) if finite else stretch - 1.0
    strain = np.swapaxes(right, 1, 2) @ (measure[:, :, None] * right)
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    S, _p, work = integrated(metal, strain - trace / 3.0 * identity, time)
    T, F, Q = (S + metal.bulk_modulus * trace * identity)[::every], F[::every], Q[::every]
    if finite:
        slopes = slope_of_log(np.swapaxes(F, 1, 2) @ F, T / 1e9) * 1e9
        stress = F @ slopes @ np.swapaxes(F, 1, 2) / np.linalg.det(F)[:, None, None]
    else:
        stress = Q @ T @ np.swapaxes(Q, 1, 2)
    return stress[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]], float(work[-1])


@case(
    group="material",
    title="Each law of metals gives the stress and work of its rates in cycles, in shear, and turned three times",
    reference="The rates of von Mises plasticity with each law's flow stress, integrated by SciPy in float64.",
    elements=("tet4",),
)
def metal_laws(setup: Setup) -> list[Row]:
    """One element; strain up to 1 % at small strain, 4 % at finite strain, and shear up to twice sqrt(3) of that."""
    rows, small = [], ("cyclic", "corotational")
    courses = setup.choose((small,), (small, ("shear", "corotational"), ("turned", "finite")))
    names = setup.choose(("Cowper-Symonds", "Chaboche"), tuple(METALS))
    for course, kinematics in courses:
        for name, metal in ((name, METALS[name]) for name in names):
            scene = driven_element(metal, course, 1e-3, kinematics)
            result = setup.run(scene)
            fine = np.linspace(0.0, result.time[-1], 10 * (len(result.time) - 1) + 1)
            stress, work = exact_course(metal, imposed(scene, fine), fine, kinematics == "finite", 10)
            worst = float(np.abs(result.paths[0].stress[:, 1] - stress).max())
            why = "the return is of first order in the step"
            greatest = f"greatest error of any component of stress, {name}, {course}"
            spent = [float(result["E_plastic"][-1])]
            rows += [
                Row(greatest, 0.0, [worst], "Pa", 1e-3, f"of the yield stress; {why}", scale=metal.yield_stress),
                Row(f"plastic work, {name}, {course}", work * SIZE**3, spent, "J", 1e-3, why),
            ]
    return rows
