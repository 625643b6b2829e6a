"""`hex8w`: the direction through the wall is found or named, and a wall of one layer has its plastic moment."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from impacts import begun, figures, finished, result_of
from scipy.spatial.transform import Rotation
from test_elements import held_of

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.degenerate import stored
from warp_mca.geometry.hexahedron import CORNERS
from warp_mca.geometry.mesh import Mesh
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.cells import body_cells

METAL = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=5e3, E_t=0.0)
SIZE = (0.05, 0.01, 0.002)
TURNS = [  # all orders of the corners of a right-handed hexahedron
    [np.flatnonzero((corner == CORNERS @ turn.T).all(axis=1))[0] for corner in CORNERS]
    for turn in np.round(Rotation.create_group("O").as_matrix())
]


def shuffled(mesh: Mesh, seed: int = 0) -> Mesh:
    """With the corners of each cell in some right-handed order."""
    choice = np.random.default_rng(seed).integers(24, size=len(mesh.hexahedra))
    return dataclasses.replace(mesh, hexahedra=np.take_along_axis(mesh.hexahedra, np.array(TURNS)[choice], axis=1))


def across(mesh: Mesh, element: str = "hex8w", **named) -> np.ndarray:
    """Mean edge of each cell along its third direction, shape (cell_count, 3)."""
    body = mca.Body(name="b", geometry=mesh, material=METAL, element=element, **named)
    (cells,) = body_cells(body, mesh)
    x = mesh.points[cells.conn]
    assert (np.linalg.det(np.einsum("ai,naj->nij", CORNERS, x)) > 0.0).all()
    return np.einsum("a,naj->nj", CORNERS[:, 2], x) / 4.0


@pytest.mark.parametrize("divisions", [(10, 4, 1), (10, 1, 1), (12, 5, 2)])
def test_the_direction_through_a_wall_is_found_whatever_the_order_of_the_corners(divisions):
    mesh = shuffled(mca.Box(size=SIZE, divisions=divisions).build())
    turn = Rotation.from_rotvec([0.7, -0.4, 1.1]).as_matrix()
    edge = across(dataclasses.replace(mesh, points=mesh.points @ turn.T)) @ turn
    np.testing.assert_allclose(np.abs(edge), [[0.0, 0.0, SIZE[2] / divisions[2]]] * len(edge), atol=1e-12)


def test_neighbours_agree_where_some_cells_are_shorter_in_another_direction():
    """Three layers, so that no cell has both faces on the surface; a tenth of the columns is shorter than thick."""
    box = mca.Box(size=(1.0, 0.3, 0.09), divisions=(20, 6, 3)).build()
    x = box.points.copy()
    x[:, 0] = np.where(x[:, 0] < 0.1, x[:, 0] * 0.4, 0.04 + (x[:, 0] - 0.1) * 0.96 / 0.9)
    edge = across(shuffled(dataclasses.replace(box, points=x)))
    np.testing.assert_allclose(np.abs(edge), [[0.0, 0.0, 0.03]] * len(edge), atol=1e-12)


def test_the_direction_follows_a_tube():
    box = mca.Box(size=(1.0, 0.3, 0.02), divisions=(24, 4, 1)).build()
    angle, radius = box.points[:, 0] * 5.0, 0.2 + box.points[:, 2]
    mesh = dataclasses.replace(
        box, points=np.column_stack([radius * np.sin(angle), box.points[:, 1], radius * np.cos(angle)])
    )
    edge = across(shuffled(mesh))
    np.testing.assert_allclose(np.linalg.norm(edge, axis=1), 0.02, rtol=1e-2)
    np.testing.assert_allclose(edge[:, 1], 0.0, atol=1e-12)


def test_the_direction_can_be_named():
    mesh = shuffled(mca.Box(size=SIZE, divisions=(10, 4, 1)).build())
    edge = across(mesh, across=(0.0, -2.0, 0.1))
    np.testing.assert_allclose(np.abs(edge), [[0.0, SIZE[1] / 4, 0.0]] * len(edge), atol=1e-12)


def test_a_direction_that_does_not_fit_is_refused():
    mesh = mca.Box(size=SIZE, divisions=(10, 4, 1)).build()
    with pytest.raises(
        RequestError, match=r"Body b.across = \(1.0, 1.0, 1.0\): 40 of its cells have no edges within 45"
    ):
        across(mesh, across=(1, 1, 1))
    with pytest.raises(
        RequestError, match=r"Body b.across = \(0.0, 0.0, 1.0\): hex8i has no direction .* hex8w or hex8w3"
    ):
        across(mesh, "hex8i", across=(0, 0, 1))
    with pytest.raises(RequestError, match=r"Body b.across = \(0.0, 0.0, 0.0\): give a direction other than zero"):
        across(mesh, across=(0, 0, 0))


def test_edges_that_collapsed_are_not_across():
    """Wedges stored as hexahedra, flat along their collapsed edges: the shortest edges that are left are across."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0.2], [1, 0, 0.2], [0, 1, 0.2]], dtype=float)
    mesh = Mesh(points=points, hexahedra=stored(points, np.arange(6)[None], "wedge"))
    element = ELEMENTS["hex8w"]
    body = mca.Body(name="b", geometry=mesh, material=METAL, element="hex8w")
    for turn in TURNS:
        conn = mesh.hexahedra[:, turn]
        turned = element.oriented(body, dataclasses.replace(mesh, hexahedra=conn), conn, np.array([0], dtype=np.int32))
        edge = points[turned[0, 4:]] - points[turned[0, :4]]
        np.testing.assert_allclose(np.abs(edge), [[0.0, 0.0, 0.2]] * 4, atol=1e-15)


def plastic_moment(mesh: Mesh, element: str, turn: np.ndarray, kinematics: str = "corotational") -> float:
    """Moment of a strip bent to forty times the yield curvature, over that of full flow [-].

    Its ends' cross sections turn as planes, strains of bending across are free: displacements are those of a beam with
    nu = 1/2 after flow, which the cells have exactly; virtual work with bending about y gives the moment.
    """
    held = held_of(dataclasses.replace(mesh, points=mesh.points @ turn.T), element, kinematics, material=METAL)
    x, y, z = (mesh.points - [0.0, 0.5 * SIZE[1], 0.5 * SIZE[2]]).T
    way = np.column_stack([z * x, -0.5 * z * y, -0.5 * x**2 + 0.25 * (y**2 - z**2)])
    curvature = METAL.sigma_y / METAL.E * 2.0 / SIZE[2]
    for step in np.linspace(0.0, 40.0, 400)[1:]:
        force = held.forces(step * curvature * way @ turn.T)
    moment = -(force * (way @ turn.T)).sum() / SIZE[0]
    return float(moment / (METAL.sigma_y * SIZE[1] * SIZE[2] ** 2 / 4.0))


IDENTITY, TILTED = np.eye(3), Rotation.from_rotvec([0.7, -0.4, 1.1]).as_matrix()


@pytest.mark.parametrize(
    ("element", "layers", "expected"),
    [("hex8i", 1, 2.0 / 3.0**0.5), ("hex8i", 2, 1.0), ("hex8w", 1, 1.0), ("hex8w3", 1, 1.0)],
)
def test_plastic_moment_of_a_strip(element: str, layers: int, expected: float):
    """The points' sum of |zeta| over that of the section, 1/2: 15.5 % too much with two points of Gauss."""
    mesh = mca.Box(size=SIZE, divisions=(5, 1, layers)).build()
    plain = plastic_moment(mesh, element, IDENTITY)
    assert plain == pytest.approx(expected, rel=0.02)
    assert plastic_moment(shuffled(mesh), element, TILTED) == pytest.approx(plain, rel=1e-3)


def cantilever(mesh: Mesh, element: str, kinematics: str = "corotational", **named) -> mca.Scene:
    """A clamped bar of one layer under 1.2 times the weight of collapse, set on at once."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=50e6, E_t=7e8)
    body = mca.Body(name="bar", geometry=mesh, material=metal, element=element, kinematics=kinematics, **named)
    gravity = 1.2 * metal.sigma_y * SIZE[2] / (2.0 * metal.rho * SIZE[0] ** 2)
    return mca.Scene(
        name="cantilever",
        bodies=(body,),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        gravity=(0.0, 0.0, -gravity),
        impact=mca.ImpactPhase(duration=1.2e-3, output_interval=2e-5),
        paths=(
            mca.Path(
                name="top",
                lines=(mca.Line(body="bar", start=(0.0, 0.005, 0.002), end=(0.04, 0.005, 0.002)),),
                spacing=0.004,
            ),
        ),
        probes=(mca.Probe(name="tip", body="bar", nodes="xmax"),),
    )


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("element", ["hex8i", "hex8w"])
def test_energy_balance_where_a_wall_yields_in_bending(element: str, kinematics: str):
    """What internal vectors lag by, over the greatest internal energy."""
    mesh = mca.Box(size=SIZE, divisions=(12, 2, 1)).build()
    result = result_of(finished(cantilever(mesh, element, kinematics)))
    E_plastic, E_internal = result.history["E_plastic"].max(), result.history["E_internal"].max()
    assert E_plastic > 0.5 * E_internal > 0.0
    assert np.abs(result.history["E_total_error"]).max() < 1e-3 * E_internal


def test_a_run_does_not_depend_on_the_order_of_the_corners(tmp_path):
    """Histories and stress along a path; bits where cells are in order, and where the run goes on from a state."""
    mesh = mca.Box(size=SIZE, divisions=(12, 2, 1)).build()
    plain, turned = (figures(finished(cantilever(m, "hex8w"), precision="float64")) for m in (mesh, shuffled(mesh)))
    named = figures(finished(cantilever(mesh, "hex8w", across=(0.0, 0.0, 1.0)), precision="float64"))
    for name, value in plain.items():
        np.testing.assert_array_equal(named[name], value)
        np.testing.assert_allclose(turned[name], value, rtol=0.0, atol=1e-6 * np.abs(value).max())
    part, whole = begun(cantilever(shuffled(mesh), "hex8w")), finished(cantilever(shuffled(mesh), "hex8w"))
    part.advance(20)
    part.save(tmp_path / "state")
    rest = begun(cantilever(shuffled(mesh), "hex8w"))
    rest.load(tmp_path / "state")
    rest.advance()
    np.testing.assert_array_equal(rest.state.u.numpy(), whole.state.u.numpy())
    both = begun(cantilever(mesh, "hex8w"), cantilever(shuffled(mesh), "hex8w"))
    both.advance()
    count = len(mesh.points)
    np.testing.assert_array_equal(both.state.u.numpy()[count:], whole.state.u.numpy())
