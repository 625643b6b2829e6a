"""How recipes use gmsh: silent, off the main thread, without a trace in the process that calls them."""

from __future__ import annotations

import subprocess
import sys
import threading
from pathlib import Path

import pytest
from recipes import plate, rod

from warp_mca.base.errors import RequestError


def test_gmsh_is_silent_and_works_off_the_main_thread(capfd):
    meshes = []
    thread = threading.Thread(target=lambda: meshes.append(rod().build()))
    thread.start()
    thread.join()
    assert len(meshes) == 1
    assert capfd.readouterr() == ("", "")


SIGNALS = """
import signal, sys, threading
from warp_mca.geometry import Rod
def masks():
    return [line for line in open("/proc/self/status") if line.startswith(("SigIgn", "SigCgt"))]
signal.signal(signal.SIGTERM, lambda number, frame: print("caught"))
threading.Thread(target=int).start()  # from the first one on, the C library has a signal of its own
before = masks()
task = threading.Thread(target=Rod(radius=0.01, length=0.1).build)
if sys.argv[1] == "main":
    task.run()
else:
    task.start()
    task.join()
assert masks() == before, (before, masks())
signal.raise_signal(signal.SIGTERM)
"""


@pytest.mark.parametrize("thread", ["main", "other"])
def test_gmsh_leaves_signals_to_their_handlers(thread: str):
    """SIGTERM killed the process after its first mesh, though Python still named its handler."""
    done = subprocess.run([sys.executable, "-c", SIGNALS, thread], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "caught\n"), done.stderr


def test_gmsh_session_of_the_caller_is_left_alone():
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.model.add("mine")
        plate().build()
        assert gmsh.isInitialized()
        assert gmsh.model.getCurrent() == "mine"
        assert "warp_mca" not in gmsh.model.list()
    finally:
        gmsh.finalize()


def test_missing_system_library_is_explained(tmp_path: Path, monkeypatch):
    (tmp_path / "gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    monkeypatch.delitem(sys.modules, "gmsh", raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(RequestError, match=r"libGLU\.so\.1.*apt-get install libglu1-mesa"):
        rod().build()
    sys.modules.pop("gmsh", None)
