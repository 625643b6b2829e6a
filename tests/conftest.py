"""Owns what all tests share: threads, the skip of tests marked `gpu`, fixtures."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: its threads wait for cores that other tests use

from flying_bars import FlyingBars
from undrawn import draw_nothing


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark them before the run, and ask Warp for devices only when there is such a test."""
    marked = [item for item in items if item.get_closest_marker("gpu")]
    if not marked:
        return
    import warp

    warp.init()
    if not warp.is_cuda_available():
        for item in marked:
            item.add_marker(pytest.mark.skip(reason="needs a CUDA device"))


@pytest.fixture(autouse=True, scope="module")
def no_modules_of_other_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Folders and modules that commands took from a test's folder are forgotten behind its file."""
    path = list(sys.path)
    yield
    sys.path[:] = path
    folder = str(tmp_path_factory.getbasetemp())
    for name, module in list(sys.modules.items()):
        if str(getattr(module, "__file__", None)).startswith(folder):
            del sys.modules[name]


@contextmanager
def kinds_restored() -> Iterator[Callable[..., object]]:
    """`warp_mca.register`; at the end the tables of kinds are as they were before."""
    from warp_mca.registration import TABLES, register

    tables = [table.entries for table in TABLES.values()]
    before = [dict(table) for table in tables]
    yield register
    for table, entries in zip(tables, before, strict=True):
        table.clear()
        table.update(entries)


@pytest.fixture
def register() -> Iterator[Callable[..., object]]:
    """`warp_mca.register`; after the test the tables of kinds are as they were before it."""
    with kinds_restored() as register:
        yield register


@pytest.fixture(autouse=True, scope="module")
def no_kinds_of_other_files() -> Iterator[None]:
    """What code of pages registers is forgotten behind its file."""
    with kinds_restored():
        yield


@pytest.fixture
def bars() -> FlyingBars:
    """A scene for recorders, without a run."""
    return FlyingBars()


@pytest.fixture(autouse=True)
def figures_drawn_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """No helpers draw figures, so that tests see who draws them and how."""
    monkeypatch.setattr("warp_mca.results.drawing.MOST", 1 << 20)


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are made, but not drawn."""
    draw_nothing(monkeypatch)


@pytest.fixture
def short_ranges(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ranges that threads can cut small models in."""
    from impacts import SHORT_RANGES

    for name, length in SHORT_RANGES.items():
        monkeypatch.setattr(name, length)
