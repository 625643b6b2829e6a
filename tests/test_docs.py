"""The page results.md says what the runs gave."""

import json

from benchmarks.measurements import FOLDER
from benchmarks.results import PRESETS, cases, render


def test_results_page_is_rendered_from_the_recorded_runs():
    rows = json.loads((FOLDER / "results.json").read_text(encoding="utf-8"))
    assert (FOLDER / "results.md").read_text(encoding="utf-8") == render(rows)
    assert [row["command"] for row in rows] == [case.command for case in cases()]


def test_recorded_runs_meet_what_the_page_claims():
    rows = json.loads((FOLDER / "results.json").read_text(encoding="utf-8"))
    runs = [row for row in rows if "failed" not in row]

    def first(group: str, preset: str) -> list[dict]:
        return [row for row in runs if (row["group"], row["preset"]) == (group, preset)]

    paper = first("presets", "paper")[0]["F_n_first_peak"]
    assert abs(paper / 3235.26 - 1.0) < 0.05
    assert abs(first("presets", "standard")[0]["F_n_first_peak"] / paper - 1.0) < 0.08
    assert abs(first("presets", "quick")[0]["F_n_first_peak"] / paper - 1.0) < 0.15
    assert max(row["energy_error"] for row in runs) < 5e-3
    for preset in PRESETS:
        peaks = [row["F_n_first_peak"] for row in first("mu", preset)]
        assert peaks == sorted(peaks, reverse=True)
        turned = {row["command"].split("v_plate=")[1]: row["F_t_reverses"] for row in first("v_plate", preset)}
        assert turned["1.0"] and not turned["0.4"]
        base, double = first("presets", preset)[0], first("precision", preset)[0]
        assert base["repeats"]
        assert abs(double["F_n_first_peak"] / base["F_n_first_peak"] - 1.0) < 1e-4
