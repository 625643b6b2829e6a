"""Owns the cases of rubber, viscoelasticity and foam: one element beside closed forms and integrations apart."""

from __future__ import annotations

from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.driven import SIZE, driven_cube, imposed, turned
from warp_mca.verify.large_strain import slope_of_log

_RUBBER: dict[str, Any] = {"nu": 0.45, "rho": 1100.0}
RUBBERS: dict[str, Any] = {
    "neo-Hookean": mca.NeoHookean(C10=0.5e6, **_RUBBER),
    "Mooney-Rivlin": mca.MooneyRivlin(C10=0.4e6, C01=0.1e6, **_RUBBER),
    "Ogden": mca.Ogden(mu=(0.63e6, 0.0012e6, -0.01e6), alpha=(1.3, 5.0, -2.0), **_RUBBER),  # Ogden's of 1972
}
_SERIES: dict[str, Any] = {"g": (0.4, 0.3), "tau": (1e-3, 8e-3)}
VISCOUS: dict[str, mca.Prony] = {
    "elastic": mca.Prony(elastic=mca.Elastic(E=3e6, nu=0.45, rho=1100.0), **_SERIES),
    "elastic, with k": mca.Prony(elastic=mca.Elastic(E=3e6, nu=0.45, rho=1100.0), k=(0.2, 0.0), **_SERIES),
    "neo-Hookean": mca.Prony(elastic=RUBBERS["neo-Hookean"], **_SERIES),
    "Ogden": mca.Prony(elastic=RUBBERS["Ogden"], **_SERIES),
}
FOAM = mca.CrushableFoam(
    E=5e6, rho=60.0, crush=(0.0, 0.4, 0.6, 0.8), stress=(0.2e6, 0.25e6, 0.4e6, 1.2e6), tension=0.1e6
)
SHOWN = [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]
_TABLE = 600  # entries of the velocity tables


def deviator_of(rubber: mca.Elastic, e: Array) -> Array:
    """Deviatoric stress conjugate to deviatoric logarithmic strain [Pa], shapes (row_count, 3, 3): principal values."""
    if not isinstance(rubber, mca.NeoHookean | mca.MooneyRivlin | mca.Ogden):
        return 2.0 * rubber.shear_modulus * e
    log, axes = np.linalg.eigh(e)
    stretch = np.exp(log)
    if isinstance(rubber, mca.Ogden):
        terms = [mu * stretch**alpha for mu, alpha in zip(rubber.mu, rubber.alpha, strict=True)]
        value = np.sum(terms, axis=0)
    else:
        value = 2.0 * rubber.C10 * stretch**2 - 2.0 * getattr(rubber, "C01", 0.0) * stretch**-2.0
    value = value - value.mean(axis=1, keepdims=True)
    return axes @ (value[:, :, None] * np.swapaxes(axes, 1, 2))


def relaxed(stress: Array, time: Array, g: tuple[float, ...], tau: tuple[float, ...]) -> Array:
    """(1 - sum g) T + sum h with h' + h / tau = g T': Maxwell's elements, integrated by SciPy.

    Args:
        stress: T of rows close enough for a cubic spline [Pa], shape (row_count, ...).
        time: of the rows [s].
        g, tau: as in `mca.Prony`.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    scale, flat = float(np.abs(stress).max()) or 1.0, stress.reshape(len(time), -1)
    speed = CubicSpline(time, flat / scale).derivative()
    shares, times = np.array(g)[:, None], np.array(tau)[:, None]

    def rates(t: float, h: Array) -> Array:
        return (shares * speed(t) - h.reshape(len(g), -1) / times).ravel()

    span, start = (0.0, float(time[-1])), np.zeros(len(g) * flat.shape[1])
    found = solve_ivp(rates, span, start, t_eval=time, method="LSODA", rtol=1e-8, atol=1e-10).y
    arms = scale * found.T.reshape(len(time), len(g), -1).sum(axis=1)
    return (1.0 - sum(g)) * stress + arms.reshape(stress.shape)


def exact_course(material: mca.Elastic, F: Array, time: Array, finite: bool, every: int) -> tuple[Array, float]:
    """Stress xx, yy, zz, xy, yz, xz [Pa] in each `every`-th row, and the work per volume [J/m^3].

    Small strain is U - I of F = Q U, logarithmic strain ln U; K times its trace is the pressure.
    """
    series = material if isinstance(material, mca.Prony) else None
    elastic = series.elastic if series else material
    left, stretch, right = np.linalg.svd(F)
    measure = np.log(stretch) if finite else stretch - 1.0
    strain = np.swapaxes(right, 1, 2) @ (measure[:, :, None] * right)
    trace = np.trace(strain, axis1=1, axis2=2)
    S = deviator_of(elastic, strain - trace[:, None, None] / 3.0 * np.eye(3))
    p = elastic.parameters[0] * trace
    if series:
        S = relaxed(S, time, series.g, series.tau)
        p = relaxed(p, time, series.k, series.tau) if series.k else p
    T = S + p[:, None, None] * np.eye(3)
    work = float((0.5 * (T[1:] + T[:-1]) * np.diff(strain, axis=0)).sum())
    T, F, Q = T[::every], F[::every], (left @ right)[::every]
    if not finite:
        return (Q @ T @ np.swapaxes(Q, 1, 2))[:, *SHOWN], work
    scale = float(np.abs(T).max())
    slopes = scale * slope_of_log(np.swapaxes(F, 1, 2) @ F, T / scale)
    stress = F @ slopes @ np.swapaxes(F, 1, 2) / np.linalg.det(F)[:, None, None]
    return stress[:, *SHOWN], work


def course(name: str, greatest: float) -> Array:
    """Deformation gradients over a course, shape (row_count, 3, 3): volumes change, so that the pressure counts."""
    s = np.linspace(0.0, 1.0, _TABLE + 1)
    rise = greatest * 0.5 * (1.0 - np.cos(np.pi * s))
    U = np.zeros((len(s), 3, 3)) + np.eye(3)
    if name == "uniaxial":
        U[:, 0, 0], U[:, 1, 1], U[:, 2, 2] = 1.0 + rise, (1.0 + 0.95 * rise) ** -0.5, (1.0 + 0.95 * rise) ** -0.5
    elif name == "biaxial":
        U[:, 0, 0], U[:, 1, 1], U[:, 2, 2] = 1.0 + rise, 1.0 + rise, (1.0 + 0.95 * rise) ** -2.0
    elif name == "shear":
        U[:, 0, 1] = rise
    else:
        wave = greatest * np.sin(1.5 * np.pi * s)
        U[:, 0, 0], U[:, 1, 1], U[:, 2, 2] = 1.0 + wave, 1.0 - 0.4 * wave, 1.0 - 0.3 * wave
        U[:, 0, 1] = U[:, 1, 0] = 0.25 * greatest * (1.0 - np.cos(2.0 * np.pi * s))
        U = turned(U) if name == "turned" else U
    return U


def _rows(setup: Setup, name: str, material: mca.Elastic, path: str, greatest: float, kinematics: str) -> list[Row]:
    """Greatest error of stress, and the work, over a course of 20 ms."""
    scene = driven_cube(material, course(path, greatest), 20e-3, kinematics=kinematics)
    result = setup.run(scene)
    fine = np.linspace(0.0, result.time[-1], 10 * (len(result.time) - 1) + 1)
    stress, work = exact_course(material, imposed(scene, fine), fine, kinematics == "finite", 10)
    worst, most = float(np.abs(result.paths[0].stress[:, 1] - stress).max()), float(np.abs(stress).max())
    spent = [float(result["E_internal"][-1])]  # what is stored and dissipated
    why = "of the greatest stress; drives move straight through a step"
    what = f"{name}, {path}, {kinematics}"
    return [
        Row(f"greatest error of any component of stress, {what}", 0.0, [worst], "Pa", 1e-3, why, scale=most),
        Row(f"work, {what}", work * SIZE**3, spent, "J", 1e-3, why),
    ]


@case(
    group="material",
    title="Rubber stretched twice its length along one axis and two, sheared, and turned three times",
    reference="Closed forms of the energies in principal stretches.",
    elements=("hex8", "tet4"),
)
def rubber_laws(setup: Setup) -> list[Row]:
    """One element of each law, nu = 0.45."""
    names = setup.choose(("Mooney-Rivlin",), tuple(RUBBERS))
    paths = setup.choose(("shear",), ("uniaxial", "biaxial", "shear", "turned"))
    most = {"uniaxial": 1.0, "biaxial": 0.4, "shear": 1.0, "turned": 0.3}
    found = (_rows(setup, name, RUBBERS[name], path, most[path], "finite") for name in names for path in paths)
    return [row for rows in found for row in rows]


@case(
    group="material",
    title="Stress relaxes and is taken up again in cycles, also turned three times, as Maxwell's elements do",
    reference="The rate equations of a Prony series, integrated by SciPy.",
    elements=("hex8", "tet4"),
)
def viscoelastic_laws(setup: Setup) -> list[Row]:
    """One element; two terms, of which one is much faster than the course of 20 ms."""
    rows = _rows(setup, "elastic", VISCOUS["elastic"], "cyclic", 0.03, "corotational")
    names = setup.choose((), ("elastic", "neo-Hookean", "Ogden"))
    for name in names:
        rows += _rows(setup, name, VISCOUS[name], "turned", 0.2, "finite")
    if setup.level == "full" and setup.element != "tet4":
        rows += _rows(setup, "elastic, with k", VISCOUS["elastic, with k"], "cyclic", 0.03, "corotational")
    return rows


@case(
    group="material",
    title="A pad of foam is crushed along its curve, let go and crushed again",
    reference="The curve of the material: stress over 1 - J, which the foam keeps as it does not spread.",
    elements=("hex8",),
)
def foam_pad(setup: Setup) -> list[Row]:
    """Shortened to half, let go by 6 %, shortened to a quarter, turning three times."""
    s = np.linspace(0.0, 1.0, _TABLE + 1)
    U = np.zeros((len(s), 3, 3)) + np.eye(3)
    U[:, 0, 0] = np.interp(s, [0.0, 0.4, 0.5, 0.6, 1.0], [1.0, 0.5, 0.56, 0.5, 0.25])
    scene = driven_cube(FOAM, turned(U), 40e-3, kinematics="finite")
    result = setup.run(scene)
    F, stress = imposed(scene, result.time), result.paths[0].stress[:, 1]
    J, axis = np.linalg.det(F), F[:, :, 0] / np.linalg.norm(F[:, :, 0], axis=1)[:, None]
    tensor = stress[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(-1, 3, 3)
    found = -np.einsum("ni,nij,nj->n", axis, tensor, axis)
    share = result.time / result.time[-1]
    crushing = ((share > 0.05) & (share < 0.38)) | (share > 0.65)
    curve = np.interp(1.0 - J, FOAM.crush, FOAM.stress)
    worst = float(np.abs(found / curve - 1.0)[crushing].max())
    work = float(result.summary["energy"]["external_work"])
    known = float(result["E_internal"][-1])
    why = "drives move straight through a step"
    return [
        Row("greatest error of the stress while it is crushed", 0.0, [worst], "-", 1e-3, why, scale=1.0),
        Row("stored and dissipated energy over the work of the drives", work, [known], "J", 1e-3, why),
    ]
