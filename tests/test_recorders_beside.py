"""Recorders that start and work while a GPU computes; the CPU, which computes in between, stands in for it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_recording import Memory, bar

import warp_mca as mca
from warp_mca.base.errors import GuardError, RequestError
from warp_mca.recorders import Cadence, UsdFile, frames
from warp_mca.recorders.recorder import CONTACT, PATHS, SURFACE


@pytest.fixture
def beside(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(frames, "_computes_beside", lambda output: True)


class Starting(Memory):
    """Remembers how many rows the run had when it started."""

    def __init__(self, *needs: str) -> None:
        super().__init__(*needs)
        self.launched: list[int] = []

    def start(self, info) -> None:
        super().start(info)
        self.begun = len(self.launched)


def recorded(monkeypatch: pytest.MonkeyPatch, wait: float) -> Starting:
    """A recorder after a run; recorders are patient for `wait` [s]."""
    own = Starting(SURFACE, CONTACT, PATHS)
    take = frames.Recording.take

    def counted(self: frames.Recording, row: int, needs: frozenset[str]) -> None:
        own.launched.append(row)
        take(self, row, needs)

    with monkeypatch.context() as patch:
        patch.setattr(frames, "PATIENCE", wait)
        patch.setattr(frames.Recording, "take", counted)
        mca.run(bar(), recorders=[own])
    return own


@pytest.mark.parametrize(("wait", "sets", "begun"), [(1e-9, 16, 1), (1e9, 16, 32), (1e9, 2, 21)])
def test_recorders_that_start_late_get_every_frame(monkeypatch: pytest.MonkeyPatch, wait: float, sets: int, begun: int):
    """When they have waited, with the first rows of the history, or once no further frame can be under way."""
    usual = recorded(monkeypatch, 0.0)
    assert usual.begun == 0
    monkeypatch.setattr(frames, "_computes_beside", lambda output: True)
    monkeypatch.setattr(frames, "AHEAD", sets)
    late = recorded(monkeypatch, wait)
    assert late.begun == begun
    assert [frame.step for frame in late.frames] == [frame.step for frame in usual.frames]
    for one, other in zip(late.frames, usual.frames, strict=True):
        np.testing.assert_array_equal(one.points["bar"], other.points["bar"])
        np.testing.assert_array_equal(one.path_stress["axis"], other.path_stress["axis"])
    one, other = (np.concatenate([rows["F_n_N"] for rows in own.rows]) for own in (late, usual))
    np.testing.assert_array_equal(one, other)


def test_a_recorder_that_fails_when_it_starts_late_stops_the_run(tmp_path: Path, beside: None):
    own = Memory(SURFACE)

    def start(info: object) -> None:
        raise RuntimeError("no such port")

    vars(own)["start"] = start
    with pytest.raises(RequestError, match=r"^recorders\[1\] = 'memory': start\(\) failed with RuntimeError: no such"):
        mca.run(bar(), recorders=[UsdFile(tmp_path / "new" / "a.usdc"), own], out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


def test_a_run_that_a_guard_stops_shows_the_frames_before(monkeypatch: pytest.MonkeyPatch, beside: None):
    own = Memory(SURFACE)
    monkeypatch.setattr(frames, "PATIENCE", 1e-9)
    with pytest.raises(GuardError):
        mca.run(bar(velocity=(3000.0, 0.0, 0.0)), recorders=[own])
    assert own.ended is False
    assert own.frames


def test_a_run_that_ends_before_they_start_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, beside: None
):
    monkeypatch.setattr(frames, "PATIENCE", 1e9)
    own = Memory(SURFACE)

    def stop(*args: object) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mca.run(bar(), recorders=[UsdFile(tmp_path / "a.usdc"), own], progress=stop)
    assert own.ended is None
    assert list(tmp_path.iterdir()) == []


def test_recorders_write_what_they_hold_while_the_run_waits_for_its_last_frames(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, beside: None
):
    """Little is then left to do once the last one has come."""
    monkeypatch.setattr(frames.Transfer, "arrived", property(lambda self: False))
    usual, own, file = Memory(SURFACE), Memory(SURFACE), UsdFile(tmp_path / "a.usdc", cadence=Cadence(frames=5))
    held: list[tuple[int, int]] = []
    vars(own)["idle"] = lambda: held.append((len(own.frames), file.saved_count))
    mca.run(bar(), recorders=[usual, file, own])
    assert held == [(2, 2), (3, 3), (4, 4)]
    assert [frame.step for frame in own.frames] == [frame.step for frame in usual.frames]
    assert file.saved_count == 5


def test_what_goes_on_beside_others_begins_before_any_finishes_and_is_waited_for_last():
    order: list[str] = []
    first, second = Memory(SURFACE), Memory(SURFACE)
    for name, recorder in (("first", first), ("second", second)):
        vars(recorder)["finish"] = lambda ok, name=name: order.append(f"finish {name} {ok}")
    vars(first)["before_finish"] = lambda: order.append("before")
    mca.run(bar(), recorders=[first, second])
    assert order == ["before", "finish second True", "finish first True"]
