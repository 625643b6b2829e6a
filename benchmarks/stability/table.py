"""Owns which cells there are, in their order, and how new ones replace those stored."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import partial

from benchmarks.stability import (  # noqa: F401  (they register axes)
    arm,
    bars,
    bodies,
    contact,
    material,
    motion,
    options,
    passing,
    turns,
)
from benchmarks.stability.axis import AXES, Level, ordered_axes
from benchmarks.stability.measure import PRECISIONS, Cell, cell
from warp_mca.verify.case import USUAL

__all__ = ["AXES", "keys", "merged", "tasks"]

Key = tuple[str, object, str, str]


def key(found: Cell) -> Key:
    """What a cell is of."""
    return found["axis"], found["value"], found["element"], found["precision"]


def keys(names: Iterable[str] = (), level: Level | None = None) -> Iterator[Key]:
    """Axis, value, element and precision of each cell of a level, of both "full" and "long" if None."""
    for item in ordered_axes():
        if (names and item.name not in names) or (level == "long" and item.level != "long"):
            continue
        if level in ("quick", "full") and item.level == "long":
            continue
        for value in item.quick if level == "quick" else item.values:
            for element in item.elements or USUAL:
                for precision in PRECISIONS:
                    yield item.name, value, element, precision


def tasks(names: Iterable[str], level: Level, stored: Iterable[Cell] = ()) -> Iterator[Callable[[str], Cell]]:
    """A function of the device for each cell that is not stored; axes that are named are run at any level."""
    chosen, known = tuple(names), {key(item) for item in stored}
    for name, value, element, precision in keys(chosen, None if chosen and level == "full" else level):
        if (name, value, element, precision) not in known:
            yield partial(cell, name, value, element, precision)  # type: ignore[arg-type]


def merged(stored: Iterable[Cell], new: Iterable[Cell]) -> list[Cell]:
    """Cells in the order of the table, new ones in place of those stored; others are dropped."""
    found = {key(item): item for item in [*stored, *new]}
    return [found[item] for item in keys() if item in found]
