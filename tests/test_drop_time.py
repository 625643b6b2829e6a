"""How long drops run: the contact that parts may have with the floor, beside closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.scene.drop_time import contact_time
from warp_mca.scene.extent import extent_of, mesh_of

SPEED = 4.0
SIDES = (0.03, 0.02, 0.015)
RUBBER = mca.library.EPDM_60
SOFT = mca.J2Bilinear(E=2e9, nu=0.3, rho=1000.0, sigma_y=5e6, E_t=0.0)
MARGIN = 1.25


def time_of(body: mca.Body, floor: mca.Elastic | None = None) -> float:
    return contact_time((body,), [mesh_of(body)], extent_of((body,)).mass, SPEED, floor)


def hertz(mass: float, radius: float, modulus: float) -> float:
    """Johnson, Contact Mechanics (1985), eq. 11.24: 2.87 (m^2 / (R E*^2 v))^(1/5) [s]."""
    return 2.87 * (mass**2 / (radius * modulus**2 * SPEED)) ** 0.2


@pytest.mark.parametrize("floor", [None, mca.Elastic(E=RUBBER.E, nu=RUBBER.nu, rho=RUBBER.rho)])
def test_an_elastic_ball_touches_for_the_time_of_hertz(floor: mca.Elastic | None):
    ball = mca.Body(name="ball", geometry=mca.Sphere(radius=0.01), material=RUBBER, kinematics="finite")
    modulus = RUBBER.E / (1.0 - RUBBER.nu**2) / (2.0 if floor else 1.0)
    expected = MARGIN * hertz(extent_of((ball,)).mass, 0.01, modulus)
    assert time_of(ball, floor) == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize("tetrahedra", [True, False])
def test_a_soft_corner_touches_until_it_is_crushed(tetrahedra: bool):
    """Its tip d^3 / (6 n_x n_y n_z) yields; the work grows as d^3, so that D / v0 1.402 pass."""
    block = mca.Box(size=SIDES, divisions=(6, 4, 3))
    geometry = block.build()
    if tetrahedra:
        split = np.array(((0, 1, 2, 6), (0, 2, 3, 6), (0, 3, 7, 6), (0, 7, 4, 6), (0, 4, 5, 6), (0, 5, 1, 6)))
        geometry = mca.Mesh(
            points=geometry.points,
            hexahedra=np.zeros((0, 8), np.int32),
            tetrahedra=geometry.hexahedra[:, split].reshape(-1, 4),
        )
    body = mca.drop_test(mca.Body(name="block", geometry=geometry, material=SOFT), height=1.0, pose="corner").bodies[0]
    mass, n = SOFT.rho * math.prod(SIDES), np.array(SIDES) / np.linalg.norm(SIDES)
    depth = (6.0 * n.prod() * 0.5 * mass * SPEED**2 / (1.5 * SOFT.sigma_y)) ** (1.0 / 3.0)
    load = depth / SPEED * math.sqrt(math.pi) * math.gamma(4.0 / 3.0) / math.gamma(5.0 / 6.0)
    section = depth**2 / (2.0 * n.prod())
    spring = 2.0 * SOFT.E / (1.0 - SOFT.nu**2) * math.sqrt(section / math.pi)
    expected = MARGIN * (load + 0.5 * math.pi * math.sqrt(mass / spring))
    assert time_of(body) == pytest.approx(expected, rel=0.03)


def test_a_drop_runs_for_its_contact_or_the_passes_of_waves_if_these_take_longer():
    """Of rubber by far, of a steel block on its face not."""
    passes = 20.0 * math.hypot(*SIDES) / 5000.0
    for material, pose, most in ((mca.library.STRUCTURAL_STEEL, "face", 1.0), (RUBBER, "face", 20.0)):
        kinematics = "finite" if material.finite_only else "corotational"
        block = mca.Box(size=SIDES, divisions=(6, 4, 3))
        body = mca.Body(name="block", geometry=block, material=material, kinematics=kinematics)
        impact = mca.drop_test(body, height=1.0, pose=pose).impact
        assert impact.output_interval == pytest.approx(impact.duration / 400)
        if most == 1.0:
            assert impact.duration == pytest.approx(passes)
        else:
            assert 5.0 * passes < impact.duration < most * passes


def test_a_rigid_body_on_a_rigid_floor_takes_no_time():
    block = mca.Body(name="block", geometry=mca.Box(size=SIDES, divisions=(1, 1, 1)), material=SOFT, rigid=True)
    assert time_of(block) < 1e-6
    assert contact_time((), (), 1.0, SPEED, None) == 0.0
