"""Every element: forces are the slope of its energy, rotation costs nothing, patches of all cells, stable step."""

from __future__ import annotations

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from impacts import Displaced
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.geometry.cell_types import CELL_TYPES, TETRAHEDRON, linear_type
from warp_mca.geometry.degenerate import among, cell_names, cut_to, stored, tetrahedral
from warp_mca.geometry.mesh import Mesh
from warp_mca.geometry.quality import check, scaled_jacobian, volumes
from warp_mca.kernels.nodes.gather import gather_function
from warp_mca.model.build import build_model
from warp_mca.physics.elements import ELEMENTS, of_hexahedra
from warp_mca.physics.elements.stage import gather_lists
from warp_mca.step.solver import Solver
from warp_mca.verify.small_meshes import mixed_cube

gather = gather_function("float64")

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
NONE = np.zeros(0)
KINDS = [(name, kinematics) for name in ELEMENTS for kinematics in ("corotational", "finite")]


def shaped(mesh: Mesh, element: str) -> Mesh:
    """The mesh with its hexahedra cut to wedges for elements that compute these; others stay."""
    cells = mesh.hexahedra
    if ELEMENTS[element].cell != "wedge" or among(cells, "wedge").any():
        return mesh
    halves = np.concatenate([cells[:, [0, 1, 2, 4, 5, 6]], cells[:, [0, 2, 3, 4, 6, 7]]])
    return dataclasses.replace(mesh, hexahedra=stored(mesh.points, halves, "wedge"), cell_sets={}, volume_ratio=NONE)


def held_of(mesh: Mesh, element: str, kinematics: str, precision: str = "float64", material=STEEL) -> Displaced:
    mesh = shaped(mesh, element)
    body = mca.Body(name="body", geometry=mesh, material=material, element=element, kinematics=kinematics)
    scene = mca.Scene(name="test", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))
    meshes = mca.mesh(scene)
    X = meshes["body"].points
    model = build_model(scene, meshes, {"body": X}, {"body": np.zeros_like(X)})
    return Displaced(Solver(model, device="cpu", precision=precision, dt=1e-9))


def settled(held: Displaced, u: np.ndarray) -> np.ndarray:
    """The forces at u [N], when internal vectors of elements that keep them have come to rest."""
    for _ in range(25):
        force = held.forces(u)
    return force


def cut(mesh: Mesh, element: str) -> Mesh:
    """The mesh with the cells of an element."""
    cell = ELEMENTS[element].cell
    return shaped(mesh, element) if cell == "wedge" else cut_to(mesh, cell)


def cells_of(mesh: Mesh, element: str) -> np.ndarray:
    """Nodes of its cells, shape (cell_count, corners)."""
    kind = CELL_TYPES[ELEMENTS[element].cell]
    return mesh.cells[kind.stored_as][:, kind.own_corners]


def energy(held: Displaced, u: np.ndarray) -> float:
    """Elastic and hourglass energy [J]."""
    settled(held, u)
    return float(held.energies()[[0, 4]].sum())


@pytest.fixture(scope="module")
def cube() -> Mesh:
    box = mca.Box(size=(1.0, 0.8, 1.2), divisions=(2, 2, 1)).build()
    points = box.points + np.random.default_rng(3).uniform(-0.06, 0.06, box.points.shape)
    return dataclasses.replace(box, points=points)


@pytest.mark.parametrize(("element", "kinematics"), KINDS)
def test_forces_are_the_slope_of_the_energy(element: str, kinematics: str, cube: Mesh):
    """At strains of 20 %, 5 % where internal vectors must not fade; small strain takes the rotation of least energy."""
    consistent = kinematics == "finite" or element[:5] == "hex8i"
    rng = np.random.default_rng(0)
    cube = cut(cube, element)
    held = held_of(cube, element, kinematics)
    size = (0.05 if element[:5] in ("hex8i", "hex8w") else 0.2) if consistent else 1e-3
    u = cube.points @ rng.uniform(-size, size, (3, 3)) + size * 0.3 * rng.uniform(-1, 1, cube.points.shape)
    force = settled(held, u)
    for _ in range(3):
        way = rng.normal(size=u.shape)
        h = 1e-6 * size
        slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
        # Other co-rotational forces leave out how the rotation changes with the strain, a product of both strains; so
        # do the hourglass forces.
        tolerance = 1e-6 if consistent else 5e-3
        tolerance = 0.05 if element == "hex8r" and kinematics == "finite" else tolerance
        assert -(force * way).sum() == pytest.approx(slope, rel=tolerance, abs=tolerance * np.abs(force).max())


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 3e-14), ("mixed", 2e-6)])
@pytest.mark.parametrize(("element", "kinematics"), KINDS)
def test_rotation_leaves_no_force_and_turns_those_there_are(element, kinematics, precision, tolerance, cube: Mesh):
    cube = cut(cube, element)
    held = held_of(cube, element, kinematics, precision)
    turn = Rotation.from_rotvec([0.9, -1.3, 0.6]).as_matrix()
    rigid = cube.points @ turn.T - cube.points + [3.0, -1.0, 2.0]
    assert np.abs(held.forces(rigid)).max() < tolerance * STEEL.E
    rng = np.random.default_rng(1)
    u = 0.05 * rng.uniform(-1, 1, cube.points.shape)
    force = settled(held, u)
    turned = settled(held, (cube.points + u) @ turn.T - cube.points)
    assert turned == pytest.approx(force @ turn.T, abs=30 * tolerance * np.abs(force).max() + tolerance * STEEL.E)


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("element", of_hexahedra())
def test_patch_of_hexahedra_wedges_pyramids_and_tetrahedra(element: str, kinematics: str):
    """A linear field, also with 10 % strain, leaves no force at inner nodes, but for those of `wedge6`."""
    mesh = mixed_cube()
    check(mesh, "mixed")
    assert volumes(mesh).sum() == pytest.approx(1.0, rel=1e-12)
    mesh = cut(mesh, element)
    gradient = 0.1 * np.array([[0.5, 0.3, -0.2], [0.1, -0.4, 0.6], [0.7, 0.2, 0.3]])
    held = held_of(mesh, element, kinematics)
    force = held.forces(mesh.points @ gradient.T)
    inner = ((mesh.points > 1e-9) & (mesh.points < 1.0 - 1e-9)).all(axis=1)
    assert inner.sum() >= 2
    for block in held.solver.model.blocks:
        inner[block.conn if block.element == "wedge6" else []] = False
    assert np.abs(force[inner]).max() < 1e-13 * np.abs(force).max() * len(force)


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_uniform_stretch_at_finite_strain(element: str, cube: Mesh):
    """Twice as long without change of width: Cauchy stress (K + 4 G / 3) ln 2 / 2 along, from logarithmic strain."""
    cube = cut(cube, element)
    held = held_of(cube, element, "finite")
    force = held.forces(cube.points * [1.0, 0.0, 0.0])
    K, G = STEEL.bulk_modulus, STEEL.shear_modulus
    virial = (cube.points * [2.0, 1.0, 1.0]).T @ force  # minus the Kirchhoff stress times the volume
    stress = -np.diag(virial) / volumes(cube).sum()
    expected = np.log(2.0) * np.array([K + 4.0 * G / 3.0, K - 2.0 * G / 3.0, K - 2.0 * G / 3.0])
    np.testing.assert_allclose(stress, expected, rtol=1e-10)


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("element", list(ELEMENTS))
def test_plastic_work_of_a_stretched_block(element: str, kinematics: str, cube: Mesh):
    """Isochoric stretch in one step: dp = (2 G e - sigma_y) / (3 G + H) of the equivalent strain, by hand."""
    metal = mca.J2Bilinear(E=210e9, nu=0.3, rho=7850.0, sigma_y=200e6, E_t=10e9, beta=1.0)
    cube = cut(cube, element)
    held = held_of(cube, element, kinematics, material=metal)
    stretch = 1.02
    if kinematics == "finite":
        held.forces(cube.points * [stretch - 1.0, stretch**-0.5 - 1.0, stretch**-0.5 - 1.0])
        strain = np.log(stretch)
    else:
        held.forces(cube.points * [0.02, -0.01, -0.01])
        strain = 0.02
    G, H = metal.shear_modulus, metal.hardening_modulus
    expected = (3.0 * G * strain - metal.sigma_y) / (3.0 * G + H)
    parts = zip(held.solver.elements, held.state.elements, strict=True)
    found = [own.history.numpy()[5 : 6 * stage.points : 6] for stage, own in parts]
    np.testing.assert_allclose(np.concatenate([part.ravel() for part in found]), expected, rtol=1e-9)


@pytest.mark.parametrize("element", list(ELEMENTS))
def test_bounds_hold_the_largest_eigenvalue(element: str):
    kind = ELEMENTS[element]
    rng = np.random.default_rng(5)
    box = mca.Box(size=(1.0, 0.7, 1.6), divisions=(4, 4, 4)).build()
    points = box.points + rng.uniform(-0.05, 0.05, box.points.shape)
    mesh = cut(dataclasses.replace(box, points=points), element)
    x = mesh.points[cells_of(mesh, element)]
    n = len(x)
    K, G, rho = np.full(n, 175e9), np.full(n, 80e9), np.full(n, 7850.0)
    mass = kind.lumped_masses(x, rho)
    exact, bound = kind.largest_eigenvalues(x, K, G, mass), kind.eigenvalue_bounds(x, K, G, mass)
    coarse = kind.eigenvalue_bounds(x, K, G, mass, coarse=True)
    assert (bound >= exact * (1.0 - 1e-12)).all()
    assert (bound <= 1.7 * exact).all()
    assert (coarse >= bound * (1.0 - 1e-12)).all()
    assert (coarse <= (2.3 if kind.cell == "tetra10" else 1.5) * bound).all()


@pytest.mark.parametrize(("element", "kinematics"), KINDS)
def test_element_eigenvalue_is_that_of_its_forces(element: str, kinematics: str):
    """Stiffness by differences of the kernel's forces, on one distorted cell; averaging only lowers tet4's."""
    kind = ELEMENTS[element]
    x = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    x = x * [1.0, 0.6, 1.3] + np.random.default_rng(2).uniform(-0.08, 0.08, x.shape)
    if linear_type(kind.cell) is TETRAHEDRON:
        mesh = Mesh(x[[0, 1, 3, 4]], np.zeros((0, 8), np.int32), {}, {}, np.arange(4, dtype=np.int32)[None])
        mesh = cut(mesh, element)
    elif kind.cell == "wedge":
        mesh = Mesh(x[[0, 1, 2, 4, 5, 6]], np.array([[0, 1, 2, 2, 3, 4, 5, 5]], np.int32))
    else:
        mesh = Mesh(x, np.arange(8, dtype=np.int32)[None])
    held = held_of(mesh, element, kinematics)
    n = mesh.points.size
    stiffness = np.zeros((n, n))
    for k in range(n):
        step = np.zeros(n)
        step[k] = 1e-7
        way = step.reshape(-1, 3)
        stiffness[:, k] = -(held.forces(way) - held.forces(-way)).ravel() / 2e-7
    assert stiffness == pytest.approx(stiffness.T, abs=1e-5 * np.abs(stiffness).max())
    root = np.repeat(held.solver.model.mass, 3) ** -0.5
    largest = np.linalg.eigvalsh(root[:, None] * stiffness * root)[-1]
    args = np.full(1, STEEL.bulk_modulus), np.full(1, STEEL.shear_modulus)
    nodes = mesh.points[cells_of(mesh, element)]
    mass = kind.lumped_masses(nodes, np.full(1, STEEL.rho))
    assert kind.largest_eigenvalues(nodes, *args, mass)[0] == pytest.approx(largest, rel=1e-5)


@pytest.mark.parametrize(("element", "kinematics"), [kind for kind in KINDS if kind[0] in of_hexahedra()])
def test_bodies_of_every_element_strike_and_bounce(element: str, kinematics: str):
    """Hexahedra, or triangles, on both sides of the contact: energy is kept, momentum handed over."""
    bodies = tuple(
        mca.Body(
            name=name,
            geometry=mca.Box(size=(0.02, 0.02, 0.02), divisions=(3, 3, 3), origin=(-0.01, low, -0.01)),
            material=STEEL,
            element=element,
            kinematics=kinematics,
            velocity=(0.0, v, 0.0),
        )
        for name, low, v in (("upper", 0.0, -2.0), ("lower", -0.02, 0.0))
    )
    contact = mca.Contact(
        slave=mca.Surface(body="upper", nodes="ymin"), master=mca.Surface(body="lower", nodes="ymax"), penalty=0.5
    )
    scene = mca.Scene(
        name="cubes",
        bodies=bodies,
        contacts=(contact,),
        impact=mca.ImpactPhase(duration=3e-5, output_interval=1e-6, energy_tolerance=1e-2),
        tip=mca.Point(body="upper", at=(0.0, 0.01, 0.0)),
    )
    result = mca.run(scene, precision="mixed")
    impulse = float(result.F_n[1:].sum() * (result.time[1] - result.time[0]))
    mass = 7850.0 * 0.02**3
    assert impulse == pytest.approx(2.0 * mass, rel=0.12)  # equal bodies exchange their velocities, but for waves
    assert result.summary["element"] == element


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
@pytest.mark.parametrize("element", ["hex8i", "hex8w"])
def test_energy_that_internal_vectors_lose_as_they_lag_is_told(element: str, kinematics: str):
    """A strip lands on an edge and yields: the balance closes by what the lag took, which goes with the step."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=40e6, E_t=5e9)
    strip = mca.Box(size=(0.03, 0.01, 0.005), divisions=(6, 2, 1))
    body = mca.Body(
        name="strip", geometry=strip, material=metal, element=element, kinematics=kinematics, velocity=(0.0, 0.0, -20.0)
    )
    plane = mca.RigidPlane(point=(0.0, 0.0, 0.0), normal=(0.3, 0.0, 1.0))
    contact = mca.Contact(slave=mca.Surface(body="strip", nodes="zmin"), master=plane)
    lost = []
    for scale in (0.2, 0.05):
        impact = mca.ImpactPhase(duration=8e-5, output_interval=1e-6, time_step_scale=scale)
        scene = mca.Scene(name="strip", bodies=(body,), contacts=(contact,), impact=impact)
        energy = mca.run(scene, precision="float64").summary["energy"]
        assert abs(energy["error"]) < 2e-3 * energy["plastic"] < energy["hourglass"]
        lost.append(energy["hourglass"])
    assert 3.0 < lost[0] / lost[1] < 4.0


def test_cells_keep_their_kind():
    mesh = mixed_cube()
    padded = np.full((mesh.cell_count, 8), -1)
    padded[: len(mesh.hexahedra)] = mesh.hexahedra
    padded[len(mesh.hexahedra) :, :4] = mesh.tetrahedra
    names = cell_names(padded)
    assert {name: int((names == name).sum()) for name in CELL_TYPES} == {
        "hexahedron": 5, "wedge": 4, "pyramid": 4, "tetrahedron": 4, "tetra10": 0,
    }  # fmt: skip
    assert scaled_jacobian(mesh).min() > 0.2


def test_cutting_keeps_volume_boundary_and_sets():
    mesh = mixed_cube()
    mesh = dataclasses.replace(mesh, cell_sets={"some": np.array([0, 5, mesh.cell_count - 1], np.int32)})
    parted = tetrahedral(mesh)
    assert not len(parted.hexahedra)
    assert volumes(parted).sum() == pytest.approx(1.0, rel=1e-12)
    assert volumes(parted)[parted.cell_sets["some"]].sum() == pytest.approx(
        volumes(mesh)[mesh.cell_sets["some"]].sum(), rel=0.01
    )
    faces, _ = parted.boundary
    assert (faces[:, 2] == faces[:, 3]).all()
    area = 0.5 * np.linalg.norm(
        np.cross(*(parted.points[faces[:, k]] - parted.points[faces[:, 0]] for k in (1, 2))), axis=1
    )
    assert area.sum() == pytest.approx(6.0, rel=1e-12)


@wp.kernel(enable_backward=False, module="unique")
def gather_all(
    first_slots: wp.array(dtype=wp.vec2i),
    more_slots: wp.array(dtype=wp.vec4i),
    force: wp.array(dtype=wp.vec3d),
    total_out: wp.array(dtype=wp.vec3d),
):
    i = wp.tid()
    total_out[i] = gather(first_slots[i], more_slots, force)


def test_nodes_gather_each_of_their_slots_in_rising_order():
    """With one to eleven forces on a node, of two blocks, sums have the bits of a loop over rising slots."""
    rng = np.random.default_rng(0)
    node = rng.permutation(np.repeat(np.arange(66), np.tile(np.arange(1, 12), 6))).astype(np.int32)
    stages = [SimpleNamespace(slot_node=part, slot=0) for part in np.split(node, [150])]
    first_slots, more_slots = gather_lists(stages, 66)  # type: ignore[arg-type]
    assert [stage.slot for stage in stages] == [0, 150]
    force = rng.normal(size=(len(node), 3)) * 10.0 ** rng.integers(-8, 8, (len(node), 1))
    out = wp.full(66, np.nan, dtype=wp.vec3d, device="cpu")
    inputs = [
        wp.array(array, dtype=kind, device="cpu") for array, kind in ((first_slots, wp.vec2i), (more_slots, wp.vec4i))
    ]
    inputs.append(wp.array(force, dtype=wp.vec3d, device="cpu"))
    wp.launch(gather_all, 66, inputs=inputs, outputs=[out], device="cpu")
    expected = np.zeros((66, 3))
    for slot, n in enumerate(node):
        expected[n] += force[slot]
    np.testing.assert_array_equal(out.numpy(), expected)
