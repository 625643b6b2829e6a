"""Owns completion of commands by the shell, where argcomplete is installed."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress

from warp_mca.scene import catalogue
from warp_mca.scene.elements import ELEMENTS

ASKED = "_ARGCOMPLETE"  # in the environment when a shell asks


def answer(parser: argparse.ArgumentParser) -> None:
    """Print what may come next and end the process, if a shell asks for it; else do nothing."""
    if ASKED in os.environ:
        with suppress(ImportError):
            import argcomplete  # pyright: ignore[reportMissingImports]
            from argcomplete.completers import FilesCompleter  # pyright: ignore[reportMissingImports]

            _add_completers(parser, FilesCompleter((".py", ".mca")))
            argcomplete.autocomplete(parser)


def _add_completers(parser: argparse.ArgumentParser, files: Callable[..., Iterable[str]]) -> None:
    """Say what arguments for scenes, presets and parameters may hold; `files` lists scene and model files."""
    for action in _actions(parser):
        if action.dest == "scene":
            _set(action, lambda prefix, **more: [*catalogue.scene_names(), *files(prefix, **more)])
        elif action.dest == "element":
            _set(action, lambda **more: list(ELEMENTS))
        elif action.dest == "preset":
            _set(action, lambda parsed_args, **more: _of_scene(parsed_args, "presets", ""))
        elif action.dest == "settings":
            _set(action, lambda parsed_args, **more: _of_scene(parsed_args, "parameters", "="))


def _set(action: argparse.Action, completer: object) -> None:
    action.completer = completer  # pyright: ignore[reportAttributeAccessIssue]  # argcomplete looks for it there


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """All arguments of a parser and its commands."""
    for action in parser._actions:
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


def _of_scene(args: argparse.Namespace, what: str, end: str) -> list[str]:
    """Names of presets or parameters of the built-in scene on the command line; a file is not run for its own."""
    scene = getattr(args, "scene", None)
    if scene not in catalogue.scene_names():
        return []
    return [name + end for name in getattr(catalogue.load_source(scene), what)]
