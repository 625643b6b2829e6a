"""Owns how docstrings are read for the API: names that share a description, as `tip, target: ...`, each get it."""

from __future__ import annotations

import re
from typing import Any

import griffe

_GROUP = re.compile(r"(?P<indent> +)(?P<names>\w+(?:, \w+)+): (?P<text>.*)")


class SharedDescriptions(griffe.Extension):
    """Splits entries of several names, in sections such as Args and Attributes, into one for each."""

    def on_object(self, *, obj: griffe.Object, **_: Any) -> None:
        """Rewrite the docstring of an object."""
        if obj.docstring:
            obj.docstring.value = split(obj.docstring.value)


def split(docstring: str) -> str:
    """The docstring with an entry for each name."""
    lines, found = docstring.splitlines(), []
    while lines:
        line = lines.pop(0)
        match = _GROUP.fullmatch(line)
        if not match:
            found.append(line)
            continue
        more = []
        while lines and lines[0].startswith(match["indent"] + " "):
            more.append(lines.pop(0))
        for name in match["names"].split(", "):
            found += [f"{match['indent']}{name}: {match['text']}", *more]
    return "\n".join(found)
