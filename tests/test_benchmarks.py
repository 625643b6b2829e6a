"""The benchmark command measures and stores what the page on performance needs; the page says what was stored."""

import json
from pathlib import Path

from benchmarks.__main__ import main
from benchmarks.blocks import RATES, SAVINGS
from benchmarks.measurements import FOLDER
from benchmarks.report import render, roofline, stored


def test_command_measures_what_the_report_needs(tmp_path: Path, capsys):
    file = tmp_path / "cpu.json"
    words = ["--quick", "--sizes", "108", "--precision", "mixed", "-o", str(file)]
    main([*words, "--elements", "hex8", "--parts", "ceilings", "rates", "savings", "host"])
    data = json.loads(file.read_text(encoding="utf-8"))
    assert {row["case"] for row in data["rates"]} == set(RATES)
    assert all(row["rate"] > 0.0 and row["sound"] and row["force_error"] < 1e-4 for row in data["rates"])
    yielded = {row["case"]: row["yielded"] for row in data["rates"]}
    assert yielded["plastic, none yields"] == 0.0 and yielded["plastic, all yield"] == 1.0
    (whole,) = data["savings"]
    assert set(whole["saves"]) == set(SAVINGS)
    assert "element forces" in whole["stages"] and whole["sound"]
    assert not {"date", "time"} & set(data)
    page = render([file])
    assert "| hex8 | mixed | 108 | " in page and "{" not in page
    assert "hex8" in capsys.readouterr().out


def test_rows_are_added_in_place(tmp_path: Path):
    from benchmarks.__main__ import merged

    def row(element: str, rate: float) -> dict:
        return {"element": element, "size": "5k", "precision": "mixed", "case": "elastic", "rate": rate}

    assert merged([row("tet4", 1.0), row("hex8", 2.0)], [row("tet4", 3.0)]) == [row("hex8", 2.0), row("tet4", 3.0)]


def test_about_five_per_cent_yield():
    from benchmarks.blocks import Held, assemble

    held = Held(assemble("hex8", 4000), RATES["plastic, 5 % yield"], "cpu", "float64")
    held.advance(1)
    assert 0.02 < held.yielded() <= 0.1


def test_page_is_rendered_from_what_was_stored(tmp_path: Path):
    assert (FOLDER / "performance.md").read_text(encoding="utf-8") == render(stored())
    roofline(stored(), tmp_path / "roofline.png")
    assert (tmp_path / "roofline.png").stat().st_size > 10_000
