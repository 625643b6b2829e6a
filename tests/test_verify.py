"""The quick level of every verification case is met; errors in the engine that cases name can be made."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import pytest

from benchmarks.deliberate import MUTATIONS
from warp_mca.base.errors import GuardError
from warp_mca.verify import Setup, bending, cases
from warp_mca.verify.case import Row
from warp_mca.verify.report import lines
from warp_mca.verify.runner import outcome, verify

ROOT = Path(__file__).parent.parent


# All cases with the default; with the others those that show what is theirs, but for the long ones. Other cases show
# it of the same elements: `bent_beam` bending, `plastic_moment` and `upset_cube` flow, `block_on_belt` friction.
TETRAHEDRA = ("tet4", "tet10", "tet10_mean")
LONG = {
    "clamped_plate": TETRAHEDRA,
    "yielding_bar": TETRAHEDRA,
    **dict.fromkeys(("cantilever_vibration", "near_incompressible_bending", "rolling_sphere"), ("tet4",)),
    **dict.fromkeys(("decaying_friction", "sliding_block", "stick_slip_cycle", "capped_friction"), ("tet4",)),
}
SHORT = [
    (case, element)
    for case in cases()
    for element in case.taken()
    if element == Setup.element or case.group in ("elements", "material", "friction")
    if element not in LONG.get(case.name, ())
]


@pytest.mark.parametrize(("case", "element"), SHORT, ids=lambda item: item if isinstance(item, str) else item.name)
def test_case_is_met(case, element):
    found = outcome(case, Setup(element=element))
    if found.skipped:
        pytest.skip(found.skipped)
    assert found.met, "\n".join(lines(found))


def test_case_without_the_module_it_needs_is_skipped_not_failed(tmp_path, capsys, monkeypatch):
    lacking = dataclasses.replace(cases(["chain_energy"])[0], needs="no_such_module")
    monkeypatch.setattr("warp_mca.verify.runner.cases", lambda names: [lacking])
    assert verify(element="hex8", out=tmp_path)[0].skipped
    said, page = capsys.readouterr().out, (tmp_path / "verification.md").read_text()
    assert "skipped, it needs no_such_module (pip install no_such_module)" in said
    assert "0 of 0 cases met, 1 skipped" in said and "Skipped, it needs no_such_module" in page


def test_deliberate_errors_can_be_made():
    for name in MUTATIONS:
        text = (ROOT / MUTATIONS[name].file).read_text(encoding="utf-8")
        assert text.count(MUTATIONS[name].old) == 1, name


def test_a_row_is_met_within_its_tolerance_and_order():
    row = {"quantity": "q", "exact": 2.0, "unit": "-", "tolerance": 0.01, "why": "", "sizes": (2.0, 1.0)}
    assert Row(measured=(2.04, 2.0099), **row).met
    assert Row(measured=(2.04, 2.01), **row).order == pytest.approx(2.0, rel=1e-9)
    assert not Row(measured=(2.04, 2.01), **row, least_order=2.5).met
    assert not Row(measured=(2.0, 2.03), **row).met
    assert not Row(measured=(2.0, float("nan")), **row).met
    assert Row(measured=(2.04, 2.01), **(row | {"exact": 0.0}), scale=300.0).met


def test_an_open_row_is_shown_and_does_not_fail_its_case():
    row = Row(quantity="q", exact=2.0, unit="-", tolerance=0.01, why="", measured=(2.1,), open="nobody knows")
    case = dataclasses.replace(cases(["chain_energy"])[0], measure=lambda setup: [row])
    found = outcome(case, Setup())
    assert found.met and not row.met
    assert any("OPEN" in line for line in lines(found)) and any("nobody knows" in line for line in lines(found))
    assert not dataclasses.replace(found, rows=(dataclasses.replace(row, open=None),)).met


def test_a_case_without_elements_runs_once(capsys):
    assert [found.element for found in verify(["yield_surface"])] == ["none"]
    assert "(none, mixed)" in capsys.readouterr().out


def test_a_case_whose_histories_cannot_be_read_is_not_met(capsys, monkeypatch):
    def unreadable(setup):
        return [][0]

    case = dataclasses.replace(cases(["chain_energy"])[0], measure=unreadable)
    monkeypatch.setattr("warp_mca.verify.runner.cases", lambda names: [case])
    with pytest.raises(GuardError, match=r"not met: chain_energy \(none\)"):
        verify(element="hex8")
    assert "gave nothing to read: IndexError" in capsys.readouterr().out


def test_ritz_speed_is_near_beam_theory_and_comes_down_to_its_limit():
    h, bar = bending.SIDE, math.sqrt(bending.E / bending.RHO)
    # Bernoulli's beam, c / c0 = k h / sqrt(12), but for the share (k h)^2 (1 + E / (kappa G)) / 24
    assert bending.ritz(0.1 / h, h) / bar == pytest.approx(0.1 / math.sqrt(12.0), rel=0.01 * 4.1 / 24.0 * 1.1)
    for kh, apart in ((0.1, 1e-5), (0.2, 1e-4), (0.63, 5e-4), (1.88, 2e-3)):
        assert bending.ritz(kh / h, h) == pytest.approx(bending.timoshenko(kh / h, h), rel=apart)
    speeds = [bending.ritz(1.88 / h, h, degree) for degree in (4, 6, 8, 10, 12)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[-2] == pytest.approx(speeds[-1], rel=1e-6)
