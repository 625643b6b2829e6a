"""Tests scene files: finding them, reading their parameters, checking what the user sets."""

from __future__ import annotations

import dataclasses
import gc
import math
import sys
from pathlib import Path

import pytest

from warp_mca.base.errors import RequestError
from warp_mca.results.result import Result
from warp_mca.scene import Scene
from warp_mca.scene.catalogue import SceneSource, load_source, make_scene, parse_overrides, scene_names
from warp_mca.scene.parameters import Param, Parameter

SCENE = '''"""A block falls.

More about it.
"""
from __future__ import annotations
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated
import warp_mca as mca
if TYPE_CHECKING:
    from warp_mca import Scene

@dataclass
class Local:
    edge: float

PRESETS = {"small": {}, "large": {"edge": 2.0, "cells": 4}}

def build(
    *,
    edge: Annotated[float, mca.Param("edge of the block", unit="m", low=0.0, exclusive=True)] = 1.0,
    cells: Annotated[int, mca.Param("cells along each edge", low=1)] = 2,
    kind: Annotated[str, mca.Param("of support", choices=("free", "held"))] = "free",
    heavy: bool = True,
) -> Scene:
    size = (edge, edge, edge)
    material = mca.Elastic(E=1e9, nu=0.3, rho=1e3)
    body = mca.Body(name="block", geometry=mca.Box(size=size, divisions=(cells,) * 3), material=material)
    return mca.Scene(name="block", bodies=(body,), impact=mca.ImpactPhase(duration=1e-4))

def check(result):
    return []
'''


@pytest.fixture
def source(tmp_path: Path) -> SceneSource:
    path = tmp_path / "block.py"
    path.write_text(SCENE)
    return load_source(str(path))


def test_the_built_in_scenes_are_found():
    assert {"two_link", "single_rod"} <= set(scene_names())


@pytest.mark.parametrize("name", scene_names())
def test_every_preset_of_every_built_in_scene_builds(name: str):
    source = load_source(name)
    assert source.builtin and source.description
    for preset in source.presets or [None]:
        scene = source.build(source.resolve(preset))
        assert set(scene.parameters) == set(source.parameters)


@pytest.mark.parametrize("name", scene_names())
def test_every_parameter_of_a_built_in_scene_is_described_and_its_default_allowed(name: str):
    for parameter in load_source(name).parameters.values():
        assert parameter.param.description
        assert parameter.checked(parameter.default) == parameter.default


def test_a_scene_file_tells_what_it_offers(source: SceneSource):
    assert (source.name, source.description, source.builtin) == ("block", "A block falls.", False)
    assert list(source.parameters) == ["edge", "cells", "kind", "heavy"]
    assert source.parameters["edge"].param.unit == "m"
    assert source.parameters["heavy"].kind is bool
    assert source.default_preset == "small"
    assert source.check is not None


def test_values_come_from_defaults_then_preset_then_overrides(source: SceneSource):
    assert source.resolve() == {"edge": 1.0, "cells": 2, "kind": "free", "heavy": True}
    assert source.resolve("large")["cells"] == 4
    values = source.resolve("large", parse_overrides(["cells=3", "heavy=off", "edge=5e-1"]))
    assert values == {"edge": 0.5, "cells": 3, "kind": "free", "heavy": False}
    scene = source.build(values)
    assert isinstance(scene, Scene)
    assert scene.parameters == values
    assert scene.body("block").geometry.divisions == (3, 3, 3)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("edge=0", ["edge = 0.0", "above 0", "[m]"]),
        ("edge=-1", ["edge = -1.0", "above 0"]),
        ("edge=wide", ["edge = 'wide'", "finite number"]),
        ("edge=nan", ["edge = 'nan'", "finite number"]),
        ("edge=inf", ["edge = 'inf'", "finite number"]),
        ("cells=0", ["cells = 0", "1 or above"]),
        ("cells=2.5", ["cells = '2.5'", "whole number"]),
        ("kind=glued", ["kind = 'glued'", "free or held"]),
        ("heavy=perhaps", ["heavy = 'perhaps'", "true or false"]),
        ("cell=3", ["'cell'", "did you mean cells?"]),
    ],
)
def test_a_bad_value_is_refused_by_name_value_and_remedy(source: SceneSource, setting: str, words: list[str]):
    with pytest.raises(RequestError) as error:
        source.resolve(None, parse_overrides([setting]))
    assert all(word in str(error.value) for word in words), str(error.value)
    assert "\n" not in str(error.value)


def test_an_unknown_preset_is_answered_with_the_known(source: SceneSource):
    with pytest.raises(RequestError, match=r"'larg'.*small, large \(did you mean large\?\)"):
        source.resolve("larg")


@pytest.mark.parametrize("setting", ["mu", "=3", "mu=", ""])
def test_a_setting_is_key_equals_value(setting: str):
    with pytest.raises(RequestError, match="KEY=VALUE"):
        parse_overrides([setting])


def test_two_settings_of_one_parameter_are_refused():
    assert parse_overrides(["mu=1", "v = 2"]) == {"mu": "1", "v": "2"}
    with pytest.raises(RequestError, match=r"^--set = 'mu = 2': mu is given twice, also as 1; leave one"):
        parse_overrides(["mu=1", "v=1", "mu = 2"])


@pytest.mark.parametrize(
    ("param", "allowed", "refused"),
    [
        (Param(low=0.0, high=1.0), [0.0, 0.5, 1.0], [-1e-9, 1.1]),
        (Param(low=0.0, high=1.0, exclusive=True), [0.5], [0.0, 1.0]),
        (Param(high=2.0), [-1e9, 2.0], [2.1]),
        (Param(), [-1e30, 0.0, 1e-30], [math.nan, 1e31, -1e300, 1e-31, -5e-324]),
    ],
)
def test_limits_belong_to_the_range_unless_exclusive(param: Param, allowed: list[float], refused: list[float]):
    parameter = Parameter("x", float, 0.5, param)
    assert [parameter.checked(value) for value in allowed] == allowed
    for value in refused:
        with pytest.raises(RequestError):
            parameter.checked(value)


def test_values_from_python_are_checked_like_texts():
    scene = make_scene("two_link", preset="quick", mu=0.3)
    assert scene.parameters["mu"] == 0.3
    with pytest.raises(RequestError, match="mu"):
        make_scene("two_link", mu=-0.3)
    with pytest.raises(RequestError, match="mu"):
        make_scene("two_link", mu=True)


def test_moduli_that_contradict_each_other_are_refused():
    with pytest.raises(RequestError, match="E_t"):
        make_scene("two_link", E_tip=70e9, E_t_tip=70e9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("def build(:", "SyntaxError"),
        ("import nowhere_to_be_found", "ModuleNotFoundError"),
        ("x = 1", r"must define build\(\)"),
        ("def build(*, x): ...", "default"),
        ("def build(*, x: tuple = ()): ...", "float, an int, a str or a bool"),
        ("def build(): ...\nPRESETS = ['quick']", "PRESETS"),
        ("def build(): ...\nPRESETS = {5: {}}", "PRESETS"),
        ("def build(): ...\ncheck = 'x'", r"bad\.check = 'x': make it a function"),
        ("def build(*, x: 'float[' = 1.0): ...", "an annotation of build"),
        ("import functools\ndef make(): ...\nbuild = functools.partial(make, 1)", "build"),
    ],
)
def test_a_file_that_is_no_scene_file_is_refused(tmp_path: Path, text: str, words: str):
    path = tmp_path / "bad.py"
    path.write_text(text)
    with pytest.raises(RequestError, match=words) as error:
        load_source(str(path))
    assert "\n" not in str(error.value)


def test_a_scene_file_may_import_what_lies_beside_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(sys, "path", list(sys.path))
    (tmp_path / "beside_the_scene.py").write_text("LENGTH = 2.0")
    (tmp_path / "it.py").write_text("from beside_the_scene import LENGTH\ndef build(length: float = LENGTH): ...\n")
    assert load_source(tmp_path / "it.py").parameters["length"].default == 2.0


def test_build_must_return_a_scene(tmp_path: Path):
    path = tmp_path / "odd.py"
    path.write_text("def build(): return 3")
    source = load_source(str(path))
    with pytest.raises(RequestError, match=r"warp_mca\.Scene"):
        source.build(source.resolve())


@pytest.mark.parametrize("name", ["two_lnk", "nowhere.py"])
def test_a_scene_that_does_not_exist_is_refused(name: str):
    with pytest.raises(RequestError, match=name):
        load_source(name)


def test_error_in_a_users_build_is_one_sentence_with_its_line(tmp_path):
    path = tmp_path / "broken.py"
    path.write_text("def build():\n    return 1 / 0\n", encoding="utf-8")
    source = load_source(str(path))
    with pytest.raises(RequestError, match=r"broken.*ZeroDivisionError.*broken\.py, line 2"):
        source.build({})


@pytest.mark.parametrize("text", ["import sys\nsys.exit()\n", "import sys\ndef build():\n    sys.exit(0)\n"])
def test_a_file_that_exits_is_no_run_that_succeeded(tmp_path: Path, text: str):
    """Its status was that of the command line: 0, without a word, and nothing was run."""
    path = tmp_path / "mine.py"
    path.write_text(text)
    with pytest.raises(RequestError, match=r"failed.*SystemExit"):
        make_scene(str(path))


def test_build_may_be_a_partial_function(tmp_path: Path):
    path = tmp_path / "part.py"
    path.write_text(
        SCENE.replace("def build(", "def make(") + "import functools\nbuild = functools.partial(make, edge=3.0)\n"
    )
    source = load_source(str(path))
    assert source.resolve()["edge"] == 3.0
    assert source.build(source.resolve("large")).parameters["edge"] == 2.0


@pytest.mark.filterwarnings("error")
def test_async_functions_are_refused_without_warnings(tmp_path: Path):
    path = tmp_path / "late.py"
    path.write_text("async def build(): ...\nasync def check(result): return []")
    source = load_source(str(path))
    with pytest.raises(RequestError, match=r"late\.build\(\) = 'coroutine': return a warp_mca\.Scene"):
        source.build({})
    with pytest.raises(RequestError, match=r"late\.check\(\) = 'coroutine': return a list of sentences"):
        source.findings(Result({}, {}))
    gc.collect()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("1 / 0", r"check\(\) failed with ZeroDivisionError: .*line 2"),
        ("exit()", r"check\(\) failed with SystemExit"),
        ("None", r"block\.check\(\) = None: return a list"),
        ("'fine'", r"block\.check\(\) = 'fine': return a list"),
        ("[1]", r"block\.check\(\) = \[1\]: return a list"),
    ],
)
def test_a_check_that_fails_is_told_in_one_sentence(tmp_path: Path, body: str, words: str):
    path = tmp_path / "block.py"
    path.write_text(f"def check(result):\n    return {body}\ndef build(): ...\n")
    with pytest.raises(RequestError, match=words):
        load_source(str(path)).findings(Result({}, {}))


def test_findings_are_what_check_says(source: SceneSource):
    assert source.findings(Result({}, {})) == []
    assert dataclasses.replace(source, check=lambda result: ["look"]).findings(Result({}, {})) == ["look"]
    assert dataclasses.replace(source, check=None).findings(Result({}, {})) == []


@pytest.mark.parametrize("name", [None, 5, [], ""])
def test_what_names_no_scene_is_refused(name: object):
    with pytest.raises(RequestError, match=r"scene = .*two_link"):
        make_scene(name)  # type: ignore[arg-type]


@pytest.mark.parametrize("preset", [5, ["quick"]])
def test_what_names_no_preset_is_refused(preset: object):
    with pytest.raises(RequestError, match=r"preset = .*quick"):
        make_scene("two_link", preset=preset)  # type: ignore[arg-type]
