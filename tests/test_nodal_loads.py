"""Loads on surfaces, node sets, points and bodies: impulses, directions, work, and what they do not go with."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from impacts import begun, finished, momentum, result_of
from outside import goes_on
from test_bending import grid

import warp_mca as mca
from warp_mca.kernels.loads.amplitude import Tables, mean_value, value_at
from warp_mca.physics.loads.pushed import tables_of
from warp_mca.system.stage import Step
from warp_mca.verify.small_meshes import mixed_cube

DEVICES = ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)]
SIZE, PEAK, END = (0.02, 0.01, 0.01), 1e5, 2e-5  # strains of 1e-7, by which the surface grows
AREA = SIZE[1] * SIZE[2]
STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
MASS = STEEL.rho * SIZE[0] * AREA
BLOCK = mca.Body(name="block", geometry=mca.Box(size=SIZE, divisions=(8, 4, 4)), material=STEEL)
PULSE = mca.Amplitude(times=(0.0, 0.4 * END, END), values=(0.0, 1.0, 0.0))
PUSH = mca.Pressure(body="block", nodes="xmin", pressure=PEAK, amplitude=PULSE)
PULL = mca.Traction(body="block", nodes="xmax", traction=(PEAK, 0.0, 0.5 * PEAK), amplitude=PULSE)
TIP = mca.Force(body="block", nodes="xmin", force=(2.0, 0.0, 1.0), spread="area", amplitude=PULSE)
FIELD = mca.BodyForce(body="block", acceleration=(0.0, -50.0, 0.0), amplitude=PULSE)


def pushed(**change: Any) -> mca.Scene:
    phase = mca.ImpactPhase(duration=4e-5, output_interval=1e-6, energy_tolerance=1e-4)
    return replace(mca.Scene(name="pushed", bodies=(BLOCK,), loads=(PUSH,), impact=phase), **change)


def forces_of(load: Any, u: np.ndarray | None = None, body: mca.Body = BLOCK) -> tuple[np.ndarray, np.ndarray]:
    """Nodal forces of a load at t = 0 and displacements u [m], and positions of nodes, shape (node_count, 3) both."""
    impact = begun(pushed(bodies=(body,), loads=(replace(load, amplitude=None),)), precision="float64")
    solver, state = impact.solver, impact.state
    if u is not None:
        state.u.assign(u)
    solver.work.nodal_force.zero_()
    getattr(solver, type(load).__name__).push(Step(state))
    return solver.work.nodal_force.numpy(), solver.model.X


@wp.kernel(enable_backward=False)
def read_tables(tables: Tables, bounds: wp.array2d(dtype=wp.float64), found_out: wp.array2d(dtype=wp.float64)):
    k = wp.tid()
    found_out[k, 0] = mean_value(tables, 1, bounds[k, 0], bounds[k, 1])
    found_out[k, 1] = value_at(tables, 1, bounds[k, 0])


def test_means_and_values_of_tables_are_those_of_straight_lines():
    """The second of two tables, beside sums over many points, before, across and behind its entries."""
    times, values = np.array([0.1, 0.3, 0.4, 1.0]), np.array([1.0, -2.0, 5.0, 0.5])
    other = mca.Amplitude(times=(0.0, 9.0), values=(7.0, 8.0))
    own = mca.Amplitude(times=tuple(times), values=tuple(values))
    items = [type("Item", (), {"times": np.array(a.times), "values": np.array(a.values)}) for a in (other, own)]
    bounds = np.array([(-0.5, 0.0), (-0.1, 0.12), (0.15, 0.2), (0.2, 0.9), (0.05, 1.5), (1.2, 1.3), (0.3, 0.4)])
    found = wp.zeros((len(bounds), 2), dtype=wp.float64, device="cpu")
    with wp.ScopedDevice("cpu"):
        inputs = [tables_of(items), wp.array(bounds, dtype=wp.float64)]
        wp.launch(read_tables, len(bounds), inputs=inputs, outputs=[found])
    for (a, b), (mean, value) in zip(bounds, found.numpy(), strict=True):
        t = np.linspace(a, b, 200001)
        assert mean == pytest.approx(np.interp(0.5 * (t[1:] + t[:-1]), times, values).mean(), rel=1e-6)
        assert value == pytest.approx(np.interp(a, times, values), rel=1e-12)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize(
    "load, impulse",
    [
        (PUSH, np.array([0.5 * PEAK * END * AREA, 0.0, 0.0])),
        (PULL, 0.5 * END * AREA * PEAK * np.array([1.0, 0.0, 0.5])),
        (TIP, 0.5 * END * np.array([2.0, 0.0, 1.0])),
        (replace(TIP, nodes=None, at=(0.0, 0.005, 0.005), spread="equal"), 0.5 * END * np.array([2.0, 0.0, 1.0])),
        (FIELD, 0.5 * END * MASS * np.array([0.0, -50.0, 0.0])),
    ],
    ids=["pressure", "traction", "force", "point", "body"],
)
def test_a_block_takes_the_impulse_and_the_ledger_the_work(load: Any, impulse: np.ndarray, device: str):
    """Beside a rigid body, which none of it reaches."""
    rigid = mca.Body(name="rigid", geometry=BLOCK.geometry, material=STEEL, position=(0.0, 0.1, 0.0), rigid=True)
    impact = finished(pushed(bodies=(BLOCK, rigid), loads=(load,)), precision="float64", device=device)
    gained = momentum(impact, 0, impact.solver.model.node_start["rigid"])
    assert gained == pytest.approx(impulse, rel=1e-6, abs=1e-6 * np.abs(impulse).max())  # a pressure turns with faces
    energy = result_of(impact).summary["energy"]
    assert energy["external_work"] > (1.0 - 1e-6) * 0.5 * impulse @ impulse / MASS
    assert abs(energy["error"]) < 1e-4 * energy["external_work"]


def test_a_dead_force_gives_its_impulse_to_rounding_whatever_the_table():
    """Times that no step meets; half of the pulse before the phase."""
    early = mca.Amplitude(times=(-1.1e-6, 1.3e-7, 7.7e-7, 3.1e-5), values=(3.0, -1.0, 2.0, 0.0))
    impact = finished(pushed(loads=(replace(TIP, amplitude=early),)), precision="float64")
    t = np.array([0.0, 1.3e-7, 7.7e-7, 3.1e-5])
    values = np.interp(t, early.times, early.values)
    impulse = float((0.5 * np.diff(t) * (values[1:] + values[:-1])).sum())
    assert momentum(impact) == pytest.approx(impulse * np.array([2.0, 0.0, 1.0]), rel=1e-10, abs=1e-18)


def test_pressure_and_traction_follow_the_surface():
    """On a turned face they turn with it, and on a stretched one they grow with the area; a dead traction does not."""
    turn, stretch = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.diag([1.0, 1.3, 1.0])
    X = begun(pushed()).solver.model.X
    u = X @ (turn @ stretch - np.eye(3)).T
    follows = replace(PULL, follows=True)
    vector = AREA * np.array(PULL.traction)
    for load, total in (
        (PUSH, 1.3 * AREA * PEAK * turn @ [1.0, 0.0, 0.0]),
        (follows, 1.3 * turn @ vector),
        (PULL, vector),
    ):
        assert forces_of(load, u)[0].sum(axis=0) == pytest.approx(total, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("element", ["hex8i", "mixed", "tet4", "tet10", "wedge6"])
def test_pressure_on_all_sides_is_the_stress_minus_p_everywhere(element: str):
    """Nodal forces are those of a uniform stress in each element, on hexahedra, wedges, pyramids and tetrahedra."""
    if element == "mixed":
        body = replace(BLOCK, geometry=mixed_cube(), element="hex8")
    else:
        box = mca.Box(size=SIZE, divisions=(3, 2, 2))
        body = replace(BLOCK, geometry=grid(SIZE, (3, 3, 2), "deep") if element == "wedge6" else box, element=element)
    given = replace(PUSH, nodes="boundary", amplitude=None)
    impact = begun(pushed(bodies=(body,), loads=(given,)), precision="float64")
    solver, model = impact.solver, impact.solver.model
    strain = -PEAK / (3.0 * STEEL.bulk_modulus)
    impact.state.u.assign(model.X * strain)
    solver.forces(impact.state)
    total = np.array(solver.work.nodal_force.numpy())
    force = solver.work.force.numpy().astype(float)
    for stage in solver.elements:
        np.add.at(total, stage.slot_node, force[stage.slot : stage.slot + len(stage.slot_node)])
    assert np.abs(total).max() < 1e-5 * PEAK * np.ptp(model.X, axis=0).max() ** 2  # strains of 2e-7


def test_a_force_spreads_by_area_or_equally_or_to_the_nearest_node():
    force, X = forces_of(TIP)
    edges = np.minimum(X[:, 1] % SIZE[1], X[:, 2] % SIZE[2]) < 1e-9
    inner = (X[:, 0] < 1e-9) & ~edges & (X[:, 1] < 0.0099) & (X[:, 2] < 0.0099)
    assert force[inner] == pytest.approx(np.tile([2.0 / 16.0, 0.0, 1.0 / 16.0], (9, 1)))
    force, X = forces_of(replace(TIP, spread="equal"))
    assert force[X[:, 0] < 1e-9] == pytest.approx(np.tile([2.0 / 25.0, 0.0, 1.0 / 25.0], (25, 1)))
    force, X = forces_of(replace(TIP, spread="equal", nodes=None, at=(0.0, 0.0049, 0.0051)))
    assert np.flatnonzero(force.any(axis=1)).tolist() == [int(np.abs(X - [0.0, 0.005, 0.005]).sum(axis=1).argmin())]


def test_contact_is_searched_for_as_fast_as_loads_make_bodies():
    """From rest to 64 m/s over a gap of 1 mm: the other block takes half of it, and what pushes on goes on."""
    other = replace(BLOCK, name="other", position=(0.021, 0.0, 0.0))
    slave, master = mca.Surface(body="other", nodes="xmin"), mca.Surface(body="block", nodes="xmax")
    contacts = (mca.Contact(slave=slave, master=master),)
    load = mca.Force(body="block", nodes="xmin", force=(3e4, 0.0, 0.0), spread="area")
    phase = mca.ImpactPhase(duration=6e-5, output_interval=5e-6)
    result = mca.run(pushed(bodies=(BLOCK, other), loads=(load,), contacts=contacts, impact=phase))
    ((touch, *_),) = result.summary["contacts"]
    assert touch == pytest.approx(np.sqrt(2.0 * 1e-3 * MASS / 3e4), abs=1e-5)
    assert result.summary["energy_error"] < 1e-2


@pytest.mark.parametrize("loads", [(PUSH, PULL), (TIP, FIELD)], ids=["faces", "nodes"])
def test_a_model_file_and_a_checkpoint_go_on_to_the_same_bits(loads: Any, tmp_path: Path):
    goes_on(pushed(loads=loads), tmp_path)


def test_several_rates_give_the_same_impulse():
    """Loaded nodes take the common steps of contacts and joints, half as long as those of the coarser body."""
    wide = mca.Box(size=SIZE, divisions=(2, 1, 1))
    coarse = replace(BLOCK, name="coarse", geometry=wide, position=(0.0, 0.1, 0.0))
    impact = finished(pushed(bodies=(BLOCK, coarse)), precision="float64", multi_rate=2)
    model = impact.solver.model
    assert model.rates is not None and model.rates.top == 1
    gained = momentum(impact, 0, model.node_start["coarse"])
    assert gained == pytest.approx([0.5 * PEAK * END * AREA, 0.0, 0.0], rel=1e-6, abs=1e-12)
    energy = result_of(impact).summary["energy"]
    assert abs(energy["error"]) < 1e-4 * energy["external_work"]


def test_a_batch_gives_the_figures_of_the_scenes_alone():
    """One has an absorbing side besides, whose columns stand behind those of loads, the other two pressures."""
    side = mca.Absorbing(body="block", nodes="xmax")
    loads = (PUSH, TIP, FIELD)
    scenes = [pushed(absorbing=(side,), loads=loads), pushed(loads=(PUSH, replace(PUSH, nodes="ymax"), TIP, FIELD))]
    for result, scene in zip(mca.run_batch(scenes), scenes, strict=True):
        alone = mca.run(scene)
        works = [found.summary["energy"]["external_work"] for found in (result, alone)]
        assert works[0] == pytest.approx(works[1], rel=1e-9) and works[1] > 0.0
        for name in ("E_kinetic", "E_internal"):
            assert result[name] == pytest.approx(alone[name], rel=1e-9)


def test_what_does_not_fit_is_refused_by_name():
    def refused(words: str) -> Any:
        return pytest.raises(mca.RequestError, match=words)

    with refused(r"Scene.loads = .Pressure.: scenes of a batch have loads of the same"):
        mca.run_batch([pushed(), pushed(loads=())])
    with refused(r"Pressure.body = .block.: loads act on nodes of flexible bodies"):
        mca.run(pushed(bodies=(replace(BLOCK, rigid=True), replace(BLOCK, name="other"))))
    with refused(r"Pressure.body = .ball.: the scene's bodies are block"):
        pushed(loads=(replace(PUSH, body="ball"),))
    with refused(r"Pressure.nodes|node set = .side."):
        mca.run(pushed(loads=(replace(PUSH, nodes="side"),)))
    with refused(r"Scene.loads = \['Pressure of .*'\]: its times count from the impact"):
        pushed(phases=(mca.Settle(duration=1e-3),))
    pushed(loads=(replace(PUSH, amplitude=None),), phases=(mca.Settle(duration=1e-3),))
    with refused(r"Pressure of block.pressure = nan: give a number from"):
        replace(PUSH, pressure=float("nan"))
    with refused(r"Pressure of block.amplitude = float: give an Amplitude|amplitude = 2.0: give an Amplitude"):
        replace(PUSH, amplitude=2.0)
    with refused(r"Traction of block.traction = .*: give three finite numbers"):
        replace(PULL, traction=(1.0, 2.0))
    with refused(r"Force of block.nodes = None: give either nodes or at"):
        replace(TIP, nodes=None)
    with refused(r"Force of block.spread = mass: choose equal or area|Force of block.spread = .mass."):
        replace(TIP, spread="mass")
    with refused(r"Force of block.spread = .area.: a point has no area"):
        replace(TIP, nodes=None, at=(0.0, 0.0, 0.0))
    with refused(r"Amplitude.times = .*: list them in increasing order"):
        mca.Amplitude(times=(1.0, 0.0), values=(0.0, 1.0))
    with refused(r"Amplitude.half_sine.duration = 0"):
        mca.Amplitude.half_sine(0.0)


def test_times_that_count_from_the_touch_are_refused_where_nobody_knows_it():
    link = mca.make_scene("two_link")
    with pytest.raises(
        mca.RequestError, match=r"BodyForce of OA.amplitude = Amplitude.times=.*: its times count from the touch"
    ):
        mca.run(replace(link, loads=(replace(FIELD, body="OA"),)), method="pure-fem")
    with pytest.raises(mca.RequestError, match=r"Scene.t_end = 1.0: loads act in an impact alone"):
        replace(link, loads=(replace(FIELD, body="OA"),), t_end=1.0)


def test_curves_are_what_they_are_called():
    pulse, step = mca.Amplitude.half_sine(2e-3, start=1e-3), mca.Amplitude.smooth_step(1e-3)
    t, values = np.array(pulse.times), np.array(pulse.values)
    assert (t[0], t[-1], values[0], values[-1]) == (1e-3, pytest.approx(3e-3), 0.0, 0.0)
    assert (0.5 * np.diff(t) * (values[1:] + values[:-1])).sum() == pytest.approx(2.0 * 2e-3 / np.pi, rel=1e-4)
    assert (step.values[0], step.values[50], step.values[-1]) == (0.0, pytest.approx(0.5), pytest.approx(1.0))
