"""The page tradeoff.md says what the stored trade-offs found; these hold what their readers need."""

from benchmarks.measurements import FOLDER
from benchmarks.tradeoff import picture, render, stored
from warp_mca.accuracy.figures import BOUND, NAMES, errors


def test_page_is_rendered_from_the_stored_trade_offs():
    assert (FOLDER / "tradeoff.md").read_text(encoding="utf-8") == render(stored())
    assert all(picture(name).exists() for name in stored())


def test_errors_are_those_of_the_figures_against_the_reference():
    for name, found in stored().items():
        truth = found["reference"]["figures"]
        for row in (row for row in found["variants"] if not row["stopped"]):
            assert row["errors"] == errors(row["figures"], truth), name


def test_a_figure_has_a_limit_or_a_reason():
    for found in stored().values():
        reference = found["reference"]
        assert {name for name in NAMES if reference["figures"][name] is None} == set(reference["why"])
        assert any(reference["figures"][name] for name in BOUND)


def test_two_link_has_thirty_variants():
    counts = [
        sum(not row["stopped"] for row in found["variants"])
        for found in stored().values()
        if found["scene"] == "two_link"
    ]
    assert max(counts) >= 30
