"""Owns the command `resume`: a run that was stopped goes on from what its folder holds.

A folder may come from anybody, so that its file decides nothing but a scene and the options below, checked as if they
were typed: no other command, no file outside of the folder, no scene file but the one that the run was started with, no
module but those that the user names again by `--import`.
"""

from __future__ import annotations

import argparse
import hashlib
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from warp_mca.base.errors import bad_value
from warp_mca.base.outside import file_of, import_named
from warp_mca.geometry.keyword_file import KEYWORD_SUFFIXES
from warp_mca.phases.checkpoint import FILE, stored_command
from warp_mca.scene.catalogue import SUFFIX as PYTHON
from warp_mca.scene.catalogue import scene_names
from warp_mca.scene.model_file import SUFFIX as MODEL

# Options of `run` that a state may have, by the names that argparse gives them, and what they may be.
OPTIONS: dict[str, tuple[type, ...]] = {
    "preset": (str,),
    "units": (str,),
    "leave_out": (list,),
    "refine": (float,),
    "element": (str,),
    "set": (list,),
    "criterion": (list,),
    "device": (str,),
    "precision": (str,),
    "threads": (int,),
    "multi_rate": (int, str),
    "duration": (float,),
    "time_step_scale": (float,),
    "mass_scaling": (float, str),
    "method": (str,),
    "checkpoint": (str,),
    "figures": (str,),
}

LISTED = {"set": "settings", "criterion": "criteria"}  # attributes of those that are given once for each


def command_of(args: argparse.Namespace) -> dict[str, Any]:
    """What `resume` needs of the command `run`: its scene, the digest of its file if it is one, its options.

    Raises:
        OSError: the file is gone.
    """
    given = {name: getattr(args, LISTED.get(name, name)) for name in OPTIONS}
    options = {name: value for name, value in given.items() if value not in (None, [])}
    more = {"options": options, "imports": _imports(args.imports)}
    if not _is_file(args.scene):
        return {"scene": args.scene, "digest": None, **more}
    path = Path(args.scene).resolve()
    return {"scene": str(path), "digest": _digest(path), **more}


def _imports(names: Sequence[str]) -> dict[str, str]:
    """Digest of the file of each module that the command imports, by its name."""
    files = {name: file_of(import_named("--import", name)) for name in names}
    return {name: _digest(file) if file else "" for name, file in files.items()}


def resume(args: argparse.Namespace) -> None:
    """Carry out `run` again with the scene and the options that a folder holds.

    Raises:
        RequestError: the folder has no state of a command, or one that is not resumed.
    """
    folder = args.folder.absolute()
    stored = stored_command(args.folder)
    scene = _scene(stored, folder, args.scene)
    words = [*_imported_again(stored, folder, args.imports), *_words(stored, folder)]
    print("going on with:", shlex.join(["warp-mca", "run", scene, *words]), flush=True)
    again = args.parse(["run", scene, *words, f"--out={folder}"])
    again.command(again)


def _scene(stored: Mapping[str, Any], folder: Path, given: Path | None) -> str:
    """The scene of the run: a built-in one, or the user's file if it is the same as then.

    Raises:
        RequestError: there is no such scene, or its file is another one, or nobody but the folder names it.
    """
    name, digest = stored.get("scene"), stored.get("digest")
    if digest is None:
        if name not in scene_names():
            raise _strange(folder, "scene")
        if given is not None:
            raise bad_value("--scene", str(given), f"the run is of the built-in scene {name}; leave it out")
        return str(name)
    if not (isinstance(name, str) and isinstance(digest, str) and "\0" not in name and Path(name).is_absolute()):
        raise _strange(folder, "scene")
    path = (given or Path(name)).resolve()
    if not _is_file(path):
        raise bad_value("--scene", str(path), f"name the scene file ({PYTHON}) or model file ({MODEL}) of the run")
    if given is None and path.is_relative_to(folder.resolve()):
        remedy = "the folder brings this file with it, which may hold any code; if it is yours, name it by --scene FILE"
        raise bad_value("scene", str(path), remedy)
    if not path.is_file():
        raise bad_value("scene", str(path), "the scene file of the run is gone; name where it is now by --scene FILE")
    if _digest(path) != digest:
        raise bad_value("scene", str(path), "it was changed since the run was started; restore it, or start a new run")
    return str(path)


def _imported_again(stored: Mapping[str, Any], folder: Path, given: Sequence[str]) -> list[str]:
    """The options `--import` of the run, whose modules the user must name again: the folder may name any code.

    Raises:
        RequestError: the user names others, or one was changed.
    """
    modules = stored.get("imports", {})
    if not (isinstance(modules, dict) and all(isinstance(name, str) for name in modules)):
        raise _strange(folder, "imports")
    if set(modules) != set(given):
        asked = " ".join(f"--import {name}" for name in modules if name.isprintable()) or "no --import"
        raise bad_value("--import", ",".join(given) or None, f"the run was started with {asked}; give the same")
    for name, digest in _imports(given).items():
        if digest != modules[name]:
            remedy = "the module was changed since the run was started; restore it, or start a new run"
            raise bad_value("--import", name, remedy)
    return [f"--import={name}" for name in given]


def _words(stored: Mapping[str, Any], folder: Path) -> list[str]:
    """The options of the run as words of a command line, which its parser checks further.

    Raises:
        RequestError: one is not resumed, or of another type.
    """
    options = stored.get("options")
    if not isinstance(options, dict):
        raise _strange(folder, "options")
    words = []
    for name, value in options.items():
        several = value if isinstance(value, list) else [value]
        if type(value) not in OPTIONS.get(name, ()) or not all(map(_is_word, several)):
            raise _strange(folder, name)
        words += [f"--{name.replace('_', '-')}={item}" for item in several]
    return words


def _strange(folder: Path, what: str) -> Exception:
    remedy = f"{FILE} there is damaged or of another version ({what}); give the run's own command again"
    return bad_value("folder", str(folder), remedy)


def _is_word(item: object) -> bool:
    return isinstance(item, int | float) or (isinstance(item, str) and item.isprintable())


def _is_file(name: str | Path) -> bool:
    return Path(name).suffix in (PYTHON, MODEL) or Path(name).suffix.lower() in KEYWORD_SUFFIXES


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
