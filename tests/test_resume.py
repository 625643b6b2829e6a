"""The command `resume`: a folder of anybody's decides a run's scene and options, and nothing else."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.phases.checkpoint import FILE, HEADER, Checkpoint

SCENE = '''"""A block lands."""
import warp_mca as mca

def build(mu: float = 0.2, v: float = 1.0) -> mca.Scene:
    steel = mca.Elastic(E=1e9, nu=0.3, rho=1e3)
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    block = mca.Body(name="block", geometry=box, material=steel, velocity=(0.3, -v, 0.0))
    floor = mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), mu=mu)
    return mca.Scene(name="block", bodies=(block,), contacts=(floor,), impact=mca.ImpactPhase(duration=4e-5))
'''
OPTIONS = ["--set", "mu=0.3", "--set", "v=2", "--duration", "3e-5", "--threads", "1", "--checkpoint", "7"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working directory with a scene file; figures take longer than the runs."""
    for figure in ("warp_mca.results.force_figure.save_forces", "warp_mca.results.energy_figure.save_energies"):
        monkeypatch.setattr(figure, lambda *_: None)
    monkeypatch.chdir(tmp_path)
    Path("block.py").write_text(SCENE)
    return tmp_path


@pytest.fixture
def stop(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Runs a scene with a checkpoint until the state has been stored once."""

    def begin(scene: str, *options: str) -> None:
        store = Checkpoint.store

        def store_and_stop(self: Checkpoint, impact: Any, place: Any, more: Any = None) -> None:
            store(self, impact, place, more)
            raise KeyboardInterrupt

        with monkeypatch.context() as patch:
            patch.setattr(Checkpoint, "store", store_and_stop)
            assert main(["run", scene, *(options or OPTIONS), "--out", "out"]) == 130
        assert Path("out", FILE).exists()

    return begin


def rewrite(change: Callable[[dict[str, Any]], object]) -> None:
    """Change what the state says of its command."""
    path = Path("out", FILE)
    with np.load(path) as archive:
        arrays = {name: archive[name] for name in archive.files}
    head = json.loads(arrays[HEADER].tobytes())
    change(head)
    arrays[HEADER] = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    np.savez(path, **arrays)


def refused(*words: str, capsys: pytest.CaptureFixture[str], command: tuple[str, ...] = ("resume", "out")) -> None:
    capsys.readouterr()
    before = sorted(Path().rglob("*"))
    assert main(command) == 2
    said = capsys.readouterr()
    assert said.err.count("\n") == 1 and all(word in said.err for word in words), said.err
    assert sorted(Path().rglob("*")) == before


def test_a_run_goes_on_with_its_options_and_names_its_scene_file(
    stop: Callable[..., None], folder: Path, capsys: pytest.CaptureFixture[str]
):
    stop("block.py")
    assert main(["run", "block.py", *OPTIONS[:-2], "--out", "whole"]) == 0
    capsys.readouterr()
    assert main(["resume", "out"]) == 0
    assert f"going on with: warp-mca run {folder / 'block.py'} --set=mu=0.3 --set=v=2" in capsys.readouterr().out
    parts, whole = mca.load("out"), mca.load("whole")
    assert parts.summary["n_steps"] == 30 and parts.summary["parameters"] == {"mu": 0.3, "v": 2.0}
    assert all(np.array_equal(parts[name], whole[name], equal_nan=True) for name in whole.history)


def test_a_built_in_scene_goes_on_from_any_directory(
    stop: Callable[..., None], folder: Path, monkeypatch: pytest.MonkeyPatch
):
    Path("elsewhere").mkdir()
    stop("rod_on_wall", "--duration", "3e-5", "--checkpoint", "3", "--refine", "0.5")
    monkeypatch.chdir("elsewhere")
    assert main(["resume", "../out"]) == 0
    assert (folder / "out" / "summary.json").exists() and not list(Path().iterdir())


@pytest.mark.parametrize("change", ["edit", "remove", "move"])
def test_another_scene_file_is_refused_and_a_moved_one_is_named(
    stop: Callable[..., None], capsys: pytest.CaptureFixture[str], change: str
):
    stop("block.py")
    if change == "edit":
        Path("block.py").write_text(SCENE + "open('ran', 'w')\n")
        refused("scene = ", "block.py", "it was changed since the run was started", capsys=capsys)
        refused("it was changed", capsys=capsys, command=("resume", "out", "--scene", "block.py"))
        return
    Path("block.py").rename("moved.py")
    refused("scene = ", "block.py", "name where it is now by --scene FILE", capsys=capsys)
    if change == "move":
        assert main(["resume", "out", "--scene", "moved.py"]) == 0
        assert mca.load("out").summary["n_steps"] == 30


def test_a_scene_file_that_comes_with_the_folder_runs_only_if_it_is_named(
    stop: Callable[..., None], capsys: pytest.CaptureFixture[str]
):
    """Folder and file may be of anybody: their digest says nothing."""
    Path("out").mkdir()
    Path("block.py").rename("out/block.py")
    stop("out/block.py")
    Path("link").symlink_to("out")
    for name in ("out", "link"):
        refused("the folder brings this file with it", capsys=capsys, command=("resume", name))
    assert main(["resume", "out", "--scene", "out/block.py"]) == 0


EVIL = "open('ran', 'w')\n"
CHANGES: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "words": (lambda head: head.update(command=["build", "block.py", "-o", "x.mca"]), "of another version"),
    "none": (lambda head: head.update(command=None), "call it again with this out"),
    "number": (lambda head: head.update(command=3), "of another version"),
    "no head": (lambda head: head.pop("command"), "damaged"),
    "other file": (lambda head: head["command"].update(scene=str(Path("evil.py").resolve())), "it was changed"),
    "relative": (lambda head: head["command"].update(scene="block.py"), "(scene)"),
    "no digest": (lambda head: head["command"].update(digest=None), "(scene)"),
    "digest": (lambda head: head["command"].update(digest=[1]), "(scene)"),
    "no file": (lambda head: head["command"].update(scene="/etc/passwd"), "name the scene file (.py)"),
    "zero": (lambda head: head["command"].update(scene="/a\0.py"), "(scene)"),
    "options": (lambda head: head["command"].update(options=[["out", "x"]]), "(options)"),
    "out": (lambda head: head["command"]["options"].update(out="x"), "(out)"),
    "force": (lambda head: head["command"]["options"].update(force=True), "(force)"),
    "rrd": (lambda head: head["command"]["options"].update(rrd=["x.rrd"]), "(rrd)"),
    "sweep": (lambda head: head["command"]["options"].update({"sweep": ["mu=1,2"]}), "(sweep)"),
    "set": (lambda head: head["command"]["options"].update({"set": [["mu=1"]]}), "(set)"),
    "type": (lambda head: head["command"]["options"].update(threads="1 --out=x"), "(threads)"),
    "bool": (lambda head: head["command"]["options"].update(threads=True), "(threads)"),
    "choice": (lambda head: head["command"]["options"].update(method="x"), "--method"),
    "option in value": (lambda head: head["command"]["options"].update(preset="--force"), "preset = '--force'"),
    "escape": (lambda head: head["command"]["options"].update(preset="\033[2J"), "(preset)"),
    "place": (lambda head: head.update(place=3), "damaged"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_a_folder_may_not_decide_is_refused(
    stop: Callable[..., None], capsys: pytest.CaptureFixture[str], change: str
):
    stop("block.py")
    Path("evil.py").write_text(SCENE + EVIL)
    rewrite(CHANGES[change][0])
    refused(CHANGES[change][1], capsys=capsys)
    assert not Path("ran").exists()


def test_a_digest_of_a_file_that_was_never_run_runs_no_code_but_that(
    stop: Callable[..., None], capsys: pytest.CaptureFixture[str]
):
    """A file of the user's own that is named with its digest is built, said first, and refused for its other model."""
    stop("block.py")
    Path("other.py").write_text(SCENE.replace("(0.01, 0.01, 0.01)", "(0.01, 0.02, 0.01)"))
    digest = hashlib.sha256(Path("other.py").read_bytes()).hexdigest()
    rewrite(lambda head: head["command"].update(scene=str(Path("other.py").resolve()), digest=digest))
    assert main(["resume", "out"]) == 2
    said = capsys.readouterr()
    assert "other.py" in said.out and "of another request (model)" in said.err


def test_pickled_objects_are_not_read(stop: Callable[..., None], capsys: pytest.CaptureFixture[str]):
    class Evil:
        def __reduce__(self) -> tuple[Any, ...]:
            return open, ("ran", "w")

    stop("block.py")
    packed = io.BytesIO()
    np.save(packed, np.array([Evil()], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(Path("out", FILE), "a") as archive:
        archive.writestr("run/more/evil.npy", packed.getvalue())
    refused("damaged", capsys=capsys)
    assert not Path("ran").exists()
