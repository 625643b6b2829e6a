"""Tests how choices of `--accuracy` are measured and judged, and that the page accuracy.md shows what was measured."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from typing import Any

import pytest

import warp_mca as mca
from benchmarks.accuracy import JSON, PAGE
from benchmarks.accuracy_families import FAMILIES, Reference
from benchmarks.accuracy_judge import MARGIN, cost_ratio, counts, judged, no_dearer, render
from benchmarks.accuracy_left_out import left_out
from benchmarks.accuracy_measure import (
    FAMILY,
    FINE,
    added,
    completed,
    errors_of,
    jobs_of,
    lacking,
    row_of,
    sampled,
    stored,
    truth_of,
    variant_of,
)
from warp_mca.accuracy.choice import cost_of
from warp_mca.accuracy.convergence import Limit
from warp_mca.accuracy.store import families
from warp_mca.geometry.refinement import refined
from warp_mca.phases.rate_groups import COSTS

ROD = FAMILY["rod_on_wall"]  # its first peak has no limit
HOW = ROD.limits
assert isinstance(HOW, Reference) and HOW.order == 1.0


def row(refine: float, error: float = 0.0, **more: Any) -> dict[str, Any]:
    """A run with an impulse of 2 (1 + 0.1 / R + error) N s."""
    size = {
        "elements": int(600 * refine**3),
        "steps": int(200 * refine),
        "computed": 1.0,
        "work": 1.0,
        "refine": refine,
        "open": False,
    }
    return {"figures": [None, 2.0 * (1.0 + 0.1 / refine + error), 1e-3], "refine": refine, **size, **more}


TABLE = {FINE: row(5.0), **{k: row(item.refine or 1.0) for k, item in enumerate(ROD.variants)}}
LIMITS = [Limit(None), Limit(2.0, 0.03), Limit(1e-3)]


def run(refine: float, asked: float, estimate: float, deciding: float = 0.1) -> dict[str, Any]:
    shares = {"F_n_first_peak": None, "impulse": estimate, "contact_duration": None}
    return row(refine, asked=asked, estimate=shares, deciding=deciding)


def test_references_are_extrapolated_with_the_order_of_the_family():
    truth = truth_of(ROD, {}, TABLE)
    assert truth is not None
    assert truth[0].value is None
    assert [limit.value for limit in truth[1:]] == pytest.approx([2.0, 1e-3], rel=1e-12)
    assert truth_of(ROD, {}, {0: row(0.5)}) is None
    assert truth_of(ROD, {}, {FINE: row(5.0)}) is None


def test_families_with_limits_in_closed_form_need_no_reference():
    coaxial = FAMILY["coaxial_rods"]
    values = {"v": 2.0, "length": 0.5, "ratio": 2.0}
    truth = truth_of(coaxial, values, {0: row(0.5)})
    assert truth is not None
    assert truth[0].value is None
    assert [limit.value for limit in truth[1:]] == pytest.approx([7800.0 * 1.6e-3, (7800.0 / 200e9) ** 0.5], rel=1e-12)
    assert [limit.left for limit in truth[1:]] == [0.0, 0.0]
    assert truth_of(coaxial, values, {}) is None
    jobs = jobs_of([coaxial], {"coaxial_rods": [values]}, "cpu", 1.0)
    assert {job.variant for job in jobs} == set(range(len(coaxial.variants)))
    rods = mca.run(mca.make_scene("coaxial_rods", **values), refine=0.7, device="cpu")
    _, impulse, duration = errors_of(coaxial, row_of(rods, None), truth)
    assert impulse == pytest.approx(0.015, abs=0.01)
    assert duration == pytest.approx(0.07, abs=0.03)


def test_figures_whose_differences_grow_from_mesh_to_mesh_have_no_limit():
    def table(coarse: float, between: float | None, ends: bool = True) -> dict[int, dict[str, Any]]:
        rows = {HOW.partner: row(1.4, coarse - 0.1 / 1.4), FINE: row(4.0, -0.1 / 4.0, open=not ends)}
        return rows if between is None else {**rows, HOW.between: row(2.8, between - 0.1 / 2.8)}

    def impulse(found: dict[int, dict[str, Any]]) -> float | None:
        truth = truth_of(ROD, {}, found)
        assert truth is not None
        assert truth[2].value == pytest.approx(1e-3)
        return truth[1].value

    assert impulse(table(0.06, 0.04)) is None
    assert impulse(table(0.06, 0.005)) == pytest.approx(2.0 * (1.0 - 0.06 * 1.4 / 2.6))
    assert impulse(table(0.06, None)) is None  # it moves by more than can be told without the mesh between
    assert impulse(table(0.01, None)) is not None
    assert impulse(table(0.06, 0.005, ends=False)) is None  # that so far, as the run ends


def test_choices_are_judged_by_true_errors_estimates_and_cost():
    good, poor = run(2.8, 0.06, 0.04), run(1.0, 0.06, 0.02, deciding=0.5)
    scene = judged(ROD, {"v": 1.0}, TABLE, LIMITS, [good], "cuda:0")
    other = judged(ROD, {"v": 1.0}, TABLE, LIMITS, [poor, run(2.8, 0.1, 0.9)], "cuda:0")
    assert scene["runs"][0]["worst"] == pytest.approx(0.1 / 2.8)
    assert set(scene["tried"]) == set(range(len(ROD.variants)))
    assert scene["tried"][10][:3] == pytest.approx([None, 0.1 / 1.7, 0.0])
    assert scene["runs"][0]["cheapest"][1] == 10  # refine 1.7: 0.1 / 1.7 is within 6 %, 0.1 / 1.4 is not
    found = list(counts({"scenes": [scene, other]}).values())
    assert found == [(2, 3), (3, 3), (2, 3), (1, 3), (2, 3)]
    unsure = judged(ROD, {"v": 1.0}, TABLE, [*LIMITS[:1], Limit(2.0, 0.07), Limit(None)], [good], "cuda:0")
    assert unsure["runs"][0]["errors"] == [None, None, None]  # the reference may be off by more than what was asked
    assert list(counts({"scenes": [unsure]}).values()) == [(0, 0)] * 5
    assert cost_ratio({"scenes": [other]}) > 1.0  # pyright: ignore[reportOptionalOperand]


def test_variants_that_may_be_cheaper_than_those_chosen_are_measured():
    family = families()["rod_on_wall"]
    chosen = [
        {"scene": "rod_on_wall", "number": 0, "chosen": {**family.variants[k].knobs, "precision": "mixed"}}
        for k in (1, 4)
    ]
    wanted = no_dearer(chosen, "cpu")
    costs = [cost_of(size, COSTS["cpu"], True) for size in family.sizes]
    dearer = [k for k, own in enumerate(costs) if own > MARGIN * costs[4]]
    assert 0 < len(dearer) < len(costs)
    assert [k for k in range(len(costs)) if not wanted("rod_on_wall", 0, k)] == dearer
    assert all(wanted("rod_on_wall", 1, k) for k in range(len(costs)))
    other = no_dearer([{**chosen[0], "chosen": {"refine": 9.0}}], "cpu")
    assert all(other("rod_on_wall", 0, k) for k in range(len(costs)))


def test_scenes_of_all_families_are_measured_in_turn_references_and_what_they_need_first():
    links, rods = FAMILY["two_link"], ROD
    scenes = {family.scene: sampled(family, 1, 7) for family in (links, rods)}
    jobs = jobs_of([links, rods], scenes, "cuda:0", 1.0)
    assert {job.family for job in jobs[: len(jobs) // 4]} == {"two_link", "rod_on_wall"}
    for family in (links, rods):
        own = [job for job in jobs if job.family == family.scene]
        measured = sorted((scene, job.variant) for job in own for scene in job.scenes)
        assert measured == [(k, n) for k in range(7) for n in range(FINE, len(family.variants))]
    alone = [job for job in jobs if job.family == "rod_on_wall"]
    assert [job.variant for job in alone[:3]] == [FINE, HOW.partner, HOW.between]
    assert {len({values["duration"] for values in job.values}) for job in jobs if job.family == "two_link"} == {1}

    few = jobs_of([rods], scenes, "cpu", 1.0, lambda family, scene, variant: scene == 3)
    always = (FINE, HOW.partner, HOW.between)
    assert sum(len(job.scenes) for job in few if job.variant not in always) == len(rods.variants) - 2


def test_scenes_are_added_to_those_of_the_store():
    first, second = (stored(ROD, sampled(ROD, seed, 2), dict.fromkeys(range(2), TABLE)) for seed in (1, 3))
    assert len(added(first, second)["scenes"]) == 4
    assert added(first, first)["scenes"] == first["scenes"]
    assert added({**first, "variants": []}, second) == second
    assert added(None, second) == second


def test_what_is_stored_can_be_chosen_from():
    """Errors of 10 % / R, equal in all scenes: no care is needed beyond the least. One is unlike the others."""
    scenes = sampled(ROD, 1, 6)
    data = stored(ROD, scenes, dict.fromkeys(range(6), TABLE))
    assert [item["errors"][1] for item in data["scenes"][0]["runs"]] == pytest.approx(
        [0.1 / (item.refine or 1.0) for item in ROD.variants], abs=1e-5
    )
    json.dumps(data)
    entries = left_out("rod_on_wall", data)
    assert [item["device"] for item in entries] == ["H100", "cpu"]
    for found in entries:
        assert found["chosen"] == found["within"] == found["beside"] == 5
        assert found["right"] == found["estimates"] == 10


def test_variants_that_scenes_lack_are_added_to_the_store():
    few = replace(ROD, variants=ROD.variants[:7])
    scenes = sampled(ROD, 1, 3)
    before = stored(few, scenes, {k: {n: TABLE[n] for n in range(FINE, 7)} for k in range(3)})
    jobs = lacking([ROD], {"rod_on_wall": before}, "cpu")
    new = set(range(7, len(ROD.variants)))
    assert {(job.variant, job.scenes) for job in jobs} == {(number, (k,)) for number in new for k in range(3)}
    rows = {k: {number: TABLE[number] for number in new} for k in range(3)}
    before["processes"] = {"impulse": [None] * 7}  # of fewer variants
    assert completed(ROD, before, rows) == stored(ROD, scenes, dict.fromkeys(range(3), TABLE))
    assert completed(ROD, before, {})["scenes"] == before["scenes"]


@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.scene)
def test_families_are_made_of_scenes_and_variants_that_exist(family: Any):
    values = {**family.fixed, **family.sample(random.Random(3))}
    scene = mca.make_scene(family.scene, **values)
    how = family.limits
    for number in (0, FINE, how.partner, how.between) if isinstance(how, Reference) else (0,):
        made = variant_of(family, number).applied(scene)
        assert all(hasattr(refined(body.name, body.geometry, made.refine), "build") for body in made.bodies)


def test_the_page_shows_what_was_measured():
    page = PAGE.read_text(encoding="utf-8")
    if JSON.exists():
        assert page == render(page, json.loads(JSON.read_text(encoding="utf-8")))
    data = {
        "device": "it",
        "scenes": [judged(ROD, {"v": 1.5}, TABLE, LIMITS, [run(2.8, 0.05, 0.04)], "cpu")],
    }
    counts = dict.fromkeys(("scenes", "cases", "chosen", "within", "twice", "right", "estimates", "cheap", "beside"), 3)
    data["left_out"] = [
        {"family": name, "device": "cpu", **counts, "median": 1.5, "ratio": 0.4} for name in ("one", "other")
    ]
    shown = render(page, data)
    assert f"| `other`, cpu | 3 |{' 3 of 3 |' * 5} 1.50 | 0.40 |" in shown
    assert f"| all, cpu | 6 |{' 6 of 6 |' * 5}  |  |" in shown
    assert "| `rod_on_wall` v=1.5 | 5% | none | +3.6 % (est. 4.0 %) | +0.0 % |" in shown
    assert render(shown, data) == shown
    data["scenes"][0]["left"][1:], data["scenes"][0]["runs"][0]["errors"][1:] = [0.07, None], [None, None]
    assert "| 5% | none | limit to 7.0 % | none |" in render(page, data)
