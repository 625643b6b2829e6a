"""Owns what the command line asks for: a scene with its parameters, or a model file."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import warp_mca as mca
from warp_mca.base.errors import bad_value
from warp_mca.base.outside import import_named
from warp_mca.cli import part_script, robot_script
from warp_mca.geometry.keyword_file import KEYWORD_SUFFIXES
from warp_mca.scene import Scene, catalogue, model_file
from warp_mca.scene.elements import ELEMENTS
from warp_mca.scene.model_file import SUFFIX, Origin
from warp_mca.scene.options import with_options

SCALE = "time_step_scale"  # an option for every scene, and a parameter of some
OPTIONS = ("duration", "refine", "mass_scaling", SCALE)  # that scenes may have as parameters, too


@dataclass(frozen=True)
class Request:
    """What is to be run or built.

    Attributes:
        scene: built from its parameters.
        label: names the default output folder.
        source: the scene file, or None when a model file was given.
        origin: the built-in scene and its parameters, or None.
        meshes: those of a model file, or None.
    """

    scene: Scene
    label: str
    source: catalogue.SceneSource | None = None
    origin: Origin | None = None
    meshes: dict[str, mca.Mesh] | None = None


def read_request(args: argparse.Namespace) -> Request:
    """Build the scene that the arguments ask for."""
    return read_requests(args, [{}])[0]


def read_requests(args: argparse.Namespace, settings: Sequence[Mapping[str, str]]) -> list[Request]:
    """Build the scenes that the arguments ask for, each with some parameters changed; their file is read once."""
    if robot_script.is_robot(args.scene):
        raise robot_script.no_scene(args.scene)
    units, drop = getattr(args, "units", None), part_script.is_drop(args)
    if units is None and (left := getattr(args, "leave_out", ())):
        raise bad_value("--leave-out", left[0], "it is for decks that run with --units; give that, or leave it out")
    if drop:
        part_script.check_drop(args)
    elif part_script.is_part(args.scene) and units is None:
        raise part_script.no_scene(args.scene)
    if units is not None and Path(args.scene).suffix.lower() not in KEYWORD_SUFFIXES:
        remedy = f"it gives those of a keyword deck ({', '.join(KEYWORD_SUFFIXES)}); leave it out"
        raise bad_value("--units", units, remedy)
    for name in args.imports:
        import_named("--import", name)
    if drop:
        given = {name for more in settings for name in _overrides(args, more)}
        text = part_script.script_of_drop(args.scene, given)
        source = catalogue.source_of_text(text, f"{Path(args.scene).stem}-drop")
        return [_of_source(args, source, more) for more in settings]
    if units is not None:
        return [_of_deck(args, units, more) for more in settings]
    if Path(args.scene).suffix != SUFFIX:
        source = catalogue.load_source(args.scene)
        return [_of_source(args, source, more) for more in settings]
    if args.preset is not None:
        raise bad_value("--preset", args.preset, "a model file has its preset built in; leave it out or build again")
    if args.refine is not None:
        raise bad_value("--refine", args.refine, "a model file holds finished meshes; give it when building")
    stored = model_file.load(args.scene)
    return [_of_model(args, stored, more) for more in settings]


def _of_source(args: argparse.Namespace, source: catalogue.SceneSource, more: Mapping[str, str]) -> Request:
    overrides = _overrides(args, more)
    scale = _where_no_parameter(getattr(args, SCALE, None), source.parameters, overrides)
    values = source.resolve(args.preset, overrides)
    preset = args.preset or source.default_preset
    origin = Origin(source.name, preset, values) if source.builtin else None
    label = f"{source.name}-{preset}" if preset else source.name
    return Request(_with(source.build(values), args, scale), label, source, origin)


def _of_deck(args: argparse.Namespace, units: str, more: Mapping[str, str]) -> Request:
    from warp_mca.decks.deck import read_deck

    if args.preset is not None:
        raise bad_value("--preset", args.preset, "a deck has none; leave it out")
    if overrides := _overrides(args, more):
        remedy = "a deck has no parameters; change the deck, or make a scene of it by mca.read_deck"
        raise bad_value("--set", next(iter(overrides)), remedy)
    scene = _with(read_deck(args.scene, units, args.leave_out), args, getattr(args, SCALE, None))
    return Request(scene, Path(args.scene).stem)


def _of_model(args: argparse.Namespace, stored: model_file.StoredModel, more: Mapping[str, str]) -> Request:
    overrides = _overrides(args, more)
    names = stored.origin.parameters if stored.origin else ()
    scale = _where_no_parameter(getattr(args, SCALE, None), names, overrides)
    stored = model_file.changed(stored, overrides)
    scene = _with(stored.scene, args, scale)
    return Request(scene, Path(args.scene).stem, None, stored.origin, stored.meshes)


def _overrides(args: argparse.Namespace, more: Mapping[str, str]) -> dict[str, object]:
    """Parameters that `--set` gives, and `more`.

    Raises:
        RequestError: an option says the same of all scenes, and would win without a word.
    """
    overrides: dict[str, object] = {**catalogue.parse_overrides(args.settings), **more}
    for name in part_script.OPTIONS:
        if (value := getattr(args, name, None)) is not None:
            if name in overrides:
                raise bad_value(f"--{name}", value, f"it is given as {name}={overrides[name]}, too; leave one out")
            overrides[name] = value
    for name in OPTIONS:
        if (value := getattr(args, name, None)) is not None and name in overrides:
            remedy = f"{name} is given as a parameter as well, {overrides[name]}; leave one of the two out"
            raise bad_value(f"--{name.replace('_', '-')}", value, remedy)
    return overrides


def parameters_given(args: argparse.Namespace) -> set[str]:
    """Parameters that the command sets for all scenes of a sweep."""
    return {*catalogue.parse_overrides(args.settings), *([SCALE] if args.time_step_scale is not None else ())}


def _where_no_parameter(scale: float | None, names: Collection[str], overrides: dict[str, object]) -> float | None:
    """The share of the stable time step, or None where the scene has it among its parameters, which take it then."""
    if scale is not None and SCALE in names:
        overrides[SCALE] = scale
        return None
    return scale


def _with(scene: Scene, args: argparse.Namespace, scale: float | None) -> Scene:
    """The scene with what the options ask for: size of cells, element formulation, time step, mass scaling."""
    scene = with_options(scene, args.refine, getattr(args, "mass_scaling", None), None)
    if (element := args.element) is not None:
        if element not in ELEMENTS:
            raise bad_value("--element", element, f"choose among {', '.join(ELEMENTS)}")
        scene = dataclasses.replace(scene, bodies=tuple(dataclasses.replace(b, element=element) for b in scene.bodies))
    if scale is not None:
        scene = dataclasses.replace(scene, impact=dataclasses.replace(scene.impact, time_step_scale=scale))
    return dataclasses.replace(scene, criteria=(*scene.criteria, *args.criteria)) if args.criteria else scene
