"""`warp_mca.register`: kinds from outside the package get into its tables, model files and commands, or are refused."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from linear_tet import LinearTet

import warp_mca as mca
from warp_mca.base import outside
from warp_mca.base.errors import RequestError
from warp_mca.cli.main import main
from warp_mca.geometry.cell_types import TETRAHEDRON
from warp_mca.phases.checkpoint import FILE, Checkpoint
from warp_mca.registration import TABLES
from warp_mca.scene import model_file
from warp_mca.scene.contact_laws import CONTACT_LAWS
from warp_mca.scene.elements import ELEMENTS
from warp_mca.scene.materials import MATERIALS

OWN = '''"""Kinds of the user's own."""
from dataclasses import dataclass

import warp_mca as mca
from warp_mca.scene.contact_laws import Penalty


@mca.register
@dataclass(frozen=True, kw_only=True)
class Softer(Penalty):
    """The linear spring by another name."""


@mca.register
@dataclass(frozen=True, kw_only=True)
class Alloy(mca.Elastic):
    """Elastic by another name."""
'''
SCENE = '''"""A block of an alloy lands."""
import own_kinds
import warp_mca as mca

def build(v: float = 1.0) -> mca.Scene:
    box = mca.Box(size=(0.01, 0.01, 0.01), divisions=(2, 2, 2))
    alloy = own_kinds.Alloy(E=1e9, nu=0.3, rho=1e3)
    block = mca.Body(name="block", geometry=box, material=alloy, velocity=(0.0, -v, 0.0))
    bottom = mca.Surface(body="block", nodes="ymin")
    floor = mca.Contact(slave=bottom, master=mca.RigidPlane(), law=own_kinds.Softer())
    return mca.Scene(name="block", bodies=(block,), contacts=(floor,), impact=mca.ImpactPhase(duration=4e-5))
'''


@pytest.fixture(autouse=True)
def tables(register: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Tables that are restored; a folder with a module and a scene file of the user's own; no figures."""
    for figure in ("warp_mca.results.force_figure.save_forces", "warp_mca.results.energy_figure.save_energies"):
        monkeypatch.setattr(figure, lambda *_: None)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(outside, "_IMPORTED", {})
    Path("own_kinds.py").write_text(OWN)
    Path("block.py").write_text(SCENE)
    yield
    forget()


def forget() -> None:
    """As in a new process: the user's modules are not imported, their kinds not registered."""
    for kind, table in TABLES.items():
        kept = {n: v for n, v in table.entries.items() if getattr(v, "__module__", "").startswith("warp_mca.")}
        if kind != "element":
            table.entries.clear()
            table.entries.update(kept)
    for name in ("own_kinds", "warp_mca_scene_file_block"):
        sys.modules.pop(name, None)


def test_each_kind_gets_into_its_table():
    class Steel(mca.Elastic):
        pass

    class Film:
        def start(self, info: object) -> None: ...
        def frame(self, frame: object) -> None: ...
        def history(self, rows: object) -> None: ...
        def finish(self, ok: bool) -> None: ...

    assert mca.register(Steel) is Steel is MATERIALS["Steel"]
    assert mca.register(Film, kind="recorder") is TABLES["recorder"].entries["Film"]
    own = mca.register(LinearTet())
    assert ELEMENTS[own.name] is own
    assert mca.register(Steel) is Steel  # again


def test_another_thing_of_the_same_name_is_refused():
    taken = type("Elastic", (mca.Elastic,), {"__module__": "mine"})
    words = r"^register: name of the material = 'Elastic': warp_mca\.scene\.elastic\.Elastic has this name; give mine"
    with pytest.raises(RequestError, match=words):
        mca.register(taken)
    assert MATERIALS["Elastic"] is mca.Elastic


def test_another_cell_type_of_the_same_name_is_refused():
    other = replace(TETRAHEDRON, gmsh=11)
    with pytest.raises(RequestError, match=r"^register: name of the cell type = 'tetrahedron': "):
        mca.register(other)
    assert mca.register(TETRAHEDRON) is TABLES["cell type"].entries["tetrahedron"] is TETRAHEDRON


def test_a_class_that_is_read_again_replaces_itself():
    first, second = (type("Lead", (mca.Elastic,), {"__module__": "mine"}) for _ in range(2))
    mca.register(first)
    assert mca.register(second) is MATERIALS["Lead"]


@pytest.mark.parametrize("thing", [None, 5, "Steel", object(), int, mca.Elastic(E=1.0, nu=0.0, rho=1.0)])
def test_what_is_no_kind_is_refused_in_one_sentence(thing: object):
    with pytest.raises(RequestError, match=r"^register = [^\n]*: give as material a class made of [^\n]*Elastic;"):
        mca.register(thing)
    with pytest.raises(RequestError, match=r"^register = [^\n]*: give as joint a class made of [^\n]*Joint$"):
        mca.register(thing, kind="joint")
    with pytest.raises(
        RequestError, match=r"^register\.kind = 'joints': choose among material, .*, friction law, joint"
    ):
        mca.register(thing, kind="joints")


def test_a_model_file_holds_registered_kinds_and_says_what_to_import(capsys: pytest.CaptureFixture[str]):
    assert main(["build", "block.py", "-o", "block.mca"]) == 0
    forget()
    assert main(["run", "block.mca", "--out", "a"]) == 2
    said = capsys.readouterr().err
    assert "registered by the module own_kinds; import that first, as by --import own_kinds" in said
    assert "own_kinds" not in sys.modules  # a file imports nothing
    assert main(["run", "block.mca", "--import", "own_kinds", "--out", "a"]) == 0
    scene = model_file.load("block.mca").scene
    assert type(scene.contacts[0].law) is CONTACT_LAWS["Softer"]


def test_the_workers_of_a_sweep_import_what_the_command_does():
    command = ["sweep", "block.py", "--import", "own_kinds", "--grid", "v=1,2", "--workers", "2", "--out", "table"]
    assert main(command) == 0
    assert Path("table", "sweep.csv").read_text().count("done") == 2


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere", "--import = 'nowhere': there is no such module in "),
        ("own_kinds.py", "--import = 'own_kinds.py': there is no such module in "),
        ("a-b", "--import = 'a-b': name a module as in an import statement"),
        ("broken", "--import = 'broken': reading the module failed with ZeroDivisionError: division by zero"),
        ("lacking", "--import = 'lacking': reading the module failed with ModuleNotFoundError: No module named 'nope"),
    ],
)
def test_a_module_that_cannot_be_imported_is_refused(name: str, words: str, capsys: pytest.CaptureFixture[str]):
    Path("broken.py").write_text("1 / 0\n")
    Path("lacking.py").write_text("import nope_nope\n")
    assert main(["run", "block.py", "--import", name, "--out", "a"]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"warp-mca: error: {words}") and said.count("\n") == 1


def test_an_unknown_element_is_refused(capsys: pytest.CaptureFixture[str]):
    assert main(["run", "block.py", "--element", "hex20"]) == 2
    assert capsys.readouterr().err.startswith(
        f"warp-mca: error: --element = 'hex20': choose among {', '.join(ELEMENTS)}"
    )


def test_resume_imports_what_the_user_names_again(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Modules of a folder are anybody's code: they must be named again, and be as they were."""
    run = ["run", "block.py", "--import", "own_kinds", "--checkpoint", "7"]
    assert main([*run, "--out", "whole"]) == 0
    store = Checkpoint.store

    def store_and_stop(self: Checkpoint, *args: object, **more: object) -> None:
        store(self, *args, **more)  # pyright: ignore[reportArgumentType]
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr(Checkpoint, "store", store_and_stop)
        assert main([*run, "--out", "out"]) == 130
    shutil.copytree("out", "other")
    capsys.readouterr()
    forget()
    assert main(["resume", "out"]) == 2
    assert "--import = None: the run was started with --import own_kinds; give the same" in capsys.readouterr().err
    assert "own_kinds" not in sys.modules
    assert main(["resume", "out", "--import", "own_kinds"]) == 0
    assert Path("out", "history.csv").read_text() == Path("whole", "history.csv").read_text()
    with Path("own_kinds.py").open("a") as file:
        file.write("# changed\n")
    assert main(["resume", "other", "--import", "own_kinds"]) == 2
    assert "--import = 'own_kinds': the module was changed since" in capsys.readouterr().err
    assert Path("other", FILE).exists()
