"""Rigid bodies that turn: inertia of their nodes against that of their shape, and the word that is said about it."""

from __future__ import annotations

import math

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.runs.inertia_warnings import inertia_excess

HEAVY, LIGHT = mca.Elastic(E=1e9, nu=0.3, rho=2700.0), mca.Elastic(E=1e9, nu=0.3, rho=300.0)


def brick(n: int, **options: object) -> mca.Body:
    box = mca.Box(size=(0.1, 0.1, 0.1), divisions=(n, n, n))
    return mca.Body(name="brick", geometry=box, material=HEAVY, **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("n", [1, 2, 5])
def test_cells_of_a_cube_have_their_mass_in_the_corners(n: int):
    """Masses 1/2, 1, ..., 1, 1/2 at the n + 1 places along an edge: their second moment is L^2 / 12 (1 + 2 / n^2)."""
    body = brick(n, rotation=(0.3, 0.2, 0.1))
    assert inertia_excess(body, mca.Box(size=(0.1, 0.1, 0.1), divisions=(n, n, n)).build()) == pytest.approx(2.0 / n**2)


def test_tetrahedra_too():
    """Corners of one tetrahedron hold V / 4 each: S = V / 4 sum x x^T, in place of V / 20 about the centre."""
    points = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build().points[[0, 1, 2, 4]]
    mesh = mca.Mesh(points, np.zeros((0, 8), np.int32), tetrahedra=np.array([[0, 1, 2, 3]], np.int32))
    body = mca.Body(name="tet", geometry=mesh, material={"*": LIGHT})
    assert inertia_excess(body, mesh) == pytest.approx(4.0)


def spun(n: int, **motion: tuple[float, float, float]) -> list[str]:
    scene = mca.Scene(
        name="spun",
        bodies=(brick(n, rigid=True, **motion),),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6),
    )
    return [text for text in mca.run(scene, device="cpu").warnings if "inertia" in text]


def test_a_word_is_said_where_the_body_turns():
    fast, slow = (0.0, 0.0, 50.0), (0.0, 0.0, 0.1)
    (text,) = spun(2, angular_velocity=fast)
    assert "rigid body brick turns" in text and "50.0% above" in text
    assert spun(2, velocity=(1.0, 0.0, 0.0)) == []
    assert spun(2, velocity=(1.0, 0.0, 0.0), angular_velocity=slow) == []
    assert spun(math.ceil(math.sqrt(2.0 / 0.02)) + 1, angular_velocity=fast) == []
