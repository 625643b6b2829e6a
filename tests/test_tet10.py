"""Tetrahedra of ten nodes: bending, pressure, curved edges, files, contact, parts of CAD files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
from outside import holds_up
from scipy.optimize import root
from scipy.spatial.transform import Rotation
from statics import Static
from test_elements import STEEL, cut, energy, held_of
from test_own_ten_nodes import metal_bar

import warp_mca as mca
from warp_mca.geometry import tetra10
from warp_mca.geometry.cell_types import GMSH_ORDER
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.geometry.quadratic import straightened
from warp_mca.geometry.quality import check, volumes
from warp_mca.model.build import build_model
from warp_mca.recorders import FinalState, VtkHdfFile
from warp_mca.verify.small_meshes import mixed_cube

RADIUS = 0.01
TINY = 1e-9


def elastic(nu: float, E: float = 1.0) -> mca.Elastic:
    return mca.Elastic(E=E, nu=nu, rho=1.0)


# Errors of the static problems of issue 45, with what they may be.


def tip_error(element: str, nu: float, layers: int) -> float:
    """Of the deflection of a cantilever of 20 x 1 x 1 under a shear force, against Timoshenko's."""
    length = 20.0
    beam = Static(mca.Box(size=(length, 1.0, 1.0), divisions=(20, 1, layers)).build(), element, elastic(nu))
    X, force = beam.X, np.zeros_like(beam.X)
    faces, _ = beam.mesh.boundary
    middle = np.isin(np.arange(len(X)), beam.cells[:, 4:])
    inner = faces[middle[faces].all(axis=1) & (X[faces, 0] > length - TINY).all(axis=1)][
        :, :3
    ]  # one of each four parts
    a, b, c = np.moveaxis(X[inner], 1, 0)
    area = 2.0 * np.linalg.norm(np.cross(b - a, c - a), axis=1)
    np.add.at(force[:, 2], inner, area[:, None] / 3.0)
    root, held = X[:, 0] < TINY, np.zeros(X.shape, dtype=bool)
    held[root, 0], held[root & (X[:, 1] < TINY), 1], held[root & (X[:, 2] < TINY), 2] = True, True, True
    moved = float((beam.solved(force, held)[:, 2] * force[:, 2]).sum())
    return moved / (length**3 / 3.0 * 12.0 + length / (5.0 / 6.0 / (2.0 * (1.0 + nu)))) - 1.0


@pytest.mark.parametrize(
    ("element", "nu", "layers", "least", "most"),
    [("tet10", 0.3, 1, -0.01, 0.0), ("tet10", 0.499, 1, -0.02, 0.0), ("tet10_mean", 0.499, 2, 0.0, 0.08)],
)
def test_beam(element: str, nu: float, layers: int, least: float, most: float):
    assert least < tip_error(element, nu, layers) < most


def test_clamped_plate_of_cells_three_times_as_wide_as_it_is_thick():
    """A quarter of it under its weight, against the series of thin plates."""
    E, nu, q, a, h = 70e9, 0.3, 1e4, 0.05, 0.002
    plate = Static(mca.Box(size=(a, a, h), divisions=(8, 8, 1)).build(), "tet10", elastic(nu, E))
    X, force = plate.X, np.zeros_like(plate.X)
    weight = q / h * tetra10.volumes(X[plate.cells])[:, None] * ([-1.0 / 20.0] * 4 + [1.0 / 5.0] * 6)
    np.add.at(force[:, 2], plate.cells, weight)
    held = np.zeros(X.shape, dtype=bool)
    held[(X[:, :2] > a - TINY).any(axis=1)] = True
    held[:, :2] |= X[:, :2] < TINY
    moved = plate.solved(force, held)[(X[:, :2] < TINY).all(axis=1), 2].mean()
    stiffness = E * h**3 / 12.0 / (1.0 - nu**2)
    assert abs(moved / (0.00126532 * q * (2.0 * a) ** 4 / stiffness) - 1.0) < 0.04


def test_pressure_of_squeezed_rubber_with_mean_dilatation():
    """A cube between rough plates: means over elements in its middle scatter by less than 15 %."""
    size, K = 0.02, 1e6 / 3.0 / (1.0 - 2.0 * 0.4999)
    cube = Static(mca.Box(size=(size,) * 3, divisions=(6, 6, 6)).build(), "tet10_mean", elastic(0.4999, 1e6))
    X, x = cube.X, cube.X[cube.cells]
    top, held, at = X[:, 1] > size - TINY, np.zeros(X.shape, dtype=bool), np.zeros_like(X)
    held[top | (X[:, 1] < TINY)] = True
    at[top, 1] = -2e-4
    u = cube.solved(np.zeros_like(X), held, at)
    weight = tetra10.determinants(x)
    growth = np.einsum("egak,eak,eg->e", tetra10.gradients(x), u[cube.cells], weight) / weight.sum(axis=1)
    pressure = -K * growth[(np.abs(x[:, :4].mean(axis=1) - 0.5 * size) < 0.0041).all(axis=1)]
    assert pressure.mean() == pytest.approx(5.6e3, rel=0.03)
    assert pressure.std() < 0.15 * pressure.mean()


def test_plastic_moment_of_one_layer():
    """A bar of two cubes bent to ten times the curvature at which it begins to yield, against sigma_y h^3 / 4."""
    metal = mca.J2Bilinear(E=1.0, nu=0.3, rho=1.0, sigma_y=1e-3, E_t=1e-6)
    held = held_of(mca.Box(size=(2.0, 1.0, 1.0), divisions=(2, 1, 1)).build(), "tet10", "corotational", material=metal)
    X, own = held.solver.model.X, held.state.elements[0]
    fixed = np.zeros(X.shape, dtype=bool)
    left, right = X[:, 0] < TINY, X[:, 0] > 2.0 - TINY
    fixed[left | right, 0], fixed[X[:, 1] < TINY, 1], fixed[left & (X[:, 2] < TINY), 2] = True, True, True
    free = np.flatnonzero(~fixed.ravel())
    u = np.zeros_like(X)

    def forces(u: np.ndarray) -> np.ndarray:
        """At the end of one step from the virgin state."""
        own.history.zero_()
        own.yielded.zero_()
        return held.forces(u)

    def rest(x: np.ndarray) -> np.ndarray:
        """Forces on free nodes at their displacements, over what bends the cube."""
        moved = u.copy()
        moved.ravel()[free] = x
        return forces(moved).ravel()[free] / (0.25 * metal.sigma_y)

    for bent in np.linspace(0.5, 10.0, 20) * 2e-3:
        u *= bent / max(u[:, 0].max(), 0.5 * bent)
        u[right, 0] = 2.0 * bent * (X[right, 2] - 0.5)
        found = root(rest, u.ravel()[free], method="hybr", options={"xtol": 1e-9})
        u.ravel()[free] = found.x
        assert np.abs(found.fun).max() < 1e-6
    moment = -float((forces(u)[right, 0] * (X[right, 2] - 0.5)).sum())
    assert abs(moment / 0.25e-3 - 1.0) < 0.06


# Curved edges.


def bent(size: float) -> mca.Mesh:
    """Of a cube, with inner nodes of edges off their middles by up to `size`."""
    mesh = cut(mixed_cube(), "tet10")
    inner = ((mesh.points > TINY) & (mesh.points < 1.0 - TINY)).all(axis=1)
    inner &= np.isin(np.arange(len(inner)), mesh.others["tetra10"][:, 4:])
    move = np.random.default_rng(0).uniform(-size, size, mesh.points.shape) * inner[:, None]
    return replace(mesh, points=mesh.points + move)


@pytest.mark.parametrize("element", ["tet10", "tet10_mean"])
def test_constant_strain_on_curved_edges_passes_to_the_error_of_four_points(element: str):
    """Which integrate cubic functions to the second order: the force left falls with the square of the curvature."""
    gradient = 1e-3 * np.array([[0.5, 0.3, -0.2], [0.1, -0.4, 0.6], [0.7, 0.2, 0.3]])
    left = []
    for size in (0.0, 0.01, 0.02):
        held = held_of(bent(size), element, "finite")
        X = held.solver.model.X
        force = held.forces(X @ gradient.T)
        inner = ((X > TINY) & (X < 1.0 - TINY)).all(axis=1)
        left.append(np.abs(force[inner]).max() / np.abs(force).max())
    assert left[0] < 1e-12
    assert left[2] < 0.02 and left[2] / left[1] > 2.0


@pytest.mark.parametrize("element", ["tet10", "tet10_mean"])
def test_curved_elements_turn_without_force_and_forces_are_the_slope_of_the_energy(element: str):
    rng = np.random.default_rng(0)
    held = held_of(bent(0.03), element, "finite")
    X = held.solver.model.X
    turned = Rotation.from_rotvec([0.7, -1.1, 0.4]).apply(X) - X
    assert np.abs(held.forces(turned)).max() < 1e-12 * np.abs(held.forces(1e-3 * X)).max() * 1e3
    u = turned + 1e-2 * rng.uniform(-1.0, 1.0, X.shape)
    force, way, h = held.forces(u), rng.normal(size=X.shape), 1e-7
    slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
    assert -np.sum(force * way) == pytest.approx(slope, rel=1e-6)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ball of 10 mm radius: ball.step, and ball.* of tetrahedra with curved edges, in millimetres."""
    import gmsh

    folder = tmp_path_factory.mktemp("ball")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.MeshSizeMax", 8.0)
        gmsh.model.occ.addSphere(0, 0, 0, 1e3 * RADIUS)
        gmsh.model.occ.synchronize()
        gmsh.write(str(folder / "ball.step"))
        gmsh.model.addPhysicalGroup(2, [1], name="skin")
        gmsh.model.addPhysicalGroup(3, [1], name="metal")
        gmsh.option.setNumber("Mesh.SaveGroupsOfNodes", 1)
        gmsh.model.mesh.generate(3)
        gmsh.model.mesh.setOrder(2)
        for suffix in ("msh", "unv", "bdf", "inp", "key", "vtk", "med"):
            gmsh.write(str(folder / f"ball.{suffix}"))
    finally:
        gmsh.finalize()
    read = meshio.read(folder / "ball.msh")
    solids = [block for block in read.cells if block.type == "tetra10"]
    meshio.Mesh(read.points, solids).write(folder / "ball.vtu")
    return folder


@pytest.mark.parametrize("suffix", ["msh", "unv", "bdf", "inp", "key", "vtk", "vtu", "med"])
def test_files_keep_curved_edges(folder: Path, suffix: str):
    """The skin lies on the ball, nodes within its edges too; volumes are those of the file with gmsh's own numbers."""
    mesh = mca.MeshFile(folder / f"ball.{suffix}", scale=1e-3).build()
    reference = mca.MeshFile(folder / "ball.msh", scale=1e-3).build()
    check(mesh, suffix)
    assert not mesh.notes and mesh.cell_count == len(mesh.others["tetra10"]) == reference.cell_count
    skin = mesh.nodes("boundary")
    np.testing.assert_allclose(np.linalg.norm(mesh.points[skin], axis=1), RADIUS, rtol=1e-5)
    np.testing.assert_allclose(np.sort(volumes(mesh)), np.sort(volumes(reference)), rtol=2e-5)
    assert volumes(mesh).sum() == pytest.approx(4.0 / 3.0 * np.pi * RADIUS**3, rel=2e-4)
    if suffix in ("msh", "unv", "inp", "key", "med"):
        assert np.array_equal(mesh.nodes("set_1" if suffix == "key" else "skin"), skin)


CELL = [[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.01, 0], [0.5, 0.52, 0], [0.03, 0.5, 0], [0, 0.04, 0.5]]
CELL += [[0.5, 0.05, 0.5], [0.06, 0.5, 0.5]]  # nodes on edges 01, 12, 20, 03, 13, 23


def one_cell(suffix: str) -> str:
    """A file with `CELL` as the manual of its format numbers nodes."""
    rows = [[k, *place] for k, place in enumerate(CELL, 1)]
    if suffix == "inp":
        nodes = "\n".join(", ".join(map(str, row)) for row in rows)
        return f"*NODE\n{nodes}\n*ELEMENT, TYPE=C3D10, ELSET=all\n1, {', '.join(map(str, range(1, 11)))}\n"
    if suffix == "bdf":
        nodes = "\n".join(f"GRID,{row[0]},,{row[1]},{row[2]},{row[3]}" for row in rows)
        return f"BEGIN BULK\n{nodes}\nCTETRA,1,1,1,2,3,4,5,6\n,7,8,9,10\nENDDATA\n"
    if suffix == "k":
        nodes = "\n".join(f"{k:8d}{x:16.6f}{y:16.6f}{z:16.6f}" for k, x, y, z in rows)
        solid = "".join(f"{k:8d}" for k in range(1, 11))
        return f"*KEYWORD\n*NODE\n{nodes}\n*ELEMENT_SOLID\n{1:8d}{1:8d}\n{solid}\n*END\n"
    nodes = "\n".join(f"{k:10d}{1:10d}{1:10d}{11:10d}\n{x:25.16E}{y:25.16E}{z:25.16E}" for k, x, y, z in rows)
    order = [1, 5, 2, 6, 3, 7, 8, 9, 10, 4]
    lines = "".join(f"{k:10d}" for k in order[:8]) + "\n" + "".join(f"{k:10d}" for k in order[8:])
    head = "".join(f"{k:10d}" for k in (1, 118, 1, 1, 7, 10))
    return f"    -1\n  2411\n{nodes}\n    -1\n    -1\n  2412\n{head}\n{lines}\n    -1\n"


@pytest.mark.parametrize("suffix", ["inp", "bdf", "k", "unv"])
def test_nodes_are_numbered_as_the_formats_have_them(suffix: str, tmp_path: Path):
    file = tmp_path / f"one.{suffix}"
    file.write_text(one_cell(suffix))
    mesh = mca.MeshFile(file).build()
    (cell,) = mesh.others["tetra10"]
    np.testing.assert_allclose(mesh.points[cell], CELL, atol=1e-9)


def test_a_cell_that_lacks_a_node_or_shares_some_with_other_cells_is_linear(tmp_path: Path):
    lines = one_cell("bdf").replace(",7,8,9,10", ",7,,9,10")
    (tmp_path / "one.bdf").write_text(lines)
    lacking = mca.MeshFile(tmp_path / "one.bdf").build()
    text = one_cell("inp").replace("*ELEMENT", "11, 1, 1, 1\n*ELEMENT") + "*ELEMENT, TYPE=C3D4\n2, 2, 3, 4, 11\n"
    (tmp_path / "two.inp").write_text(text)
    shared = mca.MeshFile(tmp_path / "two.inp").build()
    for mesh, count in ((lacking, 1), (shared, 2)):
        assert len(mesh.tetrahedra) == mesh.cell_count == count
        assert any("1 quadratic cells (tetra10) are taken as linear ones" in note for note in mesh.notes)


def test_edges_of_a_file_that_spoil_their_cell_are_straightened(tmp_path: Path):
    (tmp_path / "one.inp").write_text(one_cell("inp").replace("\n5, 0.5, 0.01, 0", "\n5, 0.5, 0.45, 0"))
    mesh = mca.MeshFile(tmp_path / "one.inp").build()
    check(mesh, "one")
    assert any("6 edges bend so far that they spoil their cell" in note for note in mesh.notes)
    (cell,) = mesh.others["tetra10"]
    np.testing.assert_allclose(mesh.points[cell[4]], [0.5, 0.0, 0.0], atol=1e-12)


def test_cells_whose_edges_bend_inside_out_stay_as_their_corners_are(tmp_path: Path):
    """Edges of the base that lie beyond the top make the volume of a cell negative, but not that of its corners."""
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    points = np.concatenate([corners, corners[tetra10.EDGES].mean(axis=1)])
    points[4:7, 2] = 2.0
    assert tetra10.volumes(points[None])[0] < 0.0
    meshio.write(tmp_path / "out.vtu", meshio.Mesh(points, [("tetra10", np.arange(10)[None])]))
    found = mca.MeshFile(tmp_path / "out.vtu").build()
    check(found, "out")
    assert volumes(found).sum() == pytest.approx(1.0 / 6.0)


def test_nodes_within_edges_in_another_order_are_refused(tmp_path: Path):
    """A node lies within two edges then, which could not both be made straight."""
    mesh = cut(mca.Box(size=(1.0, 1.0, 1.0), divisions=(1, 1, 1)).build(), "tet10")
    cells = mesh.others["tetra10"][:, GMSH_ORDER]
    meshio.write(tmp_path / "gmsh.vtu", meshio.Mesh(mesh.points, [("tetra10", cells)]))
    with pytest.raises(mca.RequestError, match="within several edges of ten-node tetrahedra; write their nodes in the"):
        mca.MeshFile(tmp_path / "gmsh.vtu").build()


# Parts of CAD files.


def test_cad_parts_have_curved_edges_that_spoil_no_cell(folder: Path):
    mesh = mca.Cad(folder / "ball.step", size=4e-3).build()
    check(mesh, "ball")
    exact = 4.0 / 3.0 * np.pi * RADIUS**3
    assert volumes(mesh).sum() == pytest.approx(exact, rel=1e-3)
    assert abs(volumes(tetrahedral(mesh)).sum() / exact - 1.0) > 0.03
    assert np.array_equal(mesh.nodes("face_1"), mesh.nodes("boundary"))


def test_edges_are_straightened_where_they_spoil_a_cell():
    mesh = cut(mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2)).build(), "tet10")
    cells, points = mesh.others["tetra10"], mesh.points.copy()
    middle = cells[0, 4]
    points[middle] += 0.8 * (points[cells[0, 9]] - points[middle])
    assert replace(mesh, points=points).least_jacobians.min() < 0.0
    np.testing.assert_allclose(straightened(points, cells)[middle], mesh.points[middle], atol=1e-15)
    near = mesh.points.copy()
    near[middle] += 0.02 * (near[cells[0, 9]] - near[middle])
    assert np.array_equal(straightened(near, cells), near)


def dropped(part: mca.Cad, **values) -> mca.Scene:
    floor = mca.RigidPlane(normal=(0.0, 0.0, 1.0))
    body = mca.Body(name="ball", geometry=part, material=STEEL, **values)
    return mca.Scene(
        name="drop",
        bodies=(replace(body.place_on(floor, gap=1e-7), velocity=(0.0, 0.0, -1.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="ball", nodes="boundary"), master=floor),),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6),
    )


def test_cad_parts_compute_with_tet10_and_with_tet4_by_choice(folder: Path, tmp_path: Path):
    part = mca.Cad(folder / "ball.step", size=8e-3)
    recorders = (VtkHdfFile(tmp_path / "ball.vtkhdf"), FinalState(tmp_path / "ball.vtu"))
    result = mca.run(dropped(part), device="cpu", recorders=recorders)
    assert result.summary["element"] == "tet10" and result.summary["energy_error"] < 1e-3
    with h5py.File(tmp_path / "ball.vtkhdf") as file:
        assert set(file["VTKHDF/Types"][:]) == {24}
    assert [block.type for block in meshio.read(tmp_path / "ball.vtu").cells] == ["tetra10"]
    four = mca.run(dropped(part, element="tet4"), device="cpu")
    assert four.summary["element"] == "tet4"
    assert four.summary["n_elements"] == result.summary["n_elements"]
    assert four.summary["n_nodes"] < 0.3 * result.summary["n_nodes"]


def test_parts_and_cuts_keep_the_cells_of_sets():
    """Of hexahedra, tetrahedra of four nodes and of ten, in each order."""
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 1, 1)).build()
    kinds = [box, cut(box, "tet4"), cut(box, "tet10")]
    for order in ((0, 1, 2), (2, 1, 0)):
        items = []
        for k in order:
            low = kinds[k].points[kinds[k].cell(0)].mean(axis=0)[0] < 0.5
            half = np.arange(kinds[k].cell_count // 2, dtype=np.int32) + (0 if low else kinds[k].cell_count // 2)
            mesh = replace(kinds[k], cell_sets={"low": half.astype(np.int32)})
            items.append(mca.Part(name=f"p{k}", geometry=mesh, at=(0.0, 0.0, 2.0 * k)))
        whole = mca.Parts(parts=tuple(items)).build()
        check(whole, "whole")
        assert whole.cell_count == sum(kind.cell_count for kind in kinds)
        for element in ("hex8", "tet4", "tet10"):
            made = cut(whole, element) if element != "hex8" else whole
            size = volumes(made)
            middle = np.array([made.points[made.cell(k)[:4]].mean(axis=0) for k in range(made.cell_count)])
            for k in range(3):
                own = made.cell_sets[f"p{k}.low"]
                assert size[own].sum() == pytest.approx(0.5, rel=1e-12)
                assert np.abs(middle[own, 2] - 2.0 * k - 0.5).max() < 0.51
            assert size[made.cell_sets["low"]].sum() == pytest.approx(1.5, rel=1e-12)


# Contact and whole runs.


def test_springs_of_faces_are_those_of_linear_cells_of_half_the_size():
    """Each of the four parts of a face stands for the cell behind it."""
    stiffness = {}
    for element, cells in (("tet10", 2), ("tet4", 4)):
        box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(cells, cells, cells))
        floor = mca.RigidPlane(normal=(0.0, 1.0, 0.0))
        body = mca.Body(name="it", geometry=box, material=STEEL, element=element)
        contact = mca.Contact(slave=mca.Surface(body="it", nodes="ymin"), master=floor, penalty=1.0)
        scene = mca.Scene(name="x", bodies=(body,), contacts=(contact,), impact=mca.ImpactPhase(duration=1e-6))
        meshes = mca.mesh(scene)
        X = {"it": meshes["it"].points}
        (item,) = build_model(scene, meshes, X, {"it": np.zeros_like(X["it"])}).passes
        stiffness[element] = item.stiffness
    assert len(stiffness["tet10"]) == len(stiffness["tet4"])
    assert stiffness["tet10"].sum() == pytest.approx(stiffness["tet4"].sum(), rel=0.1)


def test_it_strikes_and_holds_up_as_elements_do(tmp_path: Path):
    result = holds_up(metal_bar("tet10"), "cpu", tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-4
