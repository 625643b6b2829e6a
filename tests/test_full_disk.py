"""Tests what is said, and left, where a disk takes no more."""

from __future__ import annotations

import resource
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
from flying_bars import FlyingBars
from test_results import facts, history

import warp_mca as mca
from warp_mca.base.errors import McaError, RequestError
from warp_mca.recorders import RerunStream, UsdFile, VtkHdfFile
from warp_mca.results.result import Result, summarise
from warp_mca.results.storage import save
from warp_mca.scene import model_file as scene_file


@contextmanager
def files_up_to(size: int) -> Iterator[None]:
    """The system refuses to let a file grow beyond `size` [byte], as a full disk does."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def results(folder: Path) -> None:
    save(Result(summarise(history(), facts()), history()), folder / "out")


def model(folder: Path) -> None:
    scene = mca.make_scene("rod_on_wall")
    scene_file.save(folder / "rod.mca", scene, mca.mesh(scene))


@pytest.mark.parametrize("write", [results, model])
def test_what_cannot_be_written_is_said_in_one_sentence_and_leaves_nothing(
    tmp_path: Path, write: Callable[[Path], None]
):
    with files_up_to(2000), pytest.raises(McaError, match=r"could not be written to .*: File too large") as caught:
        write(tmp_path)
    assert caught.value.exit_status == 1
    assert list(tmp_path.iterdir()) == []
    write(tmp_path)


@pytest.mark.parametrize(
    ("field", "begin"),
    [
        ("usd", lambda file: UsdFile(file).start),
        ("vtkhdf", lambda file: VtkHdfFile(file).check),
        ("rrd", lambda file: RerunStream(file).check),
    ],
)
def test_a_disk_that_is_full_at_the_start_is_refused(
    bars: FlyingBars, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, field: str, begin: Callable
):
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=24 << 10))
    file = tmp_path / {"usd": "a.usdc", "vtkhdf": "new/a.vtkhdf", "rrd": "a.rrd"}[field]
    with pytest.raises(RequestError, match=rf"^{field} = .*less than 64 MiB are free on its disk"):
        begin(file)(bars.info)
    assert list(tmp_path.iterdir()) == []
