"""Owns the tests of the shape that a body keeps: springback in closed form, rigid motion, held axes, refusals."""

from collections.abc import Callable

import numpy as np
import pytest
from impacts import Displaced, prepared
from scipy import sparse
from scipy.spatial.transform import Rotation

import warp_mca as mca
from warp_mca.base.blas import lapack_threads
from warp_mca.base.errors import GuardError
from warp_mca.model.build import build_model
from warp_mca.phases.residual import Relaxation
from warp_mca.phases.settings import Settings
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.equilibrium import equilibrium
from warp_mca.rigid.factors import inverse
from warp_mca.rigid.pieces import free_motions, shared_elements
from warp_mca.rigid.stiffness import Stiffness
from warp_mca.step.solver import Solver

E, SIGMA_Y, E_T = 70e9, 110e6, 27e9


def metal(nu: float, beta: float = 0.0) -> mca.J2Bilinear:
    return mca.J2Bilinear(E=E, nu=nu, rho=2700.0, sigma_y=SIGMA_Y, E_t=E_T, beta=beta)


class Body(Displaced):
    """One body in float64, whose forces leave its plastic history alone."""

    def __init__(self, geometry: mca.Box | mca.Rod, material: mca.Elastic, kinematics: str = "corotational") -> None:
        body = mca.Body(name="bar", geometry=geometry, material=material, kinematics=kinematics)
        scene = mca.Scene(name="test", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))
        meshes = mca.mesh(scene)
        self.masses, self.points = nodal_masses(scene, meshes)["bar"], meshes["bar"].points
        model = build_model(scene, meshes, {"bar": self.points}, {"bar": np.zeros_like(self.points)})
        super().__init__(Solver(model, device="cpu", precision="float64", dt=1e-9))

    def yielding(self, u: np.ndarray) -> np.ndarray:
        """Forces of displacements [N]; elements yield and keep their plastic strain."""
        return super().forces(u)

    def forces(self, u: np.ndarray) -> np.ndarray:
        """Forces of displacements [N] from the plastic strain that there is."""
        before = self.state.copy()
        total = self.yielding(u)
        self.state.assign(before)
        return total

    def energy(self, u: np.ndarray) -> float:
        """Elastic energy [J]."""
        before = self.state.copy()
        self.yielding(u)
        found = float(self.energies()[[0, 4]].sum())
        self.state.assign(before)
        return found

    def relax(self, u: np.ndarray, **given):
        given = {"elastic_energy": self.energy(u), **given}
        return equilibrium(self.forces, u, self.points, self.masses, **given)

    def gradient(self, u: np.ndarray) -> np.ndarray:
        """Mean displacement gradient, by least squares."""
        arms = self.points - self.points.mean(axis=0)
        return np.linalg.lstsq(arms, u - u.mean(axis=0), rcond=None)[0].T


BAR = mca.Box(size=(0.04, 0.01, 0.01), divisions=(4, 2, 2))


@pytest.mark.parametrize("e", [0.004, 0.01])
@pytest.mark.parametrize("kinematics", ["corotational", "finite"])
def test_a_stretched_bar_keeps_its_plastic_strain_exactly(kinematics: str, e: float):
    """Isochoric stretch e: dp = (3 G e - sigma_y) / (3 G + H). Without load no stress is left, and the strain is dp; or
    sigma_y / H where the back stress H dp was greater than the yield stress, so that it yielded on the way back."""
    law = metal(0.3)
    body = Body(BAR, law, kinematics)
    u = body.points * (np.expm1([e, -e / 2, -e / 2]) if kinematics == "finite" else [e, -e / 2, -e / 2])
    body.yielding(u)
    start = body.energy(u)
    found = body.relax(u)
    G, H = law.shear_modulus, law.hardening_modulus
    dp = (3.0 * G * e - SIGMA_Y) / (3.0 * G + H)
    left = min(dp, SIGMA_Y / H)
    assert (left < dp) == (e > 0.005)
    kept = np.array([left, -left / 2, -left / 2])
    kept = np.expm1(kept) if kinematics == "finite" else kept
    np.testing.assert_allclose(body.gradient(found.u), np.diag(kept), atol=1e-4 * (e - left))
    body.yielding(found.u)
    assert body.energy(found.u) < 1e-6 * start and found.remaining < 1e-6 * start
    if left == dp:
        assert found.released == pytest.approx(start, rel=0.01)


def bending_moment(curvature: float, height: float, law: mca.J2Bilinear) -> float:
    """M over the width [N] where a strain kappa y along x, and no other, was applied, Poisson's ratio 0.

    Deviatoric stress 4 G eps / 3 along x until 2 G eps = sigma_y, then 2 q / 3 with q = sigma_y + H dp and
    dp = (2 G eps - sigma_y) / (3 G + H), plus K eps; integrated over 0 <= y <= height / 2, twice.
    """
    G, H, K, c = law.shear_modulus, law.hardening_modulus, law.bulk_modulus, 0.5 * height
    first = min(SIGMA_Y / (2.0 * G * curvature), c)  # where it yields
    elastic = (K + 4.0 * G / 3.0) * curvature * first**3 / 3.0
    slope = K * curvature + 2.0 / 3.0 * H * 2.0 * G * curvature / (3.0 * G + H)
    level = 2.0 / 3.0 * SIGMA_Y * (1.0 - H / (3.0 * G + H))
    plastic = slope * (c**3 - first**3) / 3.0 + level * (c**2 - first**2) / 2.0
    return 2.0 * (elastic + plastic)


def test_a_bent_beam_springs_back_by_its_moment_over_its_stiffness():
    """Poisson's ratio 0: other stresses relax by themselves, and the curvature falls by M / (E I)."""
    height, length, law, curvature = 0.01, 0.06, metal(0.0, beta=1.0), 0.8
    body = Body(mca.Box(size=(length, height, 0.005), divisions=(48, 8, 1)), law)
    x, y = body.points[:, 0] - 0.5 * length, body.points[:, 1] - 0.5 * height
    u = np.column_stack([-curvature * x * y, 0.5 * curvature * x**2, 0.0 * x])
    body.yielding(u)
    found = body.relax(u)
    inner = (np.abs(x) < 1.5 * height) & (np.abs(y) < 1e-9)
    after = 2.0 * np.polyfit(x[inner], found.u[inner, 1], 2)[0]
    springback = bending_moment(curvature, height, law) / (E * height**3 / 12.0)
    assert 0.2 * curvature < springback < 0.8 * curvature  # both parts show
    assert curvature - after == pytest.approx(springback, rel=0.01)


def test_vibration_leaves_and_rigid_motion_stays():
    """A bar that never yielded, far from its place, turned and shaking: what is left is its rigid shape."""
    body = Body(BAR, mca.Elastic(E=E, nu=0.3, rho=2700.0))
    turn = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
    x, y, z = ((body.points - 0.02) / 0.04).T
    shake = 4e-5 * np.column_stack([x * y, np.sin(2.0 * x) + z * y, x * z])
    u = (body.points + shake) @ turn.T + [0.3, -0.2, 0.1] - body.points
    found = body.relax(u)
    shape = body.points + found.u
    before = body.points + u
    np.testing.assert_allclose(body.masses @ shape, body.masses @ before, rtol=1e-13)
    arms = shape - body.masses @ shape / body.masses.sum()
    assert np.abs(body.masses @ np.cross(arms, before - shape)).max() < 1e-4 * body.masses @ np.abs(
        arms * (before - shape)
    ).sum(axis=1)
    lengths = [np.linalg.norm(points - points[0], axis=1) for points in (shape, body.points)]
    np.testing.assert_allclose(*lengths, atol=1e-3 * np.abs(shake).max())
    assert body.energy(found.u) < 1e-6 * body.energy(u)


def test_held_axes_keep_their_displacement():
    body = Body(BAR, mca.Elastic(E=E, nu=0.3, rho=2700.0))
    foot = body.points[:, 1] == 0.0
    held = np.zeros(body.points.shape, dtype=bool)
    held[foot, 1:] = True
    u = 1e-5 * np.random.default_rng(1).uniform(-1.0, 1.0, body.points.shape) + [0.01, 0.0, 0.0]
    u[foot, 1:] = 0.0
    found = body.relax(u, held=held)
    assert not found.u[foot, 1:].any()
    np.testing.assert_allclose(found.u[:, 0], body.masses @ u[:, 0] / body.masses.sum(), atol=1e-8)
    assert body.energy(found.u) < 1e-6 * body.energy(u)


@pytest.mark.parametrize("finest", [1e-3, 2e-4])
def test_iterations_on_a_graded_rod_stay_in_the_hundreds(finest: float):
    rod = mca.Rod(radius=0.013, length=0.21, section=2, ring=2, axial=8, focus_size=finest, focus_layers=3)
    body = Body(rod, mca.Elastic(E=E, nu=0.27, rho=2700.0))
    x, y, _ = body.points.T
    near = np.exp(-(((body.points - body.points[x.argmax()]) / 2e-3) ** 2).sum(axis=1))
    u = np.column_stack([-8e-4 * x * y - 2e-6 * near, 4e-4 * x**2, 0.0 * x])
    found = body.relax(u)
    assert found.evaluations < 1000
    assert body.energy(found.u) < 1e-6 * body.energy(u)


def test_a_body_at_rest_stays_as_it_is():
    body = Body(BAR, mca.Elastic(E=E, nu=0.3, rho=2700.0))
    found = body.relax(np.zeros_like(body.points), elastic_energy=0.0)
    assert not found.u.any() and found.evaluations == 1


@pytest.mark.parametrize(
    ("forces", "message"),
    [
        (lambda u: u * np.nan, "internal forces of bar became infinite"),
        (lambda u: 1e3 * u, "shape of bar without vibration was not found: .*no stiffness"),
        (lambda u: -1e3 * np.sign(u), "shape of bar without vibration was not found: .*no stiffness"),
    ],
)
def test_a_search_that_fails_says_why(forces: Callable[[np.ndarray], np.ndarray], message: str):
    points = BAR.build().points
    u = np.random.default_rng(0).normal(size=points.shape) * 1e-5
    with pytest.raises(GuardError, match=message):
        equilibrium(forces, u, points, np.ones(len(points)), elastic_energy=1e-6, name="bar")


@pytest.mark.parametrize("held", [True, False])
def test_a_body_that_nothing_has_strained_keeps_its_shape(held: bool):
    """Displacements are rounded: no share of the elastic energy that they have then says when forces are small."""
    body = mca.Body(name="bar", geometry=mca.Box(size=(0.1, 0.01, 0.01), divisions=(10, 2, 2)), material=metal(0.3))
    fixed = (mca.Fixed(body="bar", nodes="xmin"),) if held else ()
    scene = mca.Scene(name="flying", bodies=(body,), fixed=fixed, impact=mca.ImpactPhase(duration=1e-6))
    relaxation = Relaxation(prepared(scene).model, Settings("cpu", "float64", 1))
    X = relaxation.model.X
    turn = Rotation.from_euler("z", 0.0 if held else 0.7).as_matrix()
    u = X @ turn.T - X + (0.0 if held else 0.3)
    u += 1e-17 * np.random.default_rng(0).standard_normal(u.shape) * (X[:, :1] > 0.0)
    shape = relaxation.settle(u, relaxation.solver.new_state())
    np.testing.assert_allclose(shape.u, u, atol=1e-14)


def test_forces_asked_for_again_are_those_of_a_new_search():
    """Launches are replayed, from the history at the start whatever yielded since, and with other displacements."""
    beam = mca.Body(name="beam", geometry=mca.Box(size=(0.04, 0.01, 0.01), divisions=(4, 1, 2)), material=metal(0.3))
    scene = mca.Scene(name="beam", bodies=(beam,), impact=mca.ImpactPhase(duration=1e-6))
    model, settings = prepared(scene).model, Settings("cpu", "float64", 1)
    asked = Relaxation(model, settings)
    moves = 1e-4 * np.random.default_rng(0).normal(size=(3, *model.X.shape))
    for u in (*moves, moves[0], 0.0 * moves[0], moves[1]):
        new = Relaxation(model, settings)
        assert np.array_equal(asked._forces(u), new._forces(u))
        assert asked._energies() == new._energies()
    assert asked.trial.elements[0].yielded.numpy().any()


def bent(body: Body, curvature: float) -> np.ndarray:
    """Displacements that bend a bar along x to an arc [m]."""
    x = body.points - body.points.mean(axis=0)
    angle, r = curvature * x[:, 0], 1.0 / curvature - x[:, 1]
    return np.stack([r * np.sin(angle) - x[:, 0], 1.0 / curvature - r * np.cos(angle) - x[:, 1], 0.0 * angle], axis=1)


def stiffness(body: Body, before: Stiffness | None = None) -> Stiffness:
    pattern = shared_elements([block.conn for block in body.solver.model.blocks], len(body.points))
    return Stiffness(body.forces, pattern, before=before)


def test_the_inverse_of_the_stiffness_gives_the_same_shape_in_few_evaluations():
    """Its factors hold on where the body has turned."""
    body = Body(mca.Box(size=(0.1, 0.01, 0.01), divisions=(12, 2, 2)), metal(0.3))
    u = bent(body, 4.0)
    body.yielding(u)
    kept = stiffness(body)
    alone, factored = body.relax(u), body.relax(u, stiffness=kept)
    assert 3 * factored.evaluations < 2 * alone.evaluations
    np.testing.assert_allclose(factored.u, alone.u, atol=1e-4 * np.abs(u - alone.u).max())
    assert factored.released == pytest.approx(alone.released, rel=1e-4)
    shaken = factored.u + bent(body, 0.05)
    turn = Rotation.from_rotvec([0.4, -0.9, 1.3]).as_matrix()
    first = body.relax(shaken, stiffness=(kept := stiffness(body)))
    again = body.relax((body.points + shaken) @ turn.T - body.points, stiffness=stiffness(body, kept))
    assert 10 * again.evaluations < first.evaluations
    np.testing.assert_allclose((body.points + again.u) @ turn, body.points + first.u, atol=1e-10)


def test_factors_of_another_shape_are_found_anew():
    """A straight bar is no guide to one that is bent by 0.8 rad."""
    body = Body(mca.Box(size=(0.1, 0.005, 0.01), divisions=(24, 2, 2)), metal(0.3), "finite")
    straight = stiffness(body)
    body.relax(bent(body, 0.1), stiffness=straight)
    body.yielding(bent(body, 8.0))
    u = body.relax(bent(body, 8.0)).u + bent(body, 0.02)
    found, expected = (body.relax(u, stiffness=stiffness(body, before)) for before in (straight, None))
    assert found.evaluations > expected.evaluations
    np.testing.assert_allclose(found.u, expected.u, atol=1e-3 * np.abs(u - expected.u).max())


def test_factors_turn_with_each_body_of_a_hinge():
    """Two lattices of springs to neighbours and to the ground, which have three nodes in common and turn one by one."""
    rng = np.random.default_rng(0)
    near = [sparse.csr_array(np.eye(k, k=1) + np.eye(k, k=-1) - 2.0 * np.eye(k)) for k in (4, 3, 6)]
    ones = [sparse.eye_array(k) for k in (4, 3, 6)]
    lattice = sum(
        sparse.kron(
            sparse.kron(*(near[k] if k == axis else ones[k] for k in (0, 1))), near[2] if axis == 2 else ones[2]
        )
        for axis in range(3)
    )
    tensor = np.array([[3.0, 1.0, 0.5], [1.0, 2.0, 0.3], [0.5, 0.3, 1.7]])
    one = sparse.kron(-lattice, tensor) + 0.01 * sparse.eye_array(216)
    K = sparse.bsr_array(sparse.block_diag([one, one]), blocksize=(3, 3))
    pairs = np.array([[71, 70, 69], [72, 73, 74]])
    shape = rng.normal(size=(144, 3))
    found = inverse(K, shape, pairs)
    assert found and found.exact
    turns = Rotation.from_rotvec([[0.4, -0.9, 1.3], [-1.1, 0.2, 0.7]]).as_matrix()
    node = np.repeat(turns, 72, axis=0)
    R = sparse.block_diag(list(node))
    joined = np.eye(432)
    for first, second in pairs.T:
        joined[3 * second : 3 * second + 3] = joined[3 * first : 3 * first + 3]
    free = np.setdiff1d(np.arange(432), 3 * pairs[1][:, None] + np.arange(3))
    r = rng.normal(size=(144, 3))
    r[pairs[1]] = 0.0
    expected = np.zeros(432)
    total = joined[:, free].T @ (R @ K @ R.T) @ joined[:, free]
    expected[free] = np.linalg.solve(total, r.ravel()[free])
    p = found.at(np.einsum("nij,nj->ni", node, shape) + node[:, 0])(r)
    np.testing.assert_allclose(p.ravel(), expected, atol=1e-4 * np.abs(expected).max())
    np.testing.assert_allclose(found.trace[free[::3] // 3], total.diagonal().reshape(-1, 3).sum(axis=1), rtol=1e-12)


@pytest.mark.parametrize(("joined", "held", "count"), [("no", 0, 12), ("edge", 0, 7), ("face", 0, 6), ("edge", 3, 1)])
def test_pieces_move_without_strain_as_their_joints_let_them(joined: str, held: int, count: int):
    """Two cubes of a cell, side by side: apart, hinged along an edge, glued, and one of them held."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], float)
    X = np.concatenate([corner, corner + np.array([1.0, 0.0, 0.0])])
    pairs = {"no": ([], []), "edge": ([1, 5], [8, 12]), "face": ([1, 2, 5, 6], [8, 11, 12, 15])}[joined]
    fixed = np.zeros(X.shape, dtype=bool)
    fixed[[0, 2, 5][:held]] = True
    pattern = shared_elements([np.arange(8)[:, None], np.arange(8, 16)[:, None]], len(X))
    fields = free_motions(X, np.ones(len(X)), pattern, fixed, np.array(pairs, dtype=int))
    assert fields is not None and fields.shape == (16, 3, count)
    assert np.abs(fields[fixed]).max(initial=0.0) < 1e-9
    stretch = np.einsum("ijc,ijck->ijk", X[:8] - X[:8, None], fields[:8] - fields[:8, None])
    assert np.abs(stretch).max() < 1e-9


def test_factors_have_the_same_bits_on_any_number_of_threads():
    """A slender lattice of springs, 12 by 9 nodes wide."""
    threads = lapack_threads()
    assert threads, "SciPy has no OpenBLAS here"
    number, use = threads
    before = number()
    near = [sparse.csr_array(np.eye(k, k=1) + np.eye(k, k=-1) - 2.0 * np.eye(k)) for k in (12, 9, 12)]
    ones = [sparse.eye_array(k) for k in (12, 9, 12)]
    lattice = sparse.kron(sparse.kron(near[0], ones[1]), ones[2])
    lattice += sparse.kron(sparse.kron(ones[0], near[1]), ones[2])
    lattice += sparse.kron(sparse.kron(ones[0], ones[1]), near[2])
    tensor = np.array([[3.0, 1.0, 0.5], [1.0, 2.0, 0.3], [0.5, 0.3, 1.7]])
    K = sparse.bsr_array(sparse.kron(-lattice, tensor), blocksize=(3, 3))
    r = np.random.default_rng(0).normal(size=(12 * 9 * 12, 3))
    found = []
    try:
        for count in (1, 3):
            use(count)
            solved = inverse(K, r, np.zeros((2, 0), dtype=int))
            assert solved and solved.exact and number() == count
            found.append(solved(r))
    finally:
        use(before)
    np.testing.assert_allclose(K @ found[0].ravel(), r.ravel(), atol=1e-3 * np.abs(r).max())
    assert found[0].tobytes() == found[1].tobytes()
