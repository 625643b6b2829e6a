"""Tests what is read off a force history, and that results survive being saved and loaded."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warp_mca.base.errors import RequestError
from warp_mca.results.force_history import (
    active_rows,
    contact_intervals,
    force_peaks,
    interval_edges,
    intervals,
    joined,
    reverses,
    stick_intervals,
)
from warp_mca.results.result import HISTORY_COLUMNS, Result, summarise
from warp_mca.results.storage import FILES, check_output, load, save

pytestmark = pytest.mark.usefixtures("no_figures")

TIME = np.arange(1, 601) * 1e-6


def two_bumps() -> np.ndarray:
    """3 kN at 0.1 ms and 2 kN at 0.3 ms [N], in one contact from 0 to 0.4 ms, down to 1 kN in between."""
    knots = [0.0, 1e-4, 2e-4, 3e-4, 4e-4, 1.0]
    return np.interp(TIME, knots, [0.0, 3e3, 1e3, 2e3, 0.0, 0.0])


def history(**columns: np.ndarray) -> dict[str, np.ndarray]:
    """Every column of the contract, zero where not given."""
    return {name: np.zeros(len(TIME)) for name in HISTORY_COLUMNS} | {"time_s": TIME} | columns


def facts(**changes: object) -> dict[str, Any]:
    """Facts of an imaginary run."""
    values: dict = dict(
        scene="toy",
        n_elements=1000,
        n_nodes=1331,
        dt=1e-8,
        n_steps=60_000,
        simulated_time=6e-4,
        wall={"rigid": 0.1, "mesh": 0.2, "compile": 3.0, "fe": 20.0, "output": 0.5},
        device="cpu",
        precision="mixed",
        element="hex8",
        energy_error=1e-4,
        energy={"kinetic": 1.0},
        max_plastic_strain=0.01,
        parameters={"mu": 0.47},
    )
    return values | changes


def test_edges_put_the_first_interval_before_the_first_row():
    assert interval_edges(np.array([2.0, 3.0, 4.0])) == pytest.approx([1.0, 2.0, 3.0, 4.0])
    assert interval_edges(np.array([0.0, 1.0])) == pytest.approx([0.0, 0.0, 1.0])


def test_contact_lasts_from_the_first_to_the_last_interval_with_force():
    force = np.where((TIME > 50.5e-6) & (TIME < 150.5e-6), 100.0, 0.0)  # rows 51 µs to 150 µs
    assert contact_intervals(TIME, force) == [pytest.approx((50e-6, 150e-6))]


@pytest.mark.parametrize(("gap", "count"), [(3, 1), (5, 2), (40, 2)])
def test_separations_below_two_percent_of_a_contact_are_none(gap: int, count: int):
    force = np.where(TIME < 2e-4, 100.0, 0.0)
    force[80 : 80 + gap] = 0.0
    assert len(contact_intervals(TIME, force)) == count


def test_residual_force_below_a_thousandth_of_the_peak_is_no_contact():
    force = two_bumps()
    force[450:] = 2.9
    assert contact_intervals(TIME, force) == [pytest.approx((0.0, 4e-4), abs=2e-6)]


def test_no_force_gives_no_contact_and_no_peak():
    assert contact_intervals(TIME, np.zeros_like(TIME)) == []
    assert force_peaks(TIME, np.zeros_like(TIME)) == []
    assert force_peaks(np.zeros(0), np.zeros(0)) == []


def test_peaks_of_two_bumps_at_their_times_and_values():
    peaks = force_peaks(TIME, two_bumps())
    assert peaks == [pytest.approx((1e-4, 3e3)), pytest.approx((3e-4, 2e3))]


def test_peaks_are_not_confused_by_nodes_entering_and_leaving_contact():
    jitter = 1.0 + 0.08 * np.sin(2 * np.pi * TIME / 3e-6)
    peaks = force_peaks(TIME, two_bumps() * jitter)
    assert [peak[0] for peak in peaks] == pytest.approx([1e-4, 3e-4], abs=3e-6)
    assert [peak[1] for peak in peaks] == pytest.approx([3e3, 2e3], rel=0.09)


def test_the_largest_peak_is_the_largest_force():
    rng = np.random.default_rng(1)
    force = two_bumps() + rng.normal(0.0, 30.0, len(TIME)) * (TIME < 4e-4)
    assert max(value for _, value in force_peaks(TIME, force)) == force.max()


@pytest.mark.parametrize("interval", [0.5e-6, 1e-6, 2e-6, 5e-6])
def test_peaks_do_not_depend_on_the_output_interval(interval: float):
    time = np.arange(1, round(6e-4 / interval) + 1) * interval
    force = 3e3 * np.exp(-(((time - 1e-4) / 4e-5) ** 2)) + 2e3 * np.exp(-(((time - 3e-4) / 4e-5) ** 2))
    assert [value for _, value in force_peaks(time, force)] == pytest.approx([3e3, 2e3], rel=1e-3)


def test_force_that_starts_high_is_a_peak():
    assert len(force_peaks(TIME, 1e3 * (1.0 - TIME / TIME[-1]))) == 1


def test_sticking_counts_only_while_in_contact():
    stick = np.where((TIME > 300.5e-6) & (TIME < 550.5e-6), 0.6, 0.2)
    assert stick_intervals(TIME, two_bumps(), stick) == [pytest.approx((3e-4, 4e-4), abs=2e-6)]


def test_intervals_reach_the_last_row():
    assert intervals(TIME, joined(active_rows(TIME > 598.5e-6))) == [pytest.approx((598e-6, 600e-6))]


def test_summary_has_every_figure_of_the_contract():
    force = two_bumps()
    summary = summarise(history(F_n_N=force, F_t_N=-0.47 * force + 10.0), facts(t_contact=0.256, v_n=2.25, v_t=3.4))
    contract = """t_contact v_n v_t theta theta_dot F_n_first_peak F_n_max F_t_min F_t_max contacts contact_duration
        max_plastic_strain energy_error energy n_elements n_nodes dt n_steps simulated_time wall element_steps_per_s
        device precision element parameters version""".split()
    assert set(contract) <= set(summary)
    assert summary["F_n_first_peak"] == summary["F_n_max"] == pytest.approx(3e3)
    assert summary["F_t_min"] == pytest.approx(10.0 - 0.47 * 3e3)
    assert summary["F_t_max"] == pytest.approx(10.0)
    assert summary["contact_duration"] == pytest.approx(4e-4, abs=2e-6)
    assert summary["element_steps_per_s"] == pytest.approx(1000 * 60_000 / 20.0)


def test_saved_results_load_with_every_bit(tmp_path: Path):
    rng = np.random.default_rng(0)
    columns = history(F_n_N=two_bumps(), tip_vx=rng.normal(size=len(TIME)) * 1e-7)
    result = Result(summarise(columns, facts(penetration=np.float64(1e-6))), columns, warnings=("look",))
    saved = save(result, tmp_path / "a" / "b")
    loaded = load(tmp_path / "a" / "b")
    assert saved.path == loaded.path == tmp_path / "a" / "b"
    assert tuple(loaded.history) == HISTORY_COLUMNS
    for name, column in columns.items():
        np.testing.assert_array_equal(loaded[name], column)
    assert loaded.warnings == ("look",)
    assert loaded.summary["penetration"] == 1e-6
    assert loaded.summary["contacts"] == result.summary["contacts"]
    assert sorted(p.name for p in saved.path.iterdir()) == sorted(FILES)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a"]


def test_header_is_the_contract_s(tmp_path: Path):
    save(Result({}, history()), tmp_path)
    header = (tmp_path / "history.csv").read_text().partition("\n")[0]
    assert header == (
        "time_s,F_n_N,F_t_N,stick_fraction,tip_vx,tip_vy,plate_vx,"
        "E_kinetic,E_internal,E_plastic,E_contact,E_friction,E_total_error"
    )
    json.loads((tmp_path / "summary.json").read_text())


def test_results_are_not_overwritten_unless_forced(tmp_path: Path):
    save(Result({"mu": 1}, history()), tmp_path)
    with pytest.raises(RequestError, match="--force"):
        save(Result({"mu": 2}, history()), tmp_path)
    assert load(tmp_path).summary["mu"] == 1
    save(Result({"mu": 2}, history()), tmp_path, force=True)
    assert load(tmp_path).summary["mu"] == 2


@pytest.mark.parametrize("other_files", [False, True])
def test_a_new_folder_appears_with_all_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, other_files: bool):
    """A kill at any time leaves the whole results or none; files that recorders put there meanwhile stay."""
    rename, seen = Path.rename, []

    def spied(self: Path, target: Path) -> Path:
        seen.append((list(target.iterdir()), sorted(file.name for file in self.iterdir())))
        if other_files:
            (target / "a.usdc").write_text("recorded")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", spied)
    assert load(save(Result({"mu": 1}, history()), tmp_path / "new").path).summary["mu"] == 1
    assert seen == [([], sorted(FILES))]
    assert sorted(file.name for file in (tmp_path / "new").iterdir()) == sorted([*FILES, *["a.usdc"] * other_files])
    assert [file.name for file in tmp_path.iterdir()] == ["new"]
    (tmp_path / "plain").mkdir()
    assert (tmp_path / "new").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_failure_while_saving_leaves_nothing(tmp_path: Path):
    broken = {name: column for name, column in history().items() if name != "plate_vx"}
    with pytest.raises(RequestError, match="plate_vx"):
        save(Result({}, broken), tmp_path / "new")
    assert list(tmp_path.iterdir()) == []


def test_output_that_is_a_file_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(RequestError, match="not a folder"):
        check_output(tmp_path / "file" / "below")


@pytest.mark.parametrize("damage", ["missing", "text", "columns"])
def test_load_says_what_is_wrong(tmp_path: Path, damage: str):
    if damage != "missing":
        save(Result({}, history()), tmp_path)
        (tmp_path / "history.csv").write_text("a,b\n1,x\n" if damage == "text" else "a,b\n1,2,3\n")
    with pytest.raises(RequestError, match=r"summary\.json" if damage == "missing" else "damaged"):
        load(tmp_path)


def _cut(folder: Path) -> None:
    """As where a copy ended in the middle of the last number."""
    file = folder / "history.csv"
    file.write_bytes(file.read_bytes()[:-2])


def _compressed(folder: Path) -> None:
    """A damaged byte where a packed array begins: there is no such kind of packing."""
    np.savez_compressed(folder / "paths.npz", **{"p/position_m": TIME})
    data = bytearray((folder / "paths.npz").read_bytes())
    data[30 + data[26] + data[28]] = 0xFF  # behind the header, the name and the extra field
    (folder / "paths.npz").write_bytes(data)


def _history(change: Callable[[str], str]) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        file = folder / "history.csv"
        file.write_text(change(file.read_text()))

    return damage


@pytest.mark.parametrize(
    "damage",
    [
        lambda folder: (folder / "summary.json").write_text("[]"),
        lambda folder: (folder / "summary.json").write_text('{"warnings": 5}'),
        lambda folder: (folder / "summary.json").write_text("[" * 100_000),
        lambda folder: (folder / "paths.npz").touch(),
        lambda folder: np.save((folder / "paths.npz").open("wb"), TIME),
        _compressed,
        _cut,
        _history(lambda text: ""),
        _history(lambda text: text.partition("\n")[2]),
        _history(lambda text: text.partition("\n")[0] + "\n"),
        _history(lambda text: text.replace("F_n_N", "F_N", 1)),
        _history(lambda text: text.replace("\n", "\n#", 1)),
    ],
    ids="list warnings nested no-paths npy zlib cut empty no-header no-rows columns comment".split(),
)
def test_damaged_files_are_refused_in_one_sentence(tmp_path: Path, damage: Callable[[Path], object]):
    save(Result({}, history()), tmp_path)
    damage(tmp_path)
    with pytest.raises(RequestError, match="its files are damaged; run again"):
        load(tmp_path)


@pytest.mark.parametrize("name", [5, "", None, "a\0b"])
def test_what_is_no_folder_is_refused(name: object):
    with pytest.raises(RequestError, match=r"results = .*: name a folder"):
        load(name)  # type: ignore[arg-type]


def test_result_names_its_columns():
    result = Result({}, history())
    assert result.time is result["time_s"]
    with pytest.raises(KeyError, match="tip_vx"):
        result["tip_v"]


def test_reversal_needs_both_signs_beyond_the_last_springs():
    wave = np.sin(np.linspace(0.0, np.pi, 50))
    pressed = np.full(2 * len(wave), 1e4)
    assert not reverses(-1000.0 * wave, pressed)
    assert not reverses(np.append(-1000.0 * wave, 0.04), pressed)
    assert reverses(np.append(-1000.0 * wave, 100.0 * wave), pressed)
    assert not reverses(np.append(-1e-3 * wave, 1e-4 * wave), pressed)  # rounding
    assert not reverses(np.zeros(4), np.zeros(4))


def test_records_of_a_run_of_1e_30_s_have_peaks_too():
    peaks = force_peaks(1e-30 * np.arange(5.0), np.array([0.0, 1.0, 3.0, 2.0, 0.0]))
    assert [force for _, force in peaks] == [3.0]


def test_a_folder_that_takes_no_file_is_refused_before_a_run():
    if not Path("/proc").is_dir():
        pytest.skip("no folder here that takes no file even of root")
    with pytest.raises(RequestError, match="out = '/proc/x': /proc cannot be written to"):
        check_output("/proc/x")
