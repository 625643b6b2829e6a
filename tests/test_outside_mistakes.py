"""Mistakes in kinds from outside the package: one sentence that names the kind and what is wrong, before any step."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import warp_mca as mca
from warp_mca.cli.main import main
from warp_mca.kernels.materials.laws import law_functions
from warp_mca.phases.half_steps import HalfSteps
from warp_mca.registration import TABLES
from warp_mca.scene.contact_laws import Penalty
from warp_mca.scene.joints import Joint
from warp_mca.scene.loads import Load
from warp_mca.scene.ties import Ties
from warp_mca.system.loads import LoadedNodes

UNTYPED = '''"""A block whose contact law multiplies a float64 by a float32."""
from dataclasses import dataclass

import warp as wp

import warp_mca as mca
from warp_mca.kernels.contact.penalty import energy
from warp_mca.scene.contact_laws import Penalty


@wp.func
def force(depth: wp.float64, k: wp.float64, parameters: wp.array2d(dtype=wp.float64), s: int) -> wp.float64:
    return k * depth * 2.0


@mca.register
@dataclass(frozen=True, kw_only=True)
class Untyped(Penalty):
    law = __name__


def build() -> mca.Scene:
    metal = mca.Elastic(E=1e9, nu=0.3, rho=1e3)
    block = mca.Body(name="block", geometry=mca.Box(size=3 * (0.01,), divisions=(2, 2, 2)), material=metal)
    contact = mca.Contact(slave=mca.Surface(body="block", nodes="ymin"), master=mca.RigidPlane(), law=Untyped())
    return mca.Scene(name="block", bodies=(block,), contacts=(contact,), impact=mca.ImpactPhase(duration=1e-5))
'''
KIND = dataclass(frozen=True, kw_only=True)


@pytest.fixture(autouse=True)
def tables() -> Iterator[None]:
    """As they were before."""
    before = {kind: dict(table.entries) for kind, table in TABLES.items()}
    yield
    for kind, table in TABLES.items():
        table.entries.clear()
        table.entries.update(before[kind])


def scene(law: Penalty | None = None, material: mca.Elastic | None = None, **changes: Any) -> mca.Scene:
    """A block of 27 nodes that lands."""
    block = mca.Body(
        name="block",
        geometry=mca.Box(size=3 * (0.01,), divisions=(2, 2, 2)),
        material=material or mca.Elastic(E=1e9, nu=0.3, rho=1e3),
        velocity=(0.0, -1.0, 0.0),
    )
    surface = mca.Surface(body="block", nodes="ymin")
    floor = mca.Contact(slave=surface, master=mca.RigidPlane(), law=law or Penalty())
    made = mca.Scene(name="block", bodies=(block,), contacts=(floor,), impact=mca.ImpactPhase(duration=1e-5))
    return replace(made, **changes)


def kind(base: type, **attributes: Any) -> Any:
    """A registered class made of `base`."""
    return mca.register(KIND(type("Own", (base,), {"__module__": __name__, **attributes})))


def phase(advance: Callable[..., Any]) -> mca.Scene:
    return scene(phases=(kind(object, advance=advance)(),))


def load(**attributes: Any) -> mca.Scene:
    return scene(loads=(kind(Load, **attributes)(body="block"),))


def joint(ties: Callable[..., Any]) -> mca.Scene:
    return scene(joints=(kind(Joint, ties=ties)(name="J", body="block"),))


def nodes(*numbers: int) -> np.ndarray:
    return np.array(numbers, dtype=np.int32)


def too_long(self: object, impact: Any, tell: object) -> None:
    """Steps beyond those of the impact, without `Impact.take`."""
    motion = HalfSteps(impact)
    while True:
        impact.advance(until=impact.state.steps + 10)
        motion.look()


MISTAKES: tuple[tuple[Callable[[], mca.Scene], str], ...] = (
    (lambda: phase(lambda self, impact, tell: None), r"Scene.phases = 'Own': its advance\(\) must return a Stretch"),
    (lambda: phase(lambda self: None), r"Scene.phases = 'Own': advance\(\) failed with TypeError"),
    (lambda: phase(too_long), r"Impact.steps.count = 10: all are taken; let Impact.take give it more"),
    (lambda: load(), r"Scene.loads = 'Own': making its arrays failed with NotImplementedError: its class has no build"),
    (lambda: load(build=lambda *_: None), r"Scene.loads = 'Own': .* build\(\) gives a NoneType, not a LoadedNodes"),
    (lambda: load(build=lambda *_: LoadedNodes(node=nodes(27))), r"Scene.loads = 'Own': .* others than 0 to 26"),
    (lambda: load(build=lambda *_: LoadedNodes(node=nodes(-1))), r"Scene.loads = 'Own': .* others than 0 to 26"),
    (lambda: load(build=lambda *_: LoadedNodes(node=nodes(1))), r"Scene.loads = 'Own': .* its class has no stage\(\)"),
    (lambda: load(refuses=("multi_rate",)), r"Own.refuses = \('multi_rate',\): give a dict of remedies"),
    (lambda: joint(lambda *_: None), r"Own J = 'ties\(\)': .* it gives a NoneType, not Ties, Rails or Clusters"),
    (lambda: joint(lambda *_: Ties(nodes(3, 99))), r"Own J = 'ties\(\)': .* other nodes of block than 0 to 26"),
    (lambda: joint(lambda *_: Ties(nodes(3), nodes(4))), r"Own J = 'ties\(\)': .* a second body just where"),
    (lambda: scene(law=kind(Penalty, law=None)()), r"Own.law = None: name the module"),
    (lambda: scene(law=kind(Penalty, stiffening=lambda *_: None)()), r"Own.stiffening\(0.0025\) = None: give a finite"),
    (lambda: scene(law=kind(Penalty, damping=lambda *_: -1.0)()), r"Own.damping\(0.0025\) = -1.0: give a finite"),
    (
        lambda: scene(law=kind(Penalty, parameters=("a",))()),
        r"Own.parameters = \('a',\): give a tuple of finite",
    ),
)


@pytest.mark.parametrize(("make", "words"), MISTAKES)
def test_what_it_returns_is_checked(make: Callable[[], mca.Scene], words: str):
    with pytest.raises(mca.RequestError, match=f"^{words}"):
        mca.run(make(), threads=1)


@pytest.mark.parametrize(
    ("constants", "words"),
    [
        ({}, "AttributeError: .*HISTORY"),
        ({"HISTORY": ("tensors",)}, "KeyError: 'tensors'"),
        ({"HISTORY": ("tensor",), "PLASTIC_ROW": 6}, "PLASTIC_ROW = 6 is none of the 6 rows"),
    ],
)
def test_the_history_of_a_law_is_checked(constants: dict[str, Any], words: str, monkeypatch: pytest.MonkeyPatch):
    name = f"own_law_{len(constants)}_{len(words)}"
    law = {key: lambda precision: None for key in ("parameters", "stress", "energies")} | constants
    monkeypatch.setitem(sys.modules, name, SimpleNamespace(**law))  # pyright: ignore[reportArgumentType]
    with pytest.raises(mca.RequestError, match=f"^law of a material = '{name}': name a module that .*{words}"):
        law_functions(name, "mixed")


def test_a_function_that_warp_cannot_compile_ends_a_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    Path("block.py").write_text(UNTYPED)
    assert main(["run", "block.py", "--out", "a"]) == 2
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("warp-mca: error: Warp cannot compile a function, mend it or leave out what needs it: Error")
    assert "block.py" in said and not Path("a").exists()


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        (
            {"law": "nowhere"},
            r"Own.parameters = \(.*\): give 3 numbers or more: K, G \[Pa\] and, with a law",
        ),
        ({"parameters": (1e9, float("nan"))}, r"Own.parameters = \(.*nan\): give 2 numbers or more"),
        ({"parameters": property(lambda self: self.D)}, r"Own.law = '': parameters failed with AttributeError"),
        ({"law": None}, r"Own.law = None: name the module of its functions, or leave it out"),
    ],
)
def test_parameters_of_a_material_are_checked(attributes: dict[str, Any], words: str):
    with pytest.raises(mca.RequestError, match=f"^{words}"):
        scene(material=kind(mca.Elastic, **attributes)(E=1e9, nu=0.3, rho=1e3))


def test_a_load_with_the_name_of_a_part_of_the_solver_is_refused():
    """Its stage would take the place of that part."""
    own = type("contacts", (Load,), {"__module__": __name__, "build": lambda *_: LoadedNodes(node=nodes(1))})
    with pytest.raises(mca.RequestError, match=r"^Scene.loads = 'contacts': the solver has a part of this name"):
        mca.run(scene(loads=(mca.register(KIND(own))(body="block"),)), threads=1)


def test_a_phase_is_a_dataclass():
    """A model file and a checkpoint must be able to hold it."""
    own = type("Own", (), {"advance": lambda *_: None})
    with pytest.raises(mca.RequestError, match=r"give as phase a class with advance, @dataclass.* \(this lacks @datac"):
        mca.register(own)


def test_what_a_class_lacks_is_named():
    own = type("Own", (), {"start": lambda *_: None, "frame": lambda *_: None})
    with pytest.raises(mca.RequestError, match=r"^register = [^;]*: give as recorder .* \(this lacks history, fini"):
        mca.register(own)
    whole = type("Own", (own,), {"history": lambda *_: None, "finish": lambda *_: None})
    with pytest.raises(mca.RequestError, match=r"^recorders\[0\] = 'Own': .*; this has no name, needs, cadence$"):
        mca.run(scene(), recorders=[mca.register(whole)()])
    with pytest.raises(mca.RequestError, match=r"^register\.kind = \['recorder'\]: choose among material"):
        mca.register(whole, kind=["recorder"])  # pyright: ignore[reportArgumentType]
