"""The wedge with assumed transverse shear: patches, plates and beams of one layer, plastic bending, impacts."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from outside import holds_up, striking
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation
from test_bending import grid
from test_elements import STEEL, held_of

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.geometry.mesh import Mesh
from warp_mca.physics.elements import ELEMENTS
from warp_mca.recorders import VtkHdfFile
from warp_mca.step.output import NodalStress
from warp_mca.verify.small_meshes import mixed_cube

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


def in_plan(mesh: Mesh, share: float) -> Mesh:
    """The mesh with columns of inner nodes moved in x and y, by a share of the smallest distance of nodes."""
    flat, size = mesh.points[:, :2], np.ptp(mesh.points[:, :2], axis=0)
    edge = size / [len(np.unique(mesh.points[:, k])) - 1 for k in range(2)]
    inner = (flat > 1e-6 * size) & (flat < (1.0 - 1e-6) * size)
    column = np.rint(flat / edge).astype(int)
    moved = np.random.default_rng(2).uniform(-share, share, (*(column.max(axis=0) + 1), 2))[*column.T]
    return replace(mesh, points=mesh.points + np.pad(moved * edge * inner, ((0, 0), (0, 1))))


def leaning() -> Mesh:
    """Two layers of wedges on irregular triangles, whose parallel columns lean and lie askew in space."""
    mesh = in_plan(grid((3.0, 3.0, 2.0), (3, 3, 2), "deep"), 0.25)
    points = mesh.points + mesh.points[:, 2:] * [0.3, -0.2, 0.0]
    return replace(mesh, points=Rotation.from_rotvec([0.4, -0.8, 0.3]).apply(points))


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_parallel_wedges_carry_constant_strain(kinematics: str):
    """No force on inner nodes, 10 % strain at most; at small strain Hooke's stress at every node."""
    mesh = leaning()
    held = held_of(mesh, "wedge6", kinematics)
    strain = np.array([[3.0, 1.0, -2.0], [1.0, -1.0, 0.5], [-2.0, 0.5, 2.0]])
    force = held.forces(0.03 * mesh.points @ strain)
    inside = np.setdiff1d(np.arange(len(mesh.points)), mesh.boundary[0])
    assert len(inside) == 4
    assert np.abs(force[inside]).max() < 1e-12 * np.abs(force).max()
    held.forces(1e-6 * mesh.points @ strain)
    recorded = NodalStress(held.solver, np.arange(len(mesh.points), dtype=np.int32))
    recorded.launch(held.state)
    stress = 2.0 * STEEL.shear_modulus * strain
    stress += (STEEL.bulk_modulus - 2.0 / 3.0 * STEEL.shear_modulus) * np.trace(strain) * np.eye(3)
    expected = 1e-6 * stress[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(recorded.tensor.numpy(), np.tile(expected, (len(mesh.points), 1)), rtol=3e-5)


@pytest.mark.parametrize("law", ["elastic", "plastic"])
def test_angular_momentum_is_kept_at_finite_strain(law: str):
    """At strains of 20 % forces have no moment about any axis: they are the slope of an energy that turns with them."""
    mesh = leaning()
    metal = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=300e6, E_t=2e9)
    held = held_of(mesh, "wedge6", "finite", material=STEEL if law == "elastic" else metal)
    u = 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, mesh.points.shape)
    force = held.forces(u)
    moment = np.cross(mesh.points + u, force)
    assert np.abs(moment.sum(axis=0)).max() < 1e-12 * np.abs(moment).sum()


def stiffness_of(mesh: Mesh, metal: mca.Elastic) -> coo_array:
    """Of a body of wedges [N/m], shape (3 node_count, 3 node_count)."""
    cells = mesh.hexahedra[:, [0, 1, 2, 4, 5, 6]]
    K, G = np.full(len(cells), metal.bulk_modulus), np.full(len(cells), metal.shear_modulus)
    own = ELEMENTS["wedge6"].stiffness(mesh.points[cells], K, G, np.ones(cells.shape))
    assert (np.linalg.eigvalsh(own[0]) > 1e-9 * np.trace(own[0])).sum() == 12  # all but rigid motion
    row = (3 * cells[:, :, None] + np.arange(3)).reshape(len(cells), 18)
    entries = own.ravel(), (np.repeat(row, 18, axis=1).ravel(), np.tile(row, (1, 18)).ravel())
    return coo_array(entries, shape=(mesh.points.size,) * 2)


def deflection(mesh: Mesh, metal: mca.Elastic, load: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Displacements along z under forces along z [N], shape (node_count,); `held` as `load`, by axis."""
    free = np.flatnonzero(~held.ravel())
    force = np.column_stack([0.0 * load, 0.0 * load, load]).ravel()
    u = np.zeros(force.size)
    u[free] = spsolve(stiffness_of(mesh, metal).tocsc()[free][:, free], force[free])
    return u[2::3]


@pytest.mark.parametrize(("shake", "tolerance"), [(0.0, 0.03), (0.2, 0.05)])
def test_a_clamped_plate_of_one_layer(shake: float, tolerance: float):
    """0.00126532 q a^4 / D in the middle (Timoshenko) of a quarter, 1.0066 times that with shear; cells three times as
    wide as the wall is thick, straight and distorted."""
    metal, h, a, q = mca.Elastic(E=70e9, nu=0.3, rho=2700.0), 2e-3, 0.1, 1e4
    mesh = in_plan(grid((a / 2, a / 2, h), (8, 8, 1), "deep"), shake)
    rho = np.full(len(mesh.hexahedra), q / h)
    cells = mesh.hexahedra[:, [0, 1, 2, 4, 5, 6]]
    share = ELEMENTS["wedge6"].lumped_masses(mesh.points[cells], rho)
    load = np.bincount(cells.ravel(), share.ravel())
    x, y, _ = mesh.points.T
    rim = (x > a / 2 - 1e-9) | (y > a / 2 - 1e-9)
    w = deflection(mesh, metal, load, np.column_stack([rim | (x < 1e-9), rim | (y < 1e-9), rim]))
    right = 1.0066 * 0.00126532 * q * a**4 / (metal.E * h**3 / 12.0 / (1.0 - metal.nu**2))
    assert w[(x < 1e-9) & (y < 1e-9)].mean() / right == pytest.approx(1.0, abs=tolerance)


@pytest.mark.parametrize(
    ("cells", "nu", "lean", "tolerance"), [(10, 0.3, 0.0, 0.02), (10, 0.49, 0.0, 0.035), (40, 0.3, 0.6, 0.01)]
)
def test_a_beam_of_one_layer(cells: int, nu: float, lean: float, tolerance: float):
    """E I and shear; cells four times as long as the beam is deep, and cubes whose columns lean along it."""
    metal, L = mca.Elastic(E=1.0, nu=nu, rho=1.0), 40.0
    mesh = grid((L, 1.0, 1.0), (cells, 1, 1), "deep")
    x, y, z = mesh.points.T
    inner = (x > 1e-9) & (x < L - 1e-9)
    mesh = replace(mesh, points=np.column_stack([x + lean * (z - 0.5) * inner, y, z]))
    load = (x > L - 1e-9) * 0.25e-6
    foot = x < 1e-9
    w = deflection(mesh, metal, load, np.column_stack([foot, foot & (y < 1e-9), foot & (z < 1e-9)]))
    right = 1e-6 * (4.0 * L**3 + L / (5.0 / 6.0 * metal.shear_modulus))
    assert w[x > L - 1e-9].mean() / right == pytest.approx(1.0, abs=tolerance)


def test_a_cantilever_of_two_layers_flows():
    """Under 0.75 of its collapse load, set on at once: -1.07 mm, 2.86 mJ (2 % and 5 % with finer hexahedra)."""
    L, W, H, sigma_y, rho = 0.05, 0.01, 0.002, 50e6, 2700.0
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=rho, sigma_y=sigma_y, E_t=7e8)
    g = 0.75 * (sigma_y * W * H**2 / 4.0) / (rho * H * W * L**2 / 2.0)
    body = mca.Body(name="bar", geometry=grid((L, W, H), (25, 3, 2), "deep"), material=metal, element="wedge6")
    scene = mca.Scene(
        name="bar",
        bodies=(body,),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        gravity=(0.0, 0.0, -g),
        impact=mca.ImpactPhase(duration=1.2e-3, output_interval=2e-5),
        probes=(mca.Probe(name="tip", body="bar", at=(L, W / 2, H / 2)),),
    )
    result = mca.run(scene)
    assert result.probes[0].position[:, 2].min() - H / 2 == pytest.approx(-1.07e-3, rel=0.03)
    assert result.summary["energy"]["plastic"] == pytest.approx(2.86e-3, rel=0.06)
    assert result.summary["energy_error"] < 1e-4


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("device", DEVICES)
def test_a_bar_strikes_a_rigid_block(device: str, kinematics: str, tmp_path: Path):
    """A bar of wedges, whose axes lie across."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=100e6, E_t=7e9, beta=0.3)
    box = grid((0.02, 0.005, 0.005), (6, 2, 2), "across")
    result = holds_up(striking(box, metal, 10.0, element="wedge6", kinematics=kinematics), device, tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-4


def test_wedges_have_their_element_beside_others(tmp_path: Path):
    """In a body of all cells `hex8` computes the wedges, `hex8i` leaves them; recorders and masses do not differ."""
    cube = mixed_cube()
    of_hex8, named, left = (held_of(cube, name, "corotational").solver.model for name in ("hex8", "wedge6", "hex8i"))
    assert [block.element for block in of_hex8.blocks] == ["hex8", "tet4"]
    for model, first in ((named, "hex8i"), (left, "hex8i")):
        found = [(block.element, block.conn.shape) for block in model.blocks]
        assert found == [(first, (8, 9)), ("tet4", (4, 4)), ("wedge6", (6, 4))]
    np.testing.assert_allclose(left.mass.sum(), STEEL.rho, rtol=1e-12)
    body = mca.Body(name="cube", geometry=cube, material=STEEL, element="hex8i", angular_velocity=(1e-3, 2e-3, 0.0))
    scene = mca.Scene(name="free", bodies=(body,), impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-5))
    mca.run(scene, recorders=(VtkHdfFile(tmp_path / "cube.vtkhdf"),))
    with h5py.File(tmp_path / "cube.vtkhdf") as file:
        assert np.bincount(file["VTKHDF/Types"][: cube.cell_count])[10:].tolist() == [4, 0, 5, 4, 4]


def test_it_is_refused_where_there_are_no_wedges():
    body = mca.Body(
        name="bar", geometry=mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)), material=STEEL, element="wedge6"
    )
    scene = mca.Scene(name="bar", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))
    with pytest.raises(RequestError, match=r"wedge6.*computes wedges, of which bar has none.*leave it out"):
        mca.run(scene)
