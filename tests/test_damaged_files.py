"""Files that crash gmsh, or keep it busy for ever: one sentence, no process and no file left behind."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from parts import write_parts

import warp_mca as mca
from warp_mca.geometry import cad, cad_drawing
from warp_mca.geometry import gmsh_session as gmsh_session_module
from warp_mca.geometry.gmsh_session import LIMIT, gmsh_session
from warp_mca.geometry.quality import check

# A module that answers as gmsh does where nothing happens, and ends badly when a file is read.
FAKE = """
import os, signal, types
def initialize(**options): pass
def merge(path):
    {merge}
option = types.SimpleNamespace(setNumber=lambda name, value: None)
model = types.SimpleNamespace(add=lambda name: None)
"""
BUSY = """open(path + '.pid', 'w').write(str(os.getpid()))
    while True:
        [signal.signal(number, signal.SIG_IGN) for number in (2, 15)]
"""
COMMAND = "import sys; sys.path.insert(0, '.'); from warp_mca.cli.main import main; sys.exit(main(['run', 'a.step']))"


@pytest.fixture
def gmsh_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Makes gmsh do what a line of Python says when it reads the file a.step."""

    def make(merge: str) -> Path:
        (tmp_path / "gmsh.py").write_text(FAKE.format(merge=merge))
        (tmp_path / "a.step").write_text("damaged")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.chdir(tmp_path)
        return tmp_path

    return make


def gone(process: int) -> bool:
    """Whether a process ends within a second."""
    for _ in range(100):
        try:
            if Path(f"/proc/{process}/stat").read_text().split()[2] == "Z":  # nobody has asked how it ended yet
                return True
        except OSError:
            return True
        time.sleep(0.01)
    return False


@pytest.mark.parametrize(
    ("merge", "words"),
    [
        ("os.abort()", "crashed, as damaged files may make it: SIGABRT"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
        ("os._exit(3)", "exit status 3"),
        ("raise Exception('no\\nsuch entity.')", "(no such entity); repair the part"),
        (
            BUSY,
            "it took more than 0.5 s of processor time, as damaged files may make it; the environment variable "
            "WARP_MCA_MESH_TIME=5 ",
        ),
    ],
)
def test_what_goes_wrong_in_gmsh_is_one_sentence(gmsh_that, monkeypatch: pytest.MonkeyPatch, merge: str, words: str):
    folder = gmsh_that(merge)
    before = set(folder.iterdir())
    if merge == BUSY:
        monkeypatch.setenv(LIMIT, "0.5")
    with pytest.raises(mca.RequestError) as caught:
        mca.Cad("a.step", size=1.0).build()
    assert words in str(caught.value) and str(caught.value).startswith("Cad.path = ")
    if merge == BUSY:
        assert gone(int((folder / "a.step.pid").read_text()))
        (folder / "a.step.pid").unlink()
    assert {path for path in folder.iterdir() if path.name != "__pycache__"} == before


@pytest.mark.parametrize(
    ("number", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -signal.SIGKILL)]
)
def test_a_command_that_is_stopped_takes_gmsh_with_it(gmsh_that, number: signal.Signals, status: int):
    folder = gmsh_that(BUSY)
    command = subprocess.Popen([sys.executable, "-c", COMMAND], stderr=subprocess.PIPE, text=True)
    while not (folder / "a.step.pid").exists() or not (text := (folder / "a.step.pid").read_text()):
        assert command.poll() is None
        time.sleep(0.01)
    command.send_signal(number)
    assert command.wait(10.0) == status
    assert command.stderr is not None
    assert command.stderr.read().count("\n") == (status > 0)
    assert gone(int(text))


def test_the_limit_counts_processor_time(gmsh_that, monkeypatch: pytest.MonkeyPatch):
    """On a loaded machine gmsh waits for its turn: a second of it with none of the processor is not counted."""
    gmsh_that("__import__('time').sleep(1.0); raise Exception('done waiting')")
    monkeypatch.setenv(LIMIT, "0.5")
    with pytest.raises(mca.RequestError, match="done waiting"):
        mca.Cad("a.step", size=1.0).build()
    monkeypatch.setattr(gmsh_session_module, "_IDLE", 0.5)  # of what waits for ever the clock's is
    with pytest.raises(mca.RequestError, match=r"it took more than 0\.25 s, as damaged files"):
        mca.Cad("a.step", size=1.0).build()


@pytest.mark.parametrize("text", ["", "0", "-1", "nan", "soon"])
def test_a_limit_that_is_none_is_refused(monkeypatch: pytest.MonkeyPatch, text: str):
    monkeypatch.setenv(LIMIT, text)
    with pytest.raises(mca.RequestError, match=rf"^{LIMIT} = '{text}': give the longest time"), gmsh_session():
        pass


def test_a_session_ends_its_process_and_errors_of_gmsh_do_not():
    with gmsh_session() as gmsh:
        process = gmsh._process.process
        with pytest.raises(Exception, match="Could not find model"):
            gmsh.model.setCurrent("none")
        with pytest.raises(AttributeError):
            gmsh.model.nothing()
        gmsh.model.occ.addBox(0, 0, 0, 1, 2, 3)
        gmsh.model.occ.synchronize()
        assert gmsh.model.occ.getMass(3, 1) == pytest.approx(6.0)
        assert process.poll() is None
    assert process.poll() is not None


def test_large_files_and_many_elements_may_take_longer(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What a file is given, and what its mesh."""
    write_parts(tmp_path)
    allowed = []
    monkeypatch.setattr(cad, "allow", lambda gmsh, seconds: allowed.append(seconds))
    mca.Cad(tmp_path / "part.brep", size=0.01, scale=1e-3).build()
    monkeypatch.setattr(cad_drawing, "_BYTE", 1.0)
    monkeypatch.setattr(cad, "_ELEMENT", 1.0)
    mca.Cad(tmp_path / "part.brep", size=0.011, scale=1e-3).build()
    count = 6.0 * 0.04 * 0.02 * 0.04 / 0.011**3  # of a part that fills its box
    assert allowed[0] < 90.0
    assert allowed[1] == pytest.approx(80.0 + (tmp_path / "part.brep").stat().st_size + count, rel=1e-3)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    write_parts(folder := tmp_path_factory.mktemp("parts"))
    return folder


@pytest.mark.parametrize("suffix", ["step", "brep", "iges", "stl", "unv"])
def test_flipped_bytes_give_a_mesh_or_one_sentence(
    suffix: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
):
    """Of a thousand such files one in five ended the process, or stopped it for ever."""
    monkeypatch.setenv(LIMIT, "1")
    intact = (folder / f"part.{suffix}").read_bytes()
    chance = random.Random(suffix)
    file = tmp_path / f"a.{suffix}"
    for _ in range(6):
        damaged = bytearray(intact)
        for _ in range(2):
            damaged[chance.randrange(len(damaged))] = chance.randrange(256)
        file.write_bytes(damaged)
        os.utime(file, ns=(0, chance.randrange(1 << 60)))  # or the mesh of the one before is taken
        part = mca.MeshFile(file, scale=1e-3) if suffix == "unv" else mca.Cad(file, size=0.012, scale=1e-3)
        try:
            check(part.build(), "part")
        except mca.RequestError as error:
            assert "\n" not in str(error)
    assert list(tmp_path.iterdir()) == [file]
    assert capfd.readouterr().out == ""
