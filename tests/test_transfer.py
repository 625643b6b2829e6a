"""How arrays come to the host: only what was written of them, and by the same memory however often a phase pauses."""

from __future__ import annotations

import numpy as np
import pytest
import warp as wp
from impacts import begun, result_of

import warp_mca as mca
from warp_mca.step.transfer import Transfer


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_only_the_rows_that_were_written_are_copied(device: str):
    ring = wp.array(np.arange(24.0).reshape(4, 3, 2), dtype=wp.float64, device=device)
    flag = wp.full(5, 7, dtype=wp.int32, device=device)
    way = Transfer({"ring": ring, "flag": flag}, device)
    for tag, rows in ((0, 4), (1, 4), (2, 3)):  # the third one is in the memory of the first
        way.send(tag, rows={"ring": rows})
        ring.assign(ring.numpy() + 100.0)
        way.send(-1)
        received, found = way.receive()
        kept = {name: array.copy() for name, array in found.items()}
        way.receive()
        assert received == tag
        np.testing.assert_array_equal(kept["ring"][:rows], np.arange(24.0).reshape(4, 3, 2)[:rows] + 100.0 * tag)
        assert (kept["flag"] == 7).all()
    assert (kept["ring"][3] != np.arange(18.0, 24.0).reshape(3, 2) + 200.0).all()
    assert way.carries({"ring": ring, "flag": flag})
    assert not way.carries({"ring": ring}) and not way.carries({"ring": ring, "flag": wp.clone(flag)})


@pytest.mark.parametrize("device", ["cpu", pytest.param("cuda:0", marks=pytest.mark.gpu)])
def test_a_phase_that_pauses_keeps_its_way_to_the_host(device: str):
    scene = mca.make_scene("single_rod")
    whole, paused = (begun(scene, duration=2e-5, device=device) for _ in range(2))
    whole.advance()
    paused.advance(until=3)
    kept = paused.ways
    for step in range(13, paused.steps.count, 10):
        paused.advance(until=step)
        assert paused.ways == kept
    paused.advance()
    one, other = result_of(whole).history, result_of(paused).history
    assert [name for name in one if not np.array_equal(one[name], other[name], equal_nan=True)] == []
