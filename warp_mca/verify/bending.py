"""Owns the case of bending waves: Timoshenko's theory, and three-dimensional elasticity by Ritz's method beside it."""

from __future__ import annotations

import math

import numpy as np

from warp_mca.verify.case import Row, Setup, case
from warp_mca.verify.vibration import fitted_frequencies
from warp_mca.verify.waves import frequency

E, NU, RHO = 200e9, 0.3, 7800.0  # of the beam [Pa], [-], [kg/m^3]
SIDE, LENGTH = 0.02, 0.1  # [m]


def timoshenko(k: float, h: float) -> float:
    """Phase speed of bending waves in a beam of square section [m/s], the lower root of Timoshenko's equation.

    The shear coefficient is 5 (1 + nu) / (6 + 5 nu), by which Timoshenko matched the plane solution.

    Args:
        k: wavenumber [1/m].
        h: side of the section [m].
    """
    shear = 5.0 * (1.0 + NU) / (6.0 + 5.0 * NU) * E / (2.0 * (1.0 + NU))
    r2 = h * h / 12.0  # radius of gyration, squared
    # r2 rho^2 / shear c^4 - rho (1 + 1 / (r2 k^2) + E / shear) r2 c^2 + E r2 = 0, over r2
    b = 1.0 + 1.0 / (r2 * k * k) + E / shear
    return math.sqrt((b - math.sqrt(b * b - 4.0 * E / shear)) * shear / (2.0 * RHO))


def ritz(k: float, h: float, degree: int = 10) -> float:
    """Phase speed of the lowest bending wave in a bar of square section [m/s], by three-dimensional elasticity.

    Ritz's method: u_x = U cos(k x), u_y = V sin(k x), u_z = W sin(k x) with polynomials U, V, W over the section. They
    bound the speed from above; degree 12 lowers it by 4e-7.

    Args:
        k: wavenumber [1/m].
        h: side of the section [m].
        degree: of the polynomials.
    """
    from numpy.polynomial.legendre import Legendre, leggauss
    from scipy.linalg import eigh

    points, weights = leggauss(degree + 2)
    over_section = np.outer(weights, weights).ravel() * (0.5 * h) ** 2
    shapes = [Legendre.basis(n, domain=[-0.5 * h, 0.5 * h]) for n in range(degree + 1)]
    value = np.array([p(0.5 * h * points) for p in shapes])
    slope = np.array([p.deriv()(0.5 * h * points) for p in shapes])
    strain, displacement = [], []  # exx, eyy, ezz, gxy, gyz, gxz, and ux, uy, uz, at the points of the section
    # bending along y: U is odd in y and even in z, V is even in both, W is odd in both
    for component, (first_y, first_z) in enumerate(((1, 0), (0, 0), (1, 1))):
        for i in range(first_y, degree + 1, 2):
            for j in range(first_z, degree + 1 - i, 2):
                f = np.outer(value[i], value[j]).ravel()
                f_y, f_z = np.outer(slope[i], value[j]).ravel(), np.outer(value[i], slope[j]).ravel()
                o = np.zeros_like(f)
                of_component = ((-k * f, o, o, f_y, o, f_z), (o, f_y, o, k * f, f_z, o), (o, o, f_z, o, f_y, k * f))
                strain.append(of_component[component])
                displacement.append(tuple(f if c == component else o for c in range(3)))
    stiffness = np.zeros((6, 6))
    shear = E / (2.0 * (1.0 + NU))
    stiffness[:3, :3] = E * NU / ((1.0 + NU) * (1.0 - 2.0 * NU)) + 2.0 * shear * np.eye(3)
    stiffness[3:, 3:] = shear * np.eye(3)
    e, u = np.array(strain), np.array(displacement)
    K = np.einsum("aip,ij,bjp,p->ab", e, stiffness, e, over_section, optimize=True)
    M = RHO * np.einsum("aip,bip,p->ab", u, u, over_section, optimize=True)
    return math.sqrt(float(eigh(K, M, eigvals_only=True, subset_by_index=[0, 0])[0])) / k


def _measured(setup: Setup, section: int, axial: int, guesses: dict[int, float]) -> list[float]:
    """Phase speeds [m/s] of the standing waves with n half waves in the length, for each n and its guess."""
    scene = setup.scene(
        "ringing_bar",
        **{"motion": "across", "shape": "square", "thickness": SIDE, "length": LENGTH},
        **{"section": section, "axial": axial, "duration": 0.9e-3, "rows": 450},
    )
    result = setup.run(scene)
    path = result.paths[0]
    speeds = []
    for n, guess in guesses.items():
        k = n * math.pi / LENGTH
        amplitude = path.stress[:, :, 0].astype(np.float64) @ np.sin(k * path.position)
        near = frequency(result.time, amplitude, guess * k) / (2.0 * math.pi)
        speeds.append(2.0 * math.pi * float(fitted_frequencies(result.time, amplitude, (near,))[0]) / k)
    return speeds


@case(
    group="waves",
    title="Bending waves of a beam travel at the speeds of elasticity, to which Timoshenko's theory is near",
    reference="Timoshenko, Phil. Mag. 43 (1922) 125, shear coefficient 5 (1 + nu) / (6 + 5 nu); Kaneko, J. Phys. D 8 "
    "(1975) 1927; three-dimensional elasticity by Ritz's method with polynomials of degree 10 over the section.",
)
def timoshenko_wave(setup: Setup) -> list[Row]:
    """Beam of side h = 20 mm and length 5 h between planes of antisymmetry, one or three half waves in it."""
    quick = setup.by_element(((4, 40), (6, 60)), tet4=((4, 20), (6, 30)))  # cubes suit tetrahedra as well
    meshes = setup.choose(quick, ((4, 40), (6, 60), (8, 80)))
    c0 = math.sqrt(E / RHO)
    theory = {n: timoshenko(n * math.pi / LENGTH, SIDE) for n in (1, 3)}
    speeds = [_measured(setup, section, axial, theory) for section, axial in meshes]
    sizes = tuple(LENGTH / axial for _, axial in meshes)
    right = setup.choose((1.4,), (1.8,))[0]  # as between 4 and 6 layers, 6 and 8
    order = setup.by_element(1.9, hex8i=right, hex8r=right, tet4=1.6)
    rows = []
    for k, n in enumerate((1, 3)):
        wavenumber = n * math.pi / LENGTH
        measured, exact = tuple(found[k] / c0 for found in speeds), ritz(wavenumber, SIDE) / c0
        change = abs(measured[-1] - measured[-2]) / exact
        # a frequency is read to some 4e-4 of a period
        tolerance = change / ((sizes[-2] / sizes[-1]) ** order - 1.0) + 1e-4 / n
        apart = abs(exact - theory[n] / c0) / exact
        name = f"c / c0 at k h = {wavenumber * SIDE:.2f}"
        why = f"what order {order:g} leaves of the change from the mesh before, and {1e-4 / n:.1g} for the reading"
        below = f"the same, and {100.0 * apart:.2g} % by which the theory is below elasticity"
        # the errors of these with one half wave are not far above that of the reading
        least = None if setup.element in ("hex8i", "hex8r") and n == 1 else order
        rows += [
            Row(f"{name}, elasticity", exact, measured, "-", tolerance, why, sizes=sizes, least_order=least),
            Row(f"{name}, Timoshenko", theory[n] / c0, measured, "-", tolerance + apart, below),
        ]
    return rows
