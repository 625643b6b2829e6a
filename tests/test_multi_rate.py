"""Multi-rate steps: what groups conserve, that they are stable, that they converge, and how they are chosen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from chains import BASE, LENGTH, START, TORQUE, bars, motion_at_end
from chains import ready as chain_ready
from impacts import SHORT_RANGES, begun, figures, finished, momentum, prepared, result_of
from numpy.typing import NDArray

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.kernels.elements import hex8, hex8_patch
from warp_mca.phases.division import divide
from warp_mca.phases.impact import Impact
from warp_mca.phases.rate_groups import COSTS, StepCost, grouping
from warp_mca.physics.elements.patch_stage import PatchStage
from warp_mca.scene.catalogue import load_source
from warp_mca.system.time_step import Rates

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7800.0)
METAL = mca.J2Bilinear(E=70e9, nu=0.3, rho=2700.0, sigma_y=5e6, E_t=7e9, beta=0.3)


def graded(size: tuple[float, float, float], divisions: tuple[int, int, int], ratio: float) -> mca.Mesh:
    """A box whose cells grow along y by `ratio` in all, from ymin on."""
    box = mca.Box(size=size, divisions=divisions).build()
    heights = np.geomspace(1.0, ratio, divisions[1])
    places = size[1] * np.concatenate([[0.0], np.cumsum(heights)]) / heights.sum()
    layer = np.rint(box.points[:, 1] * divisions[1] / size[1]).astype(int)
    points = box.points.copy()
    points[:, 1] = places[layer]
    return replace(box, points=points)


def free_bar(speed: float = 20.0, element: str = "hex8", **impact: float) -> mca.Scene:
    """A graded bar falls on a soft rigid plane, fine end first, and flies off ringing."""
    bar = graded((0.02, 0.1, 0.02), (1, 24, 1), 16.0)
    plane = mca.RigidPlane(point=(0.0, 0.0, 0.0))
    return mca.Scene(
        name="bar",
        bodies=(mca.Body(name="bar", geometry=bar, material=STEEL, velocity=(0.0, -speed, 0.0), element=element),),
        contacts=(mca.Contact(slave=mca.Surface(body="bar", nodes="ymin"), master=plane, penalty=0.005),),
        impact=mca.ImpactPhase(**{"duration": 2e-4, "output_interval": 2e-6} | impact),
    )


def hinged(**impact: float) -> mca.Scene:
    """Two hinged graded bars that yield fly aslant into a rough plate; the upper one is driven at its top."""
    flight = {"material": METAL, "velocity": (1.0, -5.0, 0.5)}
    low = graded((0.02, 0.06, 0.02), (4, 8, 4), 6.0)
    high = mca.Box(size=(0.02, 0.06, 0.02), divisions=(4, 6, 4))
    plate = mca.Box(size=(0.06, 0.03, 0.06), divisions=(8, 4, 8), origin=(-0.02, -0.03, -0.02))
    top = mca.Surface(body="plate", nodes="ymax")
    along = mca.Line(body="low", start=(0.01, 0.001, 0.01), end=(0.01, 0.05, 0.01))
    return mca.Scene(
        name="hinged",
        bodies=(
            mca.Body(name="low", geometry=low, **flight),
            mca.Body(name="high", geometry=high, position=(0.0, 0.06, 0.0), **flight),
            mca.Body(name="plate", geometry=plate, material=METAL),
        ),
        joints=(mca.Revolute(name="A", body="low", at=(0.0, 0.06, 0.0), other="high", other_at=(0.0, 0.0, 0.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="low", nodes="ymin"), master=top, mu=0.4, penalty=1.0),),
        fixed=(mca.Fixed(body="plate", nodes="ymin"),),
        paths=(mca.Path(name="along", lines=(along,), spacing=0.01),),
        gravity=(0.0, -9.8, 0.0),
        impact=mca.ImpactPhase(**{"duration": 2e-5, "output_interval": 1e-6} | impact),
        tip=mca.Point(body="low", at=(0.0, 0.0, 0.0)),
        target=mca.Point(body="plate", at=(0.0, 0.0, 0.0)),
    )


def rates_of(scene: mca.Scene, groups: int | str) -> Rates | None:
    return prepared(scene, multi_rate=groups).model.rates


def test_each_element_is_below_its_own_limit_and_follows_its_fastest_node():
    """Neighbours of the smallest elements take their step; beyond, groups grow with the cells."""
    ready = prepared(free_bar(), multi_rate=4)
    rates, (block,) = ready.model.rates, ready.model.blocks
    assert rates is not None and rates.top == 3 and rates.common == 0
    level = np.repeat(np.arange(4), np.diff([0, *block.level_ends]))
    assert np.bincount(level).tolist() == list(rates.elements) and min(rates.elements) > 0
    height = np.ptp(ready.model.X[block.conn, 1], axis=0)
    assert (np.diff([height[level == k].min() for k in range(4)]) > 0.0).all()
    node = np.full(ready.model.node_count, 9)
    for corner in block.conn:
        np.minimum.at(node, corner, level)
    assert (rates.node_level == node).all()
    assert sorted(ready.model.element_of) == list(range(24))
    steps = begun(free_bar(), multi_rate=4).steps
    assert steps.dt / rates.substeps <= 0.9 * ready.model.stable.dt < steps.dt


def test_nodes_that_anything_touches_share_the_level_of_the_fastest():
    model = prepared(hinged(), multi_rate=4).model
    assert model.rates is not None and model.rates.top >= 2
    item = model.passes[0]
    touched = np.concatenate([item.slave, item.master, model.joint_first, model.joint_second])
    assert (model.rates.node_level[touched] == model.rates.common).all()


@pytest.mark.parametrize("groups", [2, 4])
def test_a_free_bar_that_rings_keeps_its_energy_and_momentum(groups: int):
    """15 periods of the longest wave after the bar has left the plane: energy swings a little, but does not drift."""
    impact = finished(free_bar(duration=6e-4), multi_rate=groups, precision="float64")
    found = result_of(impact)
    assert found.summary["contacts"][-1][1] < 1e-4
    energy = found["E_kinetic"] + found["E_internal"]
    free = found.time > 1e-4
    assert np.ptp(energy[free]) < 1e-3 * energy[0]
    assert abs(energy[free][-100:].mean() - energy[free][:100].mean()) < 2e-5 * energy[0]
    p = -impact.solver.model.mass.sum() * 20.0 + found.summary["contacts_by_pair"][0]["impulse"][1]
    assert momentum(impact)[1] == pytest.approx(p, rel=1e-12)


def test_internal_impulses_cancel_to_round_off():
    """Contact between bodies, friction and flow: momentum of all, without anything from outside."""
    scene = replace(hinged(), fixed=(), gravity=(0.0, 0.0, 0.0))
    impact = begun(scene, multi_rate=4, precision="float64")
    before = momentum(impact)
    impact.advance()
    assert result_of(impact).F_n.max() > 100.0
    scale = np.abs(impact.solver.model.mass[:, None] * impact.solver.model.V).sum()
    assert np.abs(momentum(impact) - before).max() < 1e-13 * scale


def test_gravity_alone_gives_free_fall():
    """In every group, v(t) and u(t) are exact for a constant acceleration."""
    scene = replace(free_bar(), gravity=(3.0, -9.8, 1.0), contacts=())
    impact = finished(scene, multi_rate=4, precision="float64")
    u, v = impact.at_last_record()
    t, g, V = impact.steps.interval * impact.steps.intervals, np.array([3.0, -9.8, 1.0]), np.array([0.0, -20.0, 0.0])
    assert v == pytest.approx(np.broadcast_to(V + g * t, v.shape), rel=1e-9, abs=1e-9)
    assert u == pytest.approx(np.broadcast_to(V * t + 0.5 * g * t**2, u.shape), rel=1e-9, abs=1e-13)


def test_answers_converge_with_the_step_at_second_order():
    """Against one rate at a thirtieth of the stable step; displacements of a wave in a smoothly driven bar."""
    times = tuple(np.linspace(0.0, 2e-5, 201))
    drive = mca.Prescribed(
        body="bar", nodes="ymin", axis="y", times=times, velocities=tuple(np.sin(np.pi * np.array(times) / 2e-5) ** 4)
    )
    scene = replace(free_bar(speed=0.0, duration=2.4e-5), contacts=(), prescribed=(drive,))

    def at_end(scale: float, groups: int | None) -> NDArray[np.float64]:
        made = replace(scene, impact=replace(scene.impact, time_step_scale=scale))
        impact = finished(made, multi_rate=groups, precision="float64")
        u = np.empty_like(impact.solver.model.X)
        u[:] = impact.at_last_record()[0]
        return u

    exact = at_end(0.03, None)
    errors = [np.abs(at_end(scale, 3) - exact).max() for scale in (0.8, 0.4, 0.2)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert errors[0] < 0.02 * np.abs(exact).max()
    assert (orders > 1.6).all(), (errors, orders)


def test_an_impact_gives_the_figures_of_one_rate():
    one, many = (result_of(finished(hinged(), multi_rate=groups)) for groups in (None, 4))
    assert "rate_groups" not in one.summary and many.summary["multi_rate"] == len(many.summary["rate_groups"]) >= 3
    for name, tolerance in (("F_n_N", 0.02), ("F_t_N", 0.04), ("E_kinetic", 1e-3), ("E_plastic", 0.02)):
        assert many[name] == pytest.approx(one[name], abs=tolerance * np.abs(one[name]).max()), name
    assert many.F_n.sum() == pytest.approx(one.F_n.sum(), rel=5e-3)
    stress = [result.paths[0].stress for result in (one, many)]
    assert np.linalg.norm(stress[1] - stress[0]) < 0.08 * np.linalg.norm(stress[0])
    assert max(one.summary["energy_error"], many.summary["energy_error"]) < 1e-3
    assert many.summary["joint_impulse"]["A"] == pytest.approx(one.summary["joint_impulse"]["A"], abs=2e-3)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_stored_state_goes_on_to_the_same_bits_for_any_number_of_threads(
    threads: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    whole = finished(hinged(), multi_rate=4)
    for name, length in SHORT_RANGES.items():
        monkeypatch.setattr(name, length)
    paused = begun(hinged(), multi_rate=4, threads=threads)
    paused.advance(until=paused.steps.count // 3)
    paused.save(tmp_path / "state")
    other = begun(hinged(), multi_rate=4, threads=threads)
    other.load(tmp_path / "state")
    other.advance()
    assert other.solver.threads == threads
    assert other.state.differences(whole.state) == []
    known, found = figures(whole), figures(other)
    assert [name for name in known if known[name].tobytes() != found[name].tobytes()] == []
    with pytest.raises(mca.RequestError, match="another model, precision or time step"):
        begun(hinged(), multi_rate=2).load(tmp_path / "state")


@pytest.mark.parametrize("precision", ["mixed", "float64"])
def test_patches_keep_to_one_level_in_whatever_order(precision: str, monkeypatch: pytest.MonkeyPatch):
    bar = graded((0.04, 0.3, 0.04), (8, 40, 8), 8.0)
    body = mca.Body(name="bar", geometry=bar, material=METAL)
    scene = mca.Scene(name="bar", bodies=(body,), impact=mca.ImpactPhase(duration=1e-5))
    model = prepared(scene, multi_rate=2).model
    (block,) = model.blocks
    monkeypatch.setattr(wp.get_device("cpu"), "sm_count", 2)
    stage = PatchStage(block, model.X, precision, hex8, hex8_patch, points=8)
    heads = stage.patches.head.numpy()
    first, last = int(np.searchsorted(heads[:, 0], block.level_ends[0])), len(heads)
    assert 0 < first < last and block.level_ends[0] in heads[:, 0]
    level = (np.arange(last) >= first).astype(int)
    assert (heads[:, 2] >> 25 == level).all()
    assert (stage.slot_level == np.repeat(level, heads[:, 2] >> 16 & 0x1FF)).all()
    stage.flowing.assign(np.arange(last) % 3 == 0)
    stage.schedule()
    turn = stage.patches.turn.numpy()[:, 3]
    assert sorted(turn) == list(range(last)) and (turn[: -(-last // 3)] % 3 == 0).all()


def test_hinge_torques_and_a_moving_base_act_on_their_own_level():
    """A chain whose outer bar is graded, with a driven joint on a moving base: motion and work as with one rate."""
    outer = mca.Box(size=(LENGTH, 0.02, 0.02), divisions=(24, 2, 2), origin=(0.0, -0.01, -0.01)).build()
    sizes = np.geomspace(1.0, 16.0, 24)
    places = LENGTH * np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()
    layer = np.rint(outer.points[:, 0] * 24 / LENGTH).astype(int)
    outer = replace(outer, points=np.column_stack([places[layer], outer.points[:, 1:]]))
    scene = bars(torques=(TORQUE,), base_motion=BASE)
    scene = replace(scene, bodies=(scene.bodies[0], replace(scene.bodies[1], geometry=outer)))
    span, found = 2e-4, []
    for groups in (None, 3):
        impact = Impact(
            [chain_ready(scene, grouping=grouping(scene, span, "cpu", groups))],
            span,
            device="cpu",
            precision="float64",
            threads=1,
        )
        impact.advance()
        found.append((motion_at_end(impact, START + span), result_of(impact).summary))
    (one, plain), (many, rated) = found
    assert len(rated["rate_groups"]) == 3
    assert many.theta_dot == pytest.approx(one.theta_dot, rel=1e-6)
    assert rated["energy"]["external_work"] == pytest.approx(plain["energy"]["external_work"], rel=5e-3)
    assert rated["energy_error"] < 1e-5


def test_tetrahedra_keep_one_step():
    assert rates_of(free_bar(element="tet4"), 4) is None


def test_auto_takes_what_the_stored_costs_of_the_device_make_cheapest(monkeypatch: pytest.MonkeyPatch):
    """Steps that cost nothing by themselves: the fewest elements. Steps that cost much: no more steps than needed."""
    scene = free_bar()
    models = {groups: prepared(scene, multi_rate=groups).model for groups in (2, 3, 4, 5)}
    elements = {
        model.rates.top: divide(scene, model, scene.impact.duration).count * model.rates.work
        for model in models.values()
        if model.rates
    }
    assert len(elements) == 4
    monkeypatch.setitem(COSTS, "cpu", StepCost(0.0, 1.0))
    free, dear = rates_of(scene, "auto"), StepCost(1.0, 1e-9)
    assert free is not None and elements[free.top] == min(elements.values())
    monkeypatch.setitem(COSTS, "cpu", dear)
    rates = rates_of(scene, "auto")
    assert (rates.substeps if rates else 1) <= 2
    monkeypatch.setitem(COSTS, "cpu", StepCost(0.0, 1.0, least=10**6))
    assert rates_of(scene, "auto") is None


@pytest.mark.parametrize("value", [0, 9, 2.5, "many", True])
def test_other_values_are_refused(value: object):
    with pytest.raises(mca.RequestError, match=r"multi_rate = .*groups from 1 to 8"):
        mca.run(free_bar(), multi_rate=value)  # type: ignore[arg-type]


def test_the_command_line_says_what_groups_it_took(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = tmp_path / "bars"
    command = ["run", "graded_bars", "--set", "axial=20", "--multi-rate", "auto", "--out", str(out)]
    assert main(command) == 0
    summary = mca.load(out).summary
    groups = summary["rate_groups"]
    assert sum(group["elements"] for group in groups) == summary["n_elements"] == 40
    assert groups[-1]["step"] == summary["dt"] == groups[0]["step"] * 2 ** (summary["multi_rate"] - 1)
    assert main([*command[:-1], str(tmp_path / "sweep"), "--threads", "64", "--sweep", "v=0.1,0.05"]) == 0
    assert mca.load(tmp_path / "sweep" / "1").summary["rate_groups"] == groups


@pytest.mark.parametrize("groups", ["auto", 2])
def test_rigid_bodies_alone_have_no_groups(groups: int | str):
    """They have no elements to sort, as models have that are too small for groups: all takes one step."""
    scene = mca.make_scene("hertz_sphere", rigid_sphere=True)
    assert rates_of(scene, groups) is None


@pytest.mark.gpu
@pytest.mark.parametrize(("precision", "tolerance"), [("mixed", 1e-4), ("float64", 1e-7)])
def test_device_gives_the_figures_of_the_cpu(precision: str, tolerance: float):
    cpu, cuda, again = (
        result_of(finished(hinged(), multi_rate=4, device=device, precision=precision))
        for device in ("cpu", "cuda:0", "cuda:0")
    )
    assert cuda.summary["rate_groups"] == cpu.summary["rate_groups"]
    for name in ("F_n_N", "F_t_N", "tip_vx", "E_kinetic", "E_plastic", "E_friction"):
        assert cuda[name] == pytest.approx(cpu[name], abs=tolerance * np.abs(cpu[name]).max()), name
    assert all(np.array_equal(cuda[name], again[name], equal_nan=True) for name in cuda.history)


@pytest.mark.gpu
@pytest.mark.parametrize("element", ["hex8", "hex8r"])
def test_patches_of_a_device_keep_to_their_level(element: str):
    """A block of several patches of each level, elastic and plastic ones in turn."""
    bar = graded((0.04, 0.3, 0.04), (8, 40, 8), 8.0)
    bodies = tuple(
        mca.Body(name=name, geometry=bar, material=material, position=(x, 0.0, 0.0), velocity=(0.0, -10.0, 0.0))
        for name, material, x in (("elastic", STEEL, 0.0), ("plastic", METAL, 1.0))
    )
    plane = mca.RigidPlane(point=(0.0, 0.0, 0.0))
    scene = mca.Scene(
        name="bars",
        bodies=tuple(replace(body, element=element) for body in bodies),
        contacts=tuple(mca.Contact(slave=mca.Surface(body=b.name, nodes="ymin"), master=plane) for b in bodies),
        impact=mca.ImpactPhase(duration=2e-5, output_interval=1e-6),
    )
    cpu, cuda = (result_of(finished(scene, multi_rate=4, device=device)) for device in ("cpu", "cuda:0"))
    assert cpu.summary["max_plastic_strain"] > 1e-3
    for name in ("F_n_N", "E_kinetic", "E_internal", "E_plastic"):
        assert cuda[name] == pytest.approx(cpu[name], abs=1e-4 * np.abs(cpu[name]).max()), name


@pytest.mark.parametrize(
    "options",
    [
        {"joint_nodes": "pin", "plate_absorbs": "ends", "fine_length": 0.04},
        {"joint_nodes": "pin", "rigid_bodies": "OA"},
    ],
)
def test_pins_sides_ties_and_rigid_bodies_take_part(options: dict):
    """What moves nodes in its own way takes the step of its fastest node; forces of slower elements count in full."""
    source = load_source("two_link")
    scene = source.build({**source.resolve("quick"), "penalty": 1.0, "duration": 6e-5, **options})
    one, several = (mca.run(scene, refine=0.6, multi_rate=rate) for rate in (None, 3))
    assert several.summary["multi_rate"] == 3
    assert several.F_n.sum() == pytest.approx(one.F_n.sum(), rel=2e-3)
    assert several.summary["energy_error"] < 1e-3
    for name, impulse in one.summary["joint_impulse"].items():
        np.testing.assert_allclose(
            several.summary["joint_impulse"][name], impulse, atol=5e-3 * abs(one.F_n.sum()) * 1e-6
        )
