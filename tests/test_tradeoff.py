"""Trade-offs: the plan, errors and frontier of made-up runs, a small scene from end to end, requests refused."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.accuracy import measure
from warp_mca.accuracy.combine import combinations, merged, spread
from warp_mca.accuracy.convergence import Limit
from warp_mca.accuracy.figures import NAMES
from warp_mca.accuracy.files import as_json
from warp_mca.accuracy.findings import TradeOff
from warp_mca.accuracy.knobs import BASE, Trial, one_at_a_time
from warp_mca.accuracy.measure import Bench, Measured, element_steps
from warp_mca.accuracy.reference import Reference, choose_penalty, find_reference
from warp_mca.accuracy.variant import Variant
from warp_mca.accuracy.worth import print_tradeoff
from warp_mca.cli.main import main
from warp_mca.results.result import Result

STEEL = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
SCENE = '''
"""A block bounces off a plane."""
import warp_mca as mca


def build(*, t_end: float | None = None, apart: bool = False) -> mca.Scene:
    """A block of 512 elements."""
    block = mca.Box(size=(0.01, 0.01, 0.01), divisions=(8, 8, 8), origin=(0.0, 1e-3 if apart else 0.0, 0.0))
    steel = mca.Elastic(E=210e9, nu=0.3, rho=7850.0)
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", geometry=block, material=steel, velocity=(0.0, -1.0, 0.0)),),
        contacts=(
            mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), penalty=1.0),
        ),
        impact=mca.ImpactPhase(duration=8e-6, output_interval=2e-7, energy_tolerance=0.1),
    )
'''


@pytest.fixture(autouse=True)
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "block.py").write_text(SCENE, encoding="utf-8")
    return tmp_path


def measured(knob: str, variant: Variant, seconds: float, peak: float | None, stopped: str = "") -> Measured:
    figures = {"F_n_first_peak": peak, "impulse": None, "contact_duration": 2.0}
    wall = {"fe": seconds, "whole": seconds + 1.0, "cpu": seconds}
    return Measured(
        trial=Trial(knob, variant),
        figures={} if stopped else figures,
        elements=100,
        steps=10,
        element_steps=100.0 * seconds,
        wall={} if stopped else wall,
        stopped=stopped,
    )


def study(*runs: Measured) -> TradeOff:
    """A trade-off whose first peak is 100 N in the limit, and whose impulse has none."""
    truth = {name: Limit(None, why="made up") for name in NAMES}
    truth |= {"F_n_first_peak": Limit(100.0, 0.001), "contact_duration": Limit(2.0, 0.001)}
    reference = Reference(limits=truth, levels=[], penalty=None, springs={})
    told = {"scene": "made up", "device": "cpu", "threads": 1, "duration": 1e-3, "budget": None, "clock": "cpu"}
    return TradeOff(**told, reference=reference, variants=runs)


def test_errors_against_the_limit_and_the_frontier():
    base = measured("as written", Variant(), 8.0, 110.0)
    coarse = measured("mesh", Variant(refine=0.5), 1.0, 60.0)
    slow = measured("time step", Variant(time_step_scale=0.5), 16.0, 110.0)
    light = measured("multi-rate", Variant(multi_rate=2), 4.0, 95.0)
    refused = measured("mass scaling", Variant(mass_scaling=3.0), 0.0, None, "too much mass")
    found = study(base, coarse, slow, light, refused)
    assert found.errors_of(base)["F_n_first_peak"] == pytest.approx(0.1)
    assert found.errors_of(coarse)["F_n_first_peak"] == pytest.approx(-0.4)
    assert found.errors_of(base)["impulse"] is None
    assert found.frontier() == [coarse, light]
    assert found.frontier("contact_duration") == [coarse]
    assert found.frontier("impulse") == []


def test_combinations_are_foreseen_from_changes_that_multiply():
    base = measured("as written", Variant(), 8.0, 98.0)
    runs = [
        measured("mesh", Variant(refine=0.5), 2.0, 98.0 * 0.99),
        measured("springs", Variant(penalty=10.0), 16.0, 100.0),
        measured("multi-rate", Variant(multi_rate=2), 4.0, 98.0),
        measured("precision", Variant(precision="float64"), 0.0, None, "refused"),
    ]
    bench = Bench(scene=block(), device="cpu", threads=1, duration=None)
    bench.base = base
    chosen = combinations(bench, runs, {"F_n_first_peak": 100.0}, floor=1e-4)
    knobs = {tuple(sorted(trial.variant.knobs)): cost for trial, cost in chosen}
    assert knobs[("multi_rate", "refine")] == pytest.approx(0.125)
    assert knobs[("multi_rate", "penalty")] == pytest.approx(1.0)
    assert all(len(names) > 1 and "precision" not in names for names in knobs)


def test_knobs_that_a_run_refuses_together_are_not_combined():
    base = measured("as written", Variant(), 8.0, 100.0)
    runs = [
        measured("mass scaling", Variant(mass_scaling=2.0), 4.0, 101.0),
        measured("far link rigid", Variant(parameters={"rigid_bodies": "OA"}), 2.0, 102.0),
        measured("element", Variant(element="hex8r"), 1.0, 103.0),
    ]
    bench = Bench(scene=block(), device="cpu", threads=1, duration=None)
    bench.base = base
    chosen = [trial.variant.knobs for trial, _ in combinations(bench, runs, {"F_n_first_peak": 100.0}, floor=0.0)]
    assert {"element": "hex8r", "rigid_bodies": "OA"} in chosen
    assert not any({"mass_scaling", "rigid_bodies"} <= set(knobs) for knobs in chosen)


def test_shortcuts_are_not_chosen_because_their_errors_cancel():
    """The first peak is 10 N too low; a shortcut that adds 10 N does not mend that, finer cells do."""
    base = measured("as written", Variant(), 8.0, 90.0)
    runs = [
        measured("mass scaling", Variant(mass_scaling=2.0), 4.0, 100.0),
        measured("multi-rate", Variant(multi_rate=2), 4.0, 90.0),
        measured("mesh", Variant(refine=2.0), 80.0, 100.0),
    ]
    bench = Bench(scene=block(), device="cpu", threads=1, duration=None)
    bench.base = base
    chosen = [trial.variant.knobs for trial, _ in combinations(bench, runs, {"F_n_first_peak": 100.0}, floor=0.0)]
    assert {"mass_scaling": 2.0, "multi_rate": 2} not in chosen
    assert chosen[-1] == {"refine": 2.0, "multi_rate": 2}


def test_combinations_are_tried_spread_along_the_frontier():
    assert spread(9, 3) == [0, 4, 8, 1, 2, 3, 5, 6, 7]
    assert spread(2, 10) == [0, 1]
    assert spread(0, 10) == []


def test_merged_variants_keep_what_each_changes():
    found = merged([Variant(refine=0.5), Variant(parameters={"axial_OA": 8}), Variant(multi_rate="auto")])
    assert found == Variant(refine=0.5, multi_rate="auto", parameters={"axial_OA": 8})


def block() -> mca.Scene:
    """A block on a plane."""
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(8, 8, 8))
    return mca.Scene(
        name="block",
        bodies=(mca.Body(name="block", geometry=box, material=STEEL, velocity=(0.0, -1.0, 0.0)),),
        contacts=(mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), penalty=1.0),),
        impact=mca.ImpactPhase(duration=8e-6, output_interval=2e-7, energy_tolerance=0.1),
    )


def test_the_plan_turns_one_knob_at_a_time_and_leaves_the_physics_alone():
    scene = mca.make_scene("two_link")
    plan = one_at_a_time(scene)
    assert len(plan) >= 27
    assert {trial.knob for trial in plan} >= {"mesh", "springs", "mass scaling", "multi-rate", "far link coarser"}
    assert [trial for trial in plan if trial.variant.applied(scene) == scene and not trial.variant.options] == []
    assert [trial.knob for trial in plan[:3]] == ["mesh", "springs", "mass scaling"]
    physics = {"joint_nodes", "pin_radius", "mu", "sigma_y", "beta", "two_way", "rigid_inertia"}
    assert not physics & {name for trial in plan for name in trial.variant.knobs}


def test_parameters_are_varied_only_where_the_catalogue_builds_the_scene():
    scene = mca.make_scene("two_link")
    changed = replace(scene, gravity=(0.0, -1.6, 0.0))
    assert not any(trial.variant.parameters for trial in one_at_a_time(changed))
    coarse = replace(scene, refine=0.5)
    found = [trial.variant.applied(coarse) for trial in one_at_a_time(coarse) if trial.variant.parameters]
    assert len(found) == 6 and all(item.refine == 0.5 for item in found)


def test_the_softest_penalty_is_taken_whose_springs_hold_next_to_nothing():
    """First peaks of 100 (1 - 0.02 / penalty) N: within 0.5 % from 4 on."""
    bench = Bench(scene=block(), device="cpu", threads=1, duration=None)

    def note(trial: Trial) -> Measured:
        penalty = trial.variant.penalty or 1.0
        assert isinstance(penalty, float)
        return measured("springs", trial.variant, 1.0, 100.0 * (1.0 - 0.02 / penalty))

    penalty, taken = choose_penalty(bench, lambda variant: True, note)
    assert penalty == 10.0
    assert taken["F_n_first_peak"] == pytest.approx(-0.002, abs=1e-6)
    penalty, _ = choose_penalty(bench, lambda variant: variant.penalty != 10.0, note)
    assert penalty == 3.0


@pytest.mark.parametrize(
    ("own", "other", "longer"), [("hex8i", "hex8r", 0.5), ("hex8r", "hex8i", 2.0), ("hex8w", "hex8", 2 / 3)]
)
def test_time_with_another_element_is_foreseen(own: str, other: str, longer: float):
    box = mca.Box(size=(1.0, 1.0, 1.0), divisions=(2, 2, 2))
    block = mca.Body(name="it", geometry=box, material=mca.Elastic(E=1e9, nu=0.3, rho=1e3))
    scene = mca.Scene(name="it", bodies=(replace(block, element=own),), impact=mca.ImpactPhase(duration=1e-3))
    bench = Bench(scene, "cpu", 1, None)
    bench.base = measured("as written", Variant(), 3.0, 100.0)
    assert bench.foreseen_steps(Variant(element=other)) == pytest.approx(longer * 3.0)


def test_element_steps_of_several_rates():
    groups = [{"step": 4e-8, "elements": 30}, {"step": 1e-8, "elements": 10}]
    summary = {"n_elements": 40, "n_steps": 100}
    assert element_steps(Result(summary, {})) == 4000
    assert element_steps(Result(summary | {"rate_groups": groups}, {})) == 100 * 30 + 400 * 10


def test_cost_is_foreseen_from_counts():
    bench = Bench(scene=block(), device="cpu", threads=1, duration=None)
    with pytest.raises(ValueError, match="BASE"):
        bench.foreseen(Variant())
    bench.base, bench.beside = measured("as written", Variant(), 8.0, 1.0), 0.01
    assert bench.foreseen(Variant()) == pytest.approx(8.0 + 1.0)
    assert bench.foreseen(Variant(refine=2.0)) == pytest.approx(8.0 * 16 + 8.0)
    assert bench.foreseen(Variant(mass_scaling=2.0)) == pytest.approx(4.0 + 1.0)


def test_a_scene_from_end_to_end(here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch):
    """A budget that no variant fits in leaves the scene as written and its reference."""
    monkeypatch.setattr(Bench, "foreseen", lambda self, variant: 1e9)
    command = ["tradeoff", "block.py", "--budget", "1e6", "--threads", "1", "--out", "found"]
    assert main(command) == 0
    found = json.loads((here / "found" / "tradeoff.json").read_text(encoding="utf-8"))
    assert (here / "found" / "tradeoff.png").read_bytes().startswith(b"\x89PNG")
    assert [row["knob"] for row in found["variants"]] == [BASE.knob] + 3 * ["reference"]
    assert [level["elements"] for level in found["reference"]["levels"]] == [64, 216, 512]
    assert found["reference"]["figures"]["max_plastic_strain"] is None
    assert found["reference"]["why"]["max_plastic_strain"] == "no run has this figure"
    peak, left = (found["reference"][key]["F_n_first_peak"] for key in ("figures", "left"))
    impedance = (210e9 * 0.7 / (1.3 * 0.4) * 7850.0) ** 0.5  # of a plane wave in a block held from the sides
    assert 0.85 * impedance * 1e-4 < peak < impedance * 1e-4  # springs and free sides give way
    assert 0.0 < left < 0.1
    base = found["variants"][0]
    assert base["errors"]["F_n_first_peak"] == pytest.approx(base["figures"]["F_n_first_peak"] / peak - 1.0)
    assert base["times_faster"] == 1.0 and set(base["wall"]) == {"fe", "whole", "cpu"}
    assert {"refine": 0.7} in [row["knobs"] for row in found["left_out"]]
    said = capsys.readouterr().out
    assert "reference: limit of meshes of 64, 216, 512 elements" in said and "left out" in said
    assert main(command) == 2
    assert "it holds a trade-off already" in capsys.readouterr().err


def coarse(cells: int) -> mca.Scene:
    """The block with few cells along each edge."""
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(cells, cells, cells))
    return replace(block(), bodies=(replace(block().bodies[0], geometry=box),))


def test_a_mesh_is_measured_once(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Boxes of 6 cells have 4 with refine 0.7 and 0.5, 6 with 0.85 and 1.02, 8 with 1.4 and 1.2."""

    def run(bench: Bench, trial: Trial) -> Measured:
        cells = next(iter(mca.mesh(trial.variant.applied(bench.scene)).values())).cell_count
        peak = 100.0 * (1.0 - 0.5 * cells ** (-2 / 3))
        figures = dict.fromkeys(NAMES) | {"F_n_first_peak": peak}
        found = measured(trial.knob, trial.variant, 1e-3 * cells, peak)
        found = replace(found, trial=trial, elements=cells, figures=figures)
        bench.base, bench.beside = bench.base or found, 0.0
        return found

    monkeypatch.setattr(Bench, "run", run)
    found = mca.tradeoff(coarse(6))
    rows = [row.trial.variant for row in found.variants if row.trial.knob == "mesh"]
    assert [variant.knobs for variant in rows] == [{"refine": 0.7}, {"refine": 1.4}]
    same = [(one.variant.refine, other.variant.knobs) for one, other in found.same]
    assert same == [(0.5, {"refine": 0.7}), (1.2, {"refine": 1.4}), (0.85, {})]
    assert not [row for row in found.variants if row.trial.knob == "combined" and len(row.trial.variant.knobs) < 2]
    print_tradeoff(as_json(found))
    assert "refine=0.5 (that of refine=0.7)" in " ".join(capsys.readouterr().out.split())
    assert as_json(found)["same_mesh"][2] == {"knobs": {"refine": 0.85}, "as": {}}


@pytest.mark.parametrize(("cells", "elements"), [(6, [216, 512, 1728]), (2, [8, 64])])
def test_the_reference_takes_each_mesh_once_at_its_true_size(cells: int, elements: list[int]):
    """First peaks of 100 (1 - h^2) N with h by the number of cells: their limit is found, by three meshes the order."""
    bench = Bench(scene=coarse(cells), device="cpu", threads=1, duration=None)
    bench.base, bench.beside = measured("as written", Variant(), 1.0, 1.0), 0.0
    asked: list[int] = []

    def note(trial: Trial) -> Measured:
        asked.append(next(iter(mca.mesh(trial.variant.applied(bench.scene)).values())).cell_count)
        return replace(
            measured("reference", trial.variant, 1.0, 100.0 - 100.0 * asked[-1] ** (-2 / 3)), elements=asked[-1]
        )

    found = find_reference(bench, 1.0, {}, float("inf"), note)
    assert asked == [level.elements for level in found.levels] == elements
    if len(elements) == 3:
        limit = found.limits["F_n_first_peak"]
        assert (limit.value, limit.order) == (pytest.approx(100.0), pytest.approx(2.0))


def test_a_scene_of_one_mesh_has_no_reference():
    """One cell stays one at every density that is tried."""

    @dataclass(frozen=True)
    class Cell:
        def build(self) -> mca.Mesh:
            return mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1)).build()

        def refined(self, factor: float) -> Cell:
            return self

    scene = replace(block(), bodies=(replace(block().bodies[0], geometry=Cell()),))
    bench = Bench(scene=scene, device="cpu", threads=1, duration=None)
    bench.base = measured("as written", Variant(), 1.0, 1.0)
    with pytest.raises(mca.RequestError, match="its cells are so few that other values of refine mesh it alike"):
        find_reference(bench, 1.0, {}, 1.0, lambda trial: measured("reference", trial.variant, 1.0, 1.0))


def refused_for_its_budget(budget: float, seen: list[Measured]) -> str:
    with pytest.raises(mca.RequestError, match=rf"^budget = {budget}: ") as caught:
        mca.tradeoff(block(), budget=budget, threads=1, progress=lambda found, so_far: seen.append(found))
    return str(caught.value)


def test_a_budget_that_the_scene_as_written_exceeds_stops_it_and_says_so():
    """The scene and its reference were run all the same, hours for a budget of minutes."""
    seen: list[Measured] = []
    assert "steps take about" in (said := refused_for_its_budget(1e-3, seen)) and "several times as much" in said
    assert not seen


def test_a_budget_that_the_coarsest_reference_exceeds_says_what_is_needed(monkeypatch: pytest.MonkeyPatch):
    """By the steps of the scene as written: meshes 1.96, 1.4 and 1 times as coarse, in float64 and several rates."""
    seen: list[Measured] = []
    monkeypatch.setattr(measure, "MULTI_RATE", 4e5)  # a reference that takes hours
    said = refused_for_its_budget(50.0, seen)
    (base,) = seen
    least = 4e5 * 1.1 * base.wall["fe"] * (0.51**4 + 0.714**4 + 1.0)
    wanted = float(said.rpartition("give at least ")[2].removesuffix(" s"))
    assert wanted == pytest.approx(1.5 * (base.wall["fe"] + least), rel=0.1)


def test_a_run_that_would_not_end_in_the_budget_is_stopped():
    """Only what was foreseen kept the budget: a variant that took ten times as long took it."""
    bench = Bench(block(), "cpu", 1, None)
    bench.run(BASE)
    bench.end = time.perf_counter() + 1e-3
    late = bench.run(Trial("time step", Variant(time_step_scale=0.5)))
    assert "the budget would end about" in late.stopped and not late.figures


@pytest.mark.parametrize(("lap", "more"), [(1.0, 0.0), (30.0, 30.0)])
def test_compiling_kernels_is_not_of_the_budget_and_loading_them_is(
    monkeypatch: pytest.MonkeyPatch, lap: float, more: float
):
    now = [100.0]
    monkeypatch.setattr(measure.time, "perf_counter", lambda: now[0])
    watch = measure._Watch(end=110.0)
    for stage, seconds in (("mesh", 1.0), ("compile", lap), ("impact", 0.0)):
        watch(stage, 0.0)
        now[0] += seconds
    assert watch.end == 110.0 + more
    now[0] = watch.end + 0.1
    with pytest.raises(measure.OutOfTimeError):
        watch("impact", 0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["block.py", "--budget", "0"], "budget = 0.0: give a finite time above 0 s"),
        (["block.py", "--budget", "nan"], "budget = nan: give a finite time above 0 s"),
        (["block.py", "--budget", "1e-320"], "budget = 1e-320: give a finite time above 0 s"),
        (["block.py", "--set", "apart=true"], "a run of it has none of the figures"),
        (["two_link", "--set", "t_end=0.5"], "variants are compared by one impact"),
        (["hertz_sphere", "--set", "rigid_sphere=true"], "scene = 'hertz_sphere': all its bodies are rigid"),
        (["block.mca"], "a built model holds finished meshes"),
        (["block.py", "--threads", "0"], "threads"),
    ],
)
def test_bad_requests(arguments: list[str], words: str, here: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["tradeoff", *arguments, "--out", "found"]) == 2
    assert words in capsys.readouterr().err
    assert not (here / "found").exists()
