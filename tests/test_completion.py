"""Tests what a shell is told when it completes a command; argcomplete is optional."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("argcomplete")


@pytest.mark.parametrize(
    ("line", "found", "absent"),
    [
        ("warp-mca run two_", {"two_link", "two_metal_bar"}, {"hertz_sphere"}),
        ("warp-mca run two_link --set v_", {"v_plate="}, {"mu="}),
        ("warp-mca run mine.py --preset ", set(), {"quick"}),
    ],
)
def test_the_shell_gets_scenes_and_parameters(tmp_path: Path, line: str, found: set[str], absent: set[str]):
    (tmp_path / "mine.py").write_text("raise SystemExit('was run')")
    out = tmp_path / "out"
    asked = {"_ARGCOMPLETE": "1", "COMP_LINE": line, "COMP_POINT": str(len(line)), "_ARGCOMPLETE_IFS": "\n"}
    environment = {**os.environ, **asked, "_ARGCOMPLETE_STDOUT_FILENAME": str(out)}
    command = [sys.executable, "-m", "warp_mca"]
    done = subprocess.run(command, env=environment, cwd=tmp_path, check=False, capture_output=True, timeout=60)
    assert b"was run" not in done.stderr
    words = {word.strip() for word in out.read_text().split("\n")}
    assert found <= words
    assert not absent & words
