"""Bulk viscosity: decay of waves, energy and momentum, the stable step, and who refuses it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from impacts import Displaced, begun, finished, momentum, result_of
from linear_tet import LinearTet
from test_bending import grid
from test_cycle import scene as cycle_scene

import warp_mca as mca
from warp_mca.base.rotation import rotation_matrix
from warp_mca.model.build import build_model
from warp_mca.phases.cycle import Cycle
from warp_mca.phases.prepare import Request
from warp_mca.phases.settings import Settings
from warp_mca.physics.elements import ELEMENTS
from warp_mca.physics.elements.cells import nodal_masses
from warp_mca.rigid.handoff import hand_off
from warp_mca.scene import model_file
from warp_mca.step.solver import Solver
from warp_mca.system.model import Model

STEEL = mca.Elastic(E=200e9, nu=0.3, rho=7800.0)
METAL = mca.J2Bilinear(E=200e9, nu=0.3, rho=7800.0, sigma_y=400e6, E_t=2e9)
MOVES = {"corotational": STEEL, "finite": METAL}  # a law for each strain measure
KINDS = ("hex8i", "hex8", "hex8r", "wedge6", "tet4", "tet10", "tet10_mean")


def bricks(element: str, size: tuple[float, ...], cells: tuple[int, ...]) -> mca.Mesh:
    """A box of bricks, or of wedges for the element that computes these."""
    box = grid(size, cells, "deep" if element == "wedge6" else "")
    return box


def block(element: str = "hex8i", viscosity: object = 0.1, **changes) -> mca.Scene:
    """A block of 2 x 2 x 2 cells that flies freely, of bricks that are no cubes."""
    body = {"material": STEEL, "geometry": bricks(element, (0.01, 0.012, 0.015), (2, 2, 2)), **changes}
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", element=element, **body),),
        impact=mca.ImpactPhase(duration=1e-5, output_interval=5e-7, bulk_viscosity=viscosity),  # pyright: ignore[reportArgumentType]
    )


def assembled(scene: mca.Scene) -> Model:
    meshes = mca.mesh(scene)
    start = hand_off(scene, meshes, nodal_masses(scene, meshes))
    return build_model(scene, meshes, start.positions, start.velocities)


def shaken(impact, speed: float) -> None:
    """Give the nodes velocities: a uniform gradient, and as much again without order."""
    X, random = impact.solver.model.X, np.random.default_rng(0)
    gradient = random.normal(size=(3, 3)) / np.ptp(X)
    impact.state.v.assign(speed * ((X - X.mean(axis=0)) @ gradient.T + random.normal(size=X.shape)))


@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r", "wedge6", "tet4"])
def test_a_plane_wave_decays_as_in_a_kelvin_voigt_solid(element: str):
    """Standing waves of sum rho V^2 / 4 shrink by exp(-eta k^2 t / (2 rho)), eta = c1 rho c h: Kolsky (1953), ch. 5."""
    cells, size, c1 = 40, 1e-3, 0.06
    c = np.sqrt((STEEL.bulk_modulus + 4 / 3 * STEEL.shear_modulus) / STEEL.rho)
    length = cells * size
    k, period = 2.0 * np.pi / length, length / c
    scene = mca.Scene(
        name="column",
        bodies=(
            mca.Body(
                name="b",
                element=element,
                material=STEEL,
                geometry=bricks(element, (length, size, size), (cells, 1, 1)),
            ),
        ),
        fixed=tuple(mca.Fixed(body="b", nodes=side, axes="yz") for side in ("ymin", "ymax")),
        impact=mca.ImpactPhase(duration=10 * period, output_interval=period / 4, bulk_viscosity=c1),
    )
    impact = begun(scene, precision="float64")
    model = impact.solver.model
    x = model.X[:, 0] - model.X[:, 0].min()
    impact.state.v.assign(np.outer(np.cos(k * x), [1.0, 0.0, 0.0]))
    impact.advance()
    energy = impact.scene_runs[0].ledger.energy()
    (block,) = model.blocks
    eta = float(block.viscosity[0].mean())  # pyright: ignore[reportOptionalSubscript]
    if element.startswith("hex"):
        assert block.viscosity[0] == pytest.approx(c1 * STEEL.rho * c * size, rel=1e-9)  # pyright: ignore[reportOptionalSubscript]
    time = impact.scene_runs[0].ledger.time() - impact.steps.interval
    left = np.exp(-eta * k**2 * time / STEEL.rho)
    assert (energy["kinetic"] + energy["elastic"]) / energy["initial"] == pytest.approx(left, rel=0.01)
    assert energy["damping"] / energy["initial"] == pytest.approx(1.0 - left, rel=0.02)


@pytest.mark.parametrize("kinematics", MOVES)
@pytest.mark.parametrize("element", KINDS)
def test_the_energy_taken_is_booked(element: str, kinematics: str):
    scene = block(element, (0.1, 1.2), kinematics=kinematics, material=MOVES[kinematics])
    impact = begun(scene, precision="float64")
    shaken(impact, 2.0)  # faster ones yield, and the onset of flow alone leaves 1 % of imbalance
    before = momentum(impact)
    impact.advance()
    assert impact.stopped == [None]
    ledger = impact.scene_runs[0].ledger
    found = ledger.energy()
    assert 0.02 < found["damping"] / found["initial"] < 0.5
    assert ledger.kept.energy_error < 1e-4
    scale = impact.solver.model.mass.sum() * 2.0
    assert np.abs(momentum(impact) - before).max() < 1e-13 * scale


@pytest.mark.parametrize("kinematics", MOVES)
@pytest.mark.parametrize("element", KINDS)
def test_forces_keep_momentum_and_angular_momentum(element: str, kinematics: str):
    model = assembled(block(element, kinematics=kinematics, material=MOVES[kinematics]))
    still = Displaced(Solver(model, device="cpu", precision="float64", dt=model.stable.dt))
    random = np.random.default_rng(1)
    grown = np.eye(3) + 0.01 * np.eye(3) + 0.003 * random.normal(size=(3, 3))
    turn = rotation_matrix(np.array([0.2, -0.3, 0.1]))
    x = model.X @ grown.T @ turn.T
    still.forces(model.X @ turn.T - model.X)
    moving = still.forces(x - model.X)
    resting = still.forces(x - model.X)  # the same place again: no rate
    q = moving - resting
    size = np.abs(q).sum()
    assert size > 1e-3 * np.abs(resting).sum()
    assert np.abs(q.sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.cross(x, q).sum(axis=0)).max() < 1e-12 * size * np.ptp(x)


@pytest.mark.parametrize(("element", "beyond"), [("hex8i", 1.35), ("hex8", 1.35), ("tet10", 1.7)])
@pytest.mark.parametrize("nu", [0.0, 0.45])
@pytest.mark.parametrize("size", [(2.0, 1.0, 1.0), (1.0, 1.0, 0.1)])
def test_the_step_is_stable_and_not_much_shorter_than_it_must_be(element: str, beyond: float, nu: float, size: tuple):
    """Eigenvalues z of u(n+1) = 2 u(n) - u(n-1) - dt^2 M^-1 (K u(n) + C (u(n) - u(n-1)) / dt)."""
    material = mca.Elastic(E=200e9, nu=nu, rho=7800.0)
    box = mca.Box(size=tuple(0.01 * s for s in size), divisions=(2, 1, 1))  # pyright: ignore[reportArgumentType]
    scene = block(element, 0.2, geometry=box, material=material)
    model = assembled(scene)
    count, u = 3 * model.node_count, 1e-9
    solver = Displaced(Solver(model, device="cpu", precision="float64", dt=1.0))  # q is C (u - u_before)
    both = np.empty((2, count, count))
    for i in range(count):
        at = np.zeros(count)
        at[i] = u
        solver.forces(np.zeros_like(model.X))
        both[0, :, i] = solver.forces(at.reshape(-1, 3)).ravel()
        both[1, :, i] = solver.forces(at.reshape(-1, 3)).ravel()
    K, C = -both[1] / u, (both[1] - both[0]) / u
    inverse = 1.0 / np.repeat(model.mass, 3)[:, None]
    largest = []
    for dt in (scene.impact.time_step_scale * model.stable.dt, beyond * model.stable.dt):
        now = 2.0 * np.eye(count) - dt**2 * inverse * K - dt * inverse * C
        step = np.block([[now, dt * inverse * C - np.eye(count)], [np.eye(count), np.zeros((count, count))]])
        largest.append(np.abs(np.linalg.eigvals(step)).max())
    assert largest[0] < 1.0 + 1e-4  # rigid motion has double eigenvalues 1
    assert largest[1] > 1.01


def bar(element: str = "hex8i", viscosity: object = 0.06, cells: int = 20, **impact) -> mca.Scene:
    """A bar of nu = 0 that flies flat onto a wall at 1 m/s: the force is rho c v A for two passages of the wave."""
    material = mca.Elastic(E=200e9, nu=0.0, rho=7800.0)
    box = mca.Box(size=(0.1, 0.01, 0.01), divisions=(cells, max(1, cells // 10), max(1, cells // 10)))
    body = mca.Body(name="bar", element=element, geometry=box, material=material, velocity=(-1.0, 0.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="bar", nodes="xmin"), master=mca.RigidPlane(normal=(1.0, 0.0, 0.0)))
    given = {"duration": 6e-5, "output_interval": 1e-6, "bulk_viscosity": viscosity, **impact}
    return mca.Scene(name="bar", bodies=(body,), contacts=(contact,), impact=mca.ImpactPhase(**given))  # pyright: ignore[reportArgumentType]


def test_flat_contact_rings_less():
    """Spread of the plateau; It costs 6.6 % of the energy and 1.7 % of the impulse: fronts are wide."""
    force, impulse = {}, {}
    for viscosity in (None, 0.06):
        made = bar(viscosity=viscosity)
        stiff = replace(made, contacts=(replace(made.contacts[0], penalty=2.0),))
        result = result_of(finished(stiff))
        assert result.summary["energy_error"] < 0.01
        inside = (result.time > 8e-6) & (result.time < 3.2e-5)
        force[viscosity] = result.F_n[inside].std() / result.F_n[inside].mean()
        impulse[viscosity] = result.F_n.sum()
    assert force[None] > 0.15
    assert force[0.06] < 0.08
    assert impulse[0.06] == pytest.approx(impulse[None], rel=0.02)


@pytest.mark.parametrize("element", ["hex8i", "hex8", "tet10"])
@pytest.mark.parametrize("cells", [20, 40])
def test_the_greatest_force_of_flat_contact_is_rho_c_v_A(element: str, cells: int):
    """With springs no stiffer than a cell: c1 = 0.1 keeps within 5 %, 0.06 leaves 5.01 % to `hex8` of 20 cells."""
    made = bar(element, 0.1, cells, output_interval=2e-7)
    made = replace(made, contacts=(replace(made.contacts[0], penalty=1.0),))
    result = result_of(finished(made))
    force = 7800.0 * np.sqrt(200e9 / 7800.0) * 1e-4
    inside = (result.time > 8e-6) & (result.time < 3.2e-5)
    assert 1.0 < result.summary["extremes"]["F_n_max"] / force < 1.05
    assert result.F_n[inside].mean() == pytest.approx(force, rel=2e-3)
    assert result.F_n[inside].std() < 0.02 * force


def test_the_quadratic_part_acts_in_fast_compression_alone():
    """A block that shrinks, and grows: q = theta_dot (lin - quad theta_dot) with theta_dot < 0."""
    model = assembled(block(viscosity=(0.1, 1.2)))
    dt, own = model.stable.dt, Displaced(Solver(model, device="cpu", precision="float64", dt=model.stable.dt))
    (lin, quad), rate = model.blocks[0].viscosity, 1e5  # pyright: ignore[reportGeneralTypeIssues]
    for sign in (-1.0, 1.0):
        own.state = own.solver.new_state()
        own.forces(np.zeros_like(model.X))
        own.forces(sign * rate * dt * model.X / 3.0)
        q = own.state.elements[0].extreme.numpy()[4]
        assert q == pytest.approx(sign * rate * (lin + (quad * rate if sign < 0.0 else 0.0)), rel=1e-6)
    assert (quad * rate > lin).all()


def test_several_rates_book_the_same_energy():
    """A graded block, whose elements take steps of two lengths."""
    box = mca.Box(size=(0.04, 0.01, 0.01), divisions=(12, 3, 3)).build()
    points = box.points.copy()
    points[:, 0] = 0.04 * (points[:, 0] / 0.04) ** 2
    scene = block(viscosity=0.1, geometry=mca.Mesh(points, box.hexahedra, box.node_sets, box.cell_sets))
    taken = []
    for groups in (None, 2):
        impact = begun(scene, precision="float64", multi_rate=groups)
        assert (impact.solver.model.rates is not None) == (groups is not None)
        X = impact.solver.model.X
        impact.state.v.assign(10.0 * np.sin(np.pi * X / 0.02))
        impact.advance()
        ledger = impact.scene_runs[0].ledger
        assert ledger.kept.energy_error < 2e-3
        taken.append(ledger.energy()["damping"] / ledger.energy()["initial"])
    assert taken[0] > 0.01
    assert taken[1] == pytest.approx(taken[0], rel=0.02)


def test_scenes_side_by_side_with_and_without():
    """Each as it is alone, where the step is the same."""
    scenes = [bar(viscosity=0.06), bar(viscosity=None)]
    both, alone = begun(*scenes), begun(scenes[0])
    both.advance()
    alone.advance()
    ledgers = [item.ledger for item in both.scene_runs]
    assert ledgers[1].energy()["damping"] == 0.0
    assert ledgers[0].energy()["damping"] == alone.scene_runs[0].ledger.energy()["damping"] > 0.0
    assert np.array_equal(ledgers[0].table(), alone.scene_runs[0].ledger.table())


def test_a_run_goes_on_from_its_state_to_the_same_bits(tmp_path: Path):
    whole, first = begun(bar()), begun(bar())
    first.advance(until=whole.steps.count // 3)
    first.save(tmp_path / "state")
    second = begun(bar())
    second.load(tmp_path / "state")
    whole.advance()
    second.advance()
    assert whole.state.differences(second.state) == []


@pytest.mark.parametrize("value", [-0.1, 11.0, (0.06,), (0.06, 1.2, 0.0), "much", (0.06, float("nan"))])
def test_what_is_no_viscosity_is_refused(value):
    with pytest.raises(mca.RequestError, match=r"ImpactPhase.bulk_viscosity = .*give a linear coefficient"):
        mca.ImpactPhase(duration=1e-5, bulk_viscosity=value)


def test_elements_without_viscosity_are_refused_by_name(monkeypatch):
    monkeypatch.setitem(ELEMENTS, "linear_tet", LinearTet())
    with pytest.raises(mca.RequestError, match=r"bulk_viscosity = 0.1: linear_tet has no bulk viscosity; leave it out"):
        begun(block("linear_tet"))


def test_none_and_zero_are_the_same():
    for viscosity in (None, 0.0, (0.0, 0.0)):
        model = assembled(block(viscosity=viscosity))
        assert not model.viscous
        assert model.stable.dt == assembled(block(viscosity=None)).stable.dt
    assert assembled(block(viscosity=0.06)).stable.dt / model.stable.dt == pytest.approx(0.942, abs=0.001)


def test_impacts_follow_each_other_with_viscosity():
    """Shapes settle without it, and the next impact begins without a rate."""
    scene = cycle_scene("single_link", rigid_inertia="mesh")
    scene = replace(scene, impact=replace(scene.impact, bulk_viscosity=0.06))
    result = Cycle(scene, None, Request(span=1.5e-3, settings=Settings("cpu", "float64", 1))).run()
    assert [phase["kind"] for phase in result.summary["phases"]] == ["rigid", "impact", "rigid", "impact", "rigid"]
    taken = [phase["energy"]["damping"] for phase in result.summary["phases"]]
    assert 0.0 == taken[0] < taken[1] == taken[2] < taken[3] == taken[4]
    assert result.summary["energy_error"] < 1e-4


def test_a_model_file_keeps_it(tmp_path: Path):
    for k, given in enumerate((None, 0.06, (0.06, 1.2))):
        model_file.save(tmp_path / f"{k}.mca", bar(viscosity=given), mca.mesh(bar()))
        assert model_file.load(tmp_path / f"{k}.mca").scene.impact.bulk_viscosity == given


def test_two_link_takes_it_as_a_parameter():
    assert mca.make_scene("two_link").impact.bulk_viscosity is None
    assert mca.make_scene("two_link", bulk_viscosity=0.06).impact.bulk_viscosity == 0.06


@pytest.mark.gpu
@pytest.mark.parametrize("element", ["hex8i", "hex8", "hex8r", "tet4", "tet10"])
def test_a_gpu_takes_the_same_energy(element: str):
    taken = []
    for device in ("cpu", "cuda:0"):
        impact = begun(bar(element), device=device)
        impact.advance()
        assert impact.stopped == [None]
        taken.append(impact.scene_runs[0].ledger.energy()["damping"])
        assert impact.scene_runs[0].ledger.kept.energy_error < 1e-3
    assert taken[1] == pytest.approx(taken[0], rel=0.01)
