"""Bodies that turn: inertia of their nodes against that of their shape, and the word that is said about it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.watch.inertia import inertias

STIFF, LIGHT = mca.Elastic(E=1e9, nu=0.3, rho=2700.0), mca.Elastic(E=1e9, nu=0.3, rho=300.0)
ENOUGH = math.ceil(math.sqrt(2.0 / 0.02)) + 1  # cells along each edge of a cube


def brick(
    divisions: tuple[int, int, int] = (2, 2, 2), size: tuple[float, float, float] = (0.1, 0.1, 0.1), **options: Any
) -> mca.Body:
    x, y, z = size
    box = mca.Box(size=size, divisions=divisions, origin=(-0.5 * x, -0.5 * y, -0.5 * z))
    return mca.Body(name="brick", geometry=box, material=STIFF, **options)


def excess(body: mca.Body, mesh: mca.Mesh) -> float:
    volume, nodes = inertias(body, mesh)
    return float(np.linalg.eigvals(np.linalg.solve(volume, nodes)).real.max() - 1.0)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_cells_of_a_cube_have_their_mass_in_the_corners(n: int):
    """Masses 1/2, 1, ..., 1, 1/2 at the n + 1 places along an edge: their second moment is L^2 / 12 (1 + 2 / n^2)."""
    body = brick((n, n, n), rotation=(0.3, 0.2, 0.1))
    assert excess(body, body.geometry.build()) == pytest.approx(2.0 / n**2)  # type: ignore[union-attr]


def test_tetrahedra_too():
    """Corners of one tetrahedron hold V / 4 each: S = V / 4 sum x x^T, in place of V / 20 about the centre."""
    points = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build().points[[0, 1, 2, 4]]
    mesh = mca.Mesh(points, np.zeros((0, 8), np.int32), tetrahedra=np.array([[0, 1, 2, 3]], np.int32))
    assert excess(mca.Body(name="tet", geometry=mesh, material={"*": LIGHT}), mesh) == pytest.approx(4.0)


@pytest.mark.parametrize("element", ["hex8i", "hex8"])
def test_wedges_too(element: str):
    """Two halves of a unit cube about its centre: rho / 6 about each axis, whatever computes them."""
    points = mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build().points
    halves = np.array([[0, 1, 3, 3, 4, 5, 7, 7], [0, 3, 2, 2, 4, 7, 6, 6]], np.int32)
    body = mca.Body(name="halves", geometry=mca.Mesh(points, halves), material=LIGHT, element=element)
    assert inertias(body, body.geometry)[0] == pytest.approx(300.0 / 6.0 * np.eye(3), abs=1e-9)  # type: ignore[arg-type]


BALL = mca.Sphere(radius=0.01, section=4, ring=2, pole_layers=4)
ROD = mca.Rod(radius=0.005, length=0.05, tip="flat", section=4, ring=2)


@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10"])
@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(
    ("recipe", "expected", "within"),
    [
        (BALL, [0.4 * 0.01**2] * 3, 0.02),
        (mca.Sphere(radius=0.02), [0.4 * 0.02**2] * 3, 0.01),
        (ROD, [0.5 * 0.005**2, *[0.05**2 / 12.0 + 0.25 * 0.005**2] * 2], 0.01),
    ],
)
def test_the_shape_of_a_round_body_has_its_own_inertia(
    recipe: Any, expected: list[float], within: float, exact: bool, element: str
):
    """2 m R^2 / 5 of a ball, m R^2 / 2 and m (L^2 / 12 + R^2 / 4) of a cylinder, whatever the cells leave out."""
    body = mca.Body(name="b", geometry=recipe, material=STIFF, exact_mass=exact, element=element)
    scene = mca.Scene(name="s", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6, output_interval=1e-6))
    mesh = mca.mesh(scene)["b"]
    mass = 2700.0 * (recipe.volume if exact else recipe.volume / float(mca.mesh(scene)["b"].volume_ratio[0]))
    assert np.diag(inertias(body, mesh)[0]) == pytest.approx(mass * np.array(expected), rel=within)


def told(*bodies: mca.Body, duration: float = 1e-5, **options: Any) -> list[float]:
    """Excess that each warning of a run names [-]."""
    phase = mca.ImpactPhase(duration=duration, output_interval=duration / 10)
    result = mca.run(mca.Scene(name="spun", bodies=bodies, impact=phase, **options), device="cpu")
    texts = [text for text in result.warnings if "moment of inertia" in text]
    assert all(text.startswith("rigid body") == bodies[0].rigid for text in texts)
    return [float(text.split("nodes is ")[1].split("%")[0]) / 100.0 for text in texts]


@pytest.mark.parametrize("rigid", [True, False])
def test_a_word_is_said_where_the_body_turns(rigid: bool):
    fast, slow = (0.0, 0.0, 50.0), (0.0, 0.0, 0.1)
    assert told(brick(rigid=rigid, angular_velocity=fast)) == [0.5]
    assert told(brick(rigid=rigid, angular_velocity=fast, velocity=(1.0, 0.0, 0.0), rotation=(0.5, 1.0, 0.2))) == [0.5]
    assert told(brick(rigid=rigid, velocity=(1.0, 0.0, 0.0))) == []
    assert told(brick(rigid=rigid, velocity=(1.0, 0.0, 0.0), angular_velocity=slow)) == []
    assert told(brick((ENOUGH,) * 3, rigid=rigid, angular_velocity=fast)) == []


@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize(("axis", "expected"), [((1.0, 0.0, 0.0), [2.0]), ((0.0, 0.0, 1.0), []), ((0.0, 1.0, 0.0), [])])
def test_the_axis_counts_about_which_it_turns(rigid: bool, axis: Any, expected: list[float]):
    """A bar of one cell in its section: about its own axis 2 / 1^2, across it next to nothing."""
    rotation = 0.4
    turn = np.array(
        [[math.cos(rotation), -math.sin(rotation), 0], [math.sin(rotation), math.cos(rotation), 0], [0, 0, 1]]
    )
    rate = tuple(float(w) for w in 20.0 * turn @ axis)
    bar = brick((20, 1, 1), (0.4, 0.02, 0.02), rigid=rigid, rotation=(0.0, 0.0, rotation), angular_velocity=rate)
    assert told(bar) == expected


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize(("recipe", "count"), [(mca.Sphere(radius=0.01), 0), (BALL, 1), (ROD, 0)])
def test_round_bodies_are_held_to_their_round_shape(recipe: Any, count: int, exact: bool):
    body = mca.Body(name="b", geometry=recipe, material=STIFF, angular_velocity=(0.0, 0.0, 99.0), exact_mass=exact)
    assert len(told(body)) == count


@pytest.mark.parametrize("rigid", [True, False])
@pytest.mark.parametrize("n", [2, 4])
def test_a_hinge_adds_the_inertia_of_the_centre(rigid: bool, n: int):
    """A cube hinged at an edge: J = m a^2 / 6 about the centre, which lumping raises, and m a^2 / 2 more, exact."""
    cube = brick((n, n, n), rigid=rigid, angular_velocity=(0.0, 0.0, 20.0), velocity=(1.0, -1.0, 0.0))
    hinge = mca.Revolute(name="O", body="brick", at=(0.05, 0.05, 0.0))
    assert told(cube, joints=(hinge,)) == [pytest.approx(2.0 / n**2 / 4.0, abs=5e-4)]


def test_fixed_nodes_are_a_hinge_or_a_plane_of_symmetry():
    cube = mca.Box(size=(0.1, 0.1, 0.1), divisions=(2, 2, 2))
    mesh = cube.build()
    edge = np.intersect1d(mesh.nodes("xmin"), mesh.nodes("ymin")).astype(np.int32)
    mesh = mca.Mesh(mesh.points, mesh.hexahedra, {**mesh.node_sets, "edge": edge})
    body = mca.Body(name="brick", geometry=mesh, material=STIFF, angular_velocity=(0.0, 0.0, 20.0))
    assert told(body, fixed=(mca.Fixed(body="brick", nodes="edge"),)) == [pytest.approx(0.125, abs=5e-4)]
    assert told(body, fixed=(mca.Fixed(body="brick", nodes="zmin", axes="z"),)) == [0.5]


def test_bodies_that_cannot_turn_are_not_judged():
    """A clamped bar bends, and a block at rest rocks on its contact springs."""
    bar = brick((10, 2, 2), (0.2, 0.02, 0.02), velocity=(0.0, 0.0, 0.0))
    kick = mca.Prescribed(body="brick", nodes="xmax", axis="y", times=(0.0, 1e-4), velocities=(5.0, 5.0))
    assert told(bar, fixed=(mca.Fixed(body="brick", nodes="xmin"),), prescribed=(kick,), duration=2e-4) == []
    block = brick((2, 2, 2), position=(0.0, 0.05, 0.0), velocity=(0.2, 0.0, 0.0))
    floor = mca.Contact(slave=mca.Surface(body="brick", nodes="ymin"), master=mca.RigidPlane(), mu=0.5)
    assert told(block, contacts=(floor,), gravity=(0.0, -9.81, 0.0), duration=0.01) == []


@pytest.mark.parametrize(("n", "expected"), [(2, [0.5]), (4, [0.125])])
def test_a_cube_that_falls_on_an_edge_turns(n: int, expected: list[float]):
    tilt = math.radians(30.0)
    low = 0.05 * (math.cos(tilt) + math.sin(tilt))
    cube = brick((n, n, n), rotation=(0.0, 0.0, tilt), position=(0.0, low + 1e-5, 0.0), velocity=(0.0, -1.0, 0.0))
    floor = mca.Contact(slave=mca.Surface(body="brick", nodes="boundary"), master=mca.RigidPlane(), mu=0.0, penalty=0.3)
    assert told(cube, contacts=(floor,), duration=2e-3) == expected
