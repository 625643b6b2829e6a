"""The table of a sweep: values come back bit for bit, torn lines go, columns grow, other sweeps are refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import warp_mca as mca
from warp_mca.runs.sweep_job import figures
from warp_mca.runs.sweep_table import SweepTable, check_identity, read_rows, write_identity


def row(index: int, **values: object) -> dict[str, object]:
    return {"index": index, "status": "done", **values}


def test_values_come_back_as_they_were(tmp_path: Path):
    values = {
        "third": 1.0 / 3.0, "small": 5e-324, "whole": 3.0, "count": 3, "text": 'a "b", c', "digits": "1.0", "empty": "",
        "nothing": None, "yes": True, "infinite": math.inf, "energy.rod–plane": -0.0,
    }  # fmt: skip
    table = SweepTable(tmp_path)
    table.add([row(0, **values)])
    (found,) = read_rows(tmp_path / "sweep.csv")
    assert [(name, type(value), repr(value)) for name, value in found.items()] == [
        (name, type(value), repr(value)) for name, value in row(0, **values).items()
    ]


def test_a_line_that_was_not_finished_is_dropped(tmp_path: Path):
    table = SweepTable(tmp_path)
    for k in range(3):
        table.add([row(k, F=0.1 * k, wall=1.0)])
    file = tmp_path / "sweep.csv"
    whole = file.read_bytes()
    for length in range(len(whole)):
        file.write_bytes(whole[:length])
        kept = whole[:length].count(b"\n")
        again = SweepTable(tmp_path)
        assert sorted(again.rows) == list(range(max(kept - 1, 0)))
        again.add([row(k, F=0.1 * k, wall=1.0) for k in range(3) if k not in again.rows])
        assert file.read_bytes() == whole


def test_columns_grow_and_runs_are_in_order_at_the_end(tmp_path: Path):
    table = SweepTable(tmp_path)
    table.add([row(2, v=1.0, wall=3.0)])
    table.add([{"index": 0, "v": 2.0, "status": "failed", "reason": "no mesh"}])
    table.add([row(1, v=0.5, count=7, large=2**70, F=0.25, wall=1.0)])
    assert [found["index"] for found in read_rows(tmp_path / "sweep.csv")] == [2, 0, 1]
    table.close()
    rows = read_rows(tmp_path / "sweep.csv")
    assert [(found["index"], found["reason"], found["count"]) for found in rows] == [
        (0, "no mesh", None), (1, None, 7), (2, None, None)
    ]  # fmt: skip
    assert list(rows[0])[-1] == "wall"
    stored = pq.read_table(tmp_path / "sweep.parquet")
    assert {str(stored.schema.field(name).type) for name in ("v", "F", "wall")} == {"double"}
    assert stored.to_pylist() == [found | {"large": found["large"] and str(2**70)} for found in rows]


def test_failed_runs_are_dropped_when_a_sweep_goes_on_and_stopped_ones_stay(tmp_path: Path):
    table = SweepTable(tmp_path)
    table.add([row(0), row(1) | {"status": "failed"}, row(2) | {"status": "stopped"}])
    assert sorted(SweepTable(tmp_path).rows) == [0, 2]
    assert len(read_rows(tmp_path / "sweep.csv")) == 2


@pytest.mark.parametrize("text", ["index,v\n0,1\n", "a;b\n1;2\n", 'index,status\n0,"done\n', "index,status\n0\n"])
def test_a_table_that_others_changed_is_refused(tmp_path: Path, text: str):
    (tmp_path / "sweep.csv").write_text(text, encoding="utf-8")
    with pytest.raises(mca.RequestError, match=r"sweep\.csv there was changed by others"):
        SweepTable(tmp_path)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("grid", {"v": [1.0, 3.0]}, r"grid = v=1\.0,2\.0, not v=1\.0,3\.0"),
        ("precision", "float64", "precision = mixed, not float64"),
        ("duration", 1e-3, r"duration = none, not 0\.001"),
        ("scenes", "b", "a sweep of scenes with other values"),
    ],
)
def test_the_first_difference_of_another_sweep_is_named(tmp_path: Path, key: str, value: object, said: str):
    own = {"grid": {"v": [1.0, 2.0]}, "precision": "mixed", "duration": None, "scenes": "a"}
    write_identity(tmp_path, own)
    check_identity(tmp_path, own)
    with pytest.raises(mca.RequestError, match=said):
        check_identity(tmp_path, own | {key: value})


def test_a_table_of_an_unknown_sweep_is_refused(tmp_path: Path):
    (tmp_path / "sweep.csv").write_text("index,status\n", encoding="utf-8")
    (tmp_path / "sweep.json").write_text(json.dumps([]), encoding="utf-8")
    with pytest.raises(mca.RequestError, match="of an unknown sweep"):
        check_identity(tmp_path, {})


def test_figures_are_all_single_values_of_a_summary():
    summary = {"n": 3, "energy": {"kinetic": 1.5, "parts": {"a": None}}, "peaks": [1.0], "device": "cpu\n(x)"}
    assert dict(figures(summary)) == {"n": 3, "energy.kinetic": 1.5, "energy.parts.a": None, "device": "cpu (x)"}
