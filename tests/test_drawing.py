"""Helpers draw the figures of a run as this process does."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_figures import along, pulse

from warp_mca.results import drawing
from warp_mca.results.drawing import HELPERS, begin_helpers, draw_figures


@pytest.fixture(autouse=True)
def ended() -> Iterator[None]:
    yield
    HELPERS.end()


def test_figures_are_the_same_whoever_draws_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    run = along(pulse(5092.0))
    here, there = tmp_path / "here", tmp_path / "there"
    here.mkdir()
    there.mkdir()
    draw_figures(run, here)
    monkeypatch.setattr(drawing, "MOST", 1)
    assert begin_helpers(2)
    end = time.monotonic() + 60.0
    while not HELPERS.count:
        assert time.monotonic() < end
        time.sleep(0.05)
    monkeypatch.setattr(drawing, "_draw", None)  # this process cannot
    draw_figures(run, there)
    files = sorted(file.name for file in here.iterdir())
    assert files == ["energies.png", "forces.png", "paths.png", "waves.png"]
    assert all((here / name).read_bytes() == (there / name).read_bytes() for name in files)


def test_few_cores_draw_when_the_run_has_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(drawing, "MOST", 4)
    assert not begin_helpers(3) and not HELPERS.count
