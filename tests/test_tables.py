"""A result as tables: columns with units, the same numbers in pandas, xarray and Parquet; how it shows itself."""

from __future__ import annotations

import re
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from test_gpu import oblique
from test_probes import PROBES, SECTIONS, watched

import warp_mca as mca
from warp_mca.results import tables
from warp_mca.results.headlines import headlines
from warp_mca.results.probe_figure import plot_probes
from warp_mca.results.units import unit_of


@cache
def result() -> mca.Result:
    line = mca.Line(body="large", start=(0.0, -0.03, 0.0), end=(0.0, 0.0, 0.0))
    path = mca.Path(name="down", lines=(line,), spacing=0.01)
    return mca.run(replace(watched(oblique()), paths=(path,)), threads=1)


def test_every_column_has_a_unit():
    columns = tables.table(result())
    units = result().summary["units"]
    assert all(columns[name][1] == unit for name, unit in units.items())
    assert {name for name in columns if name not in units} == {
        f"small–large.{part}" for part in ("Fx", "Fy", "Fz", "pressure", "closing_speed")
    }
    with pytest.raises(KeyError, match="add its unit"):
        unit_of("tip_x")


def test_parquet_has_the_units_of_its_columns(tmp_path: Path):
    parquet = pytest.importorskip("pyarrow.parquet")
    file = result().to_parquet(tmp_path / "run.parquet")
    table = parquet.read_table(file)
    assert np.array_equal(table["F_n_N"].to_numpy(), result().F_n)
    units = {field.name: field.metadata[b"unit"].decode() for field in table.schema}
    assert units == {name: unit for name, (_, unit) in tables.table(result()).items()}
    with pytest.raises(mca.RequestError, match="file = ''"):
        result().to_parquet("")
    with pytest.raises(mca.McaError, match="could not be written"):
        result().to_parquet(tmp_path / "none" / "run.parquet")


def test_pandas_has_all_columns_over_the_time(tmp_path: Path):
    pandas = pytest.importorskip("pandas")
    frame = result().to_pandas()
    assert frame.index.name == "time_s" and np.array_equal(frame.index, result().time)
    assert np.array_equal(frame["small–large.Fy"], result().contacts[0].force[:, 1])
    assert np.array_equal(frame["inside.ay"], result().probes[1].acceleration[:, 1])
    assert np.array_equal(frame["large cut.Fy"], result().sections[1].force[:, 1])
    assert frame.attrs["units"]["inside.ay"] == "m/s^2" and frame.attrs["scene"] == "oblique"
    again = pandas.read_parquet(result().to_parquet(tmp_path / "run.parquet"))
    assert again.set_index("time_s").equals(frame) and again.attrs == frame.attrs


def test_xarray_has_dimensions_and_units():
    pytest.importorskip("xarray")
    data = result().to_xarray()
    assert data.F_n_N.attrs["units"] == "N" and np.array_equal(data.F_n_N, result().F_n)
    acceleration = data.probe_acceleration.sel(probe="inside", axis="y")
    assert np.array_equal(acceleration, result().probes[1].acceleration[:, 1])
    assert data.section_moment.dims == ("time_s", "section", "axis") and data.section_moment.attrs["units"] == "N m"
    assert data.contact_pressure.dims == ("time_s", "contact") and data.attrs["precision"] == "mixed"
    stress = data.stress_down.sel(component="yy")
    assert np.array_equal(stress, result().paths[0].stress[:, :, 1]) and stress.attrs["units"] == "Pa"
    assert all("units" in variable.attrs for variable in data.data_vars.values())


def test_the_page_on_probes_does_what_it_says(capsys: pytest.CaptureFixture[str]):
    pytest.importorskip("pandas")
    page = (Path(__file__).parents[1] / "docs" / "probes.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(code, {})
    said = capsys.readouterr().out
    raw, smooth, force = map(float, re.findall(r"[-\d.]+(?= m/s\^2 raw| by CFC| N through)", said))
    assert raw > smooth == pytest.approx(950.0, rel=0.02) and force == pytest.approx(-0.0216 * smooth, rel=0.15)


def test_probes_are_drawn_raw_and_filtered():
    figure = plot_probes(result())
    assert [axes.get_title(loc="left") for axes in figure.axes] == [p.name for p in (*PROBES, *SECTIONS)]
    inside, cut = figure.axes[1], figure.axes[4]
    assert "y CFC 1000" in [line.get_label() for line in inside.lines]
    assert inside.get_ylabel() == "acceleration [km/s²]" and cut.get_ylabel() == "force [kN]"
    assert figure.axes[-1].get_xlabel() == "time after first contact [ms]"


def test_what_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch):
    def missing(name: str):
        raise ImportError(name)

    monkeypatch.setattr(tables, "import_module", missing)
    for call, package in ((result().to_pandas, "pandas"), (result().to_xarray, "xarray")):
        with pytest.raises(mca.RequestError, match=rf"needs the package {package}: pip install 'warp_mca\[data\]'"):
            call()


def test_a_force_that_rises_to_the_end_of_a_run_is_told_beside_peaks_that_are_none():
    summary = {**result().summary, "F_n_peaks": [], "F_n_max": 5760.0}
    assert dict(headlines(summary))["F_n peaks"] == "none yet, 5.760 kN at most so far"
    assert dict(headlines({**summary, "F_n_max": 0.0}))["F_n peaks"] == "none"


def test_a_result_shows_itself_in_a_line_and_in_notebooks():
    """It had 155,030 characters."""
    text = repr(result())
    assert len(text) < 160 and "\n" not in text
    assert text.startswith("<Result of oblique: 716 elements, 21 rows, F_n up to ") and "energy error" in text
    assert repr(replace(result(), stopped="why")).endswith("stopped by a guard>")
    html = replace(result(), warnings=("a < b",))._repr_html_()
    assert "<th style='text-align:left'>F_n peaks</th>" in html and "a &lt; b" in html and "CFC 1000" in html
    assert "data:image/png;base64,iVBOR" in html and len(html) < 300_000
