"""A material of the user's own whose yield stress rises with the strain rate: law, dataclass and its tests in one file.

sigma_y (1 + (rate / D)^(1 / q)), Cowper and Symonds, Brown University Applied Mathematics Report 28 (1957), with
`rate` that of the equivalent plastic strain. The law is a general one of `warp_mca.kernels.materials.laws`: the whole
stress of the whole strain, a history of its own, and the time step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from outside import holds_up, striking
from test_own_element import registered as linear_tets  # noqa: F401 (the plain tetrahedron of the user's own)

import warp_mca as mca
from warp_mca.kernels.hardware.scalars import scalars

HISTORY = ("deviator", "scalar", "scalar", "scalar")  # plastic strain, its equivalent, plastic work, yield stress
PLASTIC_ROW = 5
_ITERATIONS = 12  # of Newton's method, which comes from above: the residual is convex


@cache
def parameters(precision: str) -> Any:
    """The function (law, m, scale) -> (K, G, sigma_y, D, q)."""
    R = scalars(precision).real
    row = wp.types.vector(5, R)

    @wp.func
    def cowper_symonds(law: wp.array2d(dtype=R), m: int, scale: R):
        return row(law[m, 0], law[m, 1], law[m, 2], law[m, 3], law[m, 4])

    return cowper_symonds


@cache
def stress(precision: str) -> Any:
    """The function (strain, history, dt, c) -> (stress, history).

    With the trial stress q_t, x = sigma / sigma_y - 1 at the end of the step solves
    sigma_y (1 + x) + 3 G D dt x^q = q_t, where D dt x^q is the growth of the equivalent plastic strain.
    """
    t = scalars(precision)
    R, mat33, row, rows = t.real, t.mat33, wp.types.vector(5, t.real), wp.types.vector(8, t.real)

    @wp.func
    def plastic_strain(h: rows):
        return mat33(h[0], h[2], h[4], h[2], h[1], h[3], h[4], h[3], -h[0] - h[1])

    @wp.func
    def viscoplastic(strain: mat33, h: rows, dt: R, c: row):
        K = c[0]
        G = c[1]
        identity = wp.identity(n=3, dtype=R)
        mean = wp.trace(strain) / R(3.0)
        eps_p = plastic_strain(h)
        trial = R(2.0) * G * (strain - mean * identity - eps_p)
        q_t = wp.sqrt(R(1.5) * wp.ddot(trial, trial))
        new = h
        if dt > R(0.0) and q_t > c[2]:
            drop = R(3.0) * G * c[3] * dt
            beyond = q_t / c[2] - R(1.0)
            x = wp.min(beyond, wp.pow((q_t - c[2]) / drop, R(1.0) / c[4]))
            for _ in range(wp.static(_ITERATIONS)):
                power = wp.pow(x, c[4] - R(1.0))
                x -= (c[2] * (x - beyond) + drop * power * x) / (c[2] + drop * c[4] * power)
            p = h[5] + (q_t - c[2] * (R(1.0) + x)) / (R(3.0) * G)
            dp = p - h[5]  # what p takes of it: rounding does not add up
            eps_p += (R(1.5) * dp / q_t) * trial
            q = q_t - R(3.0) * G * dp
            before = wp.where(h[5] > R(0.0), h[7], c[2])
            work = h[6] + R(0.5) * (before + q) * dp
            new = rows(eps_p[0, 0], eps_p[1, 1], eps_p[0, 1], eps_p[1, 2], eps_p[0, 2], p, work, q)
        return R(2.0) * G * (strain - mean * identity - eps_p) + (R(3.0) * K * mean) * identity, new

    return viscoplastic


@cache
def energies(precision: str) -> Any:
    """The function (strain, history, c) -> (elastic energy, plastic work) [J/m^3]."""
    t = scalars(precision)
    R, mat33, row, rows = t.real, t.mat33, wp.types.vector(5, t.real), wp.types.vector(8, t.real)

    @wp.func
    def viscoplastic_energies(strain: mat33, h: rows, c: row):
        theta = wp.trace(strain)
        eps_p = mat33(h[0], h[2], h[4], h[2], h[1], h[3], h[4], h[3], -h[0] - h[1])
        e = strain - (theta / R(3.0)) * wp.identity(n=3, dtype=R) - eps_p
        return c[1] * wp.ddot(e, e) + R(0.5) * c[0] * theta * theta, h[6]

    return viscoplastic_energies


@dataclass(frozen=True, kw_only=True)
class OwnRates(mca.Elastic):
    """Yield stress sigma_y [Pa] at rest; at the rate D [1/s] of the plastic strain it is twice that."""

    sigma_y: float
    D: float
    q: float
    law = "test_own_rates"

    @property
    def parameters(self) -> tuple[float, ...]:
        """K, G, sigma_y [Pa], D [1/s], q [-]."""
        return *super().parameters, self.sigma_y, self.D, self.q


STEEL = OwnRates(E=210e9, nu=0.3, rho=7850.0, sigma_y=250e6, D=40.0, q=5.0)  # mild steel
DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
ELEMENTS = ["hex8", "hex8r", "linear_tet"]


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The one registration."""
    register(OwnRates)


def sheared(rate: float, element: str = "hex8", kinematics: str = "corotational") -> mca.Scene:
    """A layer of cells whose faces xmin and xmax slide on each other: simple shear gamma = rate t up to 2 %."""
    box = mca.Box(size=(1e-3, 2e-3, 2e-3), divisions=(1, 2, 2))
    layer = mca.Body(name="layer", geometry=box, material=STEEL, element=element, kinematics=kinematics)
    held = mca.Fixed(body="layer", nodes="xmin")
    driven = tuple(
        mca.Prescribed(body="layer", nodes="xmax", axis=axis, times=(0.0,), velocities=(v,))
        for axis, v in (("x", 0.0), ("y", rate * 1e-3), ("z", 0.0))
    )
    centre = mca.Line(body="layer", start=(0.0, 1e-3, 1e-3), end=(1e-3, 1e-3, 1e-3))
    duration = 0.02 / rate
    return mca.Scene(
        name="sheared",
        bodies=(layer,),
        fixed=(held,),
        prescribed=driven,
        paths=(mca.Path(name="centre", lines=(centre,), spacing=1e-3),),
        impact=mca.ImpactPhase(duration=duration, output_interval=duration / 50.0),
    )


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("rate", [2e2, 1e4])
def test_the_flow_stress_in_simple_shear_is_that_of_the_rate(rate: float, device: str):
    """The plastic strain grows by rate / sqrt(3); the ledger takes the work of the drive."""
    for element, kinematics in ((ELEMENTS[0], "finite"), *((name, "corotational") for name in ELEMENTS)):
        result = mca.run(sheared(rate, element, kinematics), device=device)
        found = np.sqrt(3.0) * result.paths[0].stress[-1, :, 3]
        expected = STEEL.sigma_y * (1.0 + (rate / np.sqrt(3.0) / STEEL.D) ** (1.0 / STEEL.q))
        assert np.abs(found) == pytest.approx(expected, rel=5e-3)
        assert result.summary["energy_error"] < 1e-4


def bar(element: str, material: mca.Elastic | None = None, speed: float = 20.0) -> mca.Scene:
    """A bar of the steel, which flows where it strikes."""
    box = mca.Box(size=(0.02, 0.005, 0.005), divisions=(6, 2, 2)).build()
    return striking(box, material or STEEL, speed, element=element)


@pytest.mark.parametrize("device", DEVICES)
def test_a_bar_flows_where_it_strikes_a_rigid_block(device: str, tmp_path: Path):
    result = holds_up(bar("hex8"), device, tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-3 and result["E_plastic"][-1] > 0.05 * result["E_kinetic"][0]


def test_an_element_with_nodal_pressure_is_refused():
    with pytest.raises(mca.RequestError, match=r"Body bar\.element = 'tet4': its material gives the pressure"):
        mca.run(bar("tet4"))
