"""Owns how the arrays of several scenes become those of one model: a rule for each field of a dataclass.

A field names its rule as its metadata, `node: Index = field(metadata=of("nodes"))`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

# The first node, pair, ... of each scene in the joined arrays and, last, the number of all.
Starts = Mapping[str, NDArray[np.int32]]
Metadata = dict[str, Any]
T = TypeVar("T")
_KEY = "join"


def offsets(counts: Sequence[int]) -> NDArray[np.int32]:
    """First entry of each scene and the total, from the count of each scene."""
    return np.cumsum([0, *counts]).astype(np.int32)


def _merged(values: Sequence[Any]) -> Any:
    """Arrays concatenated, tuples one after the other, entries of mappings likewise."""
    if isinstance(values[0], Mapping):
        return {key: _merged([value[key] for value in values]) for key in values[0]}
    return sum(values, ()) if isinstance(values[0], tuple) else np.concatenate(values)


@dataclass(frozen=True)
class _Rule:
    """`move` gives the value of a scene, of this number, as it stands in the joined model; `merge` makes one of all."""

    move: Callable[[Any, int, Starts], Any]
    merge: Callable[[Sequence[Any]], Any] = _merged


def _raised(kind: str) -> Callable[[Any, int, Starts], Any]:
    def move(value: Any, scene: int, starts: Starts) -> Any:
        first = starts[kind][scene]
        if isinstance(value, np.ndarray):
            return np.where(value < 0, value, value + first)
        return value if value < 0 else value + int(first)

    return move


def _moved(part: Any, scene: int, starts: Starts) -> Any:
    """A dataclass, or a tuple or mapping of these, as it stands in the joined model."""
    if isinstance(part, tuple):
        return tuple(_moved(item, scene, starts) for item in part)
    if isinstance(part, Mapping):
        return {key: _moved(item, scene, starts) for key, item in part.items()}
    found = {f.name: _rule(part, f).move(getattr(part, f.name), scene, starts) for f in fields(part)}
    return type(part)(**found)


def _merged_parts(parts: Sequence[Any]) -> Any:
    """Dataclasses as one, whose fields have rules."""
    first = parts[0]
    found = {f.name: _rule(first, f).merge([getattr(part, f.name) for part in parts]) for f in fields(first)}
    return type(first)(**found)


def of(kind: str) -> Metadata:
    """Rule of numbers of nodes, pairs, ...: raised by the first one of their scene. Negative ones, as GROUND, stay."""
    return {_KEY: _Rule(_raised(kind))}


def offsets_of(kind: str) -> Metadata:
    """Rule of the offsets of compressed rows of table entries, ..., of which the last is the number of all."""
    return {_KEY: _Rule(_raised(kind), lambda values: np.concatenate([*(v[:-1] for v in values[:-1]), values[-1]]))}


AS_IS: Metadata = {_KEY: _Rule(lambda value, scene, starts: value)}  # one scene after the other
ITEMS: Metadata = {_KEY: _Rule(_moved)}  # tuples of dataclasses whose fields have rules, or mappings of such tuples
PART: Metadata = {_KEY: _Rule(_moved, _merged_parts)}  # a dataclass whose fields have rules
SCENE: Metadata = {_KEY: _Rule(lambda value, scene, starts: scene)}  # of an item: number of its scene
ALONE: Metadata = {_KEY: "alone"}  # None in every model of a batch
GIVEN: Metadata = {_KEY: "given"}  # `join` is given it


def _rule(owner: Any, field: Any) -> Any:
    if _KEY not in field.metadata:
        kind = owner if isinstance(owner, type) else type(owner)
        remedy = "give it a rule of base/joining.py as its metadata"
        raise TypeError(f"{kind.__name__}.{field.name}: a batch would lose it; {remedy}")
    return field.metadata[_KEY]


def joinable(cls: type[T]) -> type[T]:
    """Check that each field of a dataclass has a rule.

    Raises:
        TypeError: a field has none, so that what the scenes of a batch have there would be lost.
    """
    for field in fields(cls):  # pyright: ignore[reportArgumentType]
        _rule(cls, field)
    return cls


def join(parts: Sequence[T], starts: Starts, **given: Any) -> T:
    """One dataclass of those of several scenes, of the same class, whose fields have rules; `given` are those of GIVEN.

    Raises:
        TypeError: a field has no rule.
        ValueError: a scene has what no batch can.
    """
    first: Any = parts[0]
    found: dict[str, Any] = {}
    for field in fields(first):
        rule, values = _rule(first, field), [getattr(part, field.name) for part in parts]
        if rule == "given":
            found[field.name] = given[field.name]
        elif rule == "alone":
            if any(value is not None for value in values):
                raise ValueError(f"{type(first).__name__}.{field.name}: models of a batch have none")
            found[field.name] = None
        else:
            found[field.name] = rule.merge([rule.move(value, k, starts) for k, value in enumerate(values)])
    return type(first)(**found)
