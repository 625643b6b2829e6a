"""The page on stability says what was stored, no cell is wrong without a warning, and cheap cells are as stored."""

from __future__ import annotations

import json

import numpy as np
import pytest

import warp_mca as mca
from benchmarks.measurements import FOLDER
from benchmarks.stability import turns
from benchmarks.stability.axis import AXES, with_element
from benchmarks.stability.bars import cantilever, struck
from benchmarks.stability.contact import flyer
from benchmarks.stability.material import loop
from benchmarks.stability.measure import cell, wrong
from benchmarks.stability.page import WORDS, shown, word, write_page
from benchmarks.stability.table import key, keys, merged

STORED = json.loads((FOLDER / "stability.json").read_text(encoding="utf-8"))


def test_page_is_written_from_what_was_stored(tmp_path):
    write_page(STORED, tmp_path / "stability.md")
    page = (FOLDER / "stability.md").read_text(encoding="utf-8")
    assert (tmp_path / "stability.md").read_text(encoding="utf-8") == page
    for axis in AXES.values():
        assert f"### {axis.title}\n\n{axis.reference}" in page
    assert "none is a wrong number without a warning" in page


def test_every_cell_of_the_table_is_stored_and_none_is_wrong_without_a_warning():
    assert [key(item) for item in STORED if AXES[item["axis"]].level == "full"] == [*keys((), "full")]
    assert {key(item) for item in STORED} <= {*keys()}
    assert not [key(item) for item in STORED if wrong(item)]
    known = {short for _, short, _ in WORDS}
    for item in STORED:
        assert all(word(sentence) in known for sentence in item["said"] if item["status"] != "refused"), item["said"]


CHEAP = [
    ("modulus", 0.7, "hex8", "mixed"),
    ("modulus", 7000.0, "hex8r", "float64"),
    ("size", 1e-6, "tet4", "mixed"),
    ("speed", 1e-4, "hex8", "mixed"),
    ("speed", 5000.0, "hex8r", "mixed"),
    ("step_scale", 1.02, "hex8", "mixed"),
    ("penalty", 0.001, "hex8", "mixed"),
    ("stiffness_ratio", 1e4, "hex8", "mixed"),
]


@pytest.mark.parametrize("wanted", CHEAP, ids=lambda item: f"{item[0]}-{item[1]}")
def test_cheap_cells_are_as_stored(wanted):
    (stored,) = (item for item in STORED if key(item) == wanted)
    assert shown(cell(wanted[0], wanted[1], wanted[2], wanted[3], "cpu")) == shown(stored)


@pytest.mark.parametrize("kind", list(turns.KINDS))
def test_increments_keep_rotations(kind, monkeypatch):
    """A hundred revolutions in place of a million: what is left is rounding, and the lag of floating frames."""
    monkeypatch.setattr(turns, "REVOLUTIONS", 100)
    monkeypatch.setattr(turns, "UPDATES", 1000)
    figures, steps = turns.KINDS[kind]("float64", "cpu")
    assert steps >= 100
    allowed = 1e-5 if kind == "floating frame" else 1e-10
    assert all(figure.error < allowed for figure in figures), figures


def test_a_wrong_number_is_seen():
    found = {"status": "finished", "within": False, "error": 0.5, "said": []}
    assert wrong(found) and "UNWARNED" in shown(found)
    assert not wrong({**found, "status": "warned"})
    assert merged([{**STORED[0], "error": 7.0}], STORED[:2]) == STORED[:2]


def warnings(trial, element: str = "hex8", precision: str = "mixed") -> tuple[str, ...]:
    return mca.run(with_element(trial.scene, element), precision=precision).warnings


def test_lost_volume_is_warned_of_where_shear_strain_is_small():
    """Near nu = -1 cubes shrink on all sides: the deviatoric strain alone stays below its limit."""
    (said,) = (text for text in warnings(struck(nu=-0.5, v=500.0)) if "strains as small" in text)
    assert "lost up to 23% of their volume" in said and "finite" in said
    assert not any("volume" in text for text in warnings(struck(nu=-0.5, v=100.0)))
    assert not any("volume" in text for text in warnings(struck(nu=-0.5, v=500.0, kinematics="finite")))


def test_pressure_that_rounding_shakes_up_is_warned_of():
    """Stress is off by as much as the warning says, within a factor of 3, and the energy balance does not show it."""
    trial = loop(nu=0.499999, sigma_y=1e30, stroke=4e-6)
    results = {precision: mca.run(trial.scene, precision=precision) for precision in ("mixed", "float64")}
    stress = {name: result.paths[0].stress[:, 1, 0].astype(float) for name, result in results.items()}
    off = np.abs(stress["mixed"] - stress["float64"]).max() / np.abs(stress["float64"]).max()
    (said,) = (text for text in results["mixed"].warnings if "rounding in mixed precision" in text)
    assert off > 0.1
    assert f"{off:.0%}"[-1] == "%" and 0.33 < off / (float(said.split("% of")[0].split()[-1]) / 100.0) < 3.0
    assert results["mixed"].summary["energy_error"] < 1e-3
    assert not any("rounding" in text for text in results["float64"].warnings)


@pytest.mark.parametrize(("element", "axial", "stiff"), [("hex8", 4, True), ("hex8", 20, False), ("hex8r", 4, False)])
def test_cells_that_bend_too_stiffly_are_warned_of(element, axial, stiff):
    trial = cantilever(depth=0.2, nu=0.3, axial=axial)
    result = mca.run(with_element(trial.scene, element))
    assert any("makes bar too stiff in bending" in text for text in result.warnings) == stiff
    assert (trial.read(result)[0].error > 0.12) == stiff


def test_tetrahedra_that_are_few_over_the_depth_are_warned_of():
    assert any("lay in jumps of strain" in text for text in warnings(cantilever(depth=0.2, nu=0.3, axial=8), "tet4"))


@pytest.mark.parametrize("two_way", [False, True])
def test_nodes_deep_in_a_thin_plate_are_warned_of(two_way):
    """The guard on depth is half a face, which is ten times the thickness."""
    said = warnings(flyer(v=1000.0, thickness=0.001, two_way=two_way), "hex8r")
    assert any("deep into plate, which is 0.001 m thick" in text for text in said)
    assert not any("m thick" in text for text in warnings(flyer(v=10.0, thickness=0.01), "hex8r"))
