"""The stable step against dense eigenproblems of small assembled models, contact springs and friction included."""

from __future__ import annotations

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.model import stable_step as timestep
from warp_mca.model.assembly import Assembly
from warp_mca.model.build import build_model
from warp_mca.model.stable_step import Elements, stable_step
from warp_mca.physics.contact.surfaces import surface_faces
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.physics.elements.hexahedron import eigenvalue_bounds, largest_eigenvalues, lumped_masses
from warp_mca.rigid.handoff import hand_off
from warp_mca.step.solver import Solver
from warp_mca.step.steps import Steps
from warp_mca.system.model import Model

STEEL = mca.Elastic(E=200e9, nu=0.3, rho=7800.0)
H = 0.01
DEPTH = 1e-3 * H  # overlap that makes every contact spring active
CUBE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)


def box(nx: int, ny: int, nz: int, *, size=(2 * H, H, 2 * H), origin=(0.0, 0.0, 0.0)) -> mca.Mesh:
    """A mesh of equal bricks."""
    return mca.Box(size=size, divisions=(nx, ny, nz), origin=origin).build()


def moved(mesh: mca.Mesh, points: np.ndarray) -> mca.Mesh:
    """The same mesh with its nodes elsewhere."""
    return mca.Mesh(points, mesh.hexahedra, mesh.node_sets, mesh.cell_sets)


def shaken(mesh: mca.Mesh, share: float) -> mca.Mesh:
    """The mesh with every node moved by up to `share` of H, in any direction."""
    return moved(mesh, mesh.points + np.random.default_rng(0).uniform(-share * H, share * H, mesh.points.shape))


def graded(mesh: mca.Mesh) -> mca.Mesh:
    """The mesh with cells that shrink towards its corner of least x and z."""
    points = mesh.points.copy()
    points[:, [0, 2]] = points[:, [0, 2]] ** 2 / (2 * H)
    return moved(mesh, points)


def scene(lower: mca.Mesh, upper: mca.Mesh | None = None, **contact) -> mca.Scene:
    """One body on a plane, or a body on top of another, each contact face overlapping by DEPTH."""
    bodies = [mca.Body(name="lower", geometry=lower, material=STEEL)]
    master: mca.Surface | mca.RigidPlane = mca.RigidPlane(point=(0.0, DEPTH, 0.0))
    slave = mca.Surface(body="lower", nodes="ymin")
    if upper is not None:
        top = lower.points[:, 1].max()
        bodies.append(mca.Body(name="upper", geometry=upper, material=STEEL, position=(0.0, top - DEPTH, 0.0)))
        slave, master = mca.Surface(body="upper", nodes="ymin"), mca.Surface(body="lower", nodes="ymax")
    contacts = (mca.Contact(slave=slave, master=master, **contact),) if contact else ()
    return mca.Scene(
        name="small",
        bodies=tuple(bodies),
        contacts=contacts,
        impact=mca.ImpactPhase(duration=1e-5, output_interval=1e-6),
    )


def assemble(made: mca.Scene) -> Model:
    """The model of a scene without a rigid phase."""
    meshes = mca.mesh(made)
    start = hand_off(made, meshes, nodal_masses(made, meshes))
    return build_model(made, meshes, start.positions, start.velocities)


def frequencies(model: Model, free: np.ndarray | None = None) -> np.ndarray:
    """Eigenvalues omega^2 [1/s^2] of the assembled model, from differences of the forces that the solver computes."""
    dt, h = model.stable.dt, 1e-7 * H
    solver = Solver(model, device="cpu", precision="float64", dt=dt)
    state = solver.new_state()
    solver.begin(state)
    node = np.concatenate([block.conn.ravel() for block in model.blocks])

    def force(u: np.ndarray) -> np.ndarray:
        state.u.assign(u)
        state.v.assign(u / dt)  # friction measures the motion since the last step
        solver.work.nodal_force.zero_()
        for own in state.contacts:
            own.spring.tangential.zero_()
        solver.forces(state)
        total = solver.work.nodal_force.numpy().copy() if solver.contacts else np.zeros_like(u)
        np.add.at(total, node, solver.work.force.numpy())
        return total.ravel()

    size = model.X.size
    free = np.arange(size) if free is None else free
    K = np.empty((size, len(free)))
    for column, k in enumerate(free):
        u = np.zeros(size)
        u[k] = h
        K[:, column] = -(force(u.reshape(-1, 3)) - force(-u.reshape(-1, 3))) / (2.0 * h)
    return np.linalg.eigvals(K[free] / np.repeat(model.mass, 3)[free, None]).real


@pytest.mark.parametrize("nu", [-0.4, 0.0, 0.27, 0.45])
def test_single_cube_meets_its_closed_form(nu: float):
    """Uniform dilatation has omega^2 = 12 K / (rho h^2), uniform distortion 8 G / (rho h^2); they meet at nu = 0."""
    material = mca.Elastic(E=70e9, nu=nu, rho=2700.0)
    body = mca.Body(name="cube", geometry=mca.Box(size=(H, H, H), divisions=(1, 1, 1)), material=material)
    model = assemble(mca.Scene(name="cube", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6)))
    omega2 = max(12.0 * material.bulk_modulus, 8.0 * material.shear_modulus) / (2700.0 * H**2)
    assert model.stable.dt == pytest.approx(2.0 / np.sqrt(omega2), rel=1e-10)
    assert frequencies(model).max() == pytest.approx(omega2, rel=1e-4)


CASES = {
    "free": (scene(shaken(box(2, 2, 2), 0.1)), 0.75),
    "plane": (scene(box(2, 1, 2), mu=0.0), 0.75),
    "plane, rough": (scene(shaken(box(2, 1, 2), 2e-4), mu=1e3), 0.75),
    "plane, stiff": (scene(box(2, 1, 2), penalty=10.0), 0.6),
    "alike": (scene(box(2, 1, 2), box(2, 1, 2), penalty=1.0), 0.7),
    "alike, rough": (scene(box(2, 1, 2), box(2, 1, 2), mu=1e3, penalty=3.0), 0.6),
    "alike, two-way": (scene(box(2, 1, 2), box(2, 1, 2), mu=1e3, two_way=True), 0.7),
    "fine on coarse": (scene(box(1, 1, 1), box(4, 1, 4, size=(2 * H, H / 2, 2 * H)), penalty=10.0), 0.35),
    "coarse on fine": (scene(box(4, 1, 4, size=(2 * H, H / 2, 2 * H)), box(2, 1, 2), two_way=True, penalty=10.0), 0.4),
    "graded on coarse": (scene(box(2, 2, 2), graded(box(5, 1, 5)), penalty=10.0), 0.3),
}


@pytest.mark.parametrize("name", CASES)
def test_step_is_below_the_assembled_limit_and_not_far_below(name: str):
    made, share = CASES[name]
    model = assemble(made)
    limit = 2.0 / np.sqrt(frequencies(model).max())
    assert share * limit < model.stable.dt <= limit * (1.0 + 1e-5)


def test_springs_shorten_the_step_as_their_penalty_grows():
    steps = [assemble(scene(box(2, 1, 2), mu=0.0, penalty=f)).stable for f in (1e-6, 1.0, 100.0)]
    free = assemble(scene(box(2, 1, 2))).stable
    assert steps[0].dt == pytest.approx(free.dt, rel=1e-6)
    assert free.contact_share == 0.0 < steps[1].contact_share < steps[2].contact_share < 1.0
    k_over_m = STEEL.bulk_modulus * H / (7800.0 * H**3 / 8.0)  # a corner's spring: K A^2 / V on its mass
    element = (2.0 / free.dt) ** 2
    assert (2.0 / steps[1].dt) ** 2 == pytest.approx(k_over_m + element, rel=1e-9)
    # a spring that opens and closes by itself takes (omega dt)^2 of 1 at 0.9 of the step, not of 4
    assert 100.0 * k_over_m * (0.9 * steps[2].dt) ** 2 == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("penalty", [10.0, 30.0])
def test_nodes_that_bounce_on_stiff_springs_gain_no_energy(penalty: float):
    """Steps as long as linear springs allow would throw the nodes through the plane within a tenth of this time."""
    sphere = mca.make_scene("hertz_sphere", section=4, penalty=penalty)
    assert mca.run(sphere).summary["energy_error"] < 1e-3


@pytest.mark.parametrize(("element", "axial"), [("hex8", 10), ("hex8r", 10), ("tet4", 20)])
def test_bars_that_strike_end_on_gain_no_energy(element: str, axial: int):
    """All nodes of a face close and open at once; steps a tenth longer gave 1.2 to 2.2 %."""
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    box = mca.Box(size=(0.1, 0.02, 0.02), divisions=(axial, 2, 2))
    flying = {"position": (-0.1, 0.0, 0.0), "velocity": (5.0, 0.0, 0.0)}
    bodies = [
        mca.Body(name=name, geometry=box, material=steel, element=element, **start)
        for name, start in (("one", flying), ("other", {}))
    ]
    contact = mca.Contact(
        slave=mca.Surface(body="one", nodes="xmax"), master=mca.Surface(body="other", nodes="xmin"), mu=0.0
    )
    impact = mca.ImpactPhase(duration=1.2e-4, output_interval=6e-6)
    made = mca.Scene(name="end on", bodies=tuple(bodies), contacts=(contact,), impact=impact)
    assert mca.run(made, precision="float64").summary["energy_error"] < 0.006


def test_worst_of_many_elements_is_found_wherever_it_lies():
    """The ranking by a bound and the batches of exact eigenvalues skip no element that could be the worst."""
    rng = np.random.default_rng(1)
    n, ranks = 900, []
    conn = np.arange(8 * n).reshape(n, 8)
    for _ in range(8):
        x = H * (CUBE + rng.uniform(-0.02, 0.02, (n, 8, 3)))
        K, rho = rng.uniform(9e10, 1e11, n), np.full(n, 2e3)
        G = K * rng.uniform(0.01, 0.6, n)  # the bound is close for small G only
        mass, contact = lumped_masses(x, rho), rng.uniform(0.0, 1e12, n)
        exact = largest_eigenvalues(x, K, G, mass) + contact
        found = stable_step(Elements(ELEMENTS["hex8"], x.reshape(-1, 3), conn, K, G, mass, contact, np.arange(n)))
        assert found.element == exact.argmax()
        assert found.dt == pytest.approx(2.0 / np.sqrt(exact.max()), rel=1e-12)
        assert found.contact_share == pytest.approx(contact[found.element] / exact.max(), rel=1e-12)
        ranks.append((eigenvalue_bounds(x, K, G, mass) + contact > (exact + 0.0).max()).sum())
    assert max(ranks) > 256  # some had to look beyond the first batch


@pytest.mark.parametrize("key", [timestep.KEY, 0 * timestep.KEY])
def test_odd_element_is_found_among_many_alike(key: np.ndarray, monkeypatch: pytest.MonkeyPatch):
    """Elements that repeat another are left out, one that differs in shape or in moduli alone is not.

    Nor where all have one key.
    """
    monkeypatch.setattr(timestep, "KEY", key)
    n, odd = timestep.MAX_EXACT + 1000, timestep.MAX_EXACT + 500
    conn, mass, contact = np.arange(8 * n).reshape(n, 8), np.full((n, 8), 2e3 * H**3 / 8.0), np.zeros(n)
    for larger, stiffer in ((1.001, 1.0), (1.0, 1.001)):
        x, K = np.tile(H * CUBE, (n, 1, 1)), np.full(n, 1e11)
        x[odd] *= larger  # its mass is that of the others
        K[odd] *= stiffer
        exact = largest_eigenvalues(x[odd : odd + 1], K[odd : odd + 1], 0.5 * K[odd : odd + 1], mass[:1])
        elements = Elements(ELEMENTS["hex8"], x.reshape(-1, 3), conn, K, 0.5 * K, mass, contact, np.arange(n))
        found = stable_step(elements)
        assert found.element == odd
        assert found.dt == pytest.approx(2.0 / np.sqrt(exact[0]), rel=1e-12)


def test_element_that_shortens_the_step_is_named():
    """A bar of equal elements but for one, a thirtieth as thick."""
    for thickness, named in ((1.0, False), (0.03, True)):
        mesh = box(8, 1, 1, size=(8 * H, H, H))
        mesh.points[:, 0] -= (1.0 - thickness) * H * (mesh.points[:, 0] > 3.5 * H)
        body = mca.Body(name="bar", geometry=mesh, material=STEEL)
        result = mca.run(mca.Scene(name="thin", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6)))
        said = [warning for warning in result.warnings if "times shorter" in warning]
        assert bool(said) == named
        assert all("element 3 of body bar" in warning for warning in said)


def clamped() -> mca.Scene:
    """A distorted bar that sags from one end."""
    body = mca.Body(name="bar", geometry=shaken(box(4, 1, 1, size=(4 * H, H, H)), 0.05), material=STEEL)
    return mca.Scene(
        name="clamped",
        bodies=(body,),
        fixed=(mca.Fixed(body="bar", nodes="xmin"),),
        gravity=(0.0, -1e4, 3e3),
        impact=mca.ImpactPhase(duration=1e-3, energy_tolerance=0.01),
    )


@pytest.mark.parametrize(("share", "stable"), [(0.995, True), (1.02, False)])
def test_run_blows_up_just_beyond_the_assembled_limit(share: float, stable: bool, monkeypatch: pytest.MonkeyPatch):
    made = clamped()
    model = assemble(made)
    free = np.flatnonzero(np.repeat(model.fixed_axes == 0, 3))
    dt = share * 2.0 / np.sqrt(frequencies(model, free).max())
    assert model.stable.dt < dt
    steps = Steps(dt=dt, per_search=10, searches=1, intervals=60)
    monkeypatch.setattr("warp_mca.phases.impact.divide_alike", lambda *_: steps)
    if stable:
        assert mca.run(made, precision="float64").summary["energy_error"] < 1e-3
    else:
        with pytest.raises(mca.GuardError, match="lower time_step_scale"):
            mca.run(made, precision="float64")


@pytest.mark.parametrize("coarse", [False, True])
def test_steps_of_single_elements_are_lower_bounds(coarse: bool):
    """No element's bound exceeds the step that it has alone, and none is more than a third below it."""
    made = scene(shaken(box(3, 2, 2), 0.1), box(4, 1, 4), penalty=10.0)
    meshes = mca.mesh(made)
    start = hand_off(made, meshes, nodal_masses(made, meshes))
    parts = Assembly(made, meshes, start.positions)
    added = np.zeros(len(parts.X))
    added[surface_faces(parts, made.contacts[0].slave).nodes] = 1e12
    (cells,), (mass,) = parts.cells, parts.element_mass
    alone = [
        stable_step(parts.elements(cells.element, cells.conn[[k]], mass[[k]], added, cells.index[[k]])).dt
        for k in range(parts.element_count)
    ]
    ratio = parts.element_steps(added, coarse=coarse) / alone
    assert ratio.max() <= 1.0 + 1e-12
    assert ratio.min() > 0.65
