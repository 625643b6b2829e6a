"""Owns how the arrays of several scenes become those of one model: a rule for each field of a dataclass.

A field names its rule as its metadata, `node: Index = field(metadata=of("nodes"))`.
`Starts` holds the first node, pair, ... of each scene in the joined arrays and, last, the number of all.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Starts = Mapping[str, NDArray[np.int32]]
T = TypeVar("T")
_KEY = "join"


def offsets(counts: Sequence[int]) -> NDArray[np.int32]:
    """First entry of each scene and the total, from the count of each scene."""
    return np.cumsum([0, *counts]).astype(np.int32)


@dataclass(frozen=True)
class _Rule:
    """`move` gives a value of one scene as it stands in the joined model, from the scene's number and `Starts`."""

    move: Callable[[Any, int, Starts], Any]

    def join(self, values: Sequence[Any], starts: Starts) -> Any:
        """Values of all scenes as one: arrays concatenated, tuples one after the other."""
        moved = [self.move(value, k, starts) for k, value in enumerate(values)]
        return sum(moved, ()) if isinstance(moved[0], tuple) else np.concatenate(moved)


class _Offsets(_Rule):
    """Of compressed rows, whose last entry is the number of all."""

    def join(self, values: Sequence[Any], starts: Starts) -> Any:
        moved = [self.move(value, k, starts) for k, value in enumerate(values)]
        return np.concatenate([*(value[:-1] for value in moved[:-1]), moved[-1]]).astype(np.int32)


class _Part(_Rule):
    """A dataclass whose fields have rules."""

    def join(self, values: Sequence[Any], starts: Starts) -> Any:
        return join(values, starts)


def _raised(kind: str) -> Callable[[Any, int, Starts], Any]:
    def move(value: Any, scene: int, starts: Starts) -> Any:
        first = starts[kind][scene]
        if isinstance(value, np.ndarray):
            return np.where(value < 0, value, value + first)
        return value if value < 0 else value + int(first)

    return move


def _moved(item: Any, scene: int, starts: Starts) -> Any:
    """A dataclass of one scene as it stands in the joined model."""
    return type(item)(**{f.name: _rule(item, f).move(getattr(item, f.name), scene, starts) for f in _fields(item)})


def _alone(value: Any, scene: int, starts: Starts) -> Any:
    raise TypeError("a field that batches have not is joined by `join`")


def of(kind: str) -> dict[str, Any]:
    """Rule of numbers of nodes, pairs, ...: raised by the first one of their scene. Negative ones, as GROUND, stay."""
    return {_KEY: _Rule(_raised(kind))}


def offsets_of(kind: str) -> dict[str, Any]:
    """Rule of the offsets of compressed rows of table entries, faces, ...."""
    return {_KEY: _Offsets(_raised(kind))}


AS_IS: dict[str, Any] = {_KEY: _Rule(lambda value, scene, starts: value)}  # as they are, one scene after the other


class _Kinds(_Rule):
    """Of tuples of dataclasses by kind, which all scenes have the same of."""

    def join(self, values: Sequence[Any], starts: Starts) -> Any:
        return {kind: ITEMS[_KEY].join([value[kind] for value in values], starts) for kind in values[0]}


ITEMS: dict[str, Any] = {
    _KEY: _Rule(lambda value, scene, starts: tuple(_moved(item, scene, starts) for item in value))
}  # a tuple of dataclasses whose fields have rules
KINDS: dict[str, Any] = {_KEY: _Kinds(_moved)}  # a mapping of such tuples
PART: dict[str, Any] = {_KEY: _Part(_moved)}  # a dataclass whose fields have rules
SCENE: dict[str, Any] = {_KEY: _Rule(lambda value, scene, starts: scene)}  # of an item: number of its scene
ALONE: dict[str, Any] = {_KEY: _Rule(_alone)}  # None in every model of a batch
GIVEN: dict[str, Any] = {_KEY: None}  # `join` is given it


def joinable(cls: type[T]) -> type[T]:
    """Check that each field of a dataclass has a rule.

    Raises:
        TypeError: a field has none, so that what the scenes of a batch have there would be lost.
    """
    for field in _fields(cls):
        _rule(cls, field)
    return cls


def _fields(owner: Any) -> list[Any]:
    return [field for field in fields(owner) if field.init]


def _rule(owner: Any, field: Any) -> Any:
    if _KEY not in field.metadata:
        kind = owner if isinstance(owner, type) else type(owner)
        raise TypeError(
            f"{kind.__name__}.{field.name}: a batch would lose it; give it a rule of base/joining.py as its metadata"
        )
    return field.metadata[_KEY]


def join(parts: Sequence[T], starts: Starts, **given: Any) -> T:
    """One dataclass of those of several scenes, of the same class, whose fields have rules; `given` are those of GIVEN.

    Raises:
        TypeError: a field has no rule, or is not given.
        ValueError: a scene has what no batch can.
    """
    first: Any = parts[0]
    found: dict[str, Any] = {}
    for field in _fields(first):
        rule, values = _rule(first, field), [getattr(part, field.name) for part in parts]
        if field.name in given or rule is None:
            found[field.name] = given[field.name]
        elif rule.move is _alone:
            if any(value is not None for value in values):
                raise ValueError(f"{type(first).__name__}.{field.name}: models of a batch have none")
            found[field.name] = None
        else:
            found[field.name] = rule.join(values, starts)
    return type(first)(**found)
