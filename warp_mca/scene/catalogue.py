"""Owns scene files: finding them, their parameters, and building a scene from a preset and `KEY=VALUE` overrides.

A scene file is a Python module with `build(*, name: Annotated[type, Param(...)] = default, ...) -> Scene` and,
both optional, `PRESETS: dict[str, dict[str, object]]` (the first is the default) and `check(result) -> list[str]`.
Its docstring's first line describes it.
"""

from __future__ import annotations

import dataclasses
import inspect
import os
import pkgutil
import sys
import traceback
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import lru_cache
from importlib import import_module, util
from pathlib import Path
from types import ModuleType, NoneType, SimpleNamespace
from typing import Any, get_args, get_type_hints

from warp_mca.base import validate
from warp_mca.base.errors import McaError, RequestError, bad_value
from warp_mca.scene import Scene
from warp_mca.scene.parameters import KIND_WORDS, Param, Parameter

SUFFIX = ".py"  # of scene files


@dataclass(frozen=True)
class SceneSource:
    """A scene file, read: what it is called, what it offers and how to build it.

    Attributes:
        name: of the scene: the module's or the file's.
        description: first line of its docstring.
        parameters: by name, in the order of `build`'s arguments.
        presets: parameter overrides by preset name; the first is the default; may be empty.
        builder: the module's `build`.
        check: the module's `check`, or None.
        builtin: it comes with warp_mca.
    """

    name: str
    description: str
    parameters: Mapping[str, Parameter]
    presets: Mapping[str, Mapping[str, object]]
    builder: Callable[..., Scene]
    check: Callable[[Any], list[str]] | None = None
    builtin: bool = field(default=False, kw_only=True)

    @property
    def default_preset(self) -> str | None:
        """The first preset, or None when there is none."""
        return next(iter(self.presets), None)

    def resolve(self, preset: str | None = None, overrides: Mapping[str, object] | None = None) -> dict[str, object]:
        """Every parameter's value: the defaults, then the preset's, then `overrides` (values or their text).

        Raises:
            RequestError: the preset or a parameter is unknown, or a value is not allowed.
        """
        values = {name: parameter.default for name, parameter in self.parameters.items()}
        if preset is not None and not (isinstance(preset, str) and preset in self.presets):
            raise bad_value("preset", preset, f"scene {self.name} has {_known(preset, self.presets, 'no presets')}")
        chosen = preset if preset is not None else self.default_preset
        layers = [self.presets[chosen] if chosen is not None else {}, overrides or {}]
        for name, value in (item for layer in layers for item in layer.items()):
            if name not in self.parameters:
                known = _known(name, self.parameters, "none")
                raise RequestError(f"parameter {name!r} is unknown: scene {self.name} has {known}")
            values[name] = self.parameters[name].checked(value)
        return values

    def build(self, values: Mapping[str, object]) -> Scene:
        """The scene of these parameter values, which it keeps in `Scene.parameters`.

        Raises:
            RequestError: the values contradict each other, or `build` failed or returned something else than a scene.
        """
        scene = validate.call("scene", self.name, "build()", self.builder, **values)
        if not isinstance(scene, Scene):
            raise bad_value(f"{self.name}.build()", type(scene).__name__, "return a warp_mca.Scene")
        return dataclasses.replace(scene, parameters=dict(values))

    def findings(self, result: Any) -> list[str]:
        """Sentences of the scene file's `check` about a result; empty without `check`.

        Raises:
            RequestError: `check` failed or returned something else than sentences.
        """
        if self.check is None:
            return []
        found = validate.call("scene", self.name, "check()", self.check, result)
        if not (isinstance(found, list | tuple) and all(isinstance(item, str) for item in found)):
            raise bad_value(
                f"{self.name}.check()", validate.brief(found), "return a list of sentences, empty if all is well"
            )
        return list(found)


def scene_names() -> list[str]:
    """Names of the built-in scenes, sorted."""
    package = import_module("warp_mca.scenes")
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__) if not module.name.startswith("_"))


def load_source(name: str | os.PathLike[str]) -> SceneSource:
    """The built-in scene of that name, or the scene in the Python file of that path (suffix .py).

    Raises:
        RequestError: there is no such scene, or the file is no scene file.
    """
    name = str(name) if isinstance(name, os.PathLike) else name
    if isinstance(name, str) and Path(name).suffix == SUFFIX:
        return _source(_imported(Path(name)), Path(name).stem, builtin=False)
    if not (isinstance(name, str) and _is_read(name)) and name not in (names := scene_names()):
        known = _known(name, names, "none")
        if isinstance(name, str) and Path(name).suffix and (Path(name).exists() or "did you mean" not in known):
            others = "model files (.mca), parts (.step, .iges, .brep, .stl) and meshes (.msh, .inp, .k, .vtu, …)"
            remedy = f"name a built-in scene or a Python file ({SUFFIX}); warp-mca run also takes {others}"
            raise bad_value("scene", name, remedy)
        raise bad_value(
            "scene", validate.brief(name), f"the scenes are {known}; or give a Python file (.py) or a model file (.mca)"
        )
    return _source(import_module(f"warp_mca.scenes.{name}"), name, builtin=True)


def _is_read(name: str) -> bool:
    """Whether that built-in scene has been read, so that the folder need not be listed."""
    return not name.startswith("_") and f"warp_mca.scenes.{name}" in sys.modules


def source_of_text(text: str, name: str) -> SceneSource:
    """The scene in the text of a scene file that the package has written."""
    module = ModuleType(f"warp_mca_scene_text_{name}")
    exec(compile(text, f"<{name}>", "exec"), vars(module))
    return _source(module, name, builtin=False)


def make_scene(name: str | os.PathLike[str], *, preset: str | None = None, **parameters: object) -> Scene:
    """Build a built-in scene, or the one in a Python file, e.g. `make_scene("two_link", preset="quick", mu=0.3)`.

    Raises:
        RequestError: as in `load_source` and `SceneSource.resolve`.
    """
    source = load_source(name)
    return source.build(source.resolve(preset, parameters))


def parse_overrides(settings: Iterable[str]) -> dict[str, str]:
    """`KEY=VALUE` texts as a dict.

    Raises:
        RequestError: a text is not of that form, or a key occurs twice.
    """
    overrides: dict[str, str] = {}
    for setting in settings:
        key, equals, value = setting.partition("=")
        if not (key.strip() and equals and value.strip()):
            raise bad_value("--set", setting, "write it as KEY=VALUE, without spaces")
        if key.strip() in overrides:
            remedy = f"{key.strip()} is given twice, also as {overrides[key.strip()]}; leave one of the two out"
            raise bad_value("--set", setting, remedy)
        overrides[key.strip()] = value.strip()
    return overrides


def files_of(pickled: bytes) -> list[Path]:
    """Scene files that define classes of pickled objects: whoever unpickles them must call `load_source` of each."""
    return [path for name, (path, *_) in _STAMPS.items() if name.encode() in pickled]


_STAMPS: dict[str, tuple[Path, int, int]] = {}  # path, time and size of the scene file that each module is read from


def _imported(path: Path) -> ModuleType:
    if not path.is_file():
        raise bad_value("scene", str(path), "there is no such file")
    name = f"warp_mca_scene_file_{path.stem}"
    stamp = path.resolve(), path.stat().st_mtime_ns, path.stat().st_size
    if (
        _STAMPS.get(name) == stamp and name in sys.modules
    ):  # objects of its classes are known by the classes that the module has
        return sys.modules[name]
    _STAMPS.pop(name, None)
    spec = util.spec_from_file_location(name, path)
    assert spec is not None and spec.loader is not None  # true of every name that ends in .py
    module = util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses in the file look themselves up there
    if (folder := str(path.parent.resolve())) not in sys.path:
        sys.path.append(folder)  # modules beside the file
    try:
        spec.loader.exec_module(module)
    except McaError:
        raise
    except (Exception, SystemExit) as error:
        lines = [row.lineno for row in traceback.extract_tb(error.__traceback__) if row.filename == spec.origin]
        where = f" (line {lines[-1]})" if lines else ""
        words = " ".join(f"{type(error).__name__}: {error}".split())
        raise bad_value("scene", str(path), f"reading the file failed: {words}{where}") from error
    _STAMPS[name] = stamp
    return module


def _source(module: ModuleType, name: str, *, builtin: bool) -> SceneSource:
    builder: Callable[..., Scene] | None = getattr(module, "build", None)
    if not callable(builder):
        raise bad_value("scene", name, "the file must define build() that returns a warp_mca.Scene")
    check: Callable[[Any], list[str]] | None = getattr(module, "check", None)
    if not (check is None or callable(check)):
        raise bad_value(f"{name}.check", validate.brief(check), "make it a function check(result), or leave it out")
    presets = getattr(module, "PRESETS", {})
    named = isinstance(presets, Mapping) and all(isinstance(key, str) for key in presets)
    if not (named and all(isinstance(values, Mapping) for values in presets.values())):
        raise bad_value("scene", name, "PRESETS must map preset names to dicts of parameter values")
    return SceneSource(
        name,
        (inspect.getdoc(module) or "").partition("\n")[0],
        _built_in(builder, module, name) if builtin else _parameters(builder, module, name),
        presets,
        builder,
        check,
        builtin=builtin,
    )


def _parameters(builder: Callable[..., Scene], module: ModuleType, scene: str) -> dict[str, Parameter]:
    try:  # not the return type: a scene file may import it for type checkers only
        signature = inspect.signature(builder).parameters
        written = {name: item.annotation for name, item in signature.items() if item.annotation is not item.empty}
        hints = get_type_hints(SimpleNamespace(__annotations__=written), vars(module), include_extras=True)
    except Exception as error:  # evaluating a user's annotation may raise anything
        raise bad_value("scene", scene, f"an annotation of build() cannot be read: {error}") from error
    parameters = {}
    for name, argument in signature.items():
        if argument.default is inspect.Parameter.empty:
            raise bad_value("scene", scene, f"give parameter {name} of build() a default")
        kind, *metadata = get_args(hints.get(name)) or (hints.get(name, type(argument.default)),)
        if argument.default is None:  # an optional value, as in float | None
            kind = next((item for item in get_args(kind) if item is not NoneType), kind)
        if not (isinstance(kind, type) and kind in KIND_WORDS):
            raise bad_value("scene", scene, f"parameter {name} of build() must be a float, an int, a str or a bool")
        param = next((item for item in metadata if isinstance(item, Param)), Param())
        parameters[name] = Parameter(name, kind, argument.default, param)
    return parameters


_built_in = lru_cache(maxsize=64)(_parameters)  # annotations of fifty parameters take 5 ms


def _known(wrong: object, names: Iterable[str], nothing: str) -> str:
    """Names similar to `wrong`, then all names."""
    listed = list(names)
    close = get_close_matches(str(wrong), listed, n=1, cutoff=0.6)
    return ", ".join(listed or [nothing]) + (f" (did you mean {close[0]}?)" if close else "")
