"""The report on the published study: runs, claims, pictures and pages, in a small form of its levels."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest
from undrawn import draw_nothing

from benchmarks.measurements import FOLDER
from warp_mca.base.errors import RequestError
from warp_mca.cli.main import main
from warp_mca.paper import studies
from warp_mca.paper.choices import DURATIONS_HEAD, TRIED, choice_rows, duration_rows
from warp_mca.paper.claim_table import CLAIMS
from warp_mca.paper.claims import Claim, Words, judge
from warp_mca.paper.evidence import Evidence, MissingRunError, Runs
from warp_mca.paper.page import Page, as_html, as_markdown
from warp_mca.paper.pictures import PICTURES
from warp_mca.paper.readings import event_duration
from warp_mca.paper.report import Report, make_report
from warp_mca.paper.studies import (
    LEVELS,
    LUG,
    MAIN,
    MESH,
    PENALTY,
    SPRINGS,
    STUDIES,
    TOGETHER,
    Case,
    MeshChoice,
    cases,
    in_order,
)
from warp_mca.paper.word_checks import chosen
from warp_mca.results.result import Result
from warp_mca.results.storage import load
from warp_mca.studies.sweep import LATE

COARSE = MeshChoice("quick", refine=0.5)
SMALL = replace(
    LEVELS["quick"],
    main=COARSE,
    other=COARSE,
    meshes=(),
    limit=(),
    points={"mu": (0.1, 1.5)},
    ends={"mu": ()},
    tried={},
)


def runs_of(level: studies.Level) -> Runs:
    """No run of a level."""
    return Runs(level, Path(), {}, {}, {}, "cpu")


def report_of(level: studies.Level, out: Path, deadline: float = math.inf) -> Report:
    """A report on runs of the study of friction that end after 10 us."""
    with pytest.MonkeyPatch.context() as patch:
        draw_nothing(patch)
        patch.setitem(STUDIES, "mu", replace(STUDIES["mu"], common=(("duration", 10e-6),)))
        return make_report(level, out, workers=1, deadline=deadline)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("paper")
    report = report_of(SMALL, out)
    assert [row["status"] for row in report.rows] == ["done", "done"]
    return out


def test_json_has_every_claim_and_figure(folder: Path):
    found = json.loads((folder / "paper.json").read_text(encoding="utf-8"))
    assert [claim["id"] for claim in found["claims"]] == [claim.id for claim in CLAIMS]
    assert {"id", "what", "paper", "ours", "unit", "agrees", "why"} <= set(found["claims"][0])
    assert {picture.number for picture in PICTURES} <= set(found["figures"])
    assert [row["mu"] for row in found["figures"]["14"]] == [0.1, 1.5]
    assert all(
        claim["ours"] is None and claim["agrees"] is None for claim in found["claims"] if "Table 2" in claim["source"]
    )


def test_the_command_of_a_row_gives_it_again(folder: Path, tmp_path: Path):
    row = json.loads((folder / "paper.json").read_text(encoding="utf-8"))["figures"]["14"][0]
    assert main([*row["command"].split()[1:], "--out", str(tmp_path / "again")]) == 0
    again = load(tmp_path / "again").summary
    assert {key: row[key] for key in ("F_n_max", "F_t_min", "n_steps")} == {
        key: again[key] for key in ("F_n_max", "F_t_min", "n_steps")
    }


def test_it_continues_in_its_folder(folder: Path):
    table, before = folder / "runs" / "sweep.csv", (folder / "paper.json").read_bytes()
    lines = table.read_text(encoding="utf-8").splitlines(keepends=True)
    table.write_text("".join(lines[:2]) + lines[2][:40], encoding="utf-8")  # killed while it wrote the second row
    kept = (folder / "runs" / "0" / "summary.json").stat().st_mtime_ns
    report_of(SMALL, folder)
    assert (folder / "paper.json").read_bytes() == before
    assert (folder / "runs" / "0" / "summary.json").stat().st_mtime_ns == kept


def test_a_deadline_leaves_runs_for_later(tmp_path: Path):
    report = report_of(SMALL, tmp_path, deadline=1e-9)
    assert [row["reason"] for row in report.rows] == [LATE, LATE]
    assert {verdict.why for verdict in report.verdicts if verdict.claim.id == "mu_low_peak"} == {
        f"Coefficient of friction, 0.1: {LATE}"
    }


def test_the_report_is_written_again_without_the_device(folder: Path):
    before = (folder / "paper.html").read_bytes()
    (folder / "paper.html").unlink()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("warp_mca.paper.evidence.carry_out", None)
        report_of(SMALL, folder, deadline=0.0)
    assert (folder / "paper.html").read_bytes() == before


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_runs_that_decide_most_come_first(level: studies.Level):
    found = cases(level)
    order = in_order(level, found)
    assert set(order) == set(found.values()) and len(order) == len(set(order))
    assert order[0] == found["base", 0.0, MAIN]
    assert order.index(found["limit", 1.0, MAIN]) < order.index(found["mu", 0.1, MAIN])
    main = {case for (_, _, variant), case in found.items() if variant not in (MESH, PENALTY)}
    assert set(order[: len(main)]) == main


def test_another_level_needs_another_folder(folder: Path):
    with pytest.raises(RequestError, match="out"):
        report_of(replace(SMALL, points={"mu": (0.1, 1.0)}), folder)


def test_an_empty_name_is_no_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    assert main(["paper", "--out", ""]) == 2
    assert "--out: '': name a folder" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_the_pages_show_the_same_and_need_nothing_else(folder: Path):
    page, text = ((folder / name).read_text(encoding="utf-8") for name in ("paper.html", "paper.md"))
    assert "<img" in page and not re.search(r'(src|href)="(?!data:)', page)
    for name in re.findall(r"\]\((images/\S+)\)", text):
        assert (folder / name).read_bytes().startswith(b"\x89PNG")
    for claim in CLAIMS:
        assert f"| {claim.what} |" in text


def test_a_number_agrees_within_its_tolerance():
    def claim(ours: float) -> Claim:
        return Claim("c", "s", "w", 2.0, lambda e: ours if e.variant == MAIN else 1.2 * ours, "N", 0.1, "soft springs")

    near, far = judge([claim(2.1), claim(2.3)], runs_of(SMALL))
    assert (near.agrees, near.why) == (True, "+5.0 %, within 10 %; unsure, as another mesh changes it")
    assert (far.agrees, far.why) == (False, "+15.0 %, beyond 10 %: soft springs; unsure, as another mesh changes it")
    assert near.mesh_change == pytest.approx(0.2)
    assert near.penalty_change == pytest.approx(0.0)


def test_words_that_change_with_the_mesh_are_shown():
    claim = Claim("c", "s", "w", "rises", lambda e: Words(e.variant, e.variant == MAIN))
    (verdict,) = judge([claim], runs_of(SMALL))
    assert (verdict.ours, verdict.agrees, verdict.mesh_change, verdict.penalty_change) == (MAIN, True, MESH, "same")


def test_a_claim_without_its_run_neither_agrees_nor_differs():
    def missing(evidence: object) -> float:
        raise MissingRunError("μ = 3 is not run at this level")

    (verdict,) = judge([Claim("c", "s", "w", 2.0, missing)], runs_of(SMALL))
    assert (verdict.ours, verdict.agrees, verdict.why) == (None, None, "μ = 3 is not run at this level")


def test_texts_are_escaped():
    verdicts = judge([Claim("c", "s", "a < b | c", "<", lambda e: Words("<i>", True))], runs_of(SMALL))
    page = Page(SMALL, "", verdicts, {}, {})
    assert '<td class="">a &lt; b | c' in as_html(page) and "<i>" not in as_html(page)
    assert "| a < b \\| c |" in as_markdown(page)


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_levels_run_what_the_figures_show(level: studies.Level):
    assert {picture.study for picture in PICTURES} == {*level.points, studies.MESHES}
    for name, values in level.points.items():
        assert set(level.ends.get(name, values)) <= set(values)
    found = cases(level)
    penalties = {variant: dict(found["mu", 0.1, variant].settings).get("penalty", 0.1) for variant in (MAIN, PENALTY)}
    assert penalties == {MAIN: 0.1, PENALTY: 0.3}
    assert found["mu", 0.47, MAIN] == found["base", 0.0, MAIN]  # one run for both


def test_claims_are_told_apart():
    ids = [claim.id for claim in CLAIMS]
    assert len(ids) == len(set(ids))


def test_the_page_in_docs_has_every_claim():
    text = (FOLDER / "paper.md").read_text(encoding="utf-8")
    assert [claim.id for claim in CLAIMS if f"| {claim.what} | {claim.source} |" not in text] == []


def test_the_duration_of_an_impact_includes_succession_collisions():
    def impact(*contacts: tuple[float, float], still: bool = False) -> Result:
        return Result({"contacts": contacts, "contact_open_at_end": still}, {})

    assert event_duration(impact((1e-6, 0.4e-3))) == pytest.approx(0.399)
    assert event_duration(impact((0.0, 0.8e-3), (1.1e-3, 1.4e-3), (1.8e-3, 2e-3), still=True)) == pytest.approx(1.4)
    for missing in (impact(), impact((0.0, 0.8e-3), (1.1e-3, 2e-3), still=True)):
        with pytest.raises(MissingRunError):
            event_duration(missing)


def test_choices_that_the_paper_leaves_open_stand_beside_its_figures(folder: Path):
    rows = {row[0]: row for row in choice_rows(runs_of(LEVELS["full"]))}
    assert list(rows) == ["published"]
    points = [(("mu", value, LUG), value) for value in (0.1, 1.5)]
    level = replace(LEVELS["full"], tried={LUG: (COARSE, TOGETHER)})
    found = {key: Case(COARSE, (("mu", value),)) for key, value in points}
    done = {case: {"status": "done"} for case in found.values()}
    folders = {case: folder / "runs" / str(k) for k, case in enumerate(found.values())}
    row = choice_rows(Runs(level, folder, found, done, folders, "cpu"))[1]
    summary = [load(path).summary for path in folders.values()]
    assert row[0] == TRIED[LUG] and row[1] == "–" and row[-1] == "–, –"
    assert row[4] == ", ".join(f"{1e-3 * item['F_t_min']:.3f}" for item in summary)


def test_a_claim_about_a_choice_is_read_from_its_runs_only():
    seen = []
    found = chosen(LUG, lambda evidence: seen.append(evidence.variant) or 1.0)
    assert found(Evidence(runs_of(SMALL))) == 1.0 and seen == [LUG]
    with pytest.raises(MissingRunError):
        found(Evidence(runs_of(SMALL), MESH))


def test_durations_by_springs_stand_beside_the_published_ones(folder: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("warp_mca.paper.readings.event_duration", lambda result: 1e3 * float(result.time[-1]))
    level = LEVELS["full"]
    found = cases(level)
    case, springs = found["rod", 0.7, MAIN], found["rod", 0.7, SPRINGS]
    assert dict(springs.settings)["penalty"] == 0.3 and springs.mesh == COARSE
    rows = {key: {"status": "failed", "reason": ""} for key in found.values()} | {case: {"status": "done"}}
    published, main, *others = duration_rows(Runs(level, folder, found, rows, {case: folder / "runs" / "0"}, "cpu"))
    assert len(published) == len(DURATIONS_HEAD) and len(others) == 3
    assert main[1:] == ("–",) * 4 + ("0.010", "–")  # of a run of 10 us
    assert not any(set(row[1:]) - {"–"} for row in others)
    assert duration_rows(runs_of(LEVELS["quick"])) == []
