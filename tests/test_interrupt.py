"""What is said of, and left by, runs that a signal stops."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import warp_mca as mca
from warp_mca.cli import main as cli

SCRIPT = """
import os, signal, sys
from warp_mca.cli import main as cli
from warp_mca.recorders.vtkhdf_file import VtkHdfFile

write = VtkHdfFile.frame
def frame(self, frame):
    write(self, frame)
    if frame.index == 7:
        os.kill(os.getpid(), signal.SIGTERM)  # handled as an interrupt from the keyboard is
VtkHdfFile.frame = frame
scene = ["single_rod", "--duration", "2e-5", "--frames", "20"]
sys.exit(cli.main(["run", *scene, "--out", "out", "--usd", "a.usdc", "--vtkhdf", "a.vtkhdf"]))
"""


def test_recordings_hold_the_frames_until_then(tmp_path: Path):
    """The USD file lacked up to four of them."""
    import h5py
    from pxr import Usd

    done = subprocess.run([sys.executable, "-c", SCRIPT], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 143, done.stderr
    assert done.stderr.endswith("before it was done; recordings hold the frames until then\n")
    with h5py.File(tmp_path / "a.vtkhdf") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 8
    assert Usd.Stage.Open(str(tmp_path / "a.usdc")).GetEndTimeCode() == 7.0
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("options", [[], ["--final", "a.vtu"]])
def test_nothing_is_said_of_recordings_where_there_are_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], options: list[str]
):
    def stop(*args: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(mca, "run", stop)
    assert cli.main(["run", "single_rod", *options]) == 130
    assert capsys.readouterr().err.splitlines()[-1] == "warp-mca: interrupted before it was done"
