"""Owns the model file (.mca): a scene with the meshes of its bodies, made where gmsh is and run where the GPU is.

It is an npz archive: the entry `header` is JSON, every other entry an array that the header refers to. The scene is
written as nested objects whose `$type` names a class of `warp_mca.scene` or `warp_mca.geometry`, or one from outside
that was registered; `$module` says where that was defined, and nothing is imported because a file says so.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import zipfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import warp_mca.geometry
import warp_mca.scene
from warp_mca.base.errors import McaError, bad_value
from warp_mca.base.files import check_folder, write_atomically
from warp_mca.base.validate import DAMAGE
from warp_mca.geometry import Mesh
from warp_mca.scene import Scene
from warp_mca.scene.bodies import Body
from warp_mca.scene.catalogue import load_source
from warp_mca.scene.contact_laws import CONTACT_LAWS
from warp_mca.scene.failure import FAILURES
from warp_mca.scene.freedoms import Controller
from warp_mca.scene.friction_laws import FRICTION_LAWS
from warp_mca.scene.joints import JOINTS
from warp_mca.scene.loads import LOADS
from warp_mca.scene.materials import MATERIALS
from warp_mca.scene.phases import PHASES

SUFFIX = ".mca"
FORMAT = "warp_mca model 1"
DENSEST = 50  # largest ratio of unpacked to packed size of meshes; boxes of equal cells reach 5
SMALL = 64 << 20  # smaller files are not checked [byte]


@dataclass(frozen=True)
class Origin:
    """The built-in scene that a model was built from.

    Attributes:
        scene: its name.
        preset: the preset chosen, or None.
        parameters: every parameter's value.
    """

    scene: str
    preset: str | None = None
    parameters: Mapping[str, object] = field(default_factory=dict)


class StoredModel(NamedTuple):
    """What a model file holds: the scene, a mesh for each body by its name, and where the scene came from if known."""

    scene: Scene
    meshes: dict[str, Mesh]
    origin: Origin | None


def check_path(path: str | os.PathLike[str]) -> Path:
    """The path, when a model file can be written there.

    Raises:
        RequestError: the suffix is not .mca, or the folder does not exist or cannot be written to.
    """
    checked = Path(path)
    if checked.suffix != SUFFIX:
        raise bad_value("output", str(path), f"give the model file the suffix {SUFFIX}")
    if checked.is_dir() or not checked.parent.is_dir():
        raise bad_value("output", str(path), "name a file in a folder that exists and can be written to")
    check_folder("output", checked.parent)
    return checked


def save(path: str | os.PathLike[str], scene: Scene, meshes: Mapping[str, Mesh], origin: Origin | None = None) -> None:
    """Write a model file, whole or not at all; an older one is replaced.

    Args:
        path: with suffix .mca.
        scene: to store. A geometry that is no recipe of warp_mca's own is stored as the mesh it made.
        meshes: of every body, by its name.
        origin: the built-in scene it came from, so that parameters can be changed later.

    Raises:
        RequestError: as in `check_path`.
        McaError: the disk is full or fails.
    """
    target = check_path(path)
    arrays: list[NDArray] = []
    known = set(_vocabulary().values())
    bodies = tuple(
        body if type(body.geometry) in known else dataclasses.replace(body, geometry=meshes[body.name])
        for body in scene.bodies
    )
    content = {
        "format": FORMAT,
        "scene": _encoded(dataclasses.replace(scene, bodies=bodies, parameters=_record(scene.parameters)), arrays),
        "meshes": {name: _encoded(mesh, arrays) for name, mesh in meshes.items()},
        "origin": {**dataclasses.asdict(origin), "parameters": _record(origin.parameters)} if origin else None,
    }
    entries: dict[str, Any] = {f"array{i}": array for i, array in enumerate(arrays)}
    entries["header"] = np.frombuffer(json.dumps(content).encode(), dtype=np.uint8)
    try:
        write_atomically(target, lambda file: np.savez_compressed(file, **entries))
    except OSError as error:
        raise McaError(f"the model could not be written to {target}: {error.strerror or error}") from error


def load(path: str | os.PathLike[str]) -> StoredModel:
    """Read a model file; needs neither gmsh nor meshio.

    Raises:
        RequestError: there is no such file, or it is no model file of this version.
    """
    if not Path(path).is_file():
        raise bad_value("scene", str(path), "there is no such file")
    try:
        _check_unpacked(Path(path))
        with np.load(path, allow_pickle=False) as archive:
            content = json.loads(archive["header"].tobytes())
            if content["format"] != FORMAT:
                raise ValueError(content["format"])
            arrays = {name: archive[name] for name in archive.files}
        scene = _decoded(content["scene"], arrays)
        meshes = {name: _decoded(mesh, arrays) for name, mesh in content["meshes"].items()}
        origin = Origin(**content["origin"]) if content["origin"] else None
        if not isinstance(scene, Scene) or set(meshes) != {body.name for body in scene.bodies}:
            raise ValueError("scene")
        if not all(isinstance(mesh, Mesh) for mesh in meshes.values()):
            raise ValueError("meshes")
    except McaError:
        raise
    except DAMAGE as error:
        remedy = "it is damaged or of another version; make it again with warp-mca build"
        raise bad_value("model file", str(path), remedy) from error
    return StoredModel(scene, meshes, origin)


def _check_unpacked(path: Path) -> None:
    """Refuse a file that would unpack to more than meshes of its size do, or than memory holds.

    Raises:
        RequestError: its content is larger than that.
        zipfile.BadZipFile: it is not an archive.
    """
    packed = path.stat().st_size
    with zipfile.ZipFile(path) as archive:
        unpacked = sum(entry.file_size for entry in archive.infolist())
    if unpacked > max(SMALL, DENSEST * packed):
        remedy = f"it would unpack to {unpacked / 1e9:.2g} GB, {unpacked / packed:.0f} times its size, unlike meshes"
        raise bad_value("model file", str(path), f"{remedy}; make it again with warp-mca build")
    free = _free_memory()
    if unpacked > free:
        remedy = (
            f"it takes {unpacked / 1e9:.2g} GB of memory, of which {free / 1e9:.2g} GB are free; take fewer elements"
        )
        raise bad_value("model file", str(path), remedy)


def _free_memory() -> float:
    """Memory that the system can give to a process [byte]; infinite where it does not tell."""
    with suppress(OSError, ValueError, LookupError):
        entries = dict(line.split(":") for line in Path("/proc/meminfo").read_text().splitlines())
        return 1024.0 * float(entries["MemAvailable"].split()[0])
    return math.inf


def changed(stored: StoredModel, overrides: Mapping[str, object]) -> StoredModel:
    """The model with some parameters of its built-in scene changed, on the meshes it has.

    Args:
        stored: a model file's contents.
        overrides: values, or their text, by parameter name.

    Raises:
        RequestError: the scene was not built in, a value is not allowed, or it takes another mesh.
    """
    if not overrides:
        return stored
    names = ", ".join(overrides)
    if stored.origin is None:
        raise bad_value("--set", names, "only models of built-in scenes can be changed; set it when building the model")
    source = load_source(stored.origin.scene)
    values = source.resolve(None, {**stored.origin.parameters, **overrides})
    scene = dataclasses.replace(source.build(values), refine=stored.scene.refine)
    before = {body.name: body.geometry for body in stored.scene.bodies}
    after = {body.name: body.geometry for body in scene.bodies}
    differing = [name for name in after if name not in before or not _same(before[name], after[name])]
    if differing or len(before) != len(after):
        bodies = f" of {', '.join(differing)}" if differing else ""
        raise bad_value("--set", names, f"it changes the mesh{bodies}; build the model again with it")
    return StoredModel(scene, stored.meshes, dataclasses.replace(stored.origin, parameters=values))


def _vocabulary() -> dict[str, type]:
    """The classes that a file may name: the dataclasses of scenes and geometry recipes, and what was registered."""
    members = {**vars(warp_mca.geometry), **vars(warp_mca.scene), **MATERIALS, **CONTACT_LAWS, **JOINTS, **LOADS}
    members |= {**FAILURES, **FRICTION_LAWS, **PHASES}
    return {name: item for name, item in members.items() if isinstance(item, type) and dataclasses.is_dataclass(item)}


def _named(kind: str, module: str | None) -> type:
    """The class of that name; `module` is where it was registered, of one from outside the package.

    Raises:
        RequestError: it is from outside, and is not registered.
        KeyError: there is none.
    """
    known = _vocabulary()
    if kind not in known and module is not None:
        remedy = f"it is registered by the module {module}; import that first, as by --import {module}"
        raise bad_value("model file", kind, remedy)
    return known[kind]


def _record(parameters: Mapping[str, object]) -> dict[str, object]:
    """The parameters as JSON holds them; of other values their text."""
    return json.loads(json.dumps(dict(parameters), default=str))


def _encoded(value: object, arrays: list[NDArray]) -> object:
    """`value` as JSON; arrays are put into `arrays`, the same one once, and referred to by their place there."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        if type(value) not in _vocabulary().values():
            remedy = "a model file holds warp_mca's own classes and what warp_mca.register was given; use these"
            raise bad_value("scene", type(value).__name__, remedy)
        members = {f.name: _encoded(getattr(value, f.name), arrays) for f in dataclasses.fields(value) if f.init}
        if isinstance(value, Controller):
            remedy = "a model file holds no functions; leave it out, and set it in the scene that is loaded"
            raise bad_value("Freedom.motor", type(value).__name__, remedy)
        module = type(value).__module__
        outside = {} if module.startswith("warp_mca.") else {"$module": module}
        return {"$type": type(value).__name__, **outside, **members}
    if isinstance(value, np.ndarray):
        place = next((i for i, array in enumerate(arrays) if array is value), len(arrays))
        if place == len(arrays):
            arrays.append(value)
        return {"$array": place}
    if isinstance(value, Mapping):
        return {str(key): _encoded(item, arrays) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_encoded(item, arrays) for item in value]
    if isinstance(value, Path):
        return str(value)
    return value.item() if isinstance(value, np.generic) else value


def _decoded(value: object, arrays: Mapping[str, NDArray]) -> Any:
    """The inverse of `_encoded`; every sequence becomes a tuple."""
    if isinstance(value, list):
        return tuple(_decoded(item, arrays) for item in value)
    if not isinstance(value, dict):
        return value
    if "$array" in value:
        return arrays[f"array{value['$array']}"]
    members = {key: _decoded(item, arrays) for key, item in value.items() if key not in ("$type", "$module")}
    if "$type" not in value:
        return members
    made = _named(value["$type"], value.get("$module"))
    return made(**({"element": "hex8"} | members if made is Body else members))  # what it was when files left it out


def _same(one: object, other: object) -> bool:
    """Whether two geometries are equal; meshes are compared array by array."""
    if isinstance(one, Mesh) or isinstance(other, Mesh):
        if not (isinstance(one, Mesh) and isinstance(other, Mesh)):
            return False
        arrays: list[NDArray] = []
        others: list[NDArray] = []
        alike = _encoded(one, arrays) == _encoded(other, others)
        return alike and all(map(np.array_equal, arrays, others))
    return one == other
