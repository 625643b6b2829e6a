"""Recorders that cannot be as they were made, the user's own among them: one sentence, before the run begins."""

from __future__ import annotations

import re
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from test_cli import SCENE
from test_recording import Memory, bar

import warp_mca as mca
from warp_mca.base.errors import RequestError
from warp_mca.cli import main as cli
from warp_mca.recorders import FILES, Cadence, FinalState, Kind, RerunStream, SnapshotFile, UsdFile, VtkHdfFile
from warp_mca.recorders.recorder import SURFACE

MAKE = {
    "usd": UsdFile,
    "rrd": partial(RerunStream, viewer=False),
    "vtkhdf": VtkHdfFile,
    "final": FinalState,
    "snapshot": partial(SnapshotFile, time=0.0),
}


def broken(*args: object) -> None:
    raise RuntimeError("no such\nport")


@pytest.mark.parametrize("field", MAKE)
@pytest.mark.parametrize("file", [5, "", b"a.usdc", "a\0b.usdc"])
def test_what_is_no_file_is_refused(field: str, file: object):
    with pytest.raises(RequestError, match=rf"^{field} = .*: name a file$"):
        MAKE[field](file)


@pytest.mark.parametrize("field", ["usd", "vtkhdf", "final", "snapshot"])
def test_no_file_is_refused(field: str):
    with pytest.raises(RequestError, match=rf"^{field} = None: name a file$"):
        MAKE[field](None)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (partial(UsdFile, "a.usdc", limit="a"), "limit = 'a': give the stress"),
        (partial(UsdFile, "a.usdc", limit=np.ones(2)), "limit = 'ndarray': give the stress"),
        (partial(UsdFile, "a.usdc", limit=0.0), "limit = 0.0: give the stress"),
        (partial(RerunStream, "a.rrd", limit="a"), "limit = 'a': give the stress"),
        (partial(RerunStream, "a.rrd", limit=float("inf")), "limit = inf: give the stress"),
        (partial(RerunStream, viewer="no"), "RerunStream.viewer = 'no': give True or False"),
        (partial(RerunStream, "a.rrd", viewer_options="-v"), "RerunStream.viewer_options = '-v': give a tuple of str"),
        (partial(SnapshotFile, "a.png", time="1"), "snapshot = '1': give a finite time"),
        (partial(SnapshotFile, "a.png", time=None), "snapshot = None: give a finite time"),
    ],
)
def test_options_that_are_none_are_refused(make: partial, words: str):
    with pytest.raises(RequestError, match=f"^{re.escape(words)}[^\n]*$"):
        make()


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"name": None}, "name = None: give a text"),
        ({"cadence": None}, "cadence = None: give a Cadence"),
        ({"cadence": 5}, "cadence = 5: give a Cadence"),
        ({"needs": None}, "needs = None: give a frozenset of what frames must hold, out of surface, contact"),
        ({"needs": "surface"}, "needs = 'surface': give a frozenset"),
        ({"needs": {"foo"}}, "needs = 'foo': give a frozenset"),
        ({"needs": [["surface"]]}, "needs = ['surface']: give a frozenset"),
        ({"files": 5}, "files = 5: give a tuple of the paths that it writes"),
        ({"files": "a.txt"}, "files = 'a.txt': give a tuple"),
        ({"files": [None]}, "files[0] = None: name a file"),
    ],
)
def test_attributes_that_are_none_are_refused_before_the_run(tmp_path: Path, attributes: dict, words: str):
    """Some ended in tracebacks, some gave empty frames."""
    own = Memory(SURFACE)
    vars(own).update(attributes)
    with pytest.raises(RequestError, match=rf"^recorders\[1\]\.{re.escape(words)}[^\n]*$"):
        mca.run(bar(), recorders=[UsdFile(tmp_path / "a.usdc"), own], out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("method", ["check", "start"])
@pytest.mark.parametrize("function", [broken, lambda: None, sys.exit])
def test_a_recorder_that_fails_before_the_run_stops_it_in_one_sentence(tmp_path: Path, method: str, function: object):
    own = Memory(SURFACE)
    vars(own)[method] = function
    words = rf"^recorders\[1\] = 'memory': {method}\(\) failed with \w+: [^\n]*$"
    with pytest.raises(RequestError, match=words):
        mca.run(bar(), recorders=[UsdFile(tmp_path / "a.usdc"), own], out=tmp_path / "out")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", [OSError("no space left"), SystemExit("no space left")])
def test_a_recorder_that_fails_at_its_first_frame_took_none(error: BaseException):
    def frame(frame: object) -> None:
        raise error

    own = Memory(SURFACE)
    vars(own)["frame"] = frame
    result = mca.run(bar(), recorders=[own])
    assert result.warnings[1:] == ("memory: recording stopped after 0 frames: no space left",)
    assert result.failed == ("memory",)


def test_a_recorder_gets_its_option_by_one_registration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """`peak_stress.py` writes what a recorder in memory sees, from the command line and from Python."""
    monkeypatch.setitem(FILES, "peak", Kind("peak_stress", "PeakStress", "write the greatest stress of each frame"))
    monkeypatch.chdir(tmp_path)
    Path("landing.py").write_text(SCENE)
    assert cli.main(["run", "landing.py", "--duration", "1e-5", "--peak", "a.csv", "--frames", "4"]) == 0
    seen = Memory(SURFACE, cadence=Cadence(frames=4))
    own = FILES["peak"].make("b.csv", cadence=seen.cadence)
    mca.run(mca.make_scene("landing.py"), duration=1e-5, recorders=[own, seen])
    assert Path("a.csv").read_text() == Path("b.csv").read_text()
    expected = [(frame.time, max(value.max() for value in frame.von_mises.values())) for frame in seen.frames]
    np.testing.assert_array_equal(np.loadtxt("a.csv", delimiter=","), expected)
    assert len(expected) == 4 and expected[-1][1] > 1e5
