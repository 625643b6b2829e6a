"""Tests what Blender shows of an exported USD file: colours of the stress, edges, the floor. Needs bpy."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from flying_bars import FlyingBars

import warp_mca as mca
from warp_mca.recorders import UsdFile

pytestmark = pytest.mark.skipif(find_spec("bpy") is None, reason="bpy is not installed")


def test_blender_shows_colours_edges_and_the_floor(bars: FlyingBars, tmp_path: Path):
    from matplotlib.image import imread

    floor = mca.RigidPlane(point=(0.0, -0.001, 0.0))
    contact = mca.Contact(slave=mca.Surface(body="lower", nodes="ymin"), master=floor)
    scene = dataclasses.replace(bars.info.scene, contacts=(contact,))
    bars.info = dataclasses.replace(bars.info, scene=scene)
    frame = bars.frame(1)
    stress = {body: (1e8 * (x[:, 0] > 0.05)).astype(np.float32) for body, x in frame.points.items()}
    recorder = UsdFile(tmp_path / "bars.usdc", limit=1e8)
    recorder.start(bars.info)
    recorder.frame(dataclasses.replace(frame, von_mises=stress))
    recorder.finish(True)
    # In a process of its own: Blender brings another USD.
    command = [sys.executable, "-m", "benchmarks.blender", str(tmp_path / "bars.usdc"), str(tmp_path / "bars.png")]
    done = subprocess.run([*command, "--width", "320", "--samples", "4"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    red, green, blue = np.moveaxis(imread(tmp_path / "bars.png")[:, :, :3], -1, 0)
    yellow = (red > 1.5 * blue) & (green > 1.5 * blue)
    purple = (blue > 1.2 * green) & (red > green) & ~yellow
    grey = np.ptp([red, green, blue], axis=0) < 0.08
    assert yellow.mean() > 0.03  # stressed halves of the bars
    assert purple.mean() > 0.03  # the others
    assert grey.mean() > 0.1  # floor and sky
    assert np.unique(np.round(green[yellow], 1)).size >= 2  # faces that meet at an edge differ in brightness
