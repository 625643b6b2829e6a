"""Owns the cases of elements by themselves: single ones and small patches, displaced at will."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.geometry.mesh import Mesh
from warp_mca.verify.case import EPSILON, Row, Setup, case
from warp_mca.verify.small_meshes import CUBE, mixed_cube, patch
from warp_mca.verify.statics import Imposed, Kinematics

Array = NDArray[np.float64]

MATERIAL = mca.Elastic(E=1e6, nu=0.25, rho=1000.0)  # of the patch test in its source, with a density besides


def turned(axis: Array, angle: float) -> Array:
    """Matrix of the rotation by `angle` [rad] about the unit vector `axis`, shape (3, 3), float64."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(np.remainder(angle, 2.0 * np.pi) * axis).as_matrix()


@case(
    group="elements",
    title="Patch test: distorted elements carry constant strain",
    reference="MacNeal and Harder, Finite Elements in Analysis and Design 1 (1985) 3, Fig. 2.",
)
def patch_test(setup: Setup) -> list[Row]:
    """Unit cube of 7 cells; u = 5e-4 m (2 x + y + z, x + 2 y + z, x + y + 2 z); E = 1 MPa, nu = 0.25."""
    body = Imposed(setup, patch(), MATERIAL)
    gradient = 0.5e-3 * (np.eye(3) + np.ones((3, 3)))  # symmetric: no rotation, so that the stress is exact
    u = body.X @ gradient
    inside = (body.X > 1e-9).all(axis=1) & (body.X < 1.0 - 1e-9).all(axis=1)
    left_over = float(np.linalg.norm(body.force(u)[inside], axis=1).max())
    scale = body.largest_element_force()
    stress = body.stress(u)
    exact = np.array([2000.0, 2000.0, 2000.0, 400.0, 400.0, 400.0])  # as in the source, in psi there
    worst = np.unravel_index(np.abs(stress - exact).argmax(), stress.shape)
    round_off = 10.0 * EPSILON[setup.precision]
    return [
        Row(
            quantity="largest force left on an inner node",
            exact=0.0,
            measured=(left_over,),
            unit="N",
            scale=scale,
            tolerance=round_off,
            why="ten units of round-off, as a share of the largest force of one element on a node",
        ),
        Row(
            quantity="stress farthest from exact, of 6 components at 16 nodes",
            exact=float(exact[worst[1]]),
            measured=(float(stress[worst]),),
            unit="Pa",
            scale=2000.0,
            tolerance=10.0 * EPSILON["mixed"],
            why="ten units of round-off: stress is output in single precision",
        ),
    ]


@case(
    group="elements",
    title="Hexahedra, wedges, pyramids and tetrahedra in one body carry constant strain, small and large",
    reference="Closed forms: S = 2 G e + K tr(e) I; Kirchhoff stress 2 G dev(ln V) + K ln(J) I by logarithmic strain.",
)
def mixed_patch(setup: Setup) -> list[Row]:
    """Unit cube of 5 hexahedra, 4 wedges, 4 pyramids and 4 tetrahedra; strains of 0.1 % and, finite, of 10 %."""
    gradient = np.array([[0.5, 0.3, -0.2], [0.1, -0.4, 0.6], [0.7, 0.2, 0.3]])
    G, K, identity = MATERIAL.shear_modulus, MATERIAL.bulk_modulus, np.eye(3)
    e = 0.5e-3 * (gradient + gradient.T)
    small = 2.0 * G * e + (K - 2.0 / 3.0 * G) * np.trace(e) * identity
    F = identity + 0.1 * gradient
    squared, axes = np.linalg.eigh(F @ F.T)
    strain, J = axes @ np.diag(0.5 * np.log(squared)) @ axes.T, float(np.linalg.det(F))
    large = (2.0 * G * (strain - np.log(J) / 3.0 * identity) + K * np.log(J) * identity) / J
    rows = []
    measures: tuple[tuple[Kinematics, Array, Array], ...] = (
        ("corotational", e, small),
        ("finite", F - identity, large),
    )
    for kinematics, H, exact in measures:
        body = Imposed(setup, mixed_cube(), MATERIAL, kinematics)
        u = body.X @ H.T
        inside = ((body.X > 1e-9) & (body.X < 1.0 - 1e-9)).all(axis=1)
        # the transverse shear of wedge6 is in balance between wedges alone
        wedges = [block.conn.ravel() for block in body.solver.model.blocks if block.element == "wedge6"]
        inside &= ~np.isin(np.arange(len(u)), np.concatenate([[], *wedges]))
        left_over = float(np.linalg.norm(body.force(u)[inside], axis=1).max())
        scale = body.largest_element_force()
        stress = body.stress(u)
        known = exact[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
        worst = np.unravel_index(np.abs(stress - known).argmax(), stress.shape)
        rows += [
            Row(
                quantity=f"{kinematics}: largest force left on an inner node",
                exact=0.0,
                measured=(left_over,),
                unit="N",
                scale=scale,
                tolerance=setup.by_element(10.0, tet4=40.0) * EPSILON[setup.precision],
                why="ten units of round-off, as a share of the largest force of one element on a node; forty of "
                "tetrahedra, of which twenty meet at a node",
            ),
            Row(
                quantity=f"{kinematics}: stress farthest from exact, of 6 components at all nodes",
                exact=float(known[worst[1]]),
                measured=(float(stress[worst]),),
                unit="Pa",
                scale=float(np.abs(exact).max()),
                tolerance=10.0 * EPSILON["mixed"],
                why="ten units of round-off: stress is output in single precision",
            ),
        ]
    return rows


@case(
    group="elements",
    title="A block turns through 1,000 revolutions: no force, and forces that turn with it",
    reference="Objectivity: f(Q F) = Q f(F).",
)
def rigid_rotation(setup: Setup) -> list[Row]:
    """Unit cube of 7 cells turned about (0.6, 0, 0.8) by up to 1,000 revolutions; u = (Q - I) X."""
    body = Imposed(setup, patch(), MATERIAL)
    axis = np.array([0.6, 0.0, 0.8])
    strained = body.X + 0.02 * np.sin(3.0 * body.X[:, [1, 2, 0]])
    still = body.force(strained - body.X)
    count = setup.choose((1000,), (4000,))[0]
    revolutions = np.linspace(0.0, 999.0, count) + np.remainder(0.618 * np.arange(count), 1.0)
    unstrained, mismatch = [], []
    for angle in 2.0 * np.pi * revolutions:
        Q = turned(axis, angle)
        unstrained.append(np.linalg.norm(body.force(body.X @ Q.T - body.X), axis=1).max())
        force = body.force(strained @ Q.T - body.X)
        mismatch.append(np.linalg.norm(force - still @ Q.T, axis=1).max())
    round_off = EPSILON[setup.precision]
    return [
        Row(
            quantity="largest nodal force of the block without strain",
            exact=0.0,
            measured=(float(np.max(unstrained)),),
            unit="N",
            scale=MATERIAL.E * 1.0**2,
            tolerance=6.0 * round_off,
            why="six units of round-off, as shares of E h^2 with h = 1 m; nothing grows with the angle",
        ),
        Row(
            quantity="largest difference of the strained block's forces from the turned ones",
            exact=0.0,
            measured=(float(np.max(mismatch)),),
            unit="N",
            scale=MATERIAL.E * 1.0**2,
            tolerance=6.0 * round_off,
            why="the same",
        ),
    ]


def unconverged(gamma: float, precision: str) -> float:
    """Error of the rotation's fixed number of iterations in simple shear [-]: see `kernels/elements/rotation.py`."""
    stretch = 0.5 * (gamma + np.hypot(gamma, 2.0))
    for _ in range(2 if precision == "mixed" else 3):
        stretch = 0.5 * (stretch + 1.0 / stretch)
    return float(1.5 * (stretch - 1.0) ** 2)


@case(
    group="elements",
    title="Simple shear of one cube to 100 %",
    reference="Closed form of the co-rotational law: F = R U, P = R (2 G dev(U - I) + K tr(U - I) I).",
)
def simple_shear(setup: Setup) -> list[Row]:
    """Unit cube, u_x = gamma y; E = 1 MPa, nu = 0.25. The sheared face y = 1 m is pulled by P e_y."""
    from scipy.linalg import polar

    body = Imposed(setup, Mesh(CUBE, np.arange(8, dtype=np.int32)[None]), MATERIAL)
    top = body.X[:, 1] > 0.5
    rows = []
    for gamma in (0.1, 0.5, 1.0):
        F = np.eye(3) + gamma * np.outer([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        R, U = polar(F)
        strain = U - np.eye(3)
        mean = np.trace(strain) / 3.0 * np.eye(3)
        S = 2.0 * MATERIAL.shear_modulus * (strain - mean) + 3.0 * MATERIAL.bulk_modulus * mean
        force, stress = R @ S, R @ S @ R.T
        u = body.X @ (F - np.eye(3)).T
        pull = -body.force(u)[top].sum(axis=0)
        shown = body.stress(u).mean(axis=0)
        tolerance = 20.0 * EPSILON[setup.precision] + 3.0 * unconverged(gamma, setup.precision) / gamma
        why = "20 units of round-off, and what the iterations for R leave at this stretch; shares of E gamma"
        single = 4.0 * EPSILON["mixed"]
        values = (
            ("force along x", pull[0], force[0, 1], "N", tolerance, why),
            ("force along y", pull[1], force[1, 1], "N", tolerance, "the same"),
            ("stress xx", shown[0], stress[0, 0], "Pa", tolerance + single, "the same, output in single precision"),
            ("stress xy", shown[3], stress[0, 1], "Pa", tolerance + single, "the same, output in single precision"),
        )
        rows += [
            Row(
                quantity=f"{name}, gamma = {gamma}",
                exact=float(exact),
                measured=(float(measured),),
                unit=unit,
                scale=MATERIAL.E * gamma,
                tolerance=limit,
                why=reason,
            )
            for name, measured, exact, unit, limit, reason in values
        ]
    return rows
