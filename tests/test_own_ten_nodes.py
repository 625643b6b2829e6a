"""An element of the user's own on a cell type of its own: the tetrahedron with ten nodes, which bends without locking.

Zienkiewicz, Taylor and Zhu, The Finite Element Method, 7th ed. (2013), section 6.2. Its masses are the diagonal of the
consistent ones, scaled (Hinton, Rock and Zienkiewicz, Earthquake Engng Struct. Dyn. 4 (1976) 245). Edges are straight
in the reference; the strain is linear, taken at the four points of Hammer, Marlowe and Stroud (1956).
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import warp as wp
from outside import holds_up
from scipy.spatial.transform import Rotation
from test_elements import STEEL, energy, held_of

import warp_mca as mca
from warp_mca.geometry import tetrahedron
from warp_mca.geometry.cell_types import HEXAHEDRON, TETRAHEDRON, CellType
from warp_mca.geometry.degenerate import tetrahedral
from warp_mca.kernels.elements.formulation import OWN, Formulation, force_kernel
from warp_mca.kernels.elements.fused import fused
from warp_mca.kernels.elements.patterns import mean_frame
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.physics.elements.element import largest
from warp_mca.recorders import VtkHdfFile
from warp_mca.step.output import NodalStress
from warp_mca.verify.small_meshes import mixed_cube

EDGES = np.array([(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)])  # the nodes 4 to 9 lie in their middles
FAR = (5.0 - 5.0**0.5) / 20.0  # barycentric coordinates of the points
NEAR = 1.0 - 3.0 * FAR


def with_middles(mesh: mca.Mesh) -> mca.Mesh:
    """The mesh with all cells cut to tetrahedra of ten nodes; sets take the middles of edges that lie in them."""
    cut = tetrahedral(mesh)
    ends = np.sort(cut.tetrahedra[:, EDGES], axis=2)
    edge, number = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
    middle = len(cut.points) + np.arange(len(edge))
    sets = {name: np.append(own, middle[np.isin(edge, own).all(axis=1)]) for name, own in cut.node_sets.items()}
    return replace(
        cut,
        points=np.concatenate([cut.points, cut.points[edge].mean(axis=1)]),
        tetrahedra=cut.tetrahedra[:0],
        node_sets={name: own.astype(np.int32) for name, own in sets.items()},
        others={"tetra10": np.column_stack([cut.tetrahedra, middle[number.reshape(-1, 6)]]).astype(np.int32)},
    )


TEN_NODES = CellType(
    name="tetra10",
    mirrored=(0, 2, 1, 3, 6, 5, 4, 7, 9, 8),
    stored_as="tetra10",
    stored_corners=tuple(range(10)),
    vtk=24,
    meshio="tetra10",
    gmsh=11,
    # each face in four parts
    faces=tuple(
        part
        for (a, b, c), (ab, bc, ca) in zip(TETRAHEDRON.faces, ((6, 5, 4), (4, 8, 7), (5, 9, 8), (6, 7, 9)), strict=True)
        for part in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
    ),
    edges=tuple(pair for k, (i, j) in enumerate(EDGES.tolist()) for pair in ((i, 4 + k), (4 + k, j))),
    cut_from=("hexahedron", "tetrahedron"),
    linear="tetrahedron",
    made=with_middles,
)


@cache
def formulation(precision: str, law_name: str, finite: bool) -> Formulation:
    """Displacements u of the nodes from the first one and gradients of the barycentric coordinates."""
    t = scalars(precision)
    R, vec3, mat33, mat43 = t.real, t.vec3, t.mat33, t.mat43
    mat103 = wp.types.matrix((10, 3), R)
    rotated, add_matrices = mean_frame(precision, finite), fused(precision).add_matrices

    @wp.struct
    class Tet10:
        W: mat33
        u: mat103
        slopes: mat43
        volume: R

    @wp.func
    def coordinate(g: int, i: int):
        if i == g:
            return R(NEAR)
        return R(FAR)

    @wp.func
    def gradient_of(slopes: mat43, g: int, a: int):
        if a < 4:
            return (R(4.0) * coordinate(g, a) - R(1.0)) * slopes[a]
        i = a - 4
        j = (a - 3) % 3
        if a > 6:
            i = a - 7
            j = 3
        return R(4.0) * (coordinate(g, i) * slopes[j] + coordinate(g, j) * slopes[i])

    @wp.func
    def world_gradient(u: mat103, slopes: mat43, g: int):
        H = mat33()
        for a in range(1, 10):
            H += wp.outer(u[a], gradient_of(slopes, g, a))
        return H

    @wp.func
    def edge(field: wp.array(dtype=wp.vec3d), i: int, j: int):
        d = field[j] - field[i]
        return vec3(R(d[0]), R(d[1]), R(d[2]))

    @wp.func
    def load_shape(X: wp.array(dtype=wp.vec3d), u: wp.array(dtype=wp.vec3d), conn: wp.array2d(dtype=wp.int32), e: int):
        n = conn[0, e]
        d0 = edge(X, n, conn[1, e])
        d1 = edge(X, n, conn[2, e])
        d2 = edge(X, n, conn[3, e])
        c0 = wp.cross(d1, d2)
        c1 = wp.cross(d2, d0)
        c2 = wp.cross(d0, d1)
        det = wp.dot(d0, c0)
        shape = Tet10()
        slopes = mat43()
        slopes[0] = -(c0 + c1 + c2) / det
        slopes[1] = c0 / det
        slopes[2] = c1 / det
        slopes[3] = c2 / det
        local = mat103()
        for a in range(1, 10):
            local[a] = edge(u, n, conn[a, e])
        mean = mat33()
        for g in range(4):
            mean += R(0.25) * world_gradient(local, slopes, g)
        W, _H = rotated(mean)
        shape.W = W
        shape.u = local
        shape.slopes = slopes
        shape.volume = det / R(24.0)
        return shape

    @wp.func
    def gradient(shape: Tet10, g: int):
        H = world_gradient(shape.u, shape.slopes, g)
        return shape.volume, add_matrices(H, wp.transpose(shape.W), wp.identity(n=3, dtype=R) + H)

    @wp.func
    def rotation(shape: Tet10):
        return shape.W

    @wp.func
    def corner_of(g: int, j: int):
        """Its corner, and middles of edges."""
        if j == 0:
            return g
        if g < 3:
            return 4 + g
        return 6 + j

    @wp.func
    def slope(shape: Tet10, g: int, a: int):
        return shape.volume * gradient_of(shape.slopes, g, a)

    return Formulation("tet10", 10, 4, OWN, Tet10, load_shape, gradient, rotation, 4, corner_of, slope=slope)


KERNELS = SimpleNamespace(
    force_kernel=partial(force_kernel, formulation),
    energy_kernel=partial(energy_kernel, formulation),
    stress_kernel=partial(stress_kernel, formulation),
)


class Tet10:
    """Quadratic displacements; four integration points."""

    name = "tet10"
    cell = "tetra10"
    patches = False

    def lumped_masses(self, x: np.ndarray, rho: np.ndarray) -> np.ndarray:
        """1/36 of the mass at each corner and 4/27 at the middle of each edge."""
        return (rho * tetrahedron.volumes(x[:, :4]))[:, None] * ([1.0 / 36.0] * 4 + [4.0 / 27.0] * 6)

    def largest_eigenvalues(self, x: np.ndarray, K: np.ndarray, G: np.ndarray, mass: np.ndarray) -> np.ndarray:
        """Of the 30 x 30 problem."""
        return largest(self.stiffness(x, K, G, mass))

    def eigenvalue_bounds(self, x, K, G, mass, coarse: bool = False) -> np.ndarray:
        """The largest eigenvalues themselves, or the norm."""
        return largest(self.stiffness(x, K, G, mass), coarse)

    def stiffness(self, x: np.ndarray, K: np.ndarray, G: np.ndarray, mass: np.ndarray) -> np.ndarray:
        """M^-1/2 K M^-1/2 of each element [1/s^2], shape (element_count, 30, 30)."""
        at = np.full((4, 4), FAR) + (NEAR - FAR) * np.eye(4)
        slopes, n = tetrahedron.gradients(x[:, :4]), len(x)
        b = np.empty((n, 4, 10, 3))
        b[:, :, :4] = (4.0 * at - 1.0)[None, :, :, None] * slopes[:, None]
        i, j = EDGES.T
        b[:, :, 4:] = 4.0 * (at[:, i, None] * slopes[:, None, j] + at[:, j, None] * slopes[:, None, i])
        b /= np.sqrt(mass)[:, None, :, None]
        same = np.einsum("egai,egbi->eab", b, b)
        cross = np.einsum("egai,egbj->eaibj", b, b)
        sheared = np.einsum("eab,ij->eaibj", same, np.eye(3)) + cross.transpose(0, 1, 4, 3, 2) - (2.0 / 3.0) * cross
        found = G[:, None, None] * sheared.reshape(n, 30, 30) + K[:, None, None] * cross.reshape(n, 30, 30)
        return 0.25 * tetrahedron.volumes(x[:, :4])[:, None, None] * found

    def stage(self, block: Any, X: np.ndarray, precision: str) -> Any:
        """Its arrays and kernels on the current device."""
        from warp_mca.physics.elements.stage import ElementStage

        return ElementStage(block, precision, KERNELS, points=4)


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The registrations."""
    register(TEN_NODES)
    register(Tet10())


DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_constant_strain_gives_constant_stress_and_no_force_inside(kinematics: str):
    """Patch test, of a cube whose hexahedra, wedges and pyramids are cut."""
    held = held_of(mixed_cube(), "tet10", kinematics)
    strain = 1e-6 * np.array([[3.0, 1.0, -2.0], [1.0, -1.0, 0.5], [-2.0, 0.5, 2.0]])
    X = held.solver.model.X
    force = held.forces(X @ strain)
    inside = ((X > 1e-9) & (X < 1.0 - 1e-9)).all(axis=1)
    assert inside.sum() > 2 and np.abs(force[inside]).max() < 1e-9 * np.abs(force).max()
    recorded = NodalStress(held.solver, np.arange(len(X), dtype=np.int32))
    recorded.launch(held.state)
    stress = 2.0 * STEEL.shear_modulus * strain
    stress += (STEEL.bulk_modulus - 2.0 / 3.0 * STEEL.shear_modulus) * np.trace(strain) * np.eye(3)
    expected = stress[[0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(recorded.tensor.numpy(), np.tile(expected, (len(X), 1)), rtol=2e-5)


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_rotation_gives_no_force_and_forces_are_the_slope_of_the_energy(kinematics: str):
    rng = np.random.default_rng(0)
    held = held_of(mixed_cube(), "tet10", kinematics)
    X = held.solver.model.X
    strained = np.abs(held.forces(1e-3 * X)).max()
    turned = Rotation.from_rotvec([0.7, -1.1, 0.4]).apply(X) - X
    assert np.abs(held.forces(turned)).max() < 1e-10 * strained
    u = turned + 3e-4 * rng.uniform(-1.0, 1.0, X.shape)
    force, way, h = held.forces(u), rng.normal(size=X.shape), 1e-7
    slope = (energy(held, u + h * way) - energy(held, u - h * way)) / (2.0 * h)
    assert -np.sum(force * way) == pytest.approx(slope, rel={"finite": 1e-6, "corotational": 1e-2}[kinematics])


def cantilever(element: str, **values: Any) -> mca.Scene:
    scene = mca.make_scene("cantilever", axial=10, deep=2, wide=1, samples=100, duration=8e-3, **values)
    return replace(scene, bodies=(replace(scene.bodies[0], element=element),))


@pytest.mark.parametrize("device", DEVICES)
def test_a_cantilever_vibrates_at_the_frequency_of_a_beam(device: str):
    """Half a period of the first mode, with 1.8751^2 sqrt(E I / (rho A L^4)); two cells over the depth."""
    half = np.pi / (1.87510407**2 * np.sqrt(70e9 * 0.1**2 / (12.0 * 2700.0)))
    error = {}
    for element in ("tet10", "tet4"):
        result = mca.run(cantilever(element, sag=100.0), device=device)
        turn = np.flatnonzero(np.diff(np.sign(result["tip_vy"][1:])) > 0)[0] + 1
        v = result["tip_vy"][turn : turn + 2]
        error[element] = (result.time[turn] + result.time[1] * v[0] / (v[0] - v[1])) / half - 1.0
        if element == "tet10":
            assert result.summary["energy_error"] < 1e-4
    assert abs(error["tet10"]) < 0.02 < 5.0 * abs(error["tet10"]) < abs(error["tet4"])


def striking() -> mca.Scene:
    """A bar of ten-node tetrahedra strikes a rigid block, and yields there."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=100e6, E_t=7e9, beta=0.3)
    box = mca.Box(size=(0.02, 0.005, 0.005), divisions=(4, 1, 1)).build()
    x = box.points[:, 0] / 0.02
    box.points[:, 0] = 0.02 * (1.0 - (1.0 - x) ** 2)
    block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2), origin=(0.02, -0.0025, -0.0025))
    bar = {"geometry": box, "material": metal, "element": "tet10", "velocity": (10.0, 0.0, 0.0)}
    return mca.Scene(
        name="striking",
        bodies=(
            mca.Body(name="bar", kinematics="finite", **bar),
            mca.Body(name="block", geometry=block, material=STEEL, rigid=True),
        ),
        contacts=(
            mca.Contact(
                slave=mca.Surface(body="bar", nodes="xmax"),
                master=mca.Surface(body="block", nodes="xmin"),
                penalty=0.05,
            ),
        ),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6, time_step_scale=0.2),
    )


@pytest.mark.parametrize("device", DEVICES)
def test_a_bar_strikes_a_rigid_block_and_is_shown_with_all_its_nodes(device: str, tmp_path: Path):
    result = holds_up(striking(), device, tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-4
    mca.run(striking(), device=device, recorders=(VtkHdfFile(tmp_path / "bar.vtkhdf"),))
    with h5py.File(tmp_path / "bar.vtkhdf") as file:
        assert set(file["VTKHDF/Types"][:]) == {TEN_NODES.vtk, HEXAHEDRON.vtk}
