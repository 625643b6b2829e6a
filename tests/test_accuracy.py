"""Tests `--accuracy`: what is asked, foreseen, chosen and estimated, and that runs can be repeated."""

from __future__ import annotations

import json
import math
import shlex
from dataclasses import replace
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pytest
from fake_run import fake

import warp_mca as mca
from warp_mca.accuracy import store
from warp_mca.accuracy.choice import LEAST, REGRET, WORTH, Choice, best, choices
from warp_mca.accuracy.figures import bound_errors
from warp_mca.accuracy.hinges import without_limit
from warp_mca.accuracy.plan import Plan, command, planned, run_planned
from warp_mca.accuracy.prediction import Expected, processes_of
from warp_mca.accuracy.request import Accuracy, accuracy_of
from warp_mca.accuracy.variant import Variant
from warp_mca.base.errors import RequestError, bad_value
from warp_mca.cli.main import main
from warp_mca.phases.rate_groups import COSTS
from warp_mca.scene.options import with_options

BOUND = ("F_n_first_peak", "impulse", "contact_duration")
REFINES = (0.5, 0.7, 1.0, 1.4)


def test_shares_are_read_as_users_write_them():
    assert accuracy_of("2%").share == accuracy_of(0.02).share == accuracy_of("0.02").share == 0.02
    for wrong in ("two", 0.0, "80%", float("nan")):
        with pytest.raises(mca.RequestError, match="2%"):
            accuracy_of(wrong)


def test_what_is_kept_with_a_store_foresees_the_same(known: store.Family):
    kept = replace(known, processes={name: tuple(items) for name, items in processes_of(known).items()})
    assert kept.processes["contact_duration"] == (None,) * len(REFINES)
    asked = Accuracy(share=0.05), BOUND[:2], COSTS["cpu"], True
    assert choices(kept, {"v": 1.5}, *asked) == choices(known, {"v": 1.5}, *asked)


def test_what_is_kept_must_be_that_of_all_variants(known: store.Family):
    (file,) = store.user_folder().glob("*.json")
    data = json.loads(file.read_text())
    data["families"]["rod_on_wall"]["processes"] = {"impulse": [[1.0, 1.0]]}
    file.write_text(json.dumps(data))
    with pytest.raises(mca.RequestError, match=r"mine\.json.*correct or remove it"):
        store.families()


@pytest.fixture
def known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> store.Family:
    """A family of `rod_on_wall` in the user's folder, with errors of 4 % v / R^2."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setattr(store, "_own", dict)
    speeds = (1.0, 1.2, 1.4, 1.6, 1.8, 2.0)

    def run(k: int, v: float) -> dict[str, object]:
        R = REFINES[k]
        return {
            "variant": k,
            "errors": [0.04 * v / R**2, 0.001, None],
            "elements": 600 * R**3,
            "steps": 200 * R,
            "computed": 1.0,
        }

    family = {
        "features": {"v": "log"},
        "mesh": {"axial": 40, "section": 4},
        "any_value": [],
        "no_limit": {"contact_duration": "of the test"},
        "variants": [{"refine": R, "parameters": {"penalty": 2.0}} for R in REFINES],
        "scenes": [{"parameters": {"v": v}, "runs": [run(k, v) for k in range(len(REFINES))]} for v in speeds],
    }
    folder = store.user_folder()
    folder.mkdir(parents=True)
    (folder / "mine.json").write_text(json.dumps({"families": {"rod_on_wall": family}}))
    found = store.family_of(mca.make_scene("rod_on_wall", v=1.5))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("v", "asked", "refine"), [(1.0, 0.05, 1.0), (1.0, 0.09, 0.7), (2.0, 0.09, 1.0), (2.0, 0.2, 0.7)]
)
def test_the_cheapest_variant_within_the_bound_is_chosen(known: store.Family, v: float, asked: float, refine: float):
    found = choices(known, {"v": v}, Accuracy(share=asked), BOUND[:2], COSTS["cpu"], True)
    assert [item.variant.refine for item in found] == list(REFINES)
    chosen = best(found, asked)
    assert chosen is not None
    assert chosen.variant.refine == refine
    error = chosen.errors["F_n_first_peak"]
    assert error is not None
    assert error.size == pytest.approx(0.04 * v / refine**2, rel=0.2)


@pytest.mark.parametrize(("v", "count"), [(1.5, len(REFINES)), (1e-3, 0), (1e3, 0)])
def test_a_scene_unlike_all_measured_ones_has_no_choices(known: store.Family, v: float, count: int):
    assert len(choices(known, {"v": v}, Accuracy(share=0.5), BOUND[:2], COSTS["cpu"], True)) == count


def offer(chance: float, cost: float) -> Choice:
    """A choice whose only error is within 1 % with this probability."""
    spread = 0.01 / NormalDist().inv_cdf(0.5 + 0.5 * chance)
    return Choice(variant=Variant(), number=0, errors={"impulse": Expected(0.0, spread)}, cost=cost)


def test_more_cost_must_add_to_the_probability_of_errors_within_the_bound():
    cheap, least = offer(LEAST, 1.0), LEAST + WORTH * math.log2(1.3)
    assert cheap.chance(0.01) == pytest.approx(LEAST, rel=1e-12)
    cheap = offer(LEAST + 1e-6, 1.0)
    assert best([cheap, offer(least - 0.01, 1.3)], 0.01) is cheap
    dear = offer(least + 0.01, 1.3)
    assert best([cheap, dear], 0.01) is dear
    assert best([offer(0.9 * LEAST, 1.0), dear], 0.01) is dear
    assert best([offer(0.9 * LEAST, 1.0)], 0.01) is None
    assert replace(dear, errors={**dear.errors, "F_n_first_peak": None}).chance(0.01) == 0.0


def test_more_than_twice_the_cost_must_make_up_for_what_a_cheaper_one_would_have_done():
    doubtful, middle = offer(0.2, 1.0), offer(LEAST + 0.01, 1.95)
    least = LEAST + 0.01 + 0.2 * REGRET + WORTH * math.log2(2.1 / 1.95)
    assert best([doubtful, middle, offer(least - 0.01, 2.1)], 0.01) is middle
    assert best([doubtful, middle, offer(least + 0.01, 2.1)], 0.01) is not middle


def test_nothing_is_chosen_where_no_variant_is_accurate_enough(known: store.Family):
    found = choices(known, {"v": 2.0}, Accuracy(share=0.03), BOUND[:2], COSTS["cpu"], True)
    assert best(found, 0.03) is None  # refine 1.4 errs by 4.1 %


def test_figures_without_a_limit_are_not_bound():
    assert bound_errors([0.1, None, 0.3], {}) == {"F_n_first_peak": 0.1, "impulse": None, "contact_duration": 0.3}
    found = bound_errors([0.1, 0.2, 0.3], {"contact_duration": "it rolls on", "F_n_first_peak": "it bounces"})
    assert found == {"F_n_first_peak": None, "impulse": 0.2, "contact_duration": None}


def test_variants_may_have_other_elements_unless_the_model_is_to_stay_full(known: store.Family):
    (file,) = store.user_folder().glob("*.json")
    data = json.loads(file.read_text())
    data["families"]["rod_on_wall"]["variants"][1]["element"] = "hex8r"
    file.write_text(json.dumps(data))
    scene = mca.make_scene("rod_on_wall", v=1.0)
    plan = planned(scene, 0.09, {}, "cpu", None, fake)
    assert plan is not None
    assert [body.element for body in plan.scene.bodies] == ["hex8r"] * len(scene.bodies)
    accuracy = plan.judged(fake(plan.scene)).summary["accuracy"]
    assert accuracy["chosen"]["element"] == "hex8r"
    words = shlex.split(accuracy["command"])
    assert words[:3] == ["warp-mca", "run", "rod_on_wall"]
    assert words[words.index("--element") + 1] == "hex8r"
    cut_off = fake(plan.scene)
    cut_off.summary["contact_open_at_end"] = True
    accuracy = replace(plan, reasons={}).judged(cut_off).summary["accuracy"]
    assert accuracy["estimate"]["impulse"] is None
    assert "lengthen duration" in accuracy["reasons"]["impulse"]
    assert accuracy["estimate"]["F_n_first_peak"] is not None
    force = np.array([0.0, *[100.0] * 9, 0.0, 0.0, 1.0, 0.0])
    grazing = replace(fake(plan.scene), history={"time_s": 1e-6 * np.arange(len(force)), "F_n_N": force})
    accuracy = replace(plan, reasons={}).judged(grazing).summary["accuracy"]
    assert accuracy["estimate"]["contact_duration"] is None
    assert "touches with hardly any force" in accuracy["reasons"]["contact_duration"]
    assert accuracy["estimate"]["impulse"] is not None
    faint = np.array([0.0, *[100.0] * 9, 0.5, 0.5, 40.0, 0.0])
    parting = replace(grazing, history={"time_s": 1e-6 * np.arange(len(faint)), "F_n_N": faint})
    accuracy = replace(plan, reasons={}).judged(parting).summary["accuracy"]
    assert "for 17% of it bodies hardly touch" in accuracy["reasons"]["contact_duration"]
    full = planned(scene, Accuracy(share=0.09, full=True), {}, "cpu", None, fake)
    assert full is not None
    assert full.variant.element is None


def test_of_mass_that_the_model_refuses_less_is_taken(known: store.Family):
    """How much elements gain is known once the model is made."""
    (file,) = store.user_folder().glob("*.json")
    data = json.loads(file.read_text())
    for variant in data["families"]["rod_on_wall"]["variants"]:
        variant["mass_scaling"] = 2.4
    file.write_text(json.dumps(data))
    scene = mca.make_scene("rod_on_wall", v=1.0)

    def carry_out(plan: Plan | None, most: float) -> mca.Result:
        assert plan is not None
        asked.append(factor := plan.scene.impact.mass_scaling)
        if factor is not None and float(factor) > most:
            raise bad_value("ImpactPhase.mass_scaling", factor, "it would add too much")
        return plan.judged(fake(plan.scene))

    for most, expected in ((3.0, [2.4]), (2.0, [2.4, 1.5]), (1.0, [2.4, 1.5, None])):
        asked: list[object] = []
        plan = planned(scene, 0.09, {}, "cpu", None, fake)
        result = run_planned(plan, lambda plan, most=most: carry_out(plan, most))
        assert asked == expected
        assert result.summary["accuracy"]["chosen"].get("mass_scaling") == expected[-1]
        words = shlex.split(result.summary["accuracy"]["command"])
        assert ("--mass-scaling" in words) == (expected[-1] is not None)
    typed = planned(scene, Accuracy(share=0.09, typed={"mass_scaling": 2.4}), {}, "cpu", None, fake)
    with pytest.raises(RequestError, match="too much"):
        run_planned(typed, lambda plan: carry_out(plan, 2.0))


def test_what_was_typed_stays(known: store.Family):
    def offered(**typed: object) -> list[float | None]:
        asked = Accuracy(share=0.05, typed=typed)
        return [item.variant.refine for item in choices(known, {}, asked, BOUND[:2], COSTS["cpu"], True)]

    assert offered(refine=1.4) == [1.4]
    assert offered(penalty=2.0, v=3.0) == list(REFINES)
    assert offered(penalty=0.1) == []


def test_mass_that_was_typed_is_neither_dropped_nor_foreseen_without_it(known: store.Family):
    """By the family's runs without it nothing is known; pilots have it."""
    scene = mca.make_scene("rod_on_wall", v=1.5)
    given = with_options(scene, None, 1.5, None)
    for typed in ({"mass_scaling": 1.5}, {}):
        plan = planned(given, 0.09, typed, "cpu", None, fake)
        assert plan is not None and plan.pilots is not None
        assert plan.scene.impact.mass_scaling == 1.5


def test_a_command_has_what_options_changed(known: store.Family):
    scene = mca.make_scene("rod_on_wall")
    bodies = tuple(replace(body, element="tet4") for body in scene.bodies)
    changed = replace(scene, bodies=bodies, impact=replace(scene.impact, time_step_scale=0.3))
    words = command(changed, "mixed", None, fake(scene).summary)
    assert words is not None
    assert "--element tet4" in words
    assert "--time-step-scale 0.3" in words
    assert "tet4" not in (command(scene, "mixed", None, fake(scene).summary) or "")


def test_a_figure_that_is_worse_than_asked_or_unknown_is_a_warning(known: store.Family):
    plan = planned(mca.make_scene("rod_on_wall", rho=7000.0), 0.04, {}, "cpu", None, fake)
    assert plan is not None and plan.pilots is not None
    good = plan.judged(fake(plan.scene))
    assert good.warnings == ()
    worse = plan.judged(fake(plan.scene, order=1.5, size=1.0))
    assert len(worse.warnings) == 1
    assert "first peak of F_n" in worse.warnings[0]


def test_scenes_that_differ_in_more_than_the_family_does_are_none_of_it(known: store.Family):
    scene = mca.make_scene("rod_on_wall", v=3.0)
    assert store.family_of(scene) == known
    assert store.family_of(replace(scene, gravity=(0.0, -9.8, 0.0))) is None
    assert store.family_of(mca.make_scene("rod_on_wall", rho=1000.0)) is None


def test_files_of_the_store_that_cannot_be_read_are_named(known: store.Family):
    (store.user_folder() / "other.json").write_text("{}")
    with pytest.raises(mca.RequestError, match=r"other\.json"):
        store.families()


def test_the_package_has_measurements_of_its_own():
    for family in store._read(store.OWN).values():
        assert len(family.sizes) == len(family.variants)
        assert min(size.steps * size.elements * size.computed for size in family.sizes) > 0.0
        scene = mca.make_scene(family.scene)
        for variant in family.variants:
            variant.applied(scene)


def test_point_and_line_loads_have_no_limit():
    assert without_limit(mca.make_scene("two_link", joint_nodes="pin")) == {}
    for nodes in ("ends", "axis"):
        found = without_limit(mca.make_scene("two_link", joint_nodes=nodes))
        assert set(found) == {"impulse", "contact_duration", "max_plastic_strain"}


def test_a_run_tells_its_error_and_can_be_repeated(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    """Pilots of a coarse ball; then the command that the summary gives."""
    first, second = tmp_path / "first", tmp_path / "second"
    settings = ["--set", "nu=0.31", "--set", "rho=7000"]
    assert main(["run", "hertz_sphere", *settings, "--accuracy", "12%", "--out", str(first), "--threads", "1"]) == 0
    said = capsys.readouterr()
    assert "accuracy 0.12: refine" in said.err
    assert "no body yields" in said.err
    assert "estimate" in said.out
    accuracy = json.loads((first / "summary.json").read_text())["accuracy"]
    assert accuracy["asked"] == 0.12
    assert 0.0 <= accuracy["estimate"]["F_n_first_peak"] < 0.12
    assert accuracy["estimate"]["max_plastic_strain"] is None
    words = shlex.split(accuracy["command"])[1:]
    assert main([*words, "--out", str(second), "--threads", "1"]) == 0
    assert (first / "history.csv").read_bytes() == (second / "history.csv").read_bytes()


def test_accuracy_is_refused_where_it_means_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    out = ["--out", str(tmp_path / "out")]
    for words, told in (
        (["run", "two_link", "--accuracy", "0%"], "accuracy = "),
        (["run", "two_link", "--model", "full"], "--model"),
        (["run", "two_link", "--accuracy", "2%", "--set", "t_end=1.0"], "t_end"),
        (["run", "two_link", "--accuracy", "2%", "--sweep", "mu=0.1,0.2"], "--accuracy"),
        (["run", "ringing_bar", "--accuracy", "2%"], "contacts"),
    ):
        assert main([*words, *out]) == 2
        assert told in capsys.readouterr().err
    scene = mca.make_scene("rod_on_wall")
    with pytest.raises(mca.RequestError, match="finished meshes"):
        mca.run(scene, accuracy=0.02, meshes=mca.mesh(scene))
