"""Stress along paths: which records give rows, over blocks of memory and after an interruption."""

from __future__ import annotations

import time

import numpy as np
import pytest

from warp_mca.phases.stress_rows import BLOCK, Room, StressRows
from warp_mca.system.records import SceneRecords


@pytest.mark.parametrize("given", [False, True])
@pytest.mark.parametrize("checks", [1, 3])
def test_rows_are_every_so_many_records_of_the_scenes_own_probes(
    monkeypatch: pytest.MonkeyPatch, checks: int, given: bool
):
    monkeypatch.setattr("warp_mca.phases.stress_rows.BLOCK", 8)
    records = np.random.default_rng(0).normal(size=(70, 6, 6)).astype(np.float32)
    kept, own = SceneRecords(), slice(2, 5)
    expected = records[::checks, own]
    for first, end in ((0, 40), (40, 70)):  # a run that is stored, and goes on
        rows = StressRows(kept, checks, own, np.full((7, 3, 6), np.nan, dtype=np.float32) if given else None)
        for start in range(first, end, 10):
            ring = np.full((32, 6, 6), np.nan, dtype=np.float32)
            ring[:10] = records[start : start + 10]
            rows.take(10, ring)
            count = len(expected[: -(-(start + 10) // checks)])
            np.testing.assert_array_equal(np.concatenate(rows.first(count)), expected[:count])
        kept.path_stress, kept.records, kept.count = rows.first(count), end, count
    cut = np.concatenate(rows.first(count - 3))  # where a guard stops the scene
    np.testing.assert_array_equal(cut, expected[: count - 3])


def test_memory_that_was_touched_is_given_once_and_to_scenes_of_as_many_probes():
    room = Room(3, 2000, 5)
    while len(room._found) < 3:
        time.sleep(0.01)
    assert room.take(4) is None
    found = [room.take(5) for _ in range(4)]
    assert [item is not None and item.shape for item in found] == [(BLOCK, 5, 6)] * 3 + [False]
    assert len({id(item) for item in found}) == 4
