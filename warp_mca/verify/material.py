"""Owns the cases of the material: bilinear plasticity in cycles, out of proportion, its work and its yield surface."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

import warp_mca as mca
from warp_mca.base.arrays import Array
from warp_mca.verify.case import Row, Setup, case

E, NU, SIGMA_Y, E_T = 200e9, 0.3, 400e6, 20e9  # the defaults of the scenes
H = E * E_T / (E - E_T)
SIZE, STRAIN = 0.01, 0.01  # edge of the blocks [m], greatest axial strain [-]


def displacement(item: mca.Prescribed, time: Array) -> Array:
    """Integral of a velocity table [m]: straight lines between its entries, so squares over time."""
    t, v = np.array(item.times), np.array(item.velocities)
    until = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t))])
    k = np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 2)
    past = time - t[k]
    return until[k] + past * (v[k] + 0.5 * past * (v[k + 1] - v[k]) / (t[k + 1] - t[k]))


def _bilinear(strain: Array, beta: float) -> tuple[Array, Array]:
    """Stress [Pa] and plastic work per volume [J/m^3] of the one-dimensional material over a history of strain.

    Exact where the strain goes one way between its entries: both change linearly with plastic strain then.
    """
    stress, work = np.zeros(len(strain)), np.zeros(len(strain))
    plastic = radius_strain = total = 0.0
    for i, e in enumerate(strain):
        trial = E * (e - plastic)
        centre, radius = (1.0 - beta) * H * plastic, SIGMA_Y + beta * H * radius_strain
        excess = abs(trial - centre) - radius
        if excess > 0.0:
            way = math.copysign(1.0, trial - centre)
            step = excess / (E + H)
            plastic, radius_strain = plastic + way * step, radius_strain + step
            total += 0.5 * step * (way * (centre + way * radius) + way * E * (e - plastic))
        stress[i], work[i] = E * (e - plastic), total
    return stress, work


def _cycle(setup: Setup, stroke: float, beta: float) -> tuple[mca.Result, Array]:
    """A run through tension and compression, and the axial strain in its rows."""
    scene = setup.scene("metal_block", stroke=stroke, beta=beta, strain=STRAIN, size=SIZE)
    result = setup.run(scene)
    return result, displacement(scene.prescribed[0], result.time) / SIZE


def _reversed_yield(stress: Array, strain: Array) -> float:
    """Where the lines of elastic and of plastic compression meet, in the first stroke from tension [Pa]."""
    top = int(np.argmax(strain[: len(strain) // 2]))
    stress, strain = stress[top:], strain[top:]
    end = int(np.argmin(strain))
    stress, strain = stress[: end + 1], strain[: end + 1]
    unloading = (stress > 0.0) & (stress < 0.8 * stress[0])
    flowing = strain < 0.0
    a, b = np.polyfit(strain[unloading], stress[unloading], 1)
    c, d = np.polyfit(strain[flowing], stress[flowing], 1)
    return float((a * d - b * c) / (a - c))


@case(
    group="material",
    title="A block pulled and pushed follows the exact bilinear loop, whatever the hardening",
    reference="The one-dimensional response with kinematic, mixed and isotropic hardening: Simo and Hughes, "
    "Computational Inelasticity (1998), chapter 1.",
)
def cyclic(setup: Setup) -> list[Row]:
    """sigma_y = 400 MPa, E_t = E / 10, strain of 1 % to either side, four strokes, free sides."""
    strokes = setup.choose((4e-3, 16e-3), (1e-3, 4e-3, 16e-3))
    greatest = SIGMA_Y + E_T * (STRAIN - SIGMA_Y / E)
    rows = []
    for beta in (0.0, 0.5, 1.0):
        worst, turned = [], []
        for stroke in strokes:
            result, strain = _cycle(setup, stroke, beta)
            stress = result.paths[0].stress[:, 1, 0].astype(np.float64)
            worst.append(float(np.abs(stress - _bilinear(strain, beta)[0]).max()))
            turned.append(_reversed_yield(stress, strain))
        rates = tuple(1.0 / stroke for stroke in strokes)
        vibrate = "of the yield stress; the free sides vibrate a little, the less the slower the strokes"
        what, after = f"greatest error of stress, beta = {beta:g}", f"yield stress after tension, beta = {beta:g}"
        lines = "of the yield stress; lines laid through stresses that vibrate a little"
        lower = greatest - 2.0 * (SIGMA_Y + beta * (greatest - SIGMA_Y))
        rows += [
            Row(what, 0.0, worst, "Pa", 6e-4, vibrate, scale=SIGMA_Y, sizes=rates),
            Row(after, lower, turned, "Pa", 5e-5, lines, scale=SIGMA_Y, sizes=rates),
        ]
    return rows


@case(
    group="material",
    title="E_plastic of the history is the integral of stress over plastic strain",
    reference="The integral along the exact bilinear loop, times the volume.",
)
def plastic_dissipation(setup: Setup) -> list[Row]:
    """The block of the case cyclic after four strokes, 1 cm^3."""
    strokes = setup.choose((4e-3, 16e-3), (1e-3, 4e-3, 16e-3))
    rows = []
    for beta in (0.0, 0.5, 1.0):
        measured, exact = [], 0.0
        for stroke in strokes:
            result, strain = _cycle(setup, stroke, beta)
            measured.append(float(result["E_plastic"][-1]))
            exact = float(_bilinear(strain, beta)[1][-1]) * SIZE**3
        why = "what the vibration of the free sides adds"
        rows.append(Row(f"plastic work, beta = {beta:g}", exact, measured, "J", 1e-5, why))
    return rows


def integrated_stress(strain: Array, time: Array, beta: float) -> Array:
    """Deviatoric stress [Pa] over a course of deviatoric strain, shape (row_count, 3, 3): the rates of J2 plasticity.

    Args:
        strain: without trace, shape (row_count, 3, 3), in rows close enough for a cubic spline.
        time: of the rows [s].
        beta: share of isotropic hardening.
    """
    from scipy.integrate import solve_ivp
    from scipy.interpolate import CubicSpline

    G = E / (2.0 * (1.0 + NU))
    speed = CubicSpline(time, strain).derivative()

    def rates(t: float, state: Array) -> Array:
        """Of deviatoric stress and back stress [Pa/s], and of equivalent plastic strain [1/s]."""
        S, back, p = state[:9].reshape(3, 3), state[9:18].reshape(3, 3), state[18]
        e_dot, xi = speed(t), S - back
        size = math.sqrt(1.5 * float((xi * xi).sum()))
        p_dot = 0.0
        if size >= (SIGMA_Y + beta * H * p) * (1.0 - 1e-9):
            p_dot = max(0.0, 3.0 * G * float((xi * e_dot).sum()) / size / (3.0 * G + H))
        flow = 1.5 * p_dot / size * xi if p_dot > 0.0 else np.zeros((3, 3))
        return np.concatenate(
            [(2.0 * G * (e_dot - flow)).ravel(), (2.0 / 3.0 * (1.0 - beta) * H * flow).ravel(), [p_dot]]
        )

    step = float(time[-1]) / 400.0
    solution = solve_ivp(
        rates, (0.0, time[-1]), np.zeros(19), t_eval=time, rtol=1e-8, atol=SIGMA_Y * 1e-9, max_step=step
    )
    return solution.y[:9].T.reshape(-1, 3, 3)


def _exact_course(F: Array, time: Array, beta: float) -> Array:
    """Stress xx, yy, zz, xy, yz, xz [Pa] under the deformation gradients F, shape (row_count, 3, 3), as above.

    The rates of J2 plasticity, integrated in the frame from which the rotation of F = Q U is taken out; strain is
    U - I.
    """
    K, identity = E / (3.0 * (1.0 - 2.0 * NU)), np.eye(3)
    left, stretch, right = np.linalg.svd(F)
    Q = left @ right
    strain = np.swapaxes(right, 1, 2) @ (stretch[:, :, None] * right) - identity
    trace = np.trace(strain, axis1=1, axis2=2)[:, None, None]
    S = integrated_stress(strain - trace / 3.0 * identity, time, beta)
    stress = Q @ (S + K * trace * identity) @ np.swapaxes(Q, 1, 2)
    return stress[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]


def imposed_course(scene: mca.Scene, time: Array) -> Array:
    """Deformation gradients of `strained_element` at these times [s], shape (row_count, 3, 3)."""
    far = {item.axis: item for item in scene.prescribed if item.nodes == "corner1"}  # at (size, 0, 0)
    stretch, shear = (displacement(far[axis], time) / SIZE for axis in "xy")
    F = np.zeros((len(time), 3, 3)) + np.eye(3)
    F[:, 0, 0] += stretch
    F[:, 1, 0] = shear
    F[:, 1, 1] = F[:, 2, 2] = 1.0 - 0.5 * stretch
    return F


@case(
    group="material",
    title="Tension and shear, together or not, give the stress of the integrated rate equations",
    reference="The rates of J2 plasticity with mixed hardening, integrated by an explicit Runge-Kutta method in "
    "float64: Simo and Hughes, Computational Inelasticity (1998), chapter 2.",
)
def tension_torsion(setup: Setup) -> list[Row]:
    """One element, strain and shear / sqrt(3) up to 1 %, five times the yield strain; beta = 0.5."""
    durations = setup.choose((4e-3, 16e-3), (1e-3, 4e-3, 16e-3))
    rows = []
    # float32 rounds each increment of the plastic strain: in many small steps more than in few
    together = 2e-5 if setup.precision == "mixed" else 1e-5
    for course, tolerance, order in (("together", together, None), ("in turn", 2e-4, 0.9), ("around", 8e-4, 0.9)):
        worst, steps = [], []
        for duration in durations:
            scene = setup.scene("strained_element", course=course, strain=STRAIN, size=SIZE, duration=duration)
            result = setup.run(scene)
            fine = np.linspace(0.0, result.time[-1], 10 * (len(result.time) - 1) + 1)
            F = imposed_course(scene, fine)
            exact = _exact_course(F, fine, 0.5)[::10]
            worst.append(float(np.abs(result.paths[0].stress[:, 1] - exact).max()))
            steps.append(result.summary["dt"] / duration)
        why = "of the yield stress; the return is of first order in the step where the direction of flow turns"
        what = f"greatest error of any component, {course}"
        rows.append(Row(what, 0.0, worst, "Pa", tolerance, why, scale=SIGMA_Y, sizes=tuple(steps), least_order=order))
    return rows


@case(
    group="material",
    title="After plastic loading the stress lies on the yield surface, to rounding",
    reference="sqrt(3 / 2) |S - back stress| = sigma_y + beta H p, the definition of the surface.",
    elements=(),
)
def yield_surface(setup: Setup) -> list[Row]:
    """20000 random states, driven beyond yield by a random strain of some percent, in both precisions."""
    import warp as wp

    from warp_mca.kernels.hardware.scalars import scalars
    from warp_mca.kernels.materials.j2 import return_map

    rng = np.random.default_rng(1)
    count, G = 20000, E / (2.0 * (1.0 + NU))

    def tensors(size: float) -> Array:
        """Symmetric, without trace."""
        a = rng.normal(0.0, size, (count, 3, 3))
        a = 0.5 * (a + np.swapaxes(a, 1, 2))
        return a - np.trace(a, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)

    strain, before = tensors(0.02), tensors(0.005)
    passed = np.sqrt(2.0 / 3.0 * (before**2).sum(axis=(1, 2)))  # at least what led straight there
    share = rng.uniform(0.0, 1.0, count)
    rows = []
    for precision, rounding in (("mixed", 2.0**-24), ("float64", 2.0**-53)):
        t = scalars(precision)
        limits = np.stack([np.full(count, SIGMA_Y), np.full(count, H), share], axis=1)
        tensor = [wp.array(a, dtype=t.mat33, device=setup.device) for a in (2.0 * G * strain, before)]
        scalar = [wp.array(a, dtype=t.real, device=setup.device) for a in (passed, np.full(count, G))]
        c = wp.array(limits, dtype=t.vec3, device=setup.device)
        found: Any = wp.map(return_map(precision), *tensor, *scalar, c, device=setup.device)
        S, plastic, p = (np.asarray(item.numpy(), dtype=np.float64) for item in found)
        beta = c.numpy()[:, 2].astype(np.float64)
        xi = S - (2.0 / 3.0 * (1.0 - beta) * H)[:, None, None] * plastic
        off = np.abs(np.sqrt(1.5 * (xi**2).sum(axis=(1, 2))) - SIGMA_Y - beta * H * p)
        trial = np.sqrt(6.0 * G * G * ((strain - before) ** 2).sum(axis=(1, 2)))
        why = "six roundings of the trial stress, by which the return goes back"
        what = f"distance from the surface over the trial stress, {precision}"
        rows.append(Row(what, 0.0, (float((off / trial).max()),), "-", 6.0 * rounding, why, scale=1.0))
    return rows
