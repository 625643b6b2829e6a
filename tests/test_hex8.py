"""The hexahedron against an independent NumPy element, the patch test, rigid rotation and its own energy."""

import itertools

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from warp_mca.geometry.hexahedron import gradients
from warp_mca.geometry.mesh import Mesh
from warp_mca.kernels.elements import hex8
from warp_mca.kernels.elements.rotation import nearest_rotation
from warp_mca.kernels.hardware.scalars import scalars
from warp_mca.model.stable_step import Elements, stable_step
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.hexahedron import eigenvalue_bounds, largest_eigenvalues, lumped_masses
from warp_mca.scene.materials import Elastic, J2Bilinear

K, G = 50.7e9, 27.6e9
CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)
# MacNeal and Harder, Finite Elements in Analysis and Design 1 (1985) 3, Fig. 2
INNER = np.array(
    [
        [0.249, 0.342, 0.192], [0.826, 0.288, 0.288], [0.850, 0.649, 0.263], [0.273, 0.750, 0.230],
        [0.320, 0.186, 0.643], [0.677, 0.305, 0.683], [0.788, 0.693, 0.644], [0.165, 0.745, 0.702],
    ]
)  # fmt: skip
PATCH = np.array(
    [
        [8, 9, 10, 11, 12, 13, 14, 15],
        [0, 1, 2, 3, 8, 9, 10, 11], [12, 13, 14, 15, 4, 5, 6, 7],
        [0, 1, 9, 8, 4, 5, 13, 12], [11, 10, 2, 3, 15, 14, 6, 7],
        [0, 8, 11, 3, 4, 12, 15, 7], [9, 1, 2, 10, 13, 5, 6, 14],
    ]
)  # fmt: skip


def launch(X, hexahedra, u, precision, *, sigma_y=None):
    """Forces on nodes (node_count, 3) and energies (5, element_count) of a displacement field."""
    t = scalars(precision)
    plastic, count = sigma_y is not None, len(hexahedra)
    law_name = J2Bilinear.law if plastic else Elastic.law
    with wp.ScopedDevice("cpu"):
        arrays = [
            wp.array(X, dtype=wp.vec3d),
            wp.array(hexahedra.T.astype(np.int32).copy()),
            wp.zeros(count, dtype=int),
        ]
        law = wp.array(np.array([[K, G, sigma_y or 0.0, 40e9, 0.0]]), dtype=t.real)
        history = [wp.zeros(count * plastic, dtype=int), wp.zeros((48, count * plastic), dtype=t.real)]
        field = wp.array(u, dtype=wp.vec3d)
        force = wp.full(8 * count, np.nan, dtype=t.vec3)
        energy = wp.full((5, count), np.nan, dtype=t.real)
        extreme = wp.zeros((2, count), dtype=t.real)
        kernel = hex8.force_kernel(precision, law_name)
        wp.launch(kernel, count, inputs=[*arrays, law, field, 0, count, 0.0], outputs=[*history, extreme, force])
        kernel = hex8.energy_kernel(precision, law_name)
        nodal = wp.zeros((0, 0), dtype=int), wp.zeros(0, dtype=t.real)
        outputs = [energy, wp.zeros((5, count), dtype=wp.float32)]
        wp.launch(kernel, count, inputs=[*arrays, law, *history, extreme, field, 0, *nodal], outputs=outputs)
    total = np.zeros_like(X)
    for a in range(8):
        np.add.at(total, hexahedra[:, a], force.numpy().reshape(8, count, 3)[a].astype(float))
    return total, energy.numpy().astype(float)


def reference_force(x, u):
    """Forces of one element by plain quadrature, small strain, mean dilatation."""
    b, w = (part[0] for part in gradients(x[None]))
    grad = np.einsum("ai,gaj->gij", u, b)
    theta = (w * np.trace(grad, axis1=1, axis2=2)).sum() / w.sum()
    strain = 0.5 * (grad + grad.transpose(0, 2, 1))
    stress = 2.0 * G * (strain - np.trace(strain, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3))
    return -np.einsum("g,gij,gaj->ai", w, stress + K * theta * np.eye(3), b)


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 1e-6), ("mixed", 3e-5)])
def test_forces_equal_plain_quadrature_at_small_strain(precision, tolerance):
    """The forms differ by the square of the strain: 1e-7 of the forces here."""
    rng = np.random.default_rng(0)
    for _ in range(5):
        x = 1e-3 * (CUBE + rng.uniform(-0.15, 0.15, (8, 3)))
        u = rng.normal(0.0, 1e-10, (8, 3))
        force, _ = launch(x, np.arange(8)[None], u, precision)
        expected = reference_force(x, u)
        assert force == pytest.approx(expected, abs=tolerance * np.abs(expected).max())


@pytest.mark.parametrize(("precision", "tolerance"), [("float64", 5e-15), ("mixed", 2e-6)])
def test_rigid_motion_leaves_no_force(precision, tolerance):
    x = np.random.default_rng(1).uniform(-0.1, 0.1, (8, 3)) + CUBE
    c, s = np.cos(1.0), np.sin(1.0)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) @ np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    force, energy = launch(x, np.arange(8)[None], x @ turn.T - x + [3.0, -1.0, 2.0], precision)
    assert np.abs(force).max() < tolerance * 10.0 * K
    assert energy[0, 0] < (tolerance * 10.0) ** 2 * K


@pytest.mark.parametrize(("precision", "digits"), [("mixed", 2e-7), ("float64", 1e-15)])
@pytest.mark.parametrize("angle", [1e-3, 1.0])
def test_rotation_is_the_polar_factor_to_rounding_of_its_own_size(angle, precision, digits):
    """Of gradients with a stretch of up to 10 %."""
    t = scalars(precision)
    rotation = nearest_rotation(precision)

    @wp.kernel(enable_backward=False, module="unique")
    def turn(F: wp.array(dtype=t.mat33), W_out: wp.array(dtype=t.mat33)):
        i = wp.tid()
        W_out[i] = rotation(F[i])

    rng = np.random.default_rng(11)
    Q = Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8])).as_matrix()
    frames = Rotation.random(50, rng=rng).as_matrix()
    stretch = np.einsum("nij,nj,nkj->nik", frames, 1.0 + 0.1 * min(angle, 1.0) * rng.uniform(-1, 1, (50, 3)), frames)
    out = wp.full(50, np.nan, dtype=t.mat33, device="cpu")
    wp.launch(turn, 50, inputs=[wp.array(Q @ stretch, dtype=t.mat33, device="cpu")], outputs=[out], device="cpu")
    assert out.numpy() == pytest.approx(np.broadcast_to(Q - np.eye(3), (50, 3, 3)), abs=6.0 * digits * angle + 4e-16)


def test_forces_turn_with_the_element():
    """Strain it, then turn it: the forces are the turned forces, to round-off."""
    rng = np.random.default_rng(9)
    x = CUBE + rng.uniform(-0.1, 0.1, (8, 3))
    u = rng.normal(0.0, 1e-2, (8, 3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    still, energy = launch(x, np.arange(8)[None], u, "float64")
    turned, same = launch(x, np.arange(8)[None], (x + u) @ turn.T - x, "float64")
    assert turned == pytest.approx(still @ turn.T, abs=1e-12 * np.abs(still).max())
    assert same[:, 0] == pytest.approx(energy[:, 0], rel=1e-12)


def test_mirrored_element_counts_as_inverted():
    """Its stretch is one, so that only the reflection tells."""
    x = CUBE + np.random.default_rng(10).uniform(-0.1, 0.1, (8, 3))
    for precision in ("mixed", "float64"):
        _, energy = launch(x, np.arange(8)[None], x * [-2.0, 0.0, 0.0], precision)
        assert energy[3, 0] == pytest.approx(-1.0, rel=1e-5)


def test_patch_of_distorted_hexahedra_carries_constant_strain():
    X = np.concatenate([CUBE, INNER])
    assert lumped_masses(X[PATCH], np.ones(7)).sum() == pytest.approx(1.0, rel=1e-12)
    gradient = 1e-9 * np.array([[1.0, 0.4, -0.2], [0.3, -0.7, 0.5], [0.1, 0.2, 0.6]])
    force, energy = launch(X, PATCH, X @ gradient.T, "float64")
    strain = 0.5 * (gradient + gradient.T)
    stress = 2.0 * G * (strain - np.trace(strain) / 3.0 * np.eye(3)) + K * np.trace(strain) * np.eye(3)
    assert np.abs(force[8:]).max() < 1e-8 * np.abs(stress).max()  # strain squared
    assert energy[0].sum() == pytest.approx(0.5 * (stress * strain).sum(), rel=1e-7)


def test_forces_are_minus_the_gradient_of_the_energy():
    """Up to the strain, which the co-rotational form neglects beside one."""
    rng = np.random.default_rng(2)
    x = CUBE + rng.uniform(-0.1, 0.1, (8, 3))
    u, h = rng.normal(0.0, 1e-5, (8, 3)), 1e-8
    force, _ = launch(x, np.arange(8)[None], u, "float64")
    slope = np.zeros((8, 3))
    for a, i in itertools.product(range(8), range(3)):
        step = np.zeros((8, 3))
        step[a, i] = h
        up, down = (launch(x, np.arange(8)[None], u + sign * step, "float64")[1][0, 0] for sign in (1.0, -1.0))
        slope[a, i] = (up - down) / (2.0 * h)
    assert force == pytest.approx(-slope, abs=1e-4 * np.abs(force).max())


def test_plastic_kernel_below_yield_is_the_elastic_one():
    x = CUBE + np.random.default_rng(4).uniform(-0.1, 0.1, (8, 3))
    u = 1e-4 * np.random.default_rng(5).normal(size=(8, 3))
    elastic, _ = launch(x, np.arange(8)[None], u, "float64")
    found, _ = launch(x, np.arange(8)[None], u, "float64", sigma_y=1e12)
    assert found == pytest.approx(elastic, abs=1e-14 * np.abs(elastic).max())
    yielding, energy = launch(x, np.arange(8)[None], u, "float64", sigma_y=1e6)
    assert np.abs(yielding).max() < 0.9 * np.abs(elastic).max()
    assert energy[1, 0] > 0.0


def test_eigenvalues_bound_each_other_and_meet_the_cubes_closed_form():
    rng = np.random.default_rng(6)
    x = 1e-3 * (CUBE + rng.uniform(-0.2, 0.2, (200, 8, 3)))
    moduli, rho = (np.full(200, K), np.full(200, G)), np.full(200, 2700.0)
    mass = lumped_masses(x, rho)
    exact = largest_eigenvalues(x, *moduli, mass)
    assert (eigenvalue_bounds(x, *moduli, mass) >= exact).all()
    conn = np.arange(1600).reshape(200, 8)
    found = stable_step(
        Elements(ELEMENTS["hex8"], x.reshape(-1, 3), conn, *moduli, mass, np.zeros(200), np.arange(200))
    )
    assert found.element == exact.argmax()
    assert found.dt == pytest.approx(2.0 / np.sqrt(exact.max()), rel=1e-12)
    cube = 1e-3 * CUBE[None]  # uniform dilatation is its fastest mode: energy 9 K / 2 on masses of 1/8 rho h^3
    one = largest_eigenvalues(cube, moduli[0][:1], moduli[1][:1], lumped_masses(cube, rho[:1]))
    assert one[0] == pytest.approx(12.0 * K / (2700.0 * 1e-6), rel=1e-10)


def test_eigenvalue_is_that_of_the_kernels_forces():
    """Power iteration on the force kernel, which shares no code with the host's integrals."""
    x = CUBE + np.random.default_rng(7).uniform(-0.15, 0.15, (8, 3))
    mass = lumped_masses(x[None], np.ones(1))
    exact = largest_eigenvalues(x[None], np.array([K]), np.array([G]), mass)[0]
    mode, value = np.random.default_rng(8).normal(size=(8, 3)), 0.0
    for _ in range(300):
        mode *= 1e-9 / np.abs(mode).max()
        push = -launch(x, np.arange(8)[None], mode, "float64")[0] / mass[0][:, None]
        value = (push * mode * mass[0][:, None]).sum() / (mode * mode * mass[0][:, None]).sum()
        mode = push
    assert value == pytest.approx(exact, rel=1e-3)


def test_boundary_faces_point_outwards():
    mesh = Mesh(np.concatenate([CUBE, INNER]), PATCH.astype(np.int32))
    faces, _ = mesh.boundary
    corners = mesh.points[faces]
    normal = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert len(faces) == 6
    assert (np.einsum("fi,fi->f", normal, corners.mean(axis=1) - 0.5) > 0.0).all()
