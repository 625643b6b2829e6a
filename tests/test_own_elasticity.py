"""A material of the user's own with elasticity of its own and no history: isotropic, but stiffer along fibres.

The energy lambda tr(e)^2 / 2 + mu e : e + E_f (a . e a)^2 / 2 with fibres along a = (1, 0, 0) of the reference.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation
from test_elements import energy, held_of
from test_own_element import registered as plain_tetrahedra  # noqa: F401 (a fixture)

import warp_mca as mca
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.step.output import NodalStress
from warp_mca.step.state_figures import max_plastic_strain

HISTORY = ()


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (lambda, mu, E_f)."""
    t = scalars(precision)
    R, vec3 = t.real, t.vec3

    @wp.func
    def fibred(law: wp.array2d(dtype=R), m: int, scale: R):
        return vec3(law[m, 3], law[m, 4], law[m, 5])

    return fibred


@cache
def stress(precision: str) -> Any:
    """The function (strain, history, dt, c) -> (stress, history)."""
    t = scalars(precision)
    R, vec3, mat33, none = t.real, t.vec3, t.mat33, wp.types.vector(1, t.real)

    @wp.func
    def fibre_stress(strain: mat33, h: none, dt: R, c: vec3):
        sigma = (c[0] * wp.trace(strain)) * wp.identity(n=3, dtype=R) + (R(2.0) * c[1]) * strain
        sigma[0, 0] = sigma[0, 0] + c[2] * strain[0, 0]
        return sigma, h

    return fibre_stress


@cache
def energies(precision: str) -> Any:
    """The function (strain, history, c) -> (stored, dissipated) [J/m^3]."""
    t = scalars(precision)
    R, vec3, mat33, none = t.real, t.vec3, t.mat33, wp.types.vector(1, t.real)

    @wp.func
    def fibre_energies(strain: mat33, h: none, c: vec3):
        theta = wp.trace(strain)
        stored = R(0.5) * (c[0] * theta * theta + c[2] * strain[0, 0] * strain[0, 0])
        return stored + c[1] * wp.ddot(strain, strain), R(0.0)

    return fibre_energies


@dataclass(frozen=True, kw_only=True)
class Fibred(mca.Elastic):
    """Elastic, and stiffer by E_f [Pa] along x."""

    E_f: float
    law = "test_own_elasticity"

    @property
    def bulk_modulus(self) -> float:
        """Bound of K [Pa]: the stiffness along the fibres less 4 G / 3."""
        return super().bulk_modulus + self.E_f

    @property
    def parameters(self) -> tuple[float, ...]:
        """Bounds of K and G, no yield stress, then lambda, mu and E_f [Pa]."""
        mu = self.shear_modulus
        return self.bulk_modulus, mu, np.inf, super().bulk_modulus - 2.0 / 3.0 * mu, mu, self.E_f


WOOD = Fibred(E=1e9, nu=0.3, rho=500.0, E_f=10e9)
KINDS = [
    ("hex8", "corotational", 5e-3),
    ("hex8", "finite", 1e-6),
    ("hex8r", "corotational", 5e-3),
    ("linear_tet", "finite", 1e-6),
    ("tet10", "corotational", 1e-2),
    ("tet10", "finite", 1e-6),
    ("tet10_mean", "finite", 1e-6),
]


def cube() -> mca.Mesh:
    """Eight distorted cells."""
    box = mca.Box(size=(1.0, 0.8, 1.2), divisions=(2, 2, 2)).build()
    return replace(box, points=box.points + np.random.default_rng(3).uniform(-0.06, 0.06, box.points.shape))


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The one registration."""
    register(Fibred)


@pytest.mark.parametrize(("element", "kinematics", "tolerance"), KINDS)
def test_forces_are_the_slope_of_the_energy_in_any_orientation(element: str, kinematics: str, tolerance: float):
    rng = np.random.default_rng(0)
    held = held_of(cube(), element, kinematics, material=WOOD)
    X = held.solver.model.X
    u = Rotation.from_rotvec([0.7, -1.1, 0.4]).apply(X) - X + 3e-4 * rng.uniform(-1.0, 1.0, X.shape)
    force, way, h = held.forces(u), rng.normal(size=X.shape), 1e-7
    slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
    assert -np.sum(force * way) == pytest.approx(slope, rel=tolerance)
    assert max_plastic_strain(held.solver, held.state) == 0.0 and not held.energies()[1].any()


@pytest.mark.parametrize(("element", "kinematics", "tolerance"), KINDS)
def test_uniform_strain_gives_the_stress_of_the_law(element: str, kinematics: str, tolerance: float):
    held = held_of(cube(), element, kinematics, material=WOOD)
    X = held.solver.model.X
    strain = 1e-6 * np.array([[3.0, 1.0, -2.0], [1.0, -1.0, 0.5], [-2.0, 0.5, 2.0]])
    held.forces(X @ strain)
    recorded = NodalStress(held.solver, np.arange(len(X), dtype=np.int32))
    recorded.launch(held.state)
    _, mu, _, lame, _, E_f = WOOD.parameters
    sigma = lame * np.trace(strain) * np.eye(3) + 2.0 * mu * strain
    sigma[0, 0] += E_f * strain[0, 0]
    expected = sigma[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(recorded.tensor.numpy(), np.tile(expected, (len(X), 1)), rtol=3e-5)
