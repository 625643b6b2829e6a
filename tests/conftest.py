"""Skips tests marked `gpu` where there is no CUDA device."""

from __future__ import annotations

import pytest
from flying_bars import FlyingBars


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


@pytest.fixture
def bars() -> FlyingBars:
    """A scene for recorders, without a run."""
    return FlyingBars()
