"""An element of the user's own on a cell type of its own: a ten-node tetrahedron on the shared kernel of forces.

Its points, masses and eigenvalues are those of `tet10`. It adds the gradients of the shape functions, which are all
that `force_kernel` needs; forces must be those of `tet10`.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace

import h5py
import numpy as np
import pytest
import warp as wp
from outside import holds_up, striking
from test_elements import held_of

import warp_mca as mca
from warp_mca.geometry.cell_types import HEXAHEDRON, TETRA10
from warp_mca.geometry.degenerate import with_middles
from warp_mca.geometry.tetra10 import FAR, NEAR
from warp_mca.kernels.elements import tet10
from warp_mca.kernels.elements.formulation import OWN, Formulation, force_kernel
from warp_mca.kernels.elements.readings import energy_kernel, stress_kernel
from warp_mca.kernels.elements.tet10_points import POINT, tet10_functions
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.physics.elements.stage import ElementStage
from warp_mca.physics.elements.tet10 import Tet10
from warp_mca.recorders import VtkHdfFile
from warp_mca.verify.small_meshes import mixed_cube


def cells_of_its_own(mesh: mca.Mesh) -> mca.Mesh:
    """The mesh with all cells cut to the type below."""
    made = with_middles(mesh)
    return replace(made, others={"own10": made.others["tetra10"]})


CELL = replace(TETRA10, name="own10", stored_as="own10", made=cells_of_its_own)


@cache
def formulation(precision: str, law_name: str, finite: bool) -> Formulation:
    """Points of `tet10`; gradients of shape functions from those of the barycentric coordinates."""
    R = scalars(precision).real
    TenNodes, _load, point_gradient = tet10_functions(precision, finite)

    @wp.func
    def coordinate(g: int, i: int):
        if i == g:
            return R(NEAR)
        return R(FAR)

    @wp.func
    def slope(it: TenNodes, g: int, a: int):
        _H, c, _volume = point_gradient(it, g)
        b = R(POINT) * wp.matrix_from_rows(-c[0] - c[1] - c[2], c[0], c[1], c[2])
        if a < 4:
            return (R(4.0) * coordinate(g, a) - R(1.0)) * b[a]
        i = a - 4
        j = (a - 3) % 3
        if a > 6:
            i = a - 7
            j = 3
        return R(4.0) * (coordinate(g, i) * b[j] + coordinate(g, j) * b[i])

    return replace(tet10.formulation(precision, law_name, finite, "own_tet10", OWN), slope=slope)


KERNELS = SimpleNamespace(
    force_kernel=partial(force_kernel, formulation),
    energy_kernel=partial(energy_kernel, formulation),
    stress_kernel=partial(stress_kernel, formulation),
)


class OwnTet10(Tet10):
    """With kernels of its own."""

    name, cell = "own_tet10", CELL.name

    def __init__(self) -> None:
        self.mean = False

    def stage(self, block, X: np.ndarray, precision: str) -> ElementStage:
        """Its arrays and kernels on the current device."""
        return ElementStage(block, precision, KERNELS, points=4)


@pytest.fixture(autouse=True)
def registered(register: Callable[..., object]) -> None:
    """The registrations."""
    register(CELL)
    register(OwnTet10())


@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_forces_are_those_of_tet10(kinematics: str):
    rng = np.random.default_rng(0)
    own, theirs = held_of(mixed_cube(), "own_tet10", kinematics), held_of(mixed_cube(), "tet10", kinematics)
    # at small strain `tet10` knows that its frame turns, which is of the second order in u
    size, tolerance = (0.02, 1e-13) if kinematics == "finite" else (1e-8, 1e-6)
    u = size * rng.normal(size=own.solver.model.X.shape)
    expected = theirs.forces(u)
    np.testing.assert_allclose(own.forces(u), expected, atol=tolerance * np.abs(expected).max())


def metal_bar(element: str) -> mca.Scene:
    """A bar of few cells, which yields where it strikes."""
    metal = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=100e6, E_t=7e9, beta=0.3)
    box = mca.Box(size=(0.02, 0.005, 0.005), divisions=(4, 1, 1)).build()
    return striking(box, metal, 10.0, element=element, kinematics="finite")


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_bar_strikes_a_rigid_block_and_is_shown_with_all_its_nodes(device: str, tmp_path: Path):
    scene = metal_bar("own_tet10")
    result = holds_up(scene, device, tmp_path)
    assert result.summary["max_plastic_strain"] > 1e-4
    mca.run(scene, device=device, recorders=(VtkHdfFile(tmp_path / "bar.vtkhdf"),))
    with h5py.File(tmp_path / "bar.vtkhdf") as file:
        assert set(file["VTKHDF/Types"][:]) == {CELL.vtk, HEXAHEDRON.vtk}
