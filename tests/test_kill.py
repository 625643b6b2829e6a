"""A run that is killed half-way leaves recordings that open and hold every flushed frame."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from rrd import rows

KILLED_AT = 27  # frames
SCRIPT = """
import os, signal, sys
sys.path.insert(0, sys.argv[1])
import warp_mca as mca
from test_recording import Memory, bar
from warp_mca.recorders import Cadence, RerunStream, UsdFile, VtkHdfFile, usd_file

usd_file.SAVE_AFTER = 0.0  # the run takes less

class Killer(Memory):
    def frame(self, frame):
        if frame.index == int(sys.argv[3]):
            import time
            time.sleep(0.5)  # rerun's own threads write what was flushed
            os.kill(os.getpid(), signal.SIGKILL)

cadence = Cadence(seconds=1e-6)
out = sys.argv[2]
files = RerunStream(out + "/a.rrd", cadence=cadence), UsdFile(out + "/a.usdc", cadence=cadence)
mca.run(bar(), recorders=[*files, VtkHdfFile(out + "/a.vtkhdf", cadence=cadence), Killer(cadence=cadence)], out=out)
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What such a run left."""
    folder = tmp_path_factory.mktemp("killed")
    command = [sys.executable, "-c", SCRIPT, str(Path(__file__).parent), str(folder), str(KILLED_AT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr
    return folder


def test_rerun(folder: Path):
    frames = sorted(step for _, step, _ in rows(folder / "a.rrd", "/world/bar", "Mesh3D:vertex_positions"))
    assert len(frames) >= KILLED_AT - 3
    assert frames == [frames[1] * k for k in range(len(frames))]


def test_usd(folder: Path):
    from pxr import Usd, UsdGeom

    stage = Usd.Stage.Open(str(folder / "a.usdc"))
    samples = UsdGeom.Mesh(stage.GetPrimAtPath("/World/bar")).GetPointsAttr().GetTimeSamples()
    assert len(samples) >= KILLED_AT - 4
    assert stage.GetEndTimeCode() == samples[-1]


def test_vtkhdf(folder: Path):
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(folder / "a.vtkhdf"))
    reader.Update()
    assert reader.GetNumberOfSteps() >= KILLED_AT
    assert reader.GetOutput().GetNumberOfCells() == 80


def test_no_result_is_left(folder: Path):
    assert {file.name for file in folder.iterdir()} == {"a.rrd", "a.usdc", "a.vtkhdf"}
