"""Table 2 of the report: finite elements alone beside rigid links first, on a scene whose swing lasts 1.1 ms."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from undrawn import draw_nothing

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.paper import report
from warp_mca.paper.claims import judge
from warp_mca.paper.evidence import Evidence, MissingRunError, Runs
from warp_mca.paper.page import Page, as_html, as_markdown
from warp_mca.paper.pure_claims import PURE
from warp_mca.paper.studies import LEVELS, MAIN, MESH, pure_case
from warp_mca.paper.table_2 import HEAD, compare, enough, event_end, stored, table_rows
from warp_mca.phases import flexible_swing

COARSE = {
    "section": 2,
    "ring": 1,
    "axial": 4,
    "focus_layers": 2,
    "focus_size": 2.2e-3,
    "plate_core": 2,
    "plate_core_depth": 1,
    "plate_layers": 2,
    "plate_extension": 2,
}
OPEN_TIMES = (2e-6, 4e-5, 1e-3)  # the last one does not end within the run


def scene(mu: float = 0.47) -> mca.Scene:
    """A short, coarse rod that turns fast strikes a plate."""
    made = mca.make_scene(
        "single_link", theta=46.6, output_interval=2e-6, duration=6.6e-4, rigid_inertia="mesh", mu=mu, **COARSE
    )
    assert made.rigid is not None
    return replace(made, rigid=replace(made.rigid, theta_dot=(-10.0,)))


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> Iterator[None]:
    """Drawing takes longer than the runs; blocks are so short that the swing has several."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(flexible_swing, "BLOCK", 2)
        draw_nothing(patch)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("table_2")
    compare(scene(), out, open_times=OPEN_TIMES, threads=1)
    return out


def entry(folder: Path) -> dict[str, Any]:
    found = stored(folder)
    assert found is not None
    return found


def runs(comparison: dict[str, Any] | None, out: Path = Path()) -> Runs:
    return Runs(LEVELS["quick"], out, {}, {}, {}, "cpu", comparison, out)


def test_both_ways_give_the_same_and_one_costs_more(folder: Path):
    found = entry(folder)
    ratio = found["mca"]["ratio"]
    assert [ratio[key] for key in ("F_n_first_peak", "impulse", "contact_duration")] == pytest.approx(
        [1.0] * 3, abs=2e-2
    )
    assert found["pure"]["cost"]["total"] > found["mca"]["cost"]["total"] > 0.0
    assert 0.0 < found["configuration_error"] < 1e-5
    assert ratio["n_steps"] == found["mca"]["n_steps"] / found["pure"]["n_steps"] < 0.5


def test_an_impact_that_has_ended_is_the_start_of_the_whole_one(folder: Path):
    found, whole = entry(folder), mca.load(folder / "mca")
    assert [event["open_time"] for event in found["event"]] == list(OPEN_TIMES[:2])
    for event in found["event"]:
        assert event["end"] == whole.summary["contacts"][0][1] + event["open_time"]
        assert event["impulse"] == pytest.approx(whole.F_n[whole.time <= event["end"]].sum() * 2e-6, rel=1e-12)
        assert event["n_steps"] == round(event["end"] / whole.summary["dt"])


def test_it_ends_where_an_impact_of_a_run_of_phases_does(folder: Path):
    found = entry(folder)["event"][1]
    made = scene()
    ended = mca.run(
        replace(made, t_end=0.0025, impact=replace(made.impact, open_time=OPEN_TIMES[1])), threads=1, precision="mixed"
    ).summary
    impact = ended["phases"][1]
    assert impact["ended_by"] == "separation"
    # which looks at its rows as they come, up to 32 at a time
    assert 0.0 <= impact["end"] - impact["start"] - found["end"] + 1e-12 < 32 * 2e-6
    assert ended["F_n_first_peak"] == found["F_n_first_peak"]


@pytest.mark.parametrize(
    ("contacts", "open_time", "end"),
    [
        ([(0.0, 3.0)], 1.0, 4.0),
        ([(0.0, 3.0), (3.5, 5.0)], 1.0, 6.0),
        ([(0.0, 3.0), (4.0, 5.0)], 1.0, 4.0),
        ([(0.0, 3.0), (4.0, 5.0)], 2.0, 7.0),
    ],
)
def test_an_impact_ends_when_its_contacts_have_been_open_for_so_long(
    contacts: list[tuple[float, float]], open_time: float, end: float
):
    assert event_end(contacts, open_time) == end


def test_an_open_time_is_enough_if_no_contact_follows(folder: Path):
    first, second = entry(folder)["event"]
    assert enough({"event": [first, second]}) is first
    assert enough({"event": [first | {"later_contacts": 1}, second]}) is second
    assert enough({"event": [first | {"later_contacts": 1}]}) is None


def test_it_goes_on_after_an_interruption_with_the_same_bits(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    def interrupt(stage: str, done: float, at: float) -> None:
        if stage == "impact" and done > at:
            raise KeyboardInterrupt

    monkeypatch.setattr("warp_mca.paper.table_2.EVERY", "1")
    for at in (0.3, 0.8):
        with pytest.raises(KeyboardInterrupt):
            compare(scene(), tmp_path, open_times=(), threads=1, progress=partial(interrupt, at=at))
        assert (tmp_path / "pure" / "checkpoint.npz").exists()
    found = compare(scene(), tmp_path, open_times=(), threads=1)
    again, whole = (mca.load(out / "pure") for out in (tmp_path, folder))
    assert all(np.array_equal(again[name], whole[name], equal_nan=True) for name in whole.history)
    assert found["pure"]["n_steps"] == entry(folder)["pure"]["n_steps"]
    assert (tmp_path / "mca" / "history.csv").read_bytes() == (folder / "mca" / "history.csv").read_bytes()


def test_what_is_done_is_not_done_again(folder: Path, monkeypatch: pytest.MonkeyPatch):
    before = entry(folder)
    monkeypatch.setattr(mca, "run", None)
    assert compare(scene(), folder, open_times=OPEN_TIMES, threads=1) == before


def test_a_folder_with_other_runs_is_refused(folder: Path):
    with pytest.raises(RequestError, match=r"out = .*another scene"):
        compare(scene(mu=0.3), folder, threads=1)
    with pytest.raises(RequestError, match=r"out = .*precision"):
        compare(scene(), folder, threads=1, precision="float64")


def test_claims_read_the_comparison(folder: Path):
    verdicts = {verdict.claim.id: verdict for verdict in judge(PURE, runs(entry(folder)))}
    assert verdicts["fem_peak"].agrees and verdicts["fem_motion"].agrees
    assert not verdicts["fem_cost"].agrees  # the swing is too short
    assert "ends 0.002 ms after" in str(verdicts["fem_cost"].ours)
    cheap = entry(folder)
    cheap["event"][0]["ratio"]["cost_total"] = 0.005
    (verdict,) = judge(PURE[1:2], runs(cheap))
    assert verdict.agrees and str(verdict.ours).startswith("0.500 %")


def test_claims_without_a_comparison_neither_agree_nor_differ():
    assert {(v.agrees, v.why) for v in judge(PURE, runs(None))} == {
        (None, "pure finite elements are run with --pure-fem only")
    }
    with pytest.raises(MissingRunError):
        Evidence(runs({}), MESH).comparison()
    assert Evidence(runs({}), MAIN).comparison() == {}


def test_the_table_is_on_the_page(folder: Path):
    rows = table_rows(entry(folder))
    assert len(rows) == 4 and all(len(row) == len(HEAD) for row in rows)
    assert rows[0][0] == "finite elements alone" and rows[0][-1] == "100.000 %"
    page = Page(LEVELS["quick"], "", [], {}, {}, entry(folder), ["warp-mca run --method pure-fem"])
    for text in (as_html(page), as_markdown(page)):
        assert all(cell in text for cell in rows[1]) and "--method pure-fem" in text


def test_the_report_runs_it_after_all_others(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    made = []

    def carried_out(level: object, out: Path, **_: object) -> Runs:
        made.append("runs")
        return replace(runs(None), out=out)

    def compared(scene: mca.Scene, out: Path, **_: object) -> dict[str, Any]:
        assert (tmp_path / "paper.json").exists()
        made.append(scene.parameters["joint_nodes"])
        return {"comparison": True}

    monkeypatch.setattr(report, "carry_out_runs", carried_out)
    monkeypatch.setattr(report, "compare", compared)
    monkeypatch.setattr(report, "judge", lambda *_: [])
    monkeypatch.setattr("warp_mca.paper.page.table_rows", lambda *_: [])
    monkeypatch.setattr(Page, "table_2", lambda _: [])
    report.make_report(LEVELS["quick"], tmp_path, pure_fem=True)
    assert made == ["runs", "axis"]
    assert json.loads((tmp_path / "paper.json").read_text(encoding="utf-8"))["table_2"] == {"comparison": True}


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_rigid_links_have_the_mass_of_the_mesh(level: Any):
    scene = pure_case(level).scene()
    assert scene.rigid is not None and scene.rigid.inertia == "mesh"
