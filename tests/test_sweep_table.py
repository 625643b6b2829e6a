"""The table of a sweep: values come back bit for bit, torn lines go, columns grow, other sweeps are refused."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pyarrow.parquet as pq
import pytest

import warp_mca as mca
from warp_mca.studies.sweep_job import figures
from warp_mca.studies.sweep_lines import read_lines
from warp_mca.studies.sweep_plan import Plan, RunOptions
from warp_mca.studies.sweep_table import SweepTable, check_identity, remove_sweep, write_identity


def row(index: int, **values: object) -> dict[str, object]:
    return {"index": index, "status": "done", **values}


def test_values_come_back_as_they_were(tmp_path: Path):
    values = {
        "third": 1.0 / 3.0, "small": 5e-324, "whole": 3.0, "count": 3, "text": 'a "b", c', "digits": "1.0", "empty": "",
        "nothing": None, "yes": True, "infinite": math.inf, "energy.rod–plane": -0.0,
    }  # fmt: skip
    table = SweepTable(tmp_path)
    table.add([row(0, **values)])
    (found,) = read_lines(tmp_path / "sweep.csv")[0]
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
    assert [found["index"] for found in read_lines(tmp_path / "sweep.csv")[0]] == [2, 0, 1]
    table.close()
    rows = read_lines(tmp_path / "sweep.csv")[0]
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
    assert len(read_lines(tmp_path / "sweep.csv")[0]) == 2


@pytest.mark.parametrize("text", ["index,v\n0,1\n", "a;b\n1;2\n", 'index,status\n0,"done\n', "index,status\n0\n"])
def test_a_table_that_others_changed_is_refused(tmp_path: Path, text: str):
    (tmp_path / "sweep.csv").write_text(text, encoding="utf-8")
    with pytest.raises(mca.RequestError, match=r"sweep\.csv there was changed by others"):
        SweepTable(tmp_path)


def table_of(folder: Path, count: int) -> bytes:
    """sweep.csv of so many runs."""
    table = SweepTable(folder)
    table.add([row(k, F=0.1 * k, text='a "b", é', wall=1.0) for k in range(count)])
    return (folder / "sweep.csv").read_bytes()


def test_a_damaged_row_is_named_and_its_run_counts_as_not_done(tmp_path: Path, caplog: pytest.LogCaptureFixture):
    """A digit that was changed was taken for the run's figure."""
    whole = table_of(tmp_path, 3)
    lines = whole.split(b"\n")
    start, end = len(lines[0]) + len(lines[1]) + 2, len(whole) - len(lines[3]) - 1
    for place in range(start, end):  # every byte of the row in the middle, and the end of its line
        caplog.clear()
        damaged = bytearray(whole)
        damaged[place] ^= 1 << (place % 8)
        (tmp_path / "sweep.csv").write_bytes(damaged)
        table = SweepTable(tmp_path)
        assert set(table.rows) <= {0, 2} and 0 in table.rows, place
        assert "sweep.csv is damaged in line 3" in caplog.text
        table.add([row(k, F=0.1 * k, text='a "b", é', wall=1.0) for k in range(3) if k not in table.rows])
        table.close()
        assert (tmp_path / "sweep.csv").read_bytes() == whole


def test_a_damaged_header_is_refused(tmp_path: Path):
    """A column under another name is another figure."""
    whole = table_of(tmp_path, 2)
    for place in range(whole.index(b"\n") + 1):
        for bit in (0, 3):
            damaged = bytearray(whole)
            damaged[place] ^= 1 << bit
            (tmp_path / "sweep.csv").write_bytes(damaged)
            with pytest.raises(mca.RequestError, match=r"sweep\.csv there was changed by others"):
                SweepTable(tmp_path)


def test_a_table_without_checksums_is_read_and_gets_them(tmp_path: Path):
    """As earlier versions wrote it."""
    whole = table_of(tmp_path, 2).decode()
    lines = whole.splitlines()
    old = "\n".join(line.rpartition(",")[0] for line in lines) + "\n"
    assert old.startswith("index,status,F,text,wall\n") and lines[0].endswith(",wall,checksum")
    (tmp_path / "sweep.csv").write_text(old, encoding="utf-8")
    assert sorted(SweepTable(tmp_path).rows) == [0, 1]
    assert (tmp_path / "sweep.csv").read_text(encoding="utf-8") == whole
    assert "checksum" not in read_lines(tmp_path / "sweep.csv")[0][0]


@pytest.mark.parametrize("runs", [10**9, 10**18, 10**4000, -1, "3", [3], True, None, 1.5])
def test_a_hostile_number_of_runs_is_no_work(tmp_path: Path, runs: object):
    """--force looked for the folders of as many runs as the file named."""
    (tmp_path / "sweep.json").write_text(json.dumps({"runs": runs, "folders": True}))
    (tmp_path / "000000003").mkdir()
    (tmp_path / "000000003" / "history.csv").write_text("")
    remove_sweep(tmp_path)
    assert (tmp_path / "000000003").exists() == (runs != 10**9)


def test_folders_of_runs_are_emptied_but_not_through_links(tmp_path: Path):
    out, other = tmp_path / "out", tmp_path / "other"
    for folder in (out / "0", out / "2", other):
        folder.mkdir(parents=True)
        (folder / "history.csv").write_text("")
    (out / "1").symlink_to(other)
    write_identity(out, {"runs": 2, "folders": True})
    remove_sweep(out)
    assert (other / "history.csv").exists() and (out / "2" / "history.csv").exists() and not (out / "0").exists()


@pytest.mark.parametrize("grid", [3, [1], {"v": 3}, {"v": {"a": [1]}}, {"v": ["x" * 10**5]}])
def test_a_strange_grid_is_another_one(tmp_path: Path, grid: object):
    write_identity(tmp_path, {"grid": grid})
    with pytest.raises(mca.RequestError, match="it holds a sweep with grid = ") as caught:
        check_identity(tmp_path, {"grid": {"v": [1.0]}})
    assert len(str(caught.value)) < 1000


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


@pytest.mark.parametrize("recipe", [mca.MeshFile, lambda path: mca.Cad(path, size=1e-3)], ids=["mesh", "cad"])
def test_a_file_that_was_changed_is_another_sweep(tmp_path: Path, recipe):
    """Rows of two meshes stood in one table."""
    file, metal = tmp_path / "part.stl", mca.Elastic(E=1e9, nu=0.3, rho=1e3)
    file = file.with_suffix(".msh") if recipe is mca.MeshFile else file
    file.write_text("one")
    body = mca.Body(name="b", geometry=recipe(str(file)), material=metal)
    plan = Plan([mca.Scene(name="s", bodies=(body,), impact=mca.ImpactPhase(duration=1e-6))], [{}], RunOptions())
    first = plan.identity()
    assert plan.identity() == first
    file.write_text("two")
    assert plan.identity()["scenes"] != first["scenes"]
