"""Owns the text of LS-DYNA decks: files that include others, parameters, and the fields of cards in each format."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from warp_mca.geometry.deck import blocks, integer, real

EIGHT = (10,) * 8  # columns of the fields of most cards
_LONG = 20  # columns of every field of the long format
_OPERATIONS: dict[type, Any] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
    ast.USub: operator.neg,
    ast.UAdd: operator.pos,
}
_FUNCTIONS = ("sqrt", "exp", "log", "log10", "sin", "cos", "tan", "asin", "acos", "atan", "atan2")
_NAMES: dict[str, Any] = {name: getattr(math, name) for name in _FUNCTIONS} | {
    **{"pi": math.pi, "abs": abs, "min": min, "max": max, "int": int},
}


@dataclass
class Text:
    """What all files of a deck share.

    Attributes:
        path: of the first file.
        folders: where included files are looked for.
        parameters: values by name in lower case, as text.
        open: files that are being read, one within the other.
        format: "" for standard columns, "+" for long fields, "%" for numbers of nodes and elements in ten columns.
    """

    path: Path
    folders: list[Path] = field(default_factory=list)
    parameters: dict[str, str] = field(default_factory=dict)
    open: list[Path] = field(default_factory=list)
    format: str = ""


@dataclass(frozen=True)
class Keyword:
    """A keyword with its cards.

    Attributes:
        name: in capitals, without asterisk and `_TITLE`.
        titled: whether it had `_TITLE`.
        place: where it stands, as "line 3" or "line 3 of mesh.k".
        lines: place and text of each line of data.
        format: as in `Text`.
        text: what the files share.
    """

    name: str
    titled: bool
    place: str
    lines: list[tuple[str, str]]
    format: str
    text: Text

    def fields(self, line: str, widths: Sequence[int] = EIGHT) -> list[str]:
        """The fields of a card with parameters put in, without the empty ones at its end.

        Raises:
            ValueError: a parameter is not given.
        """
        if "," in line:
            entries = line.split(",")
        else:
            entries, start = [], 0
            for width in self._widths(widths):
                entries.append(line[start : start + width])
                start += width
        found = [self._put_in(entry.strip()) for entry in entries]
        while found and not found[-1]:
            found.pop()
        return found

    def _widths(self, widths: Sequence[int]) -> Sequence[int]:
        if self.format == "+":
            return [max(width, _LONG) for width in widths]
        return [10 if width == 8 else width for width in widths] if self.format == "%" else widths

    def _put_in(self, entry: str) -> str:
        """A field, or the value of the parameter that it names as &name or -&name."""
        sign, _, name = entry.partition("&")
        if not name or sign not in ("", "-"):
            return entry
        if (value := self.text.parameters.get(name.lower())) is None:
            raise ValueError(f"there is no parameter {name}; give it before it is used")
        return value.removeprefix("-") if sign and value.startswith("-") else sign + value


def keywords(path: Path) -> Iterator[Keyword]:
    """The keywords of a deck in turn, with those of the files that it includes.

    A file ends at *END. Parameters are put in as the cards are read, so that they must be given before.

    Raises:
        ValueError: an included file is missing or includes itself, or a parameter cannot be read.
    """
    return _of_file(Text(path, [path.parent]), path)


def _of_file(text: Text, path: Path) -> Iterator[Keyword]:
    text.open.append(path.resolve())
    for block in blocks(path, "$"):
        words = block.keyword.upper().split() or [""]
        name = words[0]
        place = "" if path == text.path else f" of {path.name}"
        if name == "END":
            break
        if name.rstrip("+") == "KEYWORD":
            text.format = _format(block.keyword.upper(), text.format)
        own = name[-1:] if name.endswith(("+", "-", "%")) else ""
        plain = name.removesuffix(own) if own else name
        found = Keyword(
            name=plain.removesuffix("_TITLE"),
            titled=plain.endswith("_TITLE"),
            place=f"line {block.line}{place}",
            lines=[(f"line {number}{place}", line) for number, line in block.data],
            format=own.replace("-", "") if own else text.format,
            text=text,
        )
        if found.name in ("INCLUDE", "INCLUDE_PATH", "INCLUDE_PATH_RELATIVE"):
            yield from _included(found, path)
        elif found.name in ("PARAMETER", "PARAMETER_LOCAL"):
            _take_parameters(found)
        elif found.name in ("PARAMETER_EXPRESSION", "PARAMETER_EXPRESSION_LOCAL"):
            _take_expressions(found)
        else:
            yield found
    text.open.pop()


def _format(line: str, before: str) -> str:
    """The format that a *KEYWORD line sets."""
    words = line.replace(" ", "")
    if words.startswith("KEYWORD+") or "LONG=Y" in words:
        return "+"
    return "%" if "I10=Y" in words else before


def _included(found: Keyword, path: Path) -> Iterator[Keyword]:
    """The keywords of the files that *INCLUDE names, or none of *INCLUDE_PATH, whose folders are kept."""
    text, names = found.text, list[tuple[str, str]]()
    for place, line in found.lines:
        if names and names[-1][1].endswith(" +"):  # goes on in the next line
            names[-1] = names[-1][0], names[-1][1][:-2].rstrip() + line.strip()
        elif line.strip():
            names.append((place, line.strip()))
    for place, name in names:
        if found.name != "INCLUDE":
            text.folders.append(Path(name) if found.name == "INCLUDE_PATH" else path.parent / name)
            continue
        folders = (path.parent, *text.folders)
        file = next((folder / name for folder in folders if (folder / name).is_file()), None)
        if file is None:
            raise ValueError(f"{place}: there is no file {name}, which *INCLUDE names; put it beside the deck")
        if file.resolve() in text.open:
            raise ValueError(f"{place}: {name} includes itself; leave that out")
        yield from _of_file(text, file)


def _take_parameters(found: Keyword) -> None:
    """Cards: up to four names, each with its type as its first letter, and their values."""
    for place, line in found.lines:
        card = found.fields(line)
        for name, value in zip(card[::2], card[1::2], strict=False):
            if name[:1].upper() not in tuple("RIC") or not name[1:].strip():
                raise ValueError(f"{place}: parameter {name!r} has no type; begin its name with R, I or C")
            if name[0].upper() != "C":
                real(value)
            found.text.parameters[name[1:].strip().lower()] = value


def _take_expressions(found: Keyword) -> None:
    """Cards: a name with its type as its first letter, and a formula of numbers and parameters."""
    for place, line in found.lines:
        if not line.strip():
            continue
        name, formula = line.split(",", 1) if "," in line[:11] else (line[:10], line[10:])
        name, formula = name.strip(), formula.strip().replace("&", "").replace("^", "**").lower()
        try:
            value = _value(ast.parse(formula, mode="eval").body, found.text.parameters)
        except (ValueError, SyntaxError, ArithmeticError, TypeError) as error:
            raise ValueError(f"{place}: the formula {formula!r} is not read; write its value in its place") from error
        whole = name[:1].upper() == "I"
        found.text.parameters[name[1:].strip().lower()] = str(int(value)) if whole else repr(float(value))


def _value(node: ast.AST, parameters: dict[str, str]) -> float:
    """The value of a formula.

    Raises:
        ValueError: it has something else than numbers, parameters, arithmetic and known functions.
    """
    if isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        return node.value
    if isinstance(node, ast.Name):
        return real(parameters[node.id]) if node.id in parameters else float(_NAMES.get(node.id, "unknown"))
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_value(node.left, parameters), _value(node.right, parameters))
    if isinstance(node, ast.UnaryOp) and type(node.op) in _OPERATIONS:
        return _OPERATIONS[type(node.op)](_value(node.operand, parameters))
    if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _NAMES:
        return _NAMES[node.func.id](*(_value(item, parameters) for item in node.args))
    raise ValueError("not a formula")


def whole(text: str) -> int:
    """A whole number, which may be written as 3.0; 0 for a blank.

    Raises:
        ValueError: it is none.
    """
    try:
        return int(text or 0)
    except ValueError:
        value = real(text)
        return int(value) if value == int(value) else integer(text)
