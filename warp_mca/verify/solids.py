"""Owns static cases of solid bodies: the distorted patch, Cook's panel, and the pressure in squeezed rubber."""

from __future__ import annotations

import numpy as np

import warp_mca as mca
from warp_mca.geometry.cell_types import HEXAHEDRON
from warp_mca.physics.elements import ELEMENTS
from warp_mca.verify.case import EPSILON, Row, Setup, case, every, share_row
from warp_mca.verify.small_meshes import Array, brick
from warp_mca.verify.statics import Imposed, Statics, area_shares

COOK = {1.0 / 3.0: 23.96, 0.4999: 18.49}  # deflection of Cook's panel by Poisson's ratio [m]
RUBBER, SQUEEZED = 0.02, 2e-4  # edge of the rubber cube, and by how much it is shortened [m]
ENERGY, PRESSURE = 4.95e-4, 5.6e3  # of the rubber [J], within 1 %; in its middle [Pa], within 1.5 %
# What errors of elements other than the default may be: of deflections; of energy, pressure and its scatter.
COOK_ALLOWED = {
    "hex8": (0.055, 0.051),
    "hex8r": (0.014, 0.035),
    "tet4": (0.22, 0.42),
    "tet10": (0.02, 0.075),
}
RUBBER_ALLOWED = {
    "hex8r": (0.03, 0.04, 0.063),
    "hex8w": (0.03, 0.04, 0.063),
    "hex8w3": (0.03, 0.04, 0.063),
    "tet4": (0.17, 0.21, 1.14),
    "tet10": (0.04, 0.05, 0.5),
    "tet10_mean": (0.02, 0.03, 0.15),
}


def distorted(setup: Setup, seed: int = 1) -> float:
    """Greatest error of displacements within a cube whose skin is displaced linearly, as a share of the greatest [-].

    3 x 3 x 3 cells, of which inner nodes are moved by up to a fifth of an edge.
    """
    rng = np.random.default_rng(seed)

    def move(x: Array) -> Array:
        inside = ((x > 1e-9) & (x < 1.0 - 1e-9)).all(axis=1)
        x[inside] += 0.2 / 3.0 * rng.uniform(-1.0, 1.0, (inside.sum(), 3))
        return x

    mesh = brick(setup.element, (3, 3, 3), (1.0, 1.0, 1.0), move)
    statics = Statics(setup, mesh, mca.Elastic(E=1.0, nu=0.3, rho=1.0))
    X = statics.body.X
    exact = X @ rng.uniform(-1.0, 1.0, (3, 3))
    skin = np.any((X < 1e-9) | (X > 1.0 - 1e-9), axis=1)
    u = statics.solve(np.zeros_like(X), np.repeat(skin[:, None], 3, axis=1), exact)
    return float(np.abs(u - exact).max() / np.abs(exact).max())


def cook(setup: Setup, count: int, nu: float) -> float:
    """Error of the deflection of Cook's panel in the middle of its loaded edge [-], one layer of cells.

    Args:
        setup: with the element.
        count: cells along both edges.
        nu: 1/3, with free sides, or 0.4999, in plane strain [-].
    """

    def move(x: Array) -> Array:
        s, t = x[:, 0].copy(), x[:, 1].copy()
        x[:, 0], x[:, 1] = 48.0 * s, 44.0 * s + t * (44.0 - 28.0 * s)
        return x

    mesh = brick(setup.element, (count, count, 1), (1.0, 1.0, 1.0), move)
    statics = Statics(setup, mesh, mca.Elastic(E=1.0, nu=nu, rho=1.0))
    x, y, z = statics.body.X.T
    end, root = x > 48.0 - 1e-9, x < 1e-9
    share = area_shares(statics.body.mesh, end) / 16.0
    held = np.stack([root, root, (root & (z < 1e-9)) | (nu > 0.4)], axis=1)
    u = statics.solve(np.outer(share, [0.0, 1.0, 0.0]), held)
    return float(u[end & (np.abs(y - 52.0) < 1e-9), 1].mean() / COOK[nu] - 1.0)


def rubber(setup: Setup, count: int) -> tuple[float, float, float]:
    """A rubber cube squeezed between rough plates, E = 1 MPa, nu = 0.4999.

    Args:
        setup: with the element.
        count: cells along an edge.

    Returns:
        Error of the energy [-]; error of the pressure in the middle [-]; standard deviation of pressure in the middle
        as a share of it [-]: of points about a smooth course, or of means of elements that do not have eight of them.
    """
    mesh = brick(setup.element, (count, count, count), (RUBBER, RUBBER, RUBBER))
    statics = Statics(setup, mesh, mca.Elastic(E=1e6, nu=0.4999, rho=1e3))
    X = statics.body.X
    top, bottom = X[:, 1] > RUBBER - 1e-9, X[:, 1] < 1e-9
    given = np.outer(top, [0.0, -SQUEEZED, 0.0])
    u = statics.solve(np.zeros_like(X), np.repeat((top | bottom)[:, None], 3, axis=1), given)
    energy = 0.5 * float(u.ravel() @ (statics.K @ u.ravel()))
    place, pressure, points = pressures(statics.body, 1e-3 * u)
    near = (np.abs(place - 0.5 * RUBBER) < 0.205 * RUBBER).all(axis=1)
    p, course = 1e3 * pressure[near], np.zeros(1)
    if points:
        square = (place[near] / RUBBER - 0.5) ** 2
        even = np.column_stack([np.ones(len(p)), square, square * square[:, [1, 2, 0]], square**2])
        course = even @ np.linalg.lstsq(even, p, rcond=None)[0]
    return energy / ENERGY - 1.0, float(p.mean()) / PRESSURE - 1.0, float((p - course).std() / p.mean())


def pressures(body: Imposed, u: Array) -> tuple[Array, Array, bool]:
    """Where pressure is shown [m], shape (count, 3), how much at displacements u [Pa], and whether those are points."""
    body.settled(u)
    body.nodal_stress.find_corners(body.state, body.state.u)
    corner = -body.nodal_stress.points.numpy()[:3].sum(axis=0, dtype=np.float64) / 3.0
    natural = np.array(HEXAHEDRON.natural)
    shape = np.prod(1.0 + natural[:, None] * natural / np.sqrt(3.0), axis=2) / 8.0
    places, found, points = [], [], False
    for stage, element, first in body.nodal_stress.parts:
        shown = corner[first : first + stage.corners * len(element)].reshape(-1, stage.corners)
        x = body.X[stage.block.conn].transpose(1, 0, 2)
        points = stage.corners == stage.points == 8
        places.append((shape @ x).reshape(-1, 3) if points else x.mean(axis=1))
        found.append(shown.ravel() if points else shown.mean(axis=1))
    return np.concatenate(places), np.concatenate(found), points


@case(
    group="elements",
    title="Distorted cells find constant strain",
    reference="Patch test in three dimensions: the skin of a cube is displaced linearly, and so is its inside.",
    elements=every("wedge6"),
)
def distorted_patch(setup: Setup) -> list[Row]:
    """27 cells, the inner nodes moved by up to a fifth of an edge."""
    error, many = distorted(setup), setup.by_element(20.0, tet4=200.0, tet10=200.0, tet10_mean=200.0)
    why = "twenty units of round-off; two hundred of tetrahedra, of which many meet at a node"
    name = "greatest error of displacements inside, as a share of the greatest"
    return [Row(name, 0.0, (error,), "-", many * EPSILON[setup.precision], why, scale=1.0)]


@case(
    group="elements",
    title="Cook's panel deflects as it must",
    reference="Cook, J. Struct. Div. ASCE 100 (1974) 1851: 48 x 44 x 16, E = F = t = 1; 23.96 with nu = 1/3, 18.49 +- "
    "0.03 with nu = 0.4999 in plane strain, extrapolated.",
    elements=every("wedge6"),
)
def cook_panel(setup: Setup) -> list[Row]:
    """Eight cells along both edges, one layer."""
    allowed = setup.by_element((0.02, 0.04), **COOK_ALLOWED)
    return [
        share_row(
            f"deflection over exact, nu = {nu:.4g}", cook(setup, 8, nu), most, "error of 8 x 8 cells, and a tenth"
        )
        for nu, most in zip(COOK, allowed, strict=True)
    ]


def edge_cells(setup: Setup) -> int:
    """Cells along an edge of the rubber: fewer where each is cut to tetrahedra."""
    return 6 if ELEMENTS[setup.element].cell.startswith("tetra") else 10


@case(
    group="elements",
    title="Pressure in squeezed rubber is smooth",
    reference="Meshes of 6 to 16 cells an edge with hex8, with exact bending and with quadratic tetrahedra: 0.495 mJ "
    "within 1 %, 5.6 kPa in the middle within 1.5 %.",
    elements=every("wedge6"),
)
def rubber_cube(setup: Setup) -> list[Row]:
    """20 mm, E = 1 MPa, nu = 0.4999, shortened by 0.2 mm between rough plates."""
    count = edge_cells(setup)
    energy, pressure, scatter = rubber(setup, count)
    allowed = setup.by_element((0.035, 0.05, 0.03), **RUBBER_ALLOWED)
    why = f"error of {count} cells an edge, and of the reference"
    modes = "as measured, and a tenth; modes of pressure without resistance would be of its own size"
    name = "standard deviation of pressure in the middle, as a share of it"
    return [
        share_row("energy over the reference", energy, allowed[0], why),
        share_row("pressure in the middle over the reference", pressure, allowed[1], why),
        Row(name, 0.0, (scatter,), "-", allowed[2], modes, scale=1.0),
    ]
