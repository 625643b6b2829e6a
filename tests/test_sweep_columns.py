"""Columns of a sweep: no parameter takes a figure's place, whatever its name; tables of earlier versions still read."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.studies.sweep_columns import FIGURES, OTHERS, RESERVED, parameter_column
from warp_mca.studies.sweep_lines import read_lines
from warp_mca.studies.sweep_table import CSV, SweepTable

OUTPUTS = Path(__file__).parents[1] / "docs" / "outputs.md"


def drop(**parameters: object) -> mca.Scene:
    steel = mca.Elastic(E=1e9, nu=0.3, rho=1000.0)
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(1, 1, 1))
    cube = mca.Body(name="b", geometry=box, material=steel, position=(0.0, 1e-6, 0.0), velocity=(0.0, -1.0, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="b", nodes="ymin"), master=mca.RigidPlane())
    impact = mca.ImpactPhase(duration=6e-5, output_interval=1e-6, energy_tolerance=0.5)
    return mca.Scene(name="drop", bodies=(cube,), contacts=(contact,), impact=impact, parameters=parameters)


@pytest.fixture(scope="module")
def summary() -> dict[str, object]:
    return mca.run(drop(), threads=1).summary


def test_parameters_named_as_figures_have_columns_of_their_own(tmp_path: Path, summary: dict[str, object]):
    names = ["dt", "F_n_max", "status", "wall", "theta", "contacts", "energy.kinetic", "parameter.dt", "multi_rate"]
    kept = ["mu", "penalty", "duration", "parameter", "kinetic"]
    scenes = [drop(**dict.fromkeys([*names, *kept], value)) for value in (1.5, 2.5)]
    rows = mca.sweep(scenes, out=tmp_path / "all", workers=1, threads=1)
    columns = [*(f"parameter.{name}" for name in names), *kept]
    assert [[row[name] for name in columns] for row in rows] == [[1.5] * len(columns), [2.5] * len(columns)]
    expected = {key: summary[key] for key in ("dt", "F_n_max", "contact_duration", "v_n")} | {"status": "done"}
    assert {key: rows[1][key] for key in expected} == expected
    assert rows[0]["energy.kinetic"] == summary["energy"]["kinetic"]  # type: ignore[index]
    assert "theta" not in rows[0] and "multi_rate" not in rows[0]
    assert read_lines(tmp_path / "all" / CSV)[0] == rows
    assert mca.sweep(scenes, out=tmp_path / "all", workers=1, threads=1) == rows


def test_every_entry_of_a_summary_is_known_before_a_run(summary: dict[str, object]):
    """A figure that is not listed could be taken by a parameter; `penalty` has none of its own name."""
    text = OUTPUTS.read_text(encoding="utf-8")
    tables = text[text.index("## summary.json") : text.index("### Swings")]
    documented = {name for row in re.findall(r"^\| (`.*?) \|", tables, re.M) for name in re.findall(r"`(\w+)`", row)}
    assert len(documented) > 50
    assert {*documented, *summary} - RESERVED == {"penalty"}
    assert not set(FIGURES) & set(OTHERS)
    plain = {key for key, value in summary.items() if not isinstance(value, list | dict)}
    assert plain <= {*FIGURES}


@pytest.mark.parametrize(
    ("name", "old", "kept"), [("theta", "theta", True), ("status", "parameters.status", True), ("dt", "dt", False)]
)
def test_a_sweep_of_an_earlier_version_goes_on(tmp_path: Path, name: str, old: str, kept: bool):
    """Rows in which a parameter took a figure's place are run again; the others stay."""
    table = SweepTable(tmp_path)
    table.add(
        [{"index": k, old: 0.5 * k, "mu": 0.1, "status": "done", "F_n_max": 1.0 + k, "wall": 2.0} for k in (0, 1)]
    )
    found = SweepTable(tmp_path, [name, "mu"]).rows
    column = parameter_column(name)
    assert [(row[column], row["mu"], row["F_n_max"]) for row in found.values()] == (
        [(0.0, 0.1, 1.0), (0.5, 0.1, 2.0)] if kept else []
    )
    assert all(list(row)[1] == column for row in found.values())


def test_the_command_line_sweeps_such_a_parameter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    words = ["--set", "duration=2e-5", "--set", "output_interval=1e-6", "--workers", "1", "--threads", "1"]
    assert main(["sweep", "single_link", "--grid", "theta=85,90", *words, "--out", "all"]) == 0
    rows = read_lines(tmp_path / "all" / CSV)[0]
    assert [row["parameter.theta"] for row in rows] == [85.0, 90.0]
    assert json.loads((tmp_path / "all/sweep.json").read_text(encoding="utf-8"))["grid"] == {"theta": [85.0, 90.0]}
